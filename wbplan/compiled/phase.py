"""A phase with its names looked up: frames as numbers, targets bound, joints sorted into free and given.

Nothing here is a matrix: both backends start from this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled.acceleration import acceleration_bounds, jerk_bounds, stopping_bounds
from wbplan.compiled.aims import AscentTarget, ComTarget, ascent_target, balance_target
from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes
from wbplan.paths import NUMBER, POINT, POSE, Hold, MinJerk, Path, ask, checked, kind_of
from wbplan.problem.bodies import Body, Held, frame_number, standing, with_carried
from wbplan.problem.objectives import BalanceTask, ManipulabilityTask
from wbplan.problem.script import Phase, unknown
from wbplan.problem.tasks import ComTask, DampingTask, PostureTask, check_kind
from wbplan.robot import Robot
from wbplan.state import State, find_frame
from wbplan.statics import support

Array = NDArray[np.float64]
WORLD = -1


@final
@dataclass(frozen=True, eq=False)
class FrameTarget:
    """One frame held to one path: a contact or a frame task.

    Attributes:
        label: of the task or contact.
        frame, root: frame numbers in the phase's model; root is `WORLD` for the world.
        path: bound target of the frame in its root, a pose, point or rotation over time.
        position_weight, rotation_weight: (3,); a zero leaves the row out.
        gain: [1/s].
        hard: rows are equalities, weights then count only as zero or not.
        level: of a soft one, from 0, the highest.
    """

    label: str
    frame: int
    root: int
    path: Path
    position_weight: Array
    rotation_weight: Array
    gain: float
    hard: bool
    level: int = 0


@final
@dataclass(frozen=True, eq=False)
class JointTarget:
    """A posture task over the n actuated joints.

    Attributes:
        paths: per joint that is asked for, its index and bound target.
        weight: (n,), zero where not asked.
    """

    label: str
    paths: tuple[tuple[int, Path], ...]
    weight: Array
    gain: float
    hard: bool
    level: int = 0


@final
@dataclass(frozen=True, eq=False)
class Driven:
    """A joint whose motion is given: index among the actuated joints, and its path."""

    joint: int
    path: Path


@final
@dataclass(frozen=True, eq=False)
class CompiledPhase:
    """A phase on a robot, from a start configuration.

    Attributes:
        model: the robot's, with the carried bodies welded to their holders (a copy).
        q_start: (nq,).
        frame_targets: contacts first, then hard tasks, then soft ones.
        free: columns (nf,) of the velocity that the QP decides: the base and the free joints.
        driven: joints whose motion is given.
        polygon: where the CoM may be, the hull of the contacts or their region; `None` where the phase has no
            such limit.
        region: whether `polygon` is the static-equilibrium region: the hull is not, unless the contacts lie
            in one plane and nothing pushes.
        ascents: manipulability tasks.
        contact_points: (C, 3) [m], world.
        acceleration, braking, led, jerk: (n,) of all joints, see `acceleration`; no jerk is None.
        standing: bodies that stand in the world and are not carried, each with its pose.
    """

    robot: Robot
    phase: Phase
    model: Any
    q_start: Array
    frame_targets: tuple[FrameTarget, ...]
    com_targets: tuple[ComTarget, ...]
    joint_targets: tuple[JointTarget, ...]
    damping: float
    free: NDArray[np.intp]
    driven: tuple[Driven, ...]
    polygon: HalfPlanes | None
    region: bool
    contact_points: Array
    held: tuple[Held, ...]
    roles: Mapping[str, str | None]
    acceleration: Array
    braking: Array
    led: NDArray[np.bool_]
    jerk: Array | None
    ascents: tuple[AscentTarget, ...] = ()
    standing: tuple[tuple[Body, Any], ...] = ()

    @property
    def margin(self) -> float | None:
        """Promised stability margin [m]."""
        return self.phase.margin


def compile_phase(
    robot: Robot,
    phase: Phase,
    q: Array,
    placed: Mapping[str, Any] | None = None,
    roles: Mapping[str, str | None] | None = None,
    bodies: Sequence[Body] = (),
    velocity: Array | None = None,
) -> CompiledPhase:
    """Look up every name of a phase and bind its targets to a start configuration.

    Args:
        robot: the robot.
        phase: the phase.
        q: (nq,) configuration at the phase's start.
        placed: pose in the world of every body that stands somewhere, by name.
        roles: the role that each limb is in; by default read off `q`.
        bodies: the script's; those in `placed` that are not carried stand in the way.
        velocity: (nv,) at the phase's start, which a balance task's target leaves with; at rest.

    Raises:
        SpecError: a name does not exist, or two parts of the phase do not fit.
    """
    at = f"phase '{phase.name}'"
    now = _roles_now(robot, q, roles or {})
    model, held = with_carried(robot, phase.carried, q, placed or {}, f"{at}.carried")
    state = State(model, q)
    driven = _driven(robot, phase, state, now)
    given = {d.joint for d in driven}
    free = np.array([*range(6), *(6 + j for j in range(model.nv - 6) if j not in given)], dtype=np.intp)
    _check_feet(robot, phase, {**now, **phase.roles}, driven)
    level = {id(t): k for k, tasks in enumerate(phase.levels) for t in tasks}
    frames = _frame_targets(phase, model, state, level)
    acceleration = acceleration_bounds(robot, phase, q, model)
    points = np.array([state.pose(c.frame).translation for c in phase.contacts]).reshape(-1, 3)
    balance = [t for t in phase.soft_tasks if isinstance(t, BalanceTask)]
    polygon, region = support(phase, model, state, points, wanted=bool(balance))
    coms = tuple(
        ComTarget(
            t.label,
            _bound(t.path, state.com, f"{at}, {t.label}.target", t.takes),
            t.position_weight,
            t.gain,
            t in phase.hard,
            level.get(id(t), 0),
        )
        for t in phase.tasks
        if isinstance(t, ComTask)
    )
    if polygon is not None:
        coms += tuple(balance_target(t, polygon, state, velocity, level[id(t)]) for t in balance)
    joints = tuple(
        _joint_target(robot, t, q, given, t in phase.hard, level.get(id(t), 0), at)
        for t in phase.tasks
        if isinstance(t, PostureTask)
    )
    damping = float(sum(t.weight**2 for t in phase.soft_tasks if isinstance(t, DampingTask)))
    return CompiledPhase(
        robot,
        phase,
        model,
        np.array(q),
        frames,
        coms,
        joints,
        damping,
        free,
        driven,
        None if phase.support is None else polygon,
        region,
        points,
        held,
        {**now, **phase.roles},
        *(acceleration, *stopping_bounds(robot, phase, acceleration), jerk_bounds(robot, phase)),
        tuple(ascent_target(t, phase, model) for t in phase.soft_tasks if isinstance(t, ManipulabilityTask)),
        standing(phase.carried, placed or {}, bodies),
    )


def _roles_now(robot: Robot, q: Array, given: Mapping[str, str | None]) -> dict[str, str | None]:
    """The role that each limb is in: as given, else read off `q`."""
    _check_roles(robot, {limb: role for limb, role in given.items() if role is not None}, "roles")
    return {limb: given[limb] if limb in given else robot.role_of(limb, q) for limb in robot.roles}


def _check_roles(robot: Robot, roles: Mapping[str, str], what: str) -> None:
    for limb, role in roles.items():
        if limb not in robot.roles:
            raise unknown(f"{what}: limb", limb, robot.roles)
        if role not in robot.roles[limb]:
            raise unknown(f"{what}['{limb}']: role", role, robot.roles[limb])


def _bound(path: Path, here: Any, what: str, takes: tuple[str, ...]) -> Path:
    """The path with `AS_IS` replaced, if it is of a kind that its task takes."""
    try:
        bound = path.bind(here)
    except SpecError as error:
        raise SpecError(f"{what}: {error}") from None
    # Paths of other people's classes say what they are by what they give.
    check_kind(bound.kind or kind_of(checked(ask(bound, 0.0), what)), what, takes)
    return bound


def _driven(robot: Robot, phase: Phase, state: State, now: Mapping[str, str | None]) -> tuple[Driven, ...]:
    """Joints that are not the QP's: those held by roles, driven by name, or locked."""
    at = f"phase '{phase.name}'"
    paths: dict[str, Path] = {}
    _check_roles(robot, phase.roles, f"{at}.roles")
    for limb, held_by in robot.roles.items():
        role = phase.roles[limb] if limb in phase.roles else now[limb]
        if role is not None:
            moved = {
                joint: _towards(state.joint(joint), value, phase) for joint, value in held_by[role].items()
            }
            stuck = [joint for joint in phase.locked if joint in moved and not moved[joint].constant]
            if stuck:
                raise SpecError(f"{at}.locked: {', '.join(stuck)} moves as {limb} becomes '{role}'")
            paths.update(moved)
        elif held_by:  # in no role: what every role holds is no joint of the QP's either
            for joint in set.intersection(*(set(joints) for joints in held_by.values())):
                paths[joint] = Hold(state.joint(joint))
    for joint in (*phase.driven, *phase.locked):
        if joint not in robot.joint_names:
            raise unknown(f"{at}: joint", joint, robot.joint_names)
    for joint, path in phase.driven.items():
        what, here = f"{at}.driven['{joint}']", state.joint(joint)
        path = _bound(path, np.asarray(here), what, (NUMBER,))
        first = float(ask(path, 0.0))
        if path.constant:
            path = _towards(here, first, phase)
        elif abs(first - here) > 1e-6:
            raise SpecError(f"{what}: starts at {first:.6g}, the joint is at {here:.6g}; start it at AS_IS")
        paths[joint] = path
    paths.update({joint: Hold(state.joint(joint)) for joint in phase.locked})
    _check_given(robot, phase, paths)
    return tuple(Driven(robot.joint_index(joint)[1] - 6, path) for joint, path in sorted(paths.items()))


