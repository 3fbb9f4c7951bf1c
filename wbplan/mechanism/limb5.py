"""Zheng's five-joint limb in closed form, with the body's sideways compensation for the sixth freedom.

Axes z, y, y, y, z; straight along x at zero; positive pitch lowers the tip. With qx = q2 + q3 + q4,
a = l1 + l2 cos q2 + l31 cos(q2 + q3) + l4 cos qx and b likewise with sines (without l1):

    R = Rz(q1) Ry(qx) Rz(q5),  p = (a cos q1 + l5 r11, a sin q1 + l5 r21, -b + l5 r31)

(printed eq. 20 has +b, which contradicts its own rotation). The body may shift by s n, n = (sin t, -cos t, 0)
across its direction of travel t, which moves the target to p - s n in the limb's frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.mechanism.poe import Chain
from wbplan.mechanism.screws import line
from wbplan.mechanism.solutions import LimbSolution, LimbSolutions, distinct, sort_by_limits

Array = NDArray[np.float64]

VERTICAL = 1e-9
"""sin qx below this: joints 1 and 5 are parallel (case 1)."""
ACROSS = 1e-9
"""|cos(q1 - t)| below this: the compensation is along the limb (cases 2.1, 2.4)."""
LINE_TOLERANCE = 1e-9
"""How far [m] the target may be off the limb's plane in case 2.4."""
SEARCH = 400
"""Shifts that are tried where the least one for reach is outside the joint limits."""


