"""A script run from start to end: phase after phase, tick after tick, into a plan."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import Bundle, Trajectory
from wbplan.checks import CheckReport, check
from wbplan.compiled.acceleration import acceleration_bounds, braking_bounds, braking_kind
from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SolveError, SpecError, WbplanError
from wbplan.explain.why import Why
from wbplan.fallback import Retries
from wbplan.problem.script import Phase, Script
from wbplan.reasons import asked_of_support, why_at
from wbplan.recorder import Recorder
from wbplan.robot import Robot
from wbplan.state import State
from wbplan.tick import Loop, tick_length

if TYPE_CHECKING:
    from wbplan.physics import Simulation

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

#: A loop that is open by more than this [m or rad] when its phase starts would not stay as it is.
CLOSED = 5e-5


@final
@dataclass(frozen=True, eq=False)
class Plan:
    """A planned script: the robot it was planned for, and its bundle.

    Attributes:
        robot: the robot.
        bundle: everything that is saved, as data.
        loops: start [s] and loop of every phase, for `why`; empty for a plan that was read from files.
    """

    robot: Robot
    bundle: Bundle
    loops: tuple[tuple[float, Loop], ...] = field(default=(), repr=False)

    @property
    def report(self) -> Mapping[str, Any]:
        """Seconds of planning and motion, ticks, their median and p99 [us], worst errors, warnings, retries.

        `incomplete` says why a plan ends early: only `SolveError.partial` has it.
        """
        report: Mapping[str, Any] = self.bundle.plan["report"]
        return report

    @property
    def trajectory(self) -> Trajectory:
        """Time, q, v and the rest, as arrays."""
        return self.bundle.trajectory

    def why(self, t: float, task: str, part: str | None = None) -> Why:
        """What holds a task back at a time of the plan, and what letting go of each would give.

        Args:
            t: time [s] of the plan.
            task: label of a task of the phase then, or its frame where only one task is on it.
            part: 'position', 'orientation' or 'joints'; by default the one that is off most.

        Raises:
            SpecError: there is no such time, task or part, or the plan was not made in this process.
        """
        if not self.loops:
            raise SpecError("Plan.why: the plan has no phases to ask, only what was recorded of them")
        return why_at(self.loops, self.trajectory, t, task, part)

    def check(self) -> CheckReport:
        """Every promise recomputed from q, the URDF and the phases' specifications."""
        return check(self.bundle, folders=self._folders)

    def save(self, folder: str | Path) -> Path:
        """Write the bundle, with its animation and plots, whole or not at all.

        Raises:
            BundleError: the folder cannot be written.
        """
        from wbplan import plots
        from wbplan.view import write_html

        return self.bundle.write(
            Path(folder),
            extras={
                "scene.html": lambda path: write_html(self.bundle, path, package_dirs=self._folders),
                "plots.png": lambda path: plots.save(self.bundle, path),
                "forces.png": lambda path: plots.save_forces(self.bundle, path),
            },
        )

    def simulate(self, options: Any = None, **asked: Any) -> Simulation:
        """Replay the plan in MuJoCo, with contact, friction and servos.

        Args:
            options: `wbplan.physics.Options`, what is assumed; None: the usual.
            asked: `trials`, `seed`, `workers` and the rest of what `wbplan.physics.simulate` takes.

        Raises:
            PhysicsError: MuJoCo is missing, or the plan cannot be simulated.
        """
        from wbplan.physics import simulate

        ignored = self.robot.ignored_collisions if self.robot.srdf_path else None
        return simulate(self.bundle, options, **{"ignored": ignored, "folders": self._folders, **asked})

    def view(self, host: str = "127.0.0.1", port: int | None = None) -> Any:
        """Serve the animation in Meshcat; returns the server, with `.url` and `.stop()`."""
        from wbplan.view import serve

        return serve(self.bundle, host=host, port=port, package_dirs=self._folders)

    @property
    def _folders(self) -> tuple[Path, ...]:
        """Where the robot's meshes are: relative names count from the URDF's own folder."""
        return (self.robot.urdf_path.parent, *self.robot.package_dirs)