def _towards(here: float, value: float, phase: Phase) -> Path:
    """A joint's motion over the phase to where it is wanted, from rest to rest."""
    return Hold(here) if abs(here - value) < 1e-9 else MinJerk(here, value, phase.duration)


def _check_given(robot: Robot, phase: Phase, paths: Mapping[str, Path]) -> None:
    """Joints whose motion is given stay within their limits, or come back to them, and are not too fast."""
    at = f"phase '{phase.name}': joint"
    times = np.linspace(0.0, phase.duration, 201)
    too_fast: list[tuple[float, str, str]] = []
    for joint, path in paths.items():
        values = np.array([float(ask(path, t)) for t in (times[:2] if path.constant else times)])
        lower, upper = robot.joint_limits(joint)
        low, high = min(lower, values[0]) - 1e-9, max(upper, values[0]) + 1e-9
        held = (values >= low) & (values <= high) if phase.joint_limits is not None else np.isfinite(values)
        wrong = values[~held]
        if len(wrong):
            raise SpecError(
                f"{at} '{joint}' would be driven to {wrong[0]:.4g}, its limits are {lower:.4g} to {upper:.4g}"
            )
        speed = float(robot.model.velocityLimit[robot.joint_index(joint)[1]])
        # A tick sees a little more of a peak than samples do.
        rate = 1.0001 * float(np.abs(np.diff(values)).max()) / times[1]
        if rate > speed:
            says = f"{at} '{joint}' would have to move at {rate:.3g}, its limit is {speed:.3g}"
            too_fast.append((rate / speed, joint, says))
    if too_fast:
        factor, joint, says = max(too_fast)
        own = joint in phase.driven and not phase.driven[joint].constant
        seconds = np.ceil(100.0 * factor * phase.duration) / 100.0
        longer = f"make its path {factor:.3g} times as long"
        way = longer if own else f"give the phase {seconds:.2f} s or more"
        raise SpecError(f"{says}; {way}")