@dataclass(frozen=True, eq=False)
class FiveJointLimb:
    """Lengths, place and limits of a five-joint limb.

    Attributes:
        l1, l2, l31, l4, l5: hip, thigh, shank 1, arm 1, arm 2 [m].
        placement: T_body_O, O at joint 1 with the axes of `pose`.
        lower, upper: (5,) [rad].
        joints: names.
    """

    l1: float
    l2: float
    l31: float
    l4: float
    l5: float
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    lower: Array = field(default_factory=lambda: np.full(5, -np.pi))
    upper: Array = field(default_factory=lambda: np.full(5, np.pi))
    joints: tuple[str, ...] = ("joint1", "joint2", "joint3", "joint4", "joint5")

    @property
    def reach(self) -> tuple[float, float]:
        """Least and largest distance [m] of joint 4 from joint 2: |l2 - l31|, l2 + l31."""
        return abs(self.l2 - self.l31), self.l2 + self.l31

    def pose(self, q: Array) -> pin.SE3:
        """T_O_tip at joint positions (5,) [rad]."""
        one, two, three, four, five = np.asarray(q, dtype=np.float64)
        x = two + three + four
        a = self.l1 + self.l2 * math.cos(two) + self.l31 * math.cos(two + three) + self.l4 * math.cos(x)
        b = self.l2 * math.sin(two) + self.l31 * math.sin(two + three) + self.l4 * math.sin(x)
        turn = pin.utils.rotate("z", one) @ pin.utils.rotate("y", x) @ pin.utils.rotate("z", five)
        wrist = np.array([a * math.cos(one), a * math.sin(one), -b])
        return pin.SE3(turn, wrist + self.l5 * turn[:, 0])

    def solve(self, target: pin.SE3, travel: float = math.pi / 2, most: float = math.inf) -> LimbSolutions:
        """Every set of joint positions for a pose of the tip, with the least sideways shift of the body.

        Case 2 (joint 5 not vertical): orientation gives q1, qx, q5; position then fixes a and the shift,
        a = (X cos t + Y sin t)/cos(q1 - t), s = (X sin q1 - Y cos q1)/cos(q1 - t) (2.3); no shift allowed
        is large enough (2.2); the shift is along the limb, and free (2.4) or of no use (2.1).
        Case 1 (joint 5 vertical): no shift needed (1.4), the least that brings the tip into reach (1.3),
        too large (1.2), or no shift helps (1.1).

        Args:
            target: T_O_tip, at zero shift.
            travel: t, the body's direction of travel in the limb's frame [rad].
            most: largest shift allowed [m].

        Raises:
            SpecError: the target or an argument is not finite, or `most` is negative.
        """
        if not (np.isfinite(target.homogeneous).all() and math.isfinite(travel) and most >= 0.0):
            raise SpecError(
                f"five-joint limb: expected a finite target and travel and a shift of 0 m or more, found "
                f"{target.homogeneous.tolist()}, {travel}, {most}"
            )
        parallel = math.hypot(target.rotation[0, 2], target.rotation[1, 2]) < VERTICAL
        return (self._case_one if parallel else self._case_two)(target, travel, most)

    def _case_two(self, target: pin.SE3, travel: float, most: float) -> LimbSolutions:
        r = target.rotation
        x, y, b = self._wrist(target)
        found: list[LimbSolution] = []
        cases: list[str] = []
        reasons: list[str] = []
        for turned in (0.0, math.pi):
            one = math.atan2(r[1, 2], r[0, 2]) + turned
            qx = math.atan2(r[0, 2] * math.cos(one) + r[1, 2] * math.sin(one), r[2, 2])
            five = math.atan2(r[2, 1], -r[2, 0]) + turned
            along, aside = x * math.cos(one) + y * math.sin(one), x * math.sin(one) - y * math.cos(one)
            cosine = math.cos(one - travel)
            if abs(cosine) > ACROSS:
                shift = aside / cosine
                a = (x * math.cos(travel) + y * math.sin(travel)) / cosine
                if abs(shift) > most:
                    cases.append("2.2")
                    reasons.append(
                        f"the body would have to shift by {shift:.4f} m, at most {most:.4f} m allowed"
                    )
                    continue
                cases.append("2.3")
                found += self._planar(one, qx, five, a, b, shift)
                reasons.append(self._out_of_reach(a, b, qx))
            elif abs(aside) > LINE_TOLERANCE:
                cases.append("2.1")
                reasons.append(f"the tip is {aside:.4f} m off the limb's plane, and the shift is along it")
            else:
                cases.append("2.4")
                sign = math.sin(travel - one)  # n . (cos q1, sin q1) = +-1
                options = ((s, along - s * sign) for s in self._shifts(along, b, qx, most))
                found += self._first(one, qx, five, b, options)
                reasons.append(self._out_of_reach(along, b, qx))
        order = ("2.3", "2.4", "2.2", "2.1")
        return self._sorted(found, min(cases, key=order.index), next((w for w in reasons if w), ""))

    def _case_one(self, target: pin.SE3, travel: float, most: float) -> LimbSolutions:
        r = target.rotation
        x, y, b = self._wrist(target)
        down = 1.0 if r[2, 2] > 0.0 else -1.0
        qx = 0.0 if down > 0.0 else math.pi
        n = np.array([math.sin(travel), -math.cos(travel)])
        wide = self._radii(b, qx)
        if not wide:
            reason = (
                f"joint 4 would be {abs(b):.4f} m below joint 2, beyond the reach of {self.reach[1]:.4f} m"
            )
            return self._sorted([], "1.1", reason)
        along, square = float(n @ [x, y]), x * x + y * y
        # |(x, y) - s n| = radius: s^2 - 2 (n . xy) s + xy . xy - radius^2 = 0
        roots = [
            along + sign * math.sqrt(max(along**2 - square + radius**2, 0.0))
            for radius in {abs(w) for pair in wide for w in pair}
            for sign in (1.0, -1.0)
            if along**2 - square + radius**2 >= 0.0
        ]
        spread = min(most, self.reach[1] + math.sqrt(square) + self.l1 + self.l4)
        shifts = sorted([0.0, *roots, *np.linspace(-spread, spread, SEARCH + 1)], key=abs)
        seen = False
        for shift in (s for s in shifts if abs(s) <= most):
            px, py = x - shift * n[0], y - shift * n[1]
            found: list[LimbSolution] = []
            for sign in (1.0, -1.0):
                one = math.atan2(sign * py, sign * px)
                five = (math.atan2(down * r[1, 0], down * r[0, 0]) - one) * down
                found += self._planar(one, qx, five, sign * math.hypot(px, py), b, shift)
            seen = seen or bool(found)
            result = self._sorted(found, "1.4" if shift == 0.0 else "1.3", "")
            if result.within:
                return result
        if seen:
            return self._sorted([], "1.2", "every shift that brings the tip into reach breaks a joint limit")
        possible = min((abs(s) for s in roots), default=math.inf)
        if math.isfinite(possible):
            return self._sorted(
                [], "1.2", f"the body would have to shift by {possible:.4f} m, at most {most:.4f} m allowed"
            )
        return self._sorted([], "1.1", "no shift across the direction of travel brings the tip into reach")

    def _wrist(self, target: pin.SE3) -> tuple[float, float, float]:
        """X, Y and b of the wrist: the tip less arm 2."""
        wrist = target.translation - self.l5 * target.rotation[:, 0]
        return float(wrist[0]), float(wrist[1]), -float(wrist[2])

    def _planar(
        self, one: float, qx: float, five: float, a: float, b: float, shift: float
    ) -> list[LimbSolution]:
        """Joints 2 to 4 from a, b and qx: both elbows (eq. 31 with atan2(tb, ta))."""
        ta, tb = a - self.l1 - self.l4 * math.cos(qx), b - self.l4 * math.sin(qx)
        cosine = (ta * ta + tb * tb - self.l2**2 - self.l31**2) / (2.0 * self.l2 * self.l31)
        if abs(cosine) > 1.0 + 1e-9:
            return []
        solutions = []
        for elbow in (1.0, -1.0):
            three = elbow * math.acos(min(max(cosine, -1.0), 1.0))
            two = math.atan2(tb, ta) - math.atan2(
                self.l31 * math.sin(three), self.l2 + self.l31 * math.cos(three)
            )
            joints = np.array([one, two, three, qx - two - three, five])
            solutions.append(LimbSolution(joints, f"elbow {'+' if elbow > 0 else '-'}", shift))
        return solutions

    def _radii(self, b: float, qx: float) -> list[tuple[float, float]]:
        """Ranges of a that are in reach (one on each side of joint 2) at a depth b."""
        least, most = self.reach
        tb, base = b - self.l4 * math.sin(qx), self.l1 + self.l4 * math.cos(qx)
        if abs(tb) > most:
            return []
        far, near = math.sqrt(most**2 - tb**2), math.sqrt(max(least**2 - tb**2, 0.0))
        return [(base + near, base + far), (base - far, base - near)]

    def _shifts(self, along: float, b: float, qx: float, most: float) -> Iterator[float]:
        """Shifts along the limb, smallest first: none, just into reach, and a grid beyond."""
        edges = [along - w for pair in self._radii(b, qx) for w in pair]
        edges += [-e for e in edges]
        spread = min(most, self.reach[1] + abs(along) + self.l1 + self.l4)
        options = sorted([0.0, *edges, *np.linspace(-spread, spread, SEARCH + 1)], key=abs)
        return (s for s in options if abs(s) <= most)

    def _first(
        self, one: float, qx: float, five: float, b: float, options: Iterable[tuple[float, float]]
    ) -> list[LimbSolution]:
        """Solutions of the smallest shift that has one within limits, else of the smallest in reach."""
        fallback: list[LimbSolution] = []
        for shift, a in options:
            found = self._planar(one, qx, five, a, b, shift)
            if self._sorted(found, "", "").within:
                return found
            fallback = fallback or found
        return fallback

    def _out_of_reach(self, a: float, b: float, qx: float) -> str:
        distance = math.hypot(a - self.l1 - self.l4 * math.cos(qx), b - self.l4 * math.sin(qx))
        least, most = self.reach
        if least <= distance <= most:
            return ""
        return f"joint 4 would be {distance:.4f} m from joint 2, the reach is {least:.4f} to {most:.4f} m"

    def _sorted(self, found: list[LimbSolution], case: str, reason: str) -> LimbSolutions:
        return sort_by_limits(distinct(found), self.lower, self.upper, self.joints, reason, case)

    def chain(self) -> Chain:
        """The same limb as a product of exponentials, in the body's frame."""
        z, y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
        places = np.cumsum([0.0, self.l1, self.l2, self.l31, self.l4])
        r, p = self.placement.rotation, self.placement.translation
        screws = [
            line(r @ axis, p + r @ np.array([x, 0.0, 0.0]))
            for axis, x in zip((z, y, y, y, z), places, strict=True)
        ]
        home = self.placement * self.pose(np.zeros(5))
        return Chain(self.joints, np.array(screws), home, self.lower, self.upper)

    @classmethod
    def of(cls, chain: Chain) -> FiveJointLimb:
        """The limb that a chain of five joints is.

        Args:
            chain: five revolute joints about z, y, y, y, z of some frame, straight along its x at zero.

        Raises:
            SpecError: it is not of this shape.
        """
        if len(chain.joints) == 5 and np.linalg.norm(chain.screws[:, :3], axis=1).min() > 0.5:
            z, y = chain.screws[0, :3], chain.screws[1, :3]
            x = np.cross(y, z)
            tip = chain.home.translation
            points = [np.cross(s[:3], s[3:]) for s in chain.screws]
            origin = points[0] + z * float(z @ (tip - points[0]))
            at = np.array([float(x @ (p - origin)) for p in (*points, tip)])
            l1, l2, l31, l4, l5 = np.diff(at).tolist()
            limb = cls(
                l1,
                l2,
                l31,
                l4,
                l5,
                pin.SE3(np.column_stack([x, y, z]), origin),
                chain.lower,
                chain.upper,
                chain.joints,
            )
            own = limb.chain()
            if np.allclose(own.screws, chain.screws, atol=1e-8) and own.home.isApprox(chain.home, 1e-8):
                return limb
        raise SpecError(
            f"five-joint limb: expected axes z, y, y, y, z and the limb straight along x at zero, found "
            f"joints "
            f"{', '.join(chain.joints)} with axes {chain.screws[:, :3].round(4).tolist()}"
        )
