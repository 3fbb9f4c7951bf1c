"""Velocity and acceleration of the body from the actuated joints alone, by reciprocal screws.

A stance leg is a chain from the ground to the body: the foot's passive joints, then tibia, femur, coxa.
With the joint screws $ of all of them in one frame, in that order, and V = (omega; v_O) the body's twist,

    V = sum_j Omega_j $_j,        A = (alpha; a_O - omega x v_O) = sum_j dOmega_j $_j + L,
    L = sum_{j<k} [Omega_j $_j, Omega_k $_k]

A wrench w that is reciprocal to the passive screws leaves {w; V} = sum_active {w; $_j} q'_j, in which only
the actuated rates appear; {w; A} likewise, but for {w; L}, which needs the passive rates too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.mechanism.poe import Chain
from wbplan.mechanism.screws import adjoint, lie, line, rank, reciprocal, slide, swap

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StanceLeg:
    """Screws of one leg, ground to body, such that the body's twist is their sum with the joints' rates.

    Attributes:
        passive: (p, 6) of the foot's passive joints, in order.
        active: (a, 6) of the leg's joints, **coxa first**; signs are the robot's: a positive rate of its
            joint moves the foot against the body, so the body against the foot by the negative screw.
        wrenches: (w, 6) reciprocal to all passive screws.
    """

    passive: Array
    active: Array
    wrenches: Array

    def projection(self) -> Array:
        """(a, 6) A with q' = A E V, E the half-swap (HIphanT eqs 23 to 27).

        Row j is the wrench reciprocal to all other screws of the leg, 1 on joint j.

        Raises:
            SpecError: the leg's screws are not six independent ones.
        """
        screws = np.vstack([self.passive, self.active])
        if len(screws) != 6 or rank(screws) < 6:
            raise SpecError(
                f"projection: expected six independent screws, found {len(screws)} of rank {rank(screws)}"
            )
        rows = []
        for j in range(len(self.active)):
            others = np.delete(screws, len(self.passive) + j, axis=0)
            wrench = reciprocal(others)[0]
            rows.append(wrench / float(wrench @ swap(self.active[j])))
        return np.array(rows)

    def passive_rates(self, twist: ArrayLike, rates: ArrayLike) -> Array:
        """(p,) rates of the foot's passive joints: least squares of V = sum Omega $, the others known.

        Args:
            twist: (6,) V.
            rates: (a,) [rad/s].
        """
        rest = np.asarray(twist, dtype=np.float64) - self.active.T @ np.asarray(rates, dtype=np.float64)
        return np.asarray(np.linalg.lstsq(self.passive.T, rest, rcond=1e-12)[0])

    def lie_terms(self, passive_rates: ArrayLike, rates: ArrayLike) -> Array:
        """(6,) L: products of all pairs of screws, the one nearer to the ground first."""
        screws = np.vstack([self.passive, self.active[::-1]])
        speeds = np.concatenate([np.asarray(passive_rates), np.asarray(rates)[::-1]])
        total, before = np.zeros(6), np.zeros(6)
        for screw, speed in zip(screws, speeds, strict=True):
            total += lie(before, speed * screw)
            before = before + speed * screw
        return total


def point_leg(chain: Chain, q: ArrayLike, body: pin.SE3) -> StanceLeg:
    """A leg on a foot that turns freely about a fixed point: rotations about the world's axes (HIphanT).

    Args:
        chain: body to foot.
        q: (n,) [rad].
        body: T_world_body; screws are in the world's frame.
    """
    foot, active = _placed(chain, q, body)
    passive = np.array([line(axis, foot) for axis in np.eye(3)])
    forces = np.array([line(axis, foot) for axis in np.eye(3)])
    return StanceLeg(passive, active, forces)


def cup_leg(chain: Chain, q: ArrayLike, body: pin.SE3, slides: ArrayLike, torsion: bool = True) -> StanceLeg:
    """A leg on a suction cup, a universal and a prismatic joint (Hex-Piderix): it gives along one direction.

    k is the knee's axis and u the direction of the slide. The wrenches are 1$2, the force along k, and $r,
    the force along u x k, both through the foot. The printed leg (without `torsion`) has six screws of rank 5
    where u is in the leg's plane: k, the slide, tibia and femur are then of one planar group.

    Args:
        chain: body to foot, joints coxa, femur, tibia.
        q: (3,) [rad].
        body: T_world_body; screws are in the world's frame.
        slides: (3,) direction in which the cup gives, in the world, square to the knee's axis.
        torsion: whether the foot also turns about u, without which the leg cannot move freely.

    Raises:
        SpecError: the slide is not square to the knee's axis.
    """
    foot, active = _placed(chain, q, body)
    k = active[-1, :3]
    u = np.asarray(slides, dtype=np.float64)
    u = u / np.linalg.norm(u)
    if abs(float(u @ k)) > 1e-9:
        raise SpecError(f"cup: the slide {u} is not square to the knee's axis {k}")
    across = np.cross(u, k)
    turns = [line(across, foot), line(k, foot)]
    turns += [line(u, foot)] if torsion else []
    return StanceLeg(np.array([*turns, slide(u)]), active, np.array([line(k, foot), line(across, foot)]))


def body_twist(legs: Sequence[StanceLeg], rates: Sequence[ArrayLike]) -> Array:
    """V = (omega; v_O) (6,) from actuated rates: M' Delta V = Q' (Hex-Piderix eq. 24), least squares.

    Args:
        legs: stance legs.
        rates: for each its joints' rates, coxa first [rad/s].

    Raises:
        SpecError: the wrenches of all legs do not determine the twist.
    """
    return _solve(legs, [leg.active.T @ np.asarray(r) for leg, r in zip(legs, rates, strict=True)])


def body_acceleration(
    legs: Sequence[StanceLeg], rates: Sequence[ArrayLike], accelerations: Sequence[ArrayLike]
) -> Array:
    """A = (alpha; a_O - omega x v_O) (6,): M' Delta A = Q'' (Hex-Piderix eq. 27) with wrenches 1$2 and $r.

    Passive rates are recovered first, from V: {w; L} contains them, so they are needed, against the paper.

    Args:
        legs: stance legs.
        rates: for each its joints' rates [rad/s].
        accelerations: likewise [rad/s^2].

    Raises:
        SpecError: as `body_twist`.
    """
    twist = body_twist(legs, rates)
    own = []
    for leg, rate, acceleration in zip(legs, rates, accelerations, strict=True):
        terms = leg.lie_terms(leg.passive_rates(twist, rate), rate)
        own.append(leg.active.T @ np.asarray(acceleration) + terms)
    return _solve(legs, own)


def origin_acceleration(twist: ArrayLike, reduced: ArrayLike) -> Array:
    """(alpha; a_O): the reduced acceleration state with omega x v_O added back."""
    v, a = np.asarray(twist, dtype=np.float64), np.asarray(reduced, dtype=np.float64)
    return np.concatenate([a[:3], a[3:] + np.cross(v[:3], v[3:])])


def joint_rates(legs: Sequence[StanceLeg], twist: ArrayLike) -> Array:
    """Rates of all legs' joints for a twist of the body: q' = A E V (HIphanT eq. 29)."""
    a = np.vstack([leg.projection() for leg in legs])
    return np.asarray(a @ swap(np.asarray(twist, dtype=np.float64)))


def projected_twist(legs: Sequence[StanceLeg], rates: ArrayLike) -> Array:
    """V = (A E)^+ q' (HIphanT eqs 30, 31 with J = I): least squares where there are more than six joints."""
    a = np.vstack([leg.projection() for leg in legs])
    return np.asarray(np.linalg.lstsq(swap(a), np.asarray(rates, dtype=np.float64), rcond=1e-12)[0])


def wrench_matrix(legs: Sequence[StanceLeg]) -> Array:
    """M (6, w): the wrenches of all legs as columns."""
    return np.vstack([leg.wrenches for leg in legs]).T


def _solve(legs: Sequence[StanceLeg], own: Sequence[Array]) -> Array:
    matrix = swap(wrench_matrix(legs).T)
    if rank(matrix) < 6:
        raise SpecError(
            f"the legs' {len(matrix)} wrenches have rank {rank(matrix)}; six are needed for the body"
        )
    right = np.concatenate([swap(leg.wrenches) @ v for leg, v in zip(legs, own, strict=True)])
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-13)[0])


def _placed(chain: Chain, q: ArrayLike, body: pin.SE3) -> tuple[Array, Array]:
    """Foot (3,) in the world, and the joints' screws there, signed for the body against the foot."""
    foot = body.act(chain.pose(q).translation)
    return foot, -chain.screws_at(q) @ adjoint(body.rotation, body.translation).T