def _check_feet(
    robot: Robot, phase: Phase, roles: Mapping[str, str | None], driven: tuple[Driven, ...]
) -> None:
    """A foot may carry only while its limb is a leg, and not while the limb changes."""
    at = f"phase '{phase.name}'"
    moving = {robot.joint_names[d.joint] for d in driven if not d.path.constant}
    for contact in phase.contacts:
        frame_number(robot.model, contact.frame, f"{at}.contacts")
        for limb, foot in robot.feet.items():
            if foot != contact.frame or limb not in robot.roles:
                continue
            if roles.get(limb) not in (None, "leg"):
                raise SpecError(
                    f"{at}: contact '{foot}' needs {limb} in role 'leg', it is in role '{roles[limb]}'"
                )
            changing = moving & set(robot.limbs[limb])
            if changing:
                joints = ", ".join(sorted(changing))
                raise SpecError(f"{at}: contact '{foot}' while {limb} changes its role ({joints} move)")


def _frame_targets(
    phase: Phase, model: Any, state: State, level: Mapping[int, int]
) -> tuple[FrameTarget, ...]:
    """Contacts, then hard tasks, then soft ones."""
    targets = [
        FrameTarget(
            f"contact({c.frame})",
            find_frame(model, c.frame),
            WORLD,
            Hold(state.pose(c.frame).translation),
            np.ones(3),
            np.zeros(3),
            np.inf,
            True,
        )
        for c in phase.contacts
    ]
    for task in phase.frame_tasks:
        what = f"phase '{phase.name}', {task.label}"
        frame = frame_number(model, task.frame, what)
        root = WORLD if task.root is None else frame_number(model, task.root, what)
        here = state.pose(task.frame)
        if task.root is not None:
            here = state.pose(task.root).actInv(here)
        if POINT in task.takes and task.path.kind != POSE:
            here = here.translation
        targets.append(
            FrameTarget(
                task.label,
                frame,
                root,
                _bound(task.path, here, f"{what}.target", task.takes),
                task.position_weight,
                task.rotation_weight,
                task.gain,
                task in phase.hard,
                level.get(id(task), 0),
            )
        )
    return tuple(targets)


