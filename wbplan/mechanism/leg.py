"""The three-joint leg in closed form: one geometry for MANA's, Zhuang's, Hex-Piderix's and others.

Joint 1 turns about an axis, joints 2 and 3 about two parallel axes across it. In the leg's own frame (z along
axis 1, x radial through joint 2 at zero) with a = l1 + l2 cos q2 + l3 cos(q2 + q3):

    foot = Rz(q1) (a, offset, up (l2 sin q2 + l3 sin(q2 + q3)))

`up` is +1 where positive pitch lifts the foot along axis 1 and -1 where it lowers it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.mechanism.poe import Chain
from wbplan.mechanism.screws import line
from wbplan.mechanism.solutions import LimbSolution, LimbSolutions, distinct, sort_by_limits

Array = NDArray[np.float64]

EDGE = 1e-12
"""How far the cosine of the knee may be beyond 1 by rounding."""
PARALLEL = 1e-8
"""How far joint axes may be from parallel, or square, to count as such (as unit vectors)."""


def _full_turn(sign: float) -> Array:
    return np.full(3, sign * np.pi)


@dataclass(frozen=True, eq=False)
class ThreeJointLeg:
    """A three-joint leg: lengths, where it is, its limits, and how its angles are counted.

    Attributes:
        l1, l2, l3: axis 1 to axis 2, axis 2 to axis 3, axis 3 to the foot [m].
        offset: of the foot along axis 2, off the plane of axis 1 [m].
        up: +1 or -1, see above.
        placement: T_body_leg: z along axis 1, x radial at q1 = 0, origin at the height of axis 2.
        lower, upper: (3,) [rad].
        joints: names.
        signs, zeros: (3,) angles of the formula = signs * joint positions + zeros [rad].
    """

    l1: float
    l2: float
    l3: float
    offset: float = 0.0
    up: float = 1.0
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    lower: Array = field(default_factory=lambda: _full_turn(-1.0))
    upper: Array = field(default_factory=lambda: _full_turn(1.0))
    joints: tuple[str, ...] = ("joint1", "joint2", "joint3")
    signs: Array = field(default_factory=lambda: np.ones(3))
    zeros: Array = field(default_factory=lambda: np.zeros(3))

    def foot(self, q: ArrayLike) -> Array:
        """Foot (3,) [m] in the body's frame at joint positions (3,) [rad]."""
        one, two, three = self.signs * np.asarray(q, dtype=np.float64) + self.zeros
        a = self.l1 + self.l2 * math.cos(two) + self.l3 * math.cos(two + three)
        h = self.up * (self.l2 * math.sin(two) + self.l3 * math.sin(two + three))
        c, s = math.cos(one), math.sin(one)
        local = np.array([a * c - self.offset * s, a * s + self.offset * c, h])
        return np.asarray(self.placement.rotation @ local + self.placement.translation)

    def local(self, foot: ArrayLike) -> Array:
        """A point (3,) [m] of the body's frame in the leg's frame."""
        point = np.asarray(foot, dtype=np.float64)
        return np.asarray(self.placement.rotation.T @ (point - self.placement.translation))

    def solve(self, foot: ArrayLike) -> LimbSolutions:
        """Every set of joint positions that puts the foot at a point.

        rho = +-sqrt(x^2 + y^2 - offset^2), q1 = atan2(y, x) - atan2(offset, rho), u = rho - l1,
        q3 = +-acos((u^2 + h^2 - l2^2 - l3^2) / (2 l2 l3)),
        q2 = atan2(h, u) - atan2(l3 sin q3, l2 + l3 cos q3).

        Args:
            foot: (3,) [m] in the body's frame.

        Raises:
            SpecError: not three finite numbers.
        """
        x, y, z = self.local(_point(foot))
        square = x * x + y * y - self.offset**2
        if square < -EDGE * max(self.offset**2, 1.0):
            return LimbSolutions(
                (),
                (),
                f"the foot is {math.hypot(x, y):.4f} m from axis 1, and cannot be nearer than the offset "
                f"{abs(self.offset):.4f} m",
            )
        rho = math.sqrt(max(square, 0.0))
        found = [s for sign in (1.0, -1.0) for s in self._planar(x, y, self.up * z, sign * rho)]
        reason = "" if found else self._too_far(rho, z)
        return sort_by_limits(distinct(found), self.lower, self.upper, self.joints, reason)

    def reachable(self, foot: ArrayLike) -> bool:
        """Whether the foot can be at a point (3,) [m] of the body's frame within the joint limits."""
        return bool(self.solve(foot).within)

    def _planar(self, x: float, y: float, h: float, rho: float) -> list[LimbSolution]:
        """Both knee sides for one sign of rho."""
        u = rho - self.l1
        cosine = (u * u + h * h - self.l2**2 - self.l3**2) / (2.0 * self.l2 * self.l3)
        if abs(cosine) > 1.0 + EDGE:
            return []
        one = math.atan2(y, x) - math.atan2(self.offset, rho)
        side = "ahead" if rho >= 0.0 else "behind"
        solutions = []
        for knee in (1.0, -1.0):
            three = knee * math.acos(min(max(cosine, -1.0), 1.0))
            two = math.atan2(h, u) - math.atan2(
                self.l3 * math.sin(three), self.l2 + self.l3 * math.cos(three)
            )
            angles = (np.array([one, two, three]) - self.zeros) * self.signs
            solutions.append(LimbSolution(angles, f"{side}, knee {'+' if knee > 0 else '-'}"))
        return solutions

    def _too_far(self, rho: float, z: float) -> str:
        near, far = abs(self.l2 - self.l3), self.l2 + self.l3
        reach = math.hypot(rho - self.l1, z)
        word = "beyond" if reach > far else "inside"
        return (
            f"the foot would be {reach:.4f} m from axis 2, {word} the reach of {near:.4f} to {far:.4f} m "
            f"({math.hypot(-rho - self.l1, z):.4f} m with joint 1 turned round)"
        )

    def chain(self) -> Chain:
        """The same leg as a product of exponentials."""
        one, two = self.zeros[:2]
        radial = np.array([math.cos(one), math.sin(one), 0.0])
        across = np.array([-math.sin(one), math.cos(one), 0.0])
        high = np.array([0.0, 0.0, self.up])
        hip = self.l1 * radial
        knee = hip + self.l2 * (math.cos(two) * radial + math.sin(two) * high)
        pitch = -self.up * across
        local = (
            line([0.0, 0.0, self.signs[0]], np.zeros(3)),
            line(self.signs[1] * pitch, hip),
            line(self.signs[2] * pitch, knee),
        )
        p, r = self.placement.translation, self.placement.rotation
        screws = []
        for screw in local:
            axis = r @ screw[:3]
            screws.append(np.concatenate([axis, r @ screw[3:] + np.cross(p, axis)]))
        home = pin.SE3(np.eye(3), self.foot(np.zeros(3)))
        return Chain(self.joints, np.array(screws), home, self.lower, self.upper)

    @classmethod
    def of(cls, chain: Chain) -> ThreeJointLeg:
        """The leg that a chain of three joints is.

        Args:
            chain: three revolute joints, the last two parallel and square to the first.

        Raises:
            SpecError: it is not of this shape.
        """
        _require_shape(chain)
        z, k = chain.screws[0, :3], chain.screws[1, :3]
        points = [np.cross(s[:3], s[3:]) for s in chain.screws]
        foot = chain.home.translation
        to_hip = points[1] - points[0]
        radial = np.cross(k, z)
        l1 = float(radial @ to_hip)
        # Either direction across would do; x is taken towards axis 2, or towards the foot where l1 is zero.
        ahead = l1 if abs(l1) > PARALLEL else float(radial @ (foot - points[0]))
        up = -1.0
        if ahead < 0.0:
            radial, l1, up = -radial, -l1, 1.0
        origin = points[0] + z * float(z @ to_hip)
        placement = pin.SE3(np.column_stack([radial, np.cross(z, radial), z]), origin)
        shin_side = 1.0 if float(chain.screws[2, :3] @ k) > 0.0 else -1.0
        knee, tip = (placement.rotation.T @ (p - origin) for p in (points[2], foot))
        thigh = np.array([knee[0] - l1, up * knee[2]])
        shin = np.array([tip[0] - knee[0], up * (tip[2] - knee[2])])
        two = math.atan2(thigh[1], thigh[0])
        three = math.atan2(shin[1], shin[0]) - two
        return cls(
            l1,
            float(np.linalg.norm(thigh)),
            float(np.linalg.norm(shin)),
            float(tip[1]),
            up,
            placement,
            chain.lower,
            chain.upper,
            chain.joints,
            np.array([1.0, 1.0, shin_side]),
            np.array([0.0, two, three]),
        )


def _require_shape(chain: Chain) -> None:
    if len(chain.joints) != 3 or np.linalg.norm(chain.screws[:, :3], axis=1).min() < 0.5:
        raise SpecError(f"three-joint leg: expected three revolute joints, found {', '.join(chain.joints)}")
    one, two, three = chain.screws[:, :3]
    if abs(float(one @ two)) > PARALLEL or float(np.linalg.norm(np.cross(two, three))) > PARALLEL:
        raise SpecError(
            f"three-joint leg {', '.join(chain.joints)}: expected joints 2 and 3 parallel and square to "
            f"joint 1, "
            f"found axes {_show(one)}, {_show(two)}, {_show(three)}"
        )


def _show(axis: Sequence[float] | Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in axis) + ")"


def _point(value: ArrayLike) -> Array:
    point = np.asarray(value, dtype=np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise SpecError(f"foot: expected three finite numbers [m], found {point}")
    return point