def plan(
    robot: Robot,
    script: Script | Phase,
    start: State | str | Array | None = None,
    dt: float = 0.01,
    backend: str = "proxqp",
    *,
    task: str = "script",
    parameters: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    observe: Callable[[Loop, float], None] | None = None,
) -> Plan:
    """Plan a script.

    Args:
        robot: the robot.
        script: phases, or one phase.
        start: a state, the name of a pose, or (nq,); by default where the script starts, as in pose 'stand'.
        dt: length of a tick [s].
        backend: 'proxqp' or 'placo'.
        task: name for the bundle.
        parameters: what the script was made with, for the bundle.
        progress: called with the fraction done and the phase's name, now and then.
        observe: called with the loop and the time [s] at every sample, as a live view wants.

    Raises:
        SpecError: the script does not fit the robot, the start is outside the joint limits, or a phase
            promises what its start does not hold.
        SolveError: a tick has no step that keeps every hard promise, or neither backend finds it; the error's
            `partial` is the plan until then.
    """
    script = script if isinstance(script, Script) else Script(script)
    dt = tick_length(dt)
    start = script.start if start is None else start
    state = start if isinstance(start, State) else robot.state(start)
    if list(state.model.names) != list(robot.model.names):  # its q may be of the same size
        raise SpecError(f"start: a state of '{state.model.name}', expected one of '{robot.name}'")
    q, roles, (velocity, acceleration) = np.array(state.q), None, np.zeros((2, robot.model.nv))
    _inside_limits(robot, q)
    placed: dict[str, Any] = {b.name: b.pose for b in script.bodies if b.pose is not None}
    _compile_kernels(robot, script.phases[0], q, dt, backend, placed)
    started = time.perf_counter()
    recorder, retries = Recorder(robot, script, dt), Retries()
    loops: list[tuple[float, Loop]] = []

    def planned(incomplete: str = "") -> Plan:
        seconds = time.perf_counter() - started
        told = {"retries": retries.made, **({"incomplete": incomplete} if incomplete else {})}
        found = recorder.bundle(task, backend, dict(parameters or {}), seconds, retries.warnings())
        report = {**found.plan["report"], **told}
        whole = Bundle({**found.plan, "report": report}, found.trajectory, found.urdf)
        return Plan(robot, whole, tuple(loops))

    lengths = [max(1, int(np.ceil(phase.duration / dt - 1e-9))) for phase in script.phases]
    done = 0  # ticks
    for phase in script.phases:
        if phase.joint_limits is None:
            raise SpecError(f"phase '{phase.name}'.limits: a plan keeps joint limits; add wb.JointLimits()")
    for index, (phase, ticks) in enumerate(zip(script.phases, lengths, strict=True)):
        begun = partial(
            Loop, robot, state=q, dt=dt, backend=backend, placed=dict(placed), roles=roles,
            bodies=script.bodies, velocity=velocity, acceleration=acceleration,
            rest_at=(sum(lengths) - done) * dt, braking=_least_braking(robot, script.phases[index:], q),
        )  # fmt: skip
        loop = begun(phase=phase)
        _promises_hold(loop, phase)
        recorder.begin(index, loop, placed, done * dt)
        loops.append((done * dt, loop))
        for k in range(ticks):
            if observe is not None:
                observe(loop, (done + k) * dt)
            if progress is not None and k % 20 == 0:
                progress((done + k) / sum(lengths), phase.name)
            try:
                tick = retries.step(loop, (done + k) * dt)
            except SolveError as error:
                more = asked_of_support(loop, begun, ticks, error)
                said = f"at {(done + k) * dt:.2f} s of the plan, {k * dt:.2f} s into {error}{more}"
                kept = None
                with contextlib.suppress(WbplanError):  # forces that nobody can give: then nothing is kept
                    kept = planned(said) if recorder.cut(index, loop, (done + k) * dt) else None
                raise SolveError(said, error.clashes, error.limits, kept) from None
            recorder.record(loop, tick)
        done += ticks
        q, roles = loop.q, loop.compiled.roles
        velocity, acceleration = loop.velocity, loop.acceleration
        placed.update(_where_held(loop.compiled, q))
        recorder.end(index, loop, done * dt)
    if observe is not None:
        observe(loop, done * dt)
    if progress is not None:
        progress(1.0, "done")
    return planned()


