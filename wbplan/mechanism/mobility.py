"""Degrees of freedom by screws: constraint wrenches, common and redundant ones, a loop's finite motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from wbplan.errors import SolveError, SpecError
from wbplan.mechanism.platform import Platform
from wbplan.mechanism.poe import Chain
from wbplan.mechanism.rates import point_leg
from wbplan.mechanism.screws import rank, reciprocal

Array = NDArray[np.float64]

CLOSED = 1e-12
"""Error [m or rad] of a loop below which it counts as closed."""


@dataclass(frozen=True, eq=False)
class Mobility:
    """The screw count of a parallel mechanism at one configuration.

    Attributes:
        ranks: rank of each branch's twists.
        wrenches: per branch, a basis (6 - rank, 6) of the wrenches it puts on the platform.
        common: constraints that all branches share, lambda = 6 - rank of all twists together.
        redundant: c = number of wrenches less their rank.
        virtual: epsilon = c - (branches - 1) lambda, redundant beyond the common ones.
        links, joints: n and k, base and platform counted.
        grubler: (6 - lambda) (n - k - 1) + sum of freedoms + epsilon, the modified Gruebler-Kutzbach count.
        mobility: sum of freedoms less the rank of the loops' equations: what rates are free.
        platform: freedoms of the platform, 6 less the rank of all wrenches.
    """

    ranks: tuple[int, ...]
    wrenches: tuple[Array, ...]
    common: int
    redundant: int
    virtual: int
    links: int
    joints: int
    grubler: int
    mobility: int
    platform: int


def mobility(branches: Sequence[ArrayLike]) -> Mobility:
    """Mobility of branches that join a base to one platform, from their joint screws.

    Args:
        branches: for each the screws (n_i, 6) of its one-freedom joints, all in one frame; lengths in a
            unit in which they are about 1 keep the ranks clear of rounding.

    Raises:
        SpecError: fewer than two branches.
    """
    rows = [np.asarray(b, dtype=np.float64).reshape(-1, 6) for b in branches]
    if len(rows) < 2:
        raise SpecError(f"mobility: expected two branches or more, found {len(rows)}")
    wrenches = tuple(reciprocal(b) for b in rows)
    every = np.vstack(wrenches)
    common = 6 - rank(np.vstack(rows))
    independent = rank(every) if len(every) else 0
    redundant = len(every) - independent
    virtual = redundant - (len(rows) - 1) * common
    joints = sum(len(b) for b in rows)
    links = joints - len(rows) + 2
    return Mobility(
        tuple(rank(b) for b in rows),
        wrenches,
        common,
        redundant,
        virtual,
        links,
        joints,
        (6 - common) * (links - joints - 1) + joints + virtual,
        joints - rank(_loops(rows)),
        6 - independent,
    )


def stance_mobility(platform: Platform, joints: Mapping[str, float]) -> Mobility:
    """Mobility of the body on its legs: each a branch of its joints and three rotations at the foot.

    Args:
        platform: legs and feet.
        joints: joint -> position [rad or m] of all stance joints, loops closed.

    Raises:
        SpecError: fewer than three legs, or a joint is missing.
    """
    body = platform.pose_of(joints)
    legs = [point_leg(c, [joints[j] for j in c.joints], body) for c in platform.chains.values()]
    return mobility([np.vstack([leg.passive, leg.active]) for leg in legs])


def _loops(rows: Sequence[Array]) -> Array:
    """Loop equations: the platform moves alike by the first branch and by each other one."""
    total = sum(len(b) for b in rows)
    loops = np.zeros((6 * (len(rows) - 1), total))
    start = len(rows[0])
    for k, branch in enumerate(rows[1:]):
        loops[6 * k : 6 * k + 6, : len(rows[0])] = rows[0].T
        loops[6 * k : 6 * k + 6, start : start + len(branch)] = -branch.T
        start += len(branch)
    return loops


class ClampLoop:
    """Two limbs that hold one object: T_1(q_1) C = T_2(q_2), C the pose of tip 2 in tip 1.

    Args:
        first: chain of one limb.
        second: of the other, from the same body.
        q: (n_1 + n_2,) joint positions [rad or m] at which the object is grasped.
    """

    def __init__(self, first: Chain, second: Chain, q: ArrayLike) -> None:
        self.first, self.second = first, second
        self._n = len(first.joints)
        q1, q2 = self._split(np.asarray(q, dtype=np.float64))
        self.grasp: pin.SE3 = first.pose(q1).inverse() * second.pose(q2)

    def mobility(self, q: ArrayLike) -> Mobility:
        """The screw count at q."""
        q1, q2 = self._split(np.asarray(q, dtype=np.float64))
        return mobility([self.first.screws_at(q1), self.second.screws_at(q2)])

    def tangents(self, q: ArrayLike) -> Array:
        """(n, m) orthonormal joint rates that keep the loop closed at first order."""
        return np.asarray(null_space(self._jacobian(np.asarray(q, dtype=np.float64)), rcond=1e-9))

    def close(self, q: ArrayLike) -> Array:
        """The closed configuration found from q by Newton's method with least-norm steps.

        Raises:
            SolveError: there is none near q.
        """
        at = np.array(q, dtype=np.float64)
        for _ in range(200):
            gap = self.gap(at)
            if np.abs(gap).max() < CLOSED:
                return at
            at += np.linalg.lstsq(self._jacobian(at), gap, rcond=1e-8)[0]
        if np.abs(self.gap(at)).max() < 100 * CLOSED:
            return at
        raise SolveError("clamp: the loop cannot be closed near the given configuration")

    def gap(self, q: ArrayLike) -> Array:
        """(6,) the twist (direction, moment) that would take limb 1's end of the object to limb 2's."""
        q1, q2 = self._split(np.asarray(q, dtype=np.float64))
        error = pin.log6(self.second.pose(q2) * (self.first.pose(q1) * self.grasp).inverse()).vector
        return np.concatenate([error[3:], error[:3]])

    def departure(self, q: ArrayLike, direction: ArrayLike, step: float) -> float:
        """How far a rate is from starting a finite motion: distance to the closed set over the step.

        It goes to zero with the step for a rate that can be followed, and to a constant for one that the
        loop's first-order equations allow but its higher orders forbid.

        Args:
            q: closed configuration.
            direction: (n,) joint rates from `tangents`.
            step: how far to go along them [rad]; not so short that what forbids it, third order for Zheng's
                clamp, is lost in rounding: 0.005 and more.
        """
        along = np.asarray(direction, dtype=np.float64)
        tried = np.asarray(q, dtype=np.float64) + step * along / np.linalg.norm(along)
        return float(np.linalg.norm(self.close(tried) - tried)) / step

    def nearby(self, q: ArrayLike, spread: float, count: int, seed: int = 0) -> list[Array]:
        """Closed configurations found from random ones around q.

        Args:
            q: closed configuration.
            spread: standard deviation of each joint [rad].
            count: how many.
            seed: of the random numbers.
        """
        random = np.random.default_rng(seed)
        centre = np.asarray(q, dtype=np.float64)
        found: list[Array] = []
        for _ in range(20 * count):
            if len(found) == count:
                break
            try:
                found.append(self.close(centre + random.normal(scale=spread, size=len(centre))))
            except SolveError:
                continue
        return found

    def _split(self, q: Array) -> tuple[Array, Array]:
        return q[: self._n], q[self._n :]

    def _jacobian(self, q: Array) -> Array:
        q1, q2 = self._split(q)
        return np.hstack([self.first.screws_at(q1).T, -self.second.screws_at(q2).T])
