"""How fast each joint's speed may change: as given, or from its effort limit and what it has to move.

Unless a number is given, the bound of joint j [rad/s^2, m/s^2] is

    a_j = min(SHARE tau_j / I_j, speed limit_j / RISE)

    I_j = sum over the links i that j moves, and the bodies they carry, of  m_i d_ij^2 + J_i
          + (M / C) r_jf^2   if j stands between the base and f, one of the phase's C feet in contact

with tau_j the URDF's effort limit, m_i and J_i a link's mass and largest principal inertia, d the length of
the chain from the joint to the link's centre of mass, M the mass of the whole, and r the distance from the
joint's axis to the foot. A joint that slides moves masses: its d and r are 1, its J is 0.

- A limb folds and unfolds in a phase: its chain is taken as stretched out, where its inertia is largest.
  Feet on the ground stay: they are taken where they are when the phase begins.
- A leg in the air moves itself. One on the ground moves the robot, of which each foot carries its share.
- Half of the effort (SHARE) is left for weight and what is pushed or lifted.
- A link's inertia leaves out the motor's own rotor and gears, which URDFs do not name and which are what a
  light joint mostly moves: no joint is let go from rest to its speed limit in less than RISE.
- Where the URDF names no effort (0), only the second part is left.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.problem.bodies import frame_number
from wbplan.problem.script import Phase, unknown
from wbplan.problem.tasks import FrameTask
from wbplan.robot import Robot
from wbplan.state import find_frame

Array = NDArray[np.float64]

#: Share of a joint's effort that may go into acceleration.
SHARE = 0.5

#: Least time [s] from rest to a joint's speed limit.
RISE = 0.05

#: Share of the carrying legs' acceleration that is counted on to take over from a joint at its limit.
LED = 0.5


def limb_inertia(model: Any) -> Array:
    """(n,) inertia [kg m^2, or kg] that each joint moves with its foot in the air and its chain stretched."""
    inertia, slides = np.zeros(model.nv - 6), _slides(model)
    for link in range(2, model.njoints):
        body = model.inertias[link]
        spin = float(np.linalg.eigvalsh(body.inertia)[-1])
        for j, length in _chain(model, link, float(np.linalg.norm(body.lever))):
            inertia[j] += body.mass if slides[j] else body.mass * length**2 + spin
    return inertia


@lru_cache(maxsize=4)
def _own_limbs(robot: Robot) -> Array:
    """`limb_inertia` of a robot that carries nothing: the same in every phase of a plan."""
    return limb_inertia(robot.model)


def standing_inertia(model: Any, q: Array, feet: Sequence[str]) -> Array:
    """(n,) inertia [kg m^2, or kg] of the robot on its feet, seen by each joint between the base and a foot.

    Args:
        model: a model with a free-flyer root.
        q: (nq,) how it stands.
        feet: frames on the ground, each carrying its share.
    """
    inertia, slides = np.zeros(model.nv - 6), _slides(model)
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    mass = sum(body.mass for body in model.inertias) / max(len(feet), 1)
    for foot in feet:
        frame = find_frame(model, foot)
        moved = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        squared = (moved[:3, 6:] ** 2).sum(axis=0)  # what a unit of a joint's speed moves the foot by
        for j in _joints_of(model, frame):
            inertia[j] += mass if slides[j] else mass * squared[j]
    return inertia


def _slides(model: Any) -> list[bool]:
    return ["JointModelP" in model.joints[j].shortname() for j in range(2, model.njoints)]


def _chain(model: Any, last: int, length: float) -> Iterable[tuple[int, float]]:
    """(actuated joint, length of the chain from it) for every joint from `last` in to the base."""
    while last > 1:
        yield last - 2, length
        length += float(np.linalg.norm(model.jointPlacements[last].translation))
        if "JointModelP" in model.joints[last].shortname():
            index = model.joints[last].idx_q
            ends = np.abs([model.lowerPositionLimit[index], model.upperPositionLimit[index]])
            length += float(ends[np.isfinite(ends)].max(initial=0.0))
        last = model.parents[last]


def acceleration_bounds(robot: Robot, phase: Phase, q: Array, model: Any = None) -> Array:
    """(n,) bound of every joint's acceleration [rad/s^2, m/s^2] in a phase; see the module.

    Args:
        robot: the robot.
        phase: whose joint limits and contacts count.
        q: (nq,) how the robot stands.
        model: the robot's, with the carried bodies; by default without.

    Raises:
        SpecError: a joint is named that does not exist.
    """
    model = robot.model if model is None else model
    effort, speed = np.array(model.effortLimit[6:]), np.array(model.velocityLimit[6:])
    for contact in phase.contacts:
        frame_number(model, contact.frame, f"phase '{phase.name}'.contacts")
    limbs = _own_limbs(robot) if model is robot.model else limb_inertia(model)
    inertia = limbs + standing_inertia(model, q, [c.frame for c in phase.contacts])
    bound: Array = speed / RISE
    named = (effort > 0.0) & (inertia > 0.0)
    with np.errstate(over="ignore"):  # what next to nothing has to be moved by is no bound
        bound[named] = np.minimum(bound[named], SHARE * effort[named] / inertia[named])
    limits = phase.joint_limits
    return bound if limits is None else _given(robot, phase, limits.acceleration, bound, "acceleration")


def braking_bounds(robot: Robot, phase: Phase, bounds: Array) -> Array:
    """(n,) with what each joint may count on for braking [rad/s^2, m/s^2].

    Where a joint stops at its limit and its foot or hand has to go on, along a hard task's path, the body
    takes over: the joint counts on half (LED) of what the legs that carry the robot have, and no more.

    Args:
        robot: the robot.
        phase: its contacts and hard tasks count.
        bounds: (n,) `acceleration_bounds`.
    """
    model = robot.model
    slides, braking = _slides(model), bounds.copy()
    least = min(
        (bounds[j] for j in _joints_to(model, [c.frame for c in phase.contacts]) if not slides[j]),
        default=np.inf,
    )
    turning = led_joints(robot, phase) & ~np.array(slides)
    braking[turning] = np.minimum(braking[turning], LED * least)
    return braking


def braking_kind(phase: Phase) -> tuple[object, ...]:
    """What a phase's bounds depend on beside the robot and how it stands: phases alike in it share them."""
    led = {(t.frame, t.root) for t in phase.hard if isinstance(t, FrameTask) and not t.path.constant}
    return tuple(contact.frame for contact in phase.contacts), phase.joint_limits, frozenset(led)


