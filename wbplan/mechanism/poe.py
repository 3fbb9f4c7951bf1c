"""Product of exponentials: any limb of any robot as joint screws and a home pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, listing
from wbplan.mechanism.kernels import chain_pose
from wbplan.mechanism.screws import swap
from wbplan.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain from the body to a tip: T(q) = exp(s_1 q_1) ... exp(s_n q_n) T(0).

    Attributes:
        joints: names, from the body outward.
        screws: (n, 6) joint screws (direction, moment) at q = 0, in the body's frame.
        home: T_body_tip at q = 0.
        lower, upper: (n,) position limits [rad or m]; infinite where there are none.
    """

    joints: tuple[str, ...]
    screws: Array
    home: pin.SE3
    lower: Array
    upper: Array

    def pose(self, q: ArrayLike) -> pin.SE3:
        """T_body_tip at joint positions (n,) [rad or m].

        Raises:
            SpecError: they are not n finite numbers.
        """
        rotation, translation, _ = chain_pose(self.screws, self._checked(q))
        return pin.SE3(rotation, translation) * self.home

    def screws_at(self, q: ArrayLike) -> Array:
        """(n, 6) joint screws at q, in the body: row j is the tip's twist for a unit rate of joint j."""
        return np.asarray(chain_pose(self.screws, self._checked(q))[2], dtype=np.float64)

    def point_jacobian(self, q: ArrayLike) -> Array:
        """(3, n) velocity of the tip's origin in the body's frame per joint rate: omega x r + v_O."""
        at, tip = self.screws_at(q), self.pose(q).translation
        return np.asarray((np.cross(at[:, :3], tip) + at[:, 3:]).T)

    def hold(self, values: Mapping[str, float]) -> Chain:
        """The chain that is left where some joints stay at given positions.

        Args:
            values: joint -> position [rad or m].

        Raises:
            SpecError: a joint is not in the chain.
        """
        for name in values:
            if name not in self.joints:
                raise SpecError(f"hold: no joint {name!r} in this chain; joints: {listing(self.joints)}")
        before = pin.SE3.Identity()
        kept: list[int] = []
        screws: list[Array] = []
        for j, name in enumerate(self.joints):
            moved = swap(before.toActionMatrix() @ swap(self.screws[j]))
            if name in values:
                before = before * pin.exp6(pin.Motion(swap(self.screws[j]) * float(values[name])))
            else:
                kept.append(j)
                screws.append(moved)
        return Chain(
            tuple(self.joints[j] for j in kept),
            np.array(screws).reshape(-1, 6),
            before * self.home,
            self.lower[kept],
            self.upper[kept],
        )

    def _checked(self, q: ArrayLike) -> Array:
        values = np.asarray(q, dtype=np.float64)
        if values.shape != (len(self.joints),) or not np.isfinite(values).all():
            raise SpecError(
                f"expected {len(self.joints)} finite joint positions ({', '.join(self.joints)}), "
                f"found {values}"
            )
        return values


def chain_to(robot: Robot, frame: str) -> Chain:
    """The chain from a robot's root link to one of its frames.

    Args:
        robot: a loaded robot.
        frame: name of a link or joint frame.

    Raises:
        SpecError: there is no such frame, or a joint on the way has more than one degree of freedom.
    """
    model = robot.model
    tip = model.frames[robot.frame_id(frame)]
    support = [int(j) for j in model.supports[tip.parentJoint] if j > 1]
    for j in support:
        if model.nvs[j] != 1:
            raise SpecError(
                f"robot '{robot.name}': joint '{model.names[j]}' has {model.nvs[j]} degrees of "
                f"freedom, expected 1"
            )
    data = model.createData()
    zero = pin.neutral(model)
    pin.computeJointJacobians(model, data, zero)
    columns = [int(model.idx_vs[j]) for j in support]
    lower, upper = _limits(model, support)
    home = data.oMi[tip.parentJoint] * tip.placement
    return Chain(
        tuple(str(model.names[j]) for j in support), swap(data.J[:, columns].T), home.copy(), lower, upper
    )


def limb_chain(robot: Robot, limb: str, tip: str | None = None) -> Chain:
    """The chain of a limb.

    Args:
        robot: a loaded robot.
        limb: name of the limb.
        tip: the frame it ends in; the limb's foot, or else its hand, where not given.

    Raises:
        SpecError: there is no such limb, or it has neither foot nor hand and no tip is given.
    """
    if limb not in robot.limbs:
        raise SpecError(f"robot '{robot.name}': no limb {limb!r}; limbs: {listing(list(robot.limbs))}")
    frame = tip or robot.feet.get(limb) or robot.hands.get(limb)
    if frame is None:
        raise SpecError(f"limb '{limb}' of robot '{robot.name}' has neither foot nor hand: name a tip")
    return chain_to(robot, frame)


def positions(robot: Robot, joints: Sequence[str], q: ArrayLike) -> Array:
    """Positions of joints [rad or m] in a configuration (nq,); the angle, of a joint without limits."""
    values = np.asarray(q, dtype=np.float64)
    found = []
    for name in joints:
        index = robot.joint_index(name)[0]
        two = robot.model.nqs[robot.model.getJointId(name)] == 2
        found.append(np.arctan2(values[index + 1], values[index]) if two else values[index])
    return np.array(found, dtype=np.float64)


def _limits(model: pin.Model, joints: Sequence[int]) -> tuple[Array, Array]:
    """Position limits; none (infinite) of a continuous joint, whose numbers in q are a cosine and a sine."""
    lower, upper = np.full(len(joints), -np.inf), np.full(len(joints), np.inf)
    for i, j in enumerate(joints):
        if model.nqs[j] == 1:
            lower[i], upper[i] = (
                model.lowerPositionLimit[model.idx_qs[j]],
                model.upperPositionLimit[model.idx_qs[j]],
            )
    return lower, upper
