"""One phase, tick by tick.

    targets move on -> rows -> solve -> integrate -> measure -> keep, correct or refuse

Nothing is integrated that is not finite or leaves a hard row; and what was integrated is measured, since
rows are linear and the robot is not. A foot or loop that drifted by more than a tenth of what is
promised is put back by a least-norm correction within the same tick and the same speed limits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.backends import make_backend
from wbplan.compiled.given import check_given
from wbplan.compiled.phase import WORLD, CompiledPhase, compile_phase
from wbplan.errors import SolveError, SpecError
from wbplan.explain.active import Active, HeldBack
from wbplan.explain.replay import Replay
from wbplan.explain.why import Why, keep_goals
from wbplan.paths import ask, number, vector
from wbplan.problem.bodies import Body
from wbplan.problem.script import Phase
from wbplan.program.diagnose import solve_error
from wbplan.program.entry import check_inside, check_stops
from wbplan.program.qp import Solution
from wbplan.program.retract import DRIFT, Retraction
from wbplan.program.stack import Stack
from wbplan.robot import Robot
from wbplan.sampling import sample
from wbplan.state import State

Array = NDArray[np.float64]

#: A hard row further off than this [m or rad] after all correction breaks its promise; the checks allow 1e-4.
PROMISE = 5e-5

#: Least length of a tick [s]; powers of shorter ones vanish.
SHORTEST = 1e-6


def tick_length(dt: object) -> float:
    """The length of a tick [s], or a `SpecError`."""
    return number(dt, "dt", f"a finite positive time in seconds, {SHORTEST:g} or more", least=SHORTEST)


@final
class Tick:
    """The outcome of one step.

    Attributes:
        t: time [s] of the phase at the end of the step.
        q: (nq,) configuration then; v: (nv,) constant tangent velocity that led there [m/s, rad/s].
        com: (3,) [m]; margin: [m], infinite where the phase has no support polygon.
        clearance: the least distance [m] that is promised; infinite where none is, or nothing is near.
        microseconds: wall time of the step.
        warning: '' or why a promise is not yet kept, as 'margin not yet reached'.
    """

    __slots__ = (
        "__dict__",
        "_errors",
        "_held_back",
        "_measures",
        "_replay",
        "clearance",
        "com",
        "margin",
        "microseconds",
        "q",
        "t",
        "v",
        "warning",
    )

    def __init__(
        self, loop: Loop, v: Array, held_back: HeldBack, replay: partial[Why], started: float
    ) -> None:
        stack = loop.stack
        self.t, self.q, self.v = loop.t, loop.q, v
        self.com, self.margin = stack.kinematics.com.copy(), stack.margin
        self.clearance = np.inf if stack.clearance is None else stack.clearance.least
        self._errors, self._held_back = stack.keep_errors(), held_back
        self._measures = stack.keep_measures()
        self._replay = replay
        promised = loop.compiled.margin
        self.warning = ""
        if promised is not None and self.margin < promised - 1e-6:
            self.warning = f"margin not yet reached: {self.margin:.4f} m of {promised:.4f} m"
        asked = loop.compiled.phase.clearance
        if asked is not None and self.clearance < asked - 1e-6:
            self.warning += f"{'; ' if self.warning else ''}clearance not yet reached: {self.clearance:.4f} m"
        if loop.too_fast:
            joints = ", ".join(loop.too_fast)
            self.warning += f"{'; ' if self.warning else ''}speed not yet within its limit: {joints}"
        self.microseconds = 1e6 * (time.perf_counter() - started)

    @cached_property
    def errors(self) -> Mapping[str, float]:
        """Norm of each task's error at the end of the step, target minus actual.

        Keys: '<task>.position' [m], '<task>.orientation' [rad], '<task>.joints' [rad].
        """
        return self._errors()

    @cached_property
    def measures(self) -> Mapping[str, float]:
        """What tasks without a target are at, at the end of the step.

        Keys: '<task>.manipulability', w of a `ManipulabilityTask`.
        """
        return self._measures()

    @cached_property
    def active(self) -> tuple[Active, ...]:
        """Limits and hard rows that held the robot back in this step, the strongest first."""
        return self._held_back.named()

    def why(self, task: str, part: str | None = None) -> Why:
        """What holds a task back in this step, and what letting go of each would give.

        Args:
            task: its label, or its frame where only one task is on it.
            part: 'position', 'orientation' or 'joints'; by default the one that is off most.

        Raises:
            SpecError: there is no such task or part.
        """
        return self._replay(task, part)


@final
class Loop:
    """A phase, ticked: for a controller, a slider, or the planner.

    Args:
        robot: the robot.
        phase: what to do; its targets' times count from 0.
        state: where to start, a `State` or (nq,) configuration.
        dt: length of a tick [s].
        backend: 'proxqp' or 'placo'.
        placed: pose in the world of bodies that stand somewhere, by name.
        roles: the role that each limb is in, where `q` leaves it open.
        bodies: the bodies that there are; those in `placed` that are not carried stand in the way.
        velocity: (nv,) at which it starts, as `Loop.velocity` of a loop before [m/s, rad/s]; at rest.
        acceleration: (nv,) with which it starts, as `Loop.acceleration` of a loop before; none.
        rest_at: time [s] of the phase by which all joints are to be at rest; by default never.
        braking: (n,) accelerations [rad/s^2, m/s^2] that phases after this one leave for braking.

    Attributes:
        velocity: (nv,) of the last step [m/s, rad/s]; acceleration: (nv,) from the one before to it.
        last: the last tick made; None before the first.
        too_fast: joints that came into the phase faster than its limits let them go, and still slow down.

    Raises:
        SpecError: the phase does not fit the robot, or not how it moves when the phase begins.
    """

    def __init__(
        self,
        robot: Robot,
        phase: Phase,
        state: State | Array,
        dt: float = 0.002,
        *,
        backend: str = "proxqp",
        placed: Mapping[str, Any] | None = None,
        roles: Mapping[str, str | None] | None = None,
        bodies: Sequence[Body] = (),
        velocity: Array | None = None,
        acceleration: Array | None = None,
        rest_at: float | None = None,
        braking: Array | None = None,
    ) -> None:
        self.dt, self.t = tick_length(dt), 0.0
        if isinstance(state, State) and list(state.model.names) != list(robot.model.names):
            raise SpecError(f"state: one of '{state.model.name}', expected one of '{robot.name}'")
        start = State(robot.model, state.q if isinstance(state, State) else state)
        self.compiled: CompiledPhase = compile_phase(robot, phase, start.q, placed, roles, bodies)
        self.stack = Stack(self.compiled, self.dt)
        self.q: Array = np.array(start.q)
        self.stack.aim(0.0)
        self.stack.measure(self.q)
        self._backend = make_backend(backend, self.stack)
        self._retraction = Retraction(self.stack)
        self.last: Tick | None = None
        self._replay = Replay(self.compiled, self.dt)
        self._begin(velocity, acceleration, rest_at, braking)

    def _begin(
        self, velocity: Array | None, acceleration: Array | None, rest_at: float | None, braking: Array | None
    ) -> None:
        """How it moves when the phase begins, and when it is to be at rest."""
        nv = self.compiled.model.nv
        self.velocity = vector(np.zeros(nv) if velocity is None else velocity, nv, "Loop: velocity")
        self._rest_at = None if rest_at is None else number(rest_at, "Loop: rest_at", "a time in seconds")
        joints = self.compiled.free[6:]
        still = np.zeros(nv) if acceleration is None else acceleration
        self.acceleration = vector(still, nv, "Loop: acceleration")
        step = self.velocity * self.dt
        self.stack.begin(step, step - self.acceleration * self.dt**2)
        self.too_fast = self._faster_than_limits()
        check_given(self.compiled, self.velocity, self.dt)
        check_stops(self.compiled, self.stack.box, self.q)
        if braking is not None:
            self.stack.box.brake_as(vector(braking, nv - 6, "Loop: braking")[joints - 6])

    def _faster_than_limits(self) -> tuple[str, ...]:
        box, names = self.stack.box, self.compiled.robot.joint_names
        fast = np.flatnonzero(np.abs(box.previous) > box.reach * (1.0 + 1e-6))
        return tuple(names[self.compiled.free[6 + k] - 6] for k in fast)

    @property
    def backend(self) -> str:
        """Name of the backend that solves."""
        return self._backend.name

    def restart(self, backend: str | None = None) -> None:
        """Go on from here with a new solver, which remembers nothing of the ticks before.

        Args:
            backend: 'proxqp' or 'placo'; by default the same as before.

        Raises:
            SpecError: there is no such backend, or it cannot express the phase.
        """
        self._backend = make_backend(backend or self.backend, self.stack)

    @property
    def margin(self) -> float:
        """Stability margin now [m]."""
        return self.stack.margin

    def targets(self) -> dict[str, Array]:
        """Pose (7,) x y z qx qy qz qw in the world that each task on a frame asks for now, by task.

        A point that is asked for has the world's orientation; tasks in another root are left out.
        """
        return {label: poses[0] for label, poses in self.targets_at(np.array([self.t])).items()}

    def targets_at(self, times: Array) -> dict[str, Array]:
        """`targets` (N, 7) at times (N,) [s] of the phase."""
        found = {}
        for target in self.compiled.frame_targets:
            if target.root != WORLD or target.label.startswith("contact("):
                continue
            first = ask(target.path, float(times[0]))
            if not isinstance(first, pin.SE3) and np.shape(first) != (3,):
                continue
            points, rotations = sample(target.path, times)
            poses = np.column_stack([points, np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1))])
            if isinstance(first, pin.SE3):
                poses[:, 3:] = [pin.Quaternion(rotation).coeffs() for rotation in rotations]
            found[target.label] = poses
        return found

    def bodies(self) -> dict[str, Array]:
        """Pose (7,) x y z qx qy qz qw in the world of each carried body now, by name."""
        places = self.stack.kinematics.data.oMf
        return {h.body.name: pin.SE3ToXYZQUAT(places[h.frame]) for h in self.compiled.held}

    def put(self, q: Array, t: float) -> None:
        """Go on from configuration `q` (nq,) at time `t` [s] of the phase."""
        self.q, self.t = np.array(q), number(t, "Loop.put: t", "a finite time in seconds")
        self.stack.aim(self.t)
        self.stack.measure(self.q)

    def step(self, t: float | None = None) -> Tick:
        """Move on by one tick, from time `t` [s] of the phase (by default where the last one ended).

        Raises:
            SolveError: no step keeps every hard row and limit. The loop's state is unchanged.
            SpecError: a path's value is not finite, or not of its kind. The loop's state is unchanged.
        """
        started = time.perf_counter()
        stack, q, began = self.stack, self.q, self.t if t is None else t
        if t is not None and t != self.t:
            self.t = number(t, "Loop.step: t", "a finite time in seconds")
            stack.aim(self.t)
            stack.measure(q)
        elif stack.live:
            stack.aim(self.t)
            stack.measure(q)
        before, com = stack.margin, stack.kinematics.com.copy()
        if stack.clearance is not None:
            stack.clearance.start()
        ends = self.t + self.dt
        if self._rest_at is not None:
            stack.box.left = max(1.0, round((self._rest_at - self.t) / self.dt))
        try:
            stack.advance(self.t)
            solution = self._solve()
            new = self._keep(q, solution.step, before)
        except BaseException:  # Ctrl-C too: in a notebook somebody may go on
            stack.aim(self.t)
            stack.measure(q)
            raise
        self.q, self.t = new, ends
        taken = pin.difference(self.compiled.model, q, new)
        pace = stack.box.keep_pace()
        replay = partial(self._replay.why, self.backend, q, began, keep_goals(stack), pace, solution)
        held_back = HeldBack(stack, solution)
        before_it, self.velocity = self.velocity, taken / self.dt
        self.acceleration = (self.velocity - before_it) / self.dt
        stack.box.took(taken[stack.free], stack.kinematics.com - com)
        if self.too_fast:
            self.too_fast = self._faster_than_limits()
        self.last = Tick(self, self.velocity, held_back, replay, started)
        return self.last

    def _solve(self) -> Solution:
        """What the backend finds; whatever its library throws is a `SolveError`."""
        try:
            return self._backend.solve()
        except (RuntimeError, ArithmeticError, ValueError) as error:
            said = " ".join(str(error).split())[:200]
            name = self.compiled.phase.name
            raise SolveError(f"phase '{name}': the solver of '{self.backend}' failed: {said}") from error

    def _keep(self, q: Array, step: Array, before: float) -> Array:
        """The configuration after `step`, corrected for what its rows neglect; or a `SolveError`."""
        stack, model = self.stack, self.compiled.model
        new: Array = pin.integrate(model, q, step)
        if not math.isfinite(new.sum()):
            raise SolveError(f"phase '{self.compiled.phase.name}': the solver's step is not finite")
        if stack.box.jerky:
            check_inside(self.compiled, stack.box, q, new)
        stack.measure(new)
        if self._kept(before):
            return new
        promised = self.compiled.margin
        recovering = promised is not None and before < promised
        new = self._retraction.correct(q, new, lambda: self._kept(before), recovering=recovering)
        worst = int(np.abs(stack.hard_error).argmax()) if stack.n_hard else -1
        if worst >= 0 and not abs(stack.hard_error[worst]) <= PROMISE:
            raise self._off(q, *stack.hard_names()[worst], abs(float(stack.hard_error[worst])))
        if not self._margin_kept(before):
            raise SolveError(
                f"phase '{self.compiled.phase.name}': the step leaves a stability margin of "
                f"{stack.margin:.5f} m, {self.compiled.margin} m is promised; move slower or use a smaller dt"
            )
        if not self._clear():
            raise self._too_near()
        return new

    def _off(self, q: Array, label: str, unit: str, by: float) -> SolveError:
        """Why a hard row could not be put right: hard rows that contradict each other, or too long a step."""
        self.stack.measure(q)
        self.stack.assemble()
        error = solve_error(self.stack, "the step breaks a hard row")
        if error.clashes:
            return error
        return SolveError(
            f"phase '{self.compiled.phase.name}': '{label}' is off by {by:.3g} {unit} after the step, "
            f"{PROMISE:.0e} is allowed; move slower or use a smaller dt"
        )

    def _kept(self, before: float) -> bool:
        return self.stack.drift <= DRIFT and self._margin_kept(before) and self._clear()

    def _clear(self) -> bool:
        """Whether all distances are kept, or are no less than before."""
        return self.stack.clearance is None or self.stack.clearance.kept()

    def _too_near(self) -> SolveError:
        clearance = self.stack.clearance
        name, distance, bound = clearance.worst() if clearance is not None else ("", 0.0, 0.0)
        return SolveError(
            f"phase '{self.compiled.phase.name}': the step brings {name} to {distance:.5f} m of each other, "
            f"{bound:.5f} m is to be kept; choose another path, move slower or use a smaller dt"
        )

    def _margin_kept(self, before: float) -> bool:
        """Inside the promise, or, coming from outside of it, no further out than before."""
        promised = self.compiled.margin
        if promised is None:
            return True
        return self.stack.margin >= min(promised, before) - 1e-9