def stopping_bounds(robot: Robot, phase: Phase, bounds: Array) -> tuple[Array, NDArray[np.bool_]]:
    """`braking_bounds` and `led_joints`."""
    return braking_bounds(robot, phase, bounds), led_joints(robot, phase)


def led_joints(robot: Robot, phase: Phase) -> NDArray[np.bool_]:
    """(n,) whether a joint is on the way to a frame that a hard task leads along a path."""
    led = np.zeros(robot.model.nv - 6, dtype=np.bool_)
    tasks = [task for task in phase.hard if isinstance(task, FrameTask) and not task.path.constant]
    frames = [f for task in tasks for f in (task.frame, task.root) if f is not None]
    led[list(_joints_to(robot.model, frames))] = True
    return led


def _joints_to(model: Any, frames: Iterable[str]) -> set[int]:
    """Actuated joints between the base and any of these frames; bodies that are carried are left out."""
    return {
        j for name in frames if model.existFrame(name) for j in _joints_of(model, find_frame(model, name))
    }


def _joints_of(model: Any, frame: int) -> list[int]:
    """Actuated joints between the base and a frame."""
    return [j - 2 for j in model.supports[model.frames[frame].parentJoint] if j > 1]


def jerk_bounds(robot: Robot, phase: Phase) -> Array | None:
    """(n,) bound of every joint's jerk [rad/s^3, m/s^3], infinite where there is none; None for no bound."""
    limits = phase.joint_limits
    if limits is None or limits.jerk is None:
        return None
    return _given(robot, phase, limits.jerk, np.full(robot.model.nv - 6, np.inf), "jerk")


def _given(
    robot: Robot, phase: Phase, given: float | Mapping[str, float] | None, bound: Array, what: str
) -> Array:
    """The bounds with those replaced that the user gave."""
    if isinstance(given, Mapping):
        for joint, value in given.items():
            if joint not in robot.joint_names:
                raise unknown(f"phase '{phase.name}', JointLimits.{what}: joint", joint, robot.joint_names)
            bound[robot.joint_index(joint)[1] - 6] = value
    elif given is not None:
        bound[:] = given
    return bound