def _compile_kernels(
    robot: Robot, phase: Phase, q: Array, dt: float, backend: str, placed: Mapping[str, Any]
) -> None:
    """One tick thrown away: the first one of a machine compiles the kernels, seconds that are not planning.

    What is wrong with the phase is said when it is planned.
    """
    with _interrupts_held(), contextlib.suppress(WbplanError):
        Loop(robot, phase, q, dt, backend=backend, placed=placed).step()


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until the block ends: one in the compiler's clean-up would be lost."""
    if threading.current_thread() is not threading.main_thread():  # only that one hears signals
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    before = {
        signum: signal.signal(signum, lambda *at: came.append(at))
        for signum in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for signum, handler in before.items():
            signal.signal(signum, handler)
    if came:
        signal.raise_signal(came[0][0])


def _least_braking(robot: Robot, phases: Sequence[Phase], q: Array) -> Array:
    """(n,) what each joint can count on for braking in all of these phases [rad/s^2, m/s^2]."""
    kinds: list[tuple[object, ...]] = []
    alike = [phase for phase in phases if not _seen(braking_kind(phase), kinds)]
    found = [braking_bounds(robot, phase, acceleration_bounds(robot, phase, q)) for phase in alike]
    least: Array = np.min(found, axis=0)
    return least


def _seen(kind: tuple[object, ...], kinds: list[tuple[object, ...]]) -> bool:
    """Whether a kind is among those seen before; it is from now on."""
    if kind in kinds:
        return True
    kinds.append(kind)
    return False


def _inside_limits(robot: Robot, q: Array) -> None:
    """The start must hold the joint limits: a plan promises them at every sample."""
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    bad = [
        f"{name} is {value:.4f}, limits {lo:.4f} to {hi:.4f}"
        for name, value, lo, hi in zip(robot.joint_names, q[7:], low, high, strict=True)
        if not lo - 1e-9 <= value <= hi + 1e-9
    ]
    if bad:
        raise SpecError(f"start: joints outside their limits: {'; '.join(bad)}")


def _promises_hold(loop: Loop, phase: Phase) -> None:
    """A phase's margin holds from its first sample on, and its loops are closed."""
    if phase.margin is not None and loop.margin < phase.margin - 1e-9:
        com = loop.stack.kinematics.com
        raise SpecError(
            f"phase '{phase.name}' promises a stability margin of {phase.margin:.4f} m but starts with "
            f"{loop.margin:.4f} m (CoM x={com[0]:.4f}, y={com[1]:.4f} m over {len(phase.contacts)} "
            f"contacts); move the CoM inside before it, or promise less"
        )
    near = loop.stack.clearance.broken() if loop.stack.clearance is not None else []
    if near:
        pairs = "; ".join(f"{name} {distance:.4f} m of {asked:.4f} m" for name, distance, asked in near[:4])
        raise SpecError(
            f"phase '{phase.name}' promises a clearance but starts nearer: {pairs}"
            + (f" and {len(near) - 4} more" if len(near) > 4 else "")
            + "; move them apart before it, promise less, or say who may touch (Obstacles.except_for)"
        )
    errors = loop.stack.errors()
    for task in phase.loops:
        gap, turn = errors[f"{task.label}.position"], errors[f"{task.label}.orientation"]
        if gap > CLOSED or turn > CLOSED:
            raise SpecError(
                f"phase '{phase.name}': the loop '{task.label}' starts open by {gap:.4g} m and {turn:.4g} "
                "rad; close it with a path before, or give it target=wb.AS_IS"
            )


def _where_held(compiled: CompiledPhase, q: Array) -> dict[str, Any]:
    """World poses of the carried bodies at `q`."""
    if not compiled.held:
        return {}
    state = State(compiled.model, q)
    return {h.body.name: state.pose(h.body.name) for h in compiled.held}
