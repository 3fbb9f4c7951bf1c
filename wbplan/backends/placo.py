"""PlaCo's C++ kinematics solver behind the same specifications.

PlaCo owns its robot and tasks, so a phase is told to it once, and each tick only moves its targets. What
it does not have is made up for here:

- a carried body is a link of the URDF that it gets, so that tasks, mass and CoM see it;
- it has no gain, so a soft target is put where the gained step leads;
- it has no acceleration limits: its position limits follow the joints, one tick's box about them;
- it has one weight a task, squared weights, and masks: a task of unequal weights becomes several;
- its polygon must be clockwise, and one that is not is "infeasible" without a word;
- hard rows that depend on each other make it throw. Such rows, contacts last, are given to it as soft ones of
  a weight above all others, and the tick's own correction then puts them in full.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
import pinocchio as pin
import placo
from numpy.typing import NDArray

from wbplan.backends.apart import keep_apart
from wbplan.backends.placo_ascent import PlacoAscent
from wbplan.backends.wrappers import WRAPPERS
from wbplan.compiled.aims import ComTarget
from wbplan.compiled.phase import WORLD, FrameTarget
from wbplan.errors import SpecError
from wbplan.program.diagnose import solve_error
from wbplan.program.joint_box import UNBOUNDED
from wbplan.program.qp import Solution
from wbplan.program.stack import REGULARISATION, Stack

Array = NDArray[np.float64]

#: Hard rows whose smallest singular value is below this share of the largest count as dependent.
DEPENDENT = 1e-3

#: Weight, against squared weights of soft tasks, of a hard task that PlaCo cannot take as hard.
HEAVY = 1e7


@final
class PlacoBackend:
    """See the module."""

    name = "placo"

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        phase = stack.phase
        self._robot = WRAPPERS.lend(self, phase)
        names = list(self._robot.model.names)[2:]
        if names != list(phase.robot.joint_names):
            raise SpecError(f"backend 'placo': reads other joints from the URDF than Pinocchio: {names}")
        self._names = [frame.name for frame in phase.model.frames]
        for frame in stack.rows.frames:
            if self._names.count(self._names[frame]) > 1:
                raise SpecError(
                    f"backend 'placo' knows frames by name only, and a link and a joint are both called "
                    f"'{self._names[frame]}'; rename the joint, or use backend 'proxqp'"
                )
        self._soft_labels: set[str] = set()
        self._patient = False
        self._build()

    # -- once a phase ------------------------------------------------------------------------------------

    def _build(self) -> None:
        """A solver with the phase's tasks and limits."""
        stack, phase = self._stack, self._stack.phase
        self._robot.state.q = stack.kinematics.q
        self._robot.update_kinematics()
        self._soft_labels |= _dependent(stack)
        solver = self._solver = placo.KinematicsSolver(self._robot)
        solver.dt = stack.dt
        self._sort_frame_tasks()
        self._regularisation = solver.add_regularization_task(REGULARISATION + phase.damping)
        self._joints_given()
        self._com_tasks()
        self._posture_tasks()
        self._ascents = [PlacoAscent(ascent, stack, solver) for ascent in stack.ascents]
        self._limits()

    def _priority(self, label: str, hard: bool, weight: float) -> tuple[str, float]:
        if not hard:
            return "soft", weight**2
        return ("soft", HEAVY) if label in self._soft_labels else ("hard", 1.0)

    def _frame_tasks(self, target: FrameTarget, *, rotation: bool) -> list[Any]:
        """One PlaCo task for each distinct weight among the axes."""
        names = self._names
        frame, solver = names[target.frame], self._solver
        weights = target.rotation_weight if rotation else target.position_weight
        tasks = []
        for weight in sorted(set(weights[weights > 0])):
            axes = "".join(axis for axis, w in zip("xyz", weights, strict=True) if w == weight)
            if target.root == WORLD:
                task = (
                    solver.add_orientation_task(frame, np.eye(3))
                    if rotation
                    else solver.add_position_task(frame, np.zeros(3))
                )
            else:
                root = names[target.root]
                task = (
                    solver.add_relative_orientation_task(root, frame, np.eye(3))
                    if rotation
                    else solver.add_relative_position_task(root, frame, np.zeros(3))
                )
            if axes != "xyz":
                task.mask.set_axises(axes, "task")
            part = "rotation" if rotation else "position"
            task.configure(
                f"{target.label} {part} {axes}", *self._priority(target.label, target.hard, weight)
            )
            tasks.append(task)
        return tasks

    def _joints_given(self) -> None:
        """Joints that are not the QP's: masked where they rest, hard where they move."""
        names = self._stack.phase.robot.joint_names
        self._driven = []
        for k, driven in enumerate(self._stack.phase.driven):
            name = names[driven.joint]
            if driven.path.constant:
                self._solver.mask_dof(name)
            else:
                task = self._solver.add_joints_task()
                task.set_joint(name, float(self._stack.kinematics.q[7 + driven.joint]))
                task.configure(f"driven {name}", "hard", 1.0)
                self._driven.append((k, 7 + driven.joint, name, task))

    def _com_tasks(self) -> None:
        self._coms = []
        for k, target in enumerate(self._stack.phase.com_targets):
            lag = self._lag(target)
            for weight in sorted(set(target.weight[target.weight > 0])):
                axes = "".join(axis for axis, w in zip("xyz", target.weight, strict=True) if w == weight)
                task = self._solver.add_com_task(np.zeros(3))
                if axes != "xyz":
                    task.mask.set_axises(axes, "task")
                task.configure(f"{target.label} {axes}", *self._priority(target.label, target.hard, weight))
                self._coms.append((k, lag, task))

    def _posture_tasks(self) -> None:
        """One PlaCo task for each distinct weight among the joints; hard ones each by itself."""
        stack = self._stack
        names, q = stack.phase.robot.joint_names, stack.kinematics.q
        free = stack.phase.free[6:] - 6
        self._postures = []
        for posture in stack.postures:
            for square in sorted(set(posture.stiffness[posture.stiffness > 0])):
                task = self._solver.add_joints_task()
                columns = np.flatnonzero(posture.stiffness == square)
                joints = [names[free[k]] for k in columns]
                for k, name in zip(columns, joints, strict=True):
                    task.set_joint(name, float(q[7 + free[k]]))
                task.configure(f"{posture.label} {square}", "soft", square)
                self._postures.append((task, joints, columns, posture))
        self._hard_joints = []
        for joint, _, label in stack.hard_joints:
            task = self._solver.add_joints_task()
            task.set_joint(names[joint], float(q[7 + joint]))
            task.configure(f"{label} {names[joint]}", *self._priority(label, True, 1.0))
            self._hard_joints.append((task, names[joint]))

    def _limits(self) -> None:
        stack, solver, robot = self._stack, self._solver, self._robot
        phase = stack.phase
        # Its joint limits, moved along each tick, are the tick's whole box, which the speed limits are in.
        solver.enable_joint_limits(phase.phase.joint_limits is not None)
        solver.enable_velocity_limits(False)
        self._lower, self._upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
        self._lower[7:], self._upper[7:] = -UNBOUNDED, UNBOUNDED
        self._polygon = None
        if phase.polygon is not None and phase.phase.support is not None:
            clockwise = [np.array(vertex) for vertex in phase.polygon.vertices[::-1]]
            self._polygon = solver.add_com_polygon_constraint(clockwise, 0.0)
            self._polygon.configure("support polygon", "hard", 1.0)

    def _margin(self) -> float:
        """The margin to ask for in this tick: what the CoM may leave of its distance to the nearest edge.

        PlaCo has one margin for all edges; those further off are slowed down for as they come near.
        """
        least = float((self._stack.distances() - self._stack.closer).min())
        if self._patient:
            least = min(least, self._stack.margin)
        self._patient = False
        return least

    # -- each tick ---------------------------------------------------------------------------------------

    def solve(self) -> Solution:
        """See `Backend.solve`."""
        ease = self._stack.ease
        for mend in (ease, ease, self._soften, self._soften_all, self._wait_for_margin):
            try:
                return Solution(self._solve())
            except RuntimeError:
                mend()
        try:
            return Solution(self._solve())
        except RuntimeError as error:
            self._stack.assemble()
            raise solve_error(self._stack, f"PlaCo finds no step ({_one_line(error)})") from None

    def _soften(self) -> None:
        """Hard rows may have come to depend on each other: tell PlaCo those as heavy soft ones."""
        self._soft_labels |= _dependent(self._stack)
        self._build()

    def _soften_all(self) -> None:
        """What is missing may be less than PlaCo's solver can see: the tick's own correction sees it."""
        self._soft_labels |= {label for label, _ in self._stack.hard_names()}
        self._build()

    def _wait_for_margin(self) -> None:
        """Ask a CoM that is outside its margin only not to go further out."""
        self._patient = True

    def _solve(self) -> Array:
        stack, robot = self._stack, self._robot
        robot.state.q = stack.kinematics.q
        robot.update_kinematics()
        stack.fill_box()
        self._aim()
        here = stack.kinematics.q[stack.q_index]
        self._lower[stack.q_index] = here + stack.lower[6:]
        self._upper[stack.q_index] = here + stack.upper[6:]
        step: Array = self._solver.solve(False)
        if stack.driving:
            step[stack.driven] = stack.driven_step
        step[stack.free] = np.minimum(np.maximum(step[stack.free], stack.lower), stack.upper)
        return step if stack.clearance is None else keep_apart(stack, step)

    def _aim(self) -> None:
        """Put every target where this tick's step should lead."""
        stack, rows = self._stack, self._stack.rows
        if self._moving_places or self._moving_relative_places:
            goals = rows.position_goal - self._position_lag * rows.position_error
            for k, task in self._moving_places:
                task.target_world = goals[k]
            for k, task in self._moving_relative_places:
                task.target = goals[k]
        for k, lag, world, tasks in self._moving_turns:
            rotation = rows.rotation_goal[k]
            if lag > 0.0:
                rotation = pin.exp3(rows.rotation_error[k] * -lag) @ rotation
            for task in tasks:
                if world:
                    task.R_world_frame = rotation
                else:
                    task.R_a_b = rotation
        for k, lag, task in self._coms:
            task.target_world = rows.com_goal[k] - lag * rows.com_error[k]
        joints = stack.kinematics.q[stack.q_index]
        for task, names, columns, posture in self._postures:
            goals = posture.next_goal(joints)[columns].tolist()
            for name, goal in zip(names, goals, strict=True):
                task.set_joint(name, goal)
        if self._ascents:
            stack.kinematics.differentiate()
        for ascent in self._ascents:
            ascent.aim()
        for k, j, name, task in self._driven:
            task.set_joint(name, float(stack.kinematics.q[j] + stack.driven_step[k]))
        for (task, name), goal in zip(self._hard_joints, stack.hard_joint_goal, strict=True):
            task.set_joint(name, float(goal))
        self._regularisation.set_weight(stack.soft_damping())
        if self._polygon is not None:
            self._polygon.margin = self._margin()

    def _sort_frame_tasks(self) -> None:
        """Put what never moves in its place for good; list the rest by what `_aim` has to do."""
        rows = self._stack.rows
        self._moving_places: list[tuple[int, Any]] = []
        self._moving_relative_places: list[tuple[int, Any]] = []
        self._moving_turns: list[tuple[int, float, bool, list[Any]]] = []
        for k, target in enumerate(rows.position_targets):
            world = target.root == WORLD
            for task in self._frame_tasks(target, rotation=False):
                setattr(task, "target_world" if world else "target", rows.position_goal[k].copy())
                if not _rests(target):
                    (self._moving_places if world else self._moving_relative_places).append((k, task))
        for k, target in enumerate(rows.rotation_targets):
            world = target.root == WORLD
            tasks = self._frame_tasks(target, rotation=True)
            for task in tasks:
                setattr(task, "R_world_frame" if world else "R_a_b", rows.rotation_goal[k].copy())
            if not _rests(target):
                self._moving_turns.append((k, self._lag(target), world, tasks))
        self._position_lag = np.array([[self._lag(t)] for t in rows.position_targets]).reshape(-1, 1)

    def _lag(self, target: FrameTarget | ComTarget) -> float:
        """The share of a soft target's error that a tick leaves."""
        return 0.0 if target.hard else float(np.exp(-target.gain * self._stack.dt))


def _rests(target: FrameTarget) -> bool:
    """Whether PlaCo needs to be told a target only once."""
    return target.hard and target.path.constant


def _dependent(stack: Stack) -> set[str]:
    """Labels of hard rows that depend on each other as the robot stands; contacts only if no task does."""
    if stack.n_hard == 0:
        return set()
    stack.assemble()
    left, singular, _ = np.linalg.svd(stack.A, full_matrices=True)
    rank = int((singular > DEPENDENT * singular[0]).sum())
    share = np.abs(left[:, rank:]).max(axis=1, initial=0.0)
    names = stack.hard_names()
    found = {names[k][0] for k in np.flatnonzero(share > 1e-3)}
    return {label for label in found if not label.startswith("contact(")} or found


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:120]
