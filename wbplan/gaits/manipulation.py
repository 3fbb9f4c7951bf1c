"""A hand's work while the other limbs walk (Zheng, section 4.3).

A limb of five joints lacks one freedom of six: the body makes up for it by a shift across its way. How much a
task asks for follows in closed form (`FiveJointLimb`); the planner finds the same shift by itself where the
body is free to go sideways, the hand's path being hard, and the rows of the support polygon bound it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import GaitError
from wbplan.gaits.schedule import Course
from wbplan.gaits.stance import Walker
from wbplan.mechanism import FiveJointLimb, limb_chain
from wbplan.paths import POSE, Hold, Path, Value, as_path, number
from wbplan.problem.tasks import PoseTask, Task
from wbplan.sampling import Samples, sample

Array = NDArray[np.float64]

#: Largest shift of the body across its way, as a share of CR: what the body's centre loses of the largest
#: margin of three feet of a pentagon, 0.427 - 0.309.
SHIFT = 0.118


@final
@dataclass(frozen=True, eq=False)
class WithBody(Path):
    """Poses given against the body's nominal place, which moves along a course.

    T_world(t) = T_course(begin + t) T_path(t).

    Args:
        course: the body's nominal motion.
        begin: when the phase starts, in the course's time [s].
        path: `pin.SE3`, a path of them or `AS_IS`, in the level body at its nominal place.
        height: of the body there [m].
    """

    course: Course
    begin: float
    path: Any
    height: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", as_path(self.path, "WithBody.path"))
        for key in ("begin", "height"):
            object.__setattr__(self, key, number(getattr(self, key), f"WithBody.{key}", "a finite number"))
        object.__setattr__(self, "kind", POSE)

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        return replace(self, path=self.path.bind(nominal(self.course, self.begin, self.height).actInv(here)))

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return nominal(self.course, self.begin + t, self.height) * self.path.at(t)

    def samples(self, times: Array) -> Samples:
        """Points (N, 3) [m] and rotations (N, 3, 3) at times (N,) [s]."""
        points, rotations = sample(self.path, times)
        x, y, yaw = self.course.places(self.begin + times).T
        turn = np.zeros((len(times), 3, 3))
        turn[:, 0, 0], turn[:, 0, 1] = np.cos(yaw), -np.sin(yaw)
        turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = np.sin(yaw), np.cos(yaw), 1.0
        places = np.column_stack([x, y, np.full(len(times), self.height)])
        return places + np.einsum("nij,nj->ni", turn, points), turn @ rotations


@sample.register
def _(path: WithBody, times: Array) -> Samples:
    return path.samples(times)


def nominal(course: Course, t: float, height: float) -> pin.SE3:
    """The level body at its nominal place.

    Args:
        course: its motion.
        t: in the course's time [s].
        height: [m].
    """
    x, y, yaw = course.place(t)
    return pin.SE3(pin.utils.rotate("z", float(yaw)), np.array([x, y, height]))


def shifts(
    walker: Walker,
    limb: str,
    targets: Sequence[Any],
    travel: float,
    most: float,
    hand: str | None = None,
) -> Array:
    """How far the body has to shift across its way for a limb of five joints to meet poses of its hand.

    The shift s is along n = (sin t, -cos t), to the right of the way of direction t.

    Args:
        walker: the robot.
        limb: of five joints about z, y, y, y, z.
        targets: poses of the hand (N) in the level body at its nominal place.
        travel: t, of the body in its own frame [rad].
        most: largest shift allowed [m].
        hand: frame of the hand; the limb's where not given.

    Returns:
        (N,) [m]; of several solutions that whose joints are nearest to the pose before.

    Raises:
        SpecError: the limb is of another shape.
        GaitError: a pose would need a larger shift, or is out of reach; says which, and how large.
    """
    arm = FiveJointLimb.of(limb_chain(walker.robot, limb, hand or walker.robot.hands.get(limb)))
    yaw = math.atan2(arm.placement.rotation[1, 0], arm.placement.rotation[0, 0])
    found, last = np.zeros(len(targets)), None
    for k, target in enumerate(targets):
        local = arm.placement.actInv(target)
        solutions = arm.solve(local, travel - yaw, most)
        if not solutions.within:
            wanted = [s.shift for s in arm.solve(local, travel - yaw).within]
            why = (
                f"the body would have to shift by {min(wanted, key=abs):.4f} m across its way, "
                f"{most:.4f} m is allowed"
                if wanted
                else f"no shift of the body brings it into reach: {solutions.reason}"
            )
            raise GaitError(
                f"limb '{limb}', pose {k + 1} of {len(targets)} of its hand (case {solutions.case}): {why}"
            )
        best = min(solutions.within, key=lambda s: abs(s.shift)) if last is None else solutions.nearest(last)
        found[k], last = best.shift, best.joints
    return found


def beside_way(
    walker: Walker,
    course: Course,
    begin: float,
    height: float,
    *,
    across: float = 2.0,
    along: float = 30.0,
    turn: float = 30.0,
    gain: float = 2.0,
) -> tuple[Task, ...]:
    """The body on its nominal way, but for a shift across it: what stands for the builder's own tasks.

    Where the way is not along one of the world's axes, the weight across it counts for both.

    Args:
        walker: the robot.
        course: the body's nominal motion.
        begin: when the phase starts, in the course's time [s].
        height: of the body [m].
        across: weight across the way [1/m]; small against the hand's.
        along: weight along the way, and of the height [1/m].
        turn: weight of the body's orientation [1/rad].
        gain: [1/s].
    """
    ahead = course.place(begin + 0.5)[:2] - course.place(begin)[:2]
    length = float(np.linalg.norm(ahead))
    share = np.abs(ahead) / length if length > 1e-9 else np.zeros(2)
    x, y = (along if s > 1.0 - 1e-9 else across for s in share)
    path = WithBody(course, begin, Hold(pin.SE3.Identity()), height)
    return (PoseTask(walker.root, path, weight=((x, y, along), turn), gain=gain, name="body beside its way"),)