def _joint_target(
    robot: Robot, task: PostureTask, q: Array, given: set[int], hard: bool, level: int, at: str
) -> JointTarget:
    """Target and weight of every joint that the task asks for and the phase leaves free."""
    what = f"{at}, {task.label}"
    index = {name: j for j, name in enumerate(robot.joint_names)}
    values = task.target if isinstance(task.target, Mapping) else {}
    weights = task.weight if isinstance(task.weight, Mapping) else dict.fromkeys(index, task.weight)
    for name in (*values, *weights, *(task.joints or ())):
        if name not in index:
            raise unknown(f"{what}: joint", name, robot.joint_names)
    goal = q[7:]
    if isinstance(task.target, State):
        own, other = robot.model, task.target.model
        if list(own.names) != list(other.names):
            raise SpecError(f"{what}.target: a state of '{other.name}', expected one of '{own.name}'")
        goal = task.target.q[7:]
    named = task.joints or tuple(values)
    taken = [name for name in named if index[name] in given]
    if hard and taken:
        raise SpecError(f"{what}: {', '.join(taken)} is locked, driven or held by its limb's role")
    weight, paths = np.zeros(len(index)), []
    for name in named or robot.joint_names:
        j = index[name]
        if j in given:
            continue
        weight[j] = weights.get(name, 0.0)
        path = values.get(name, Hold(goal[j]))
        paths.append((j, _bound(path, np.asarray(q[7 + j]), f"{what}.target['{name}']", (NUMBER,))))
    return JointTarget(task.label, tuple(paths), weight, task.gain, hard, level)
