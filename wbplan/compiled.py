"""A phase with its names looked up: frames as numbers, targets bound, joints sorted into free and given.

Nothing here is a matrix: both backends start from this.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bodies import Body
from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes, support_polygon
from wbplan.paths import AS_IS, Hold, MinJerk, Path
from wbplan.robot import Robot
from wbplan.script import Phase, unknown
from wbplan.state import State, find_frame
from wbplan.tasks import ComTask, DampingTask, FrameTask, PostureTask

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
    """

    label: str
    frame: int
    root: int
    path: Path
    position_weight: Array
    rotation_weight: Array
    gain: float
    hard: bool


@final
@dataclass(frozen=True, eq=False)
class ComTarget:
    """A CoM task with its target bound."""

    label: str
    path: Path
    weight: Array
    gain: float
    hard: bool


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


@final
@dataclass(frozen=True, eq=False)
class Driven:
    """A joint whose motion is given: index among the actuated joints, and its path."""

    joint: int
    path: Path


@final
@dataclass(frozen=True, eq=False)
class Held:
    """A carried body: its pose in the holding frame, and its own frame's number in the phase's model."""

    body: Body
    holder: str
    T_holder_body: Any
    frame: int


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
        polygon: support polygon of the contacts, `None` where the phase has no such limit.
        contact_points: (C, 3) [m], world.
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
    contact_points: Array
    held: tuple[Held, ...]
    roles: Mapping[str, str | None]

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
) -> CompiledPhase:
    """Look up every name of a phase and bind its targets to a start configuration.

    Args:
        robot: the robot.
        phase: the phase.
        q: (nq,) configuration at the phase's start.
        placed: pose in the world of every body that stands somewhere, by name.
        roles: the role that each limb is in; by default read off `q`.

    Raises:
        SpecError: a name does not exist, or two parts of the phase do not fit.
    """
    at = f"phase '{phase.name}'"
    now = dict(roles) if roles is not None else {limb: robot.role_of(limb, q) for limb in robot.roles}
    model, held = _with_carried(robot, phase, q, placed or {})
    state = State(model, q)
    driven = _driven(robot, phase, state, now)
    given = {d.joint for d in driven}
    free = np.array([*range(6), *(6 + j for j in range(model.nv - 6) if j not in given)], dtype=np.intp)
    _check_feet(robot, phase, {**now, **phase.roles}, driven)
    frames = _frame_targets(phase, model, state)
    points = np.array([state.pose(c.frame).translation for c in phase.contacts]).reshape(-1, 3)
    polygon = None
    if phase.support is not None:
        try:
            polygon = support_polygon(points[:, :2])
        except SpecError as error:
            names = ", ".join(c.frame for c in phase.contacts) or "none"
            raise SpecError(f"{at}: its contacts ({names}) span no support polygon: {error}") from None
    coms = tuple(
        ComTarget(t.label, t.path.bind(state.com), t.position_weight, t.gain, t in phase.hard)
        for t in (*phase.hard, *phase.soft)
        if isinstance(t, ComTask)
    )
    joints = tuple(
        _joint_target(robot, t, q, given, t in phase.hard, at)
        for t in (*phase.hard, *phase.soft)
        if isinstance(t, PostureTask)
    )
    damping = float(sum(t.weight**2 for t in phase.soft if isinstance(t, DampingTask)))
    return CompiledPhase(
        robot, phase, model, np.array(q), frames, coms, joints, damping, free, driven, polygon, points, held,
        {**now, **phase.roles},
    )


def _with_carried(robot: Robot, phase: Phase, q: Array, placed: Mapping[str, Any]) -> tuple[Any, tuple[Held, ...]]:
    """The robot's model with each carried body added as a frame and a mass of its holder."""
    if not phase.carried:
        return robot.model, ()
    model = pin.Model(robot.model)
    state = State(robot.model, q)
    held = []
    for item in phase.carried:
        body, holder = item.body, model.frames[robot.frame_id(item.by)]
        if model.existFrame(body.name):
            raise SpecError(f"phase '{phase.name}': body '{body.name}' has the name of a frame of {robot.name}")
        if item.pose is not AS_IS:
            pose = item.pose
        elif body.name in placed:
            pose = state.pose(item.by).actInv(placed[body.name])
        else:
            pose = pin.SE3.Identity()
        placement = holder.placement * pose
        x, y, z = body.size
        inertia = pin.Inertia.FromBox(body.mass, x, y, z) if body.mass > 0 else pin.Inertia.Zero()
        inertia.lever = np.array(body.com)
        frame = pin.Frame(body.name, holder.parentJoint, robot.frame_id(item.by), placement, pin.FrameType.BODY)
        number = model.addFrame(frame)
        model.appendBodyToJoint(holder.parentJoint, inertia, placement)
        held.append(Held(body, item.by, pose, number))
    return model, tuple(held)


def _driven(robot: Robot, phase: Phase, state: State, now: Mapping[str, str | None]) -> tuple[Driven, ...]:
    """Joints that are not the QP's: those held by roles, driven by name, or locked."""
    at = f"phase '{phase.name}'"
    paths: dict[str, Path] = {}
    for limb, role in phase.roles.items():
        if limb not in robot.roles:
            raise unknown(f"{at}.roles: limb", limb, robot.roles)
        if role not in robot.roles[limb]:
            raise unknown(f"{at}.roles['{limb}']: role", role, robot.roles[limb])
    for limb, held_by in robot.roles.items():
        role = phase.roles.get(limb, now.get(limb))
        if role is not None:
            for joint, value in held_by[role].items():
                here = state.joint(joint)
                paths[joint] = Hold(here) if abs(here - value) < 1e-9 else MinJerk(here, value, phase.duration)
        else:  # in no role: what every role holds is no joint of the QP's either
            for joint in set.intersection(*(set(joints) for joints in held_by.values())):
                paths[joint] = Hold(state.joint(joint))
    for joint in (*phase.driven, *phase.locked):
        if joint not in robot.joint_names:
            raise unknown(f"{at}: joint", joint, robot.joint_names)
    paths.update({joint: path.bind(np.asarray(state.joint(joint))) for joint, path in phase.driven.items()})
    paths.update({joint: Hold(state.joint(joint)) for joint in phase.locked})
    return tuple(Driven(robot.joint_index(joint)[1] - 6, path) for joint, path in sorted(paths.items()))


def _check_feet(robot: Robot, phase: Phase, roles: Mapping[str, str | None], driven: tuple[Driven, ...]) -> None:
    """A foot may carry only while its limb is a leg, and not while the limb changes."""
    at = f"phase '{phase.name}'"
    moving = {robot.joint_names[d.joint] for d in driven if not d.path.constant}
    for contact in phase.contacts:
        robot.frame_id(contact.frame)
        for limb, foot in robot.feet.items():
            if foot != contact.frame or limb not in robot.roles:
                continue
            if roles.get(limb) not in (None, "leg"):
                raise SpecError(f"{at}: contact '{foot}' needs {limb} in role 'leg', it is in role '{roles[limb]}'")
            changing = moving & set(robot.limbs[limb])
            if changing:
                raise SpecError(f"{at}: contact '{foot}' while {limb} changes its role ({', '.join(sorted(changing))} move)")


def _frame_targets(phase: Phase, model: Any, state: State) -> tuple[FrameTarget, ...]:
    def number(name: str, who: str) -> int:
        try:
            return find_frame(model, name)
        except SpecError as error:
            raise SpecError(f"phase '{phase.name}', {who}: {error}") from None

    targets = [
        FrameTarget(
            f"contact({c.frame})", number(c.frame, "contacts"), WORLD,
            Hold(state.pose(c.frame).translation), np.ones(3), np.zeros(3), np.inf, True,
        )
        for c in phase.contacts
    ]
    for task in phase.frame_tasks:
        frame = number(task.frame, task.label)
        root = WORLD if task.root is None else number(task.root, task.label)
        here = state.pose(task.frame) if task.root is None else state.pose(task.root).actInv(state.pose(task.frame))
        if not (task.rotation_weight > 0).any() and not _wants_pose(task):
            here = here.translation
        targets.append(
            FrameTarget(
                task.label, frame, root, task.path.bind(here), task.position_weight, task.rotation_weight,
                task.gain, task in phase.hard,
            )
        )
    return tuple(sorted(targets, key=lambda target: not target.hard))


def _wants_pose(task: FrameTask) -> bool:
    """Whether a position-only task was given poses, of which the origin counts."""
    path = task.path
    goal = getattr(path, "goal", None)
    points = getattr(path, "points", ())
    return any(isinstance(value, pin.SE3) for value in (goal, *points))


def _joint_target(robot: Robot, task: PostureTask, q: Array, given: set[int], hard: bool, at: str) -> JointTarget:
    """Target and weight of every joint that the task asks for and the phase leaves free."""
    index = {name: j for j, name in enumerate(robot.joint_names)}
    values = task.target if isinstance(task.target, Mapping) else {}
    weights = task.weight if isinstance(task.weight, Mapping) else {}
    for name in (*values, *weights, *(task.joints or ())):
        if name not in index:
            raise unknown(f"{at}, {task.label}: joint", name, robot.joint_names)
    goal = task.target.q[7:] if isinstance(task.target, State) else q[7:]
    weight, paths = np.zeros(len(index)), []
    for name in task.joints or (tuple(values) if values else robot.joint_names):
        j = index[name]
        if j not in given:
            weight[j] = weights.get(name, 0.0) if weights else task.weight
            paths.append((j, values[name].bind(np.asarray(q[7 + j])) if name in values else Hold(goal[j])))
    return JointTarget(task.label, tuple(paths), weight, task.gain, hard)
