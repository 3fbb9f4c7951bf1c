"""Which sets of stance joints determine the body: all of them, with rank and condition number."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.mechanism.forward import size_of
from wbplan.mechanism.platform import Platform
from wbplan.mechanism.screws import RANK_TOLERANCE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ActuatedSet:
    """A set of stance joints, and what it fixes of the body.

    Attributes:
        joints: names.
        distribution: how many of them each leg has, in the platform's order.
        rank: of their rows of the rates' map: the body's freedoms that they determine.
        condition: largest over smallest singular value, the body's rotation counted in lengths of the
            stance's size; infinite where the rank is below 6.
    """

    joints: tuple[str, ...]
    distribution: tuple[int, ...]
    rank: int
    condition: float

    @property
    def regular(self) -> bool:
        """Whether the set determines the body."""
        return self.rank == 6


def actuated_sets(platform: Platform, joints: Mapping[str, float], count: int = 6) -> tuple[ActuatedSet, ...]:
    """Every set of `count` stance joints at a configuration, the best conditioned first.

    A set is admissible iff its rows of G (`Platform.rates_map`) have rank 6.

    Args:
        platform: legs and feet.
        joints: joint -> position [rad or m] of all stance joints, loops closed.
        count: joints in a set, six or more.

    Raises:
        SpecError: fewer than six joints in a set, or more than there are.
    """
    names = platform.joints
    if not 6 <= count <= len(names):
        raise SpecError(f"actuated sets: expected 6 to {len(names)} joints in a set, found {count}")
    scaled = platform.rates_map(joints) @ np.diag([size_of(platform)] * 3 + [1.0] * 3)
    picks = np.array(list(itertools.combinations(range(len(names)), count)))
    values = np.linalg.svd(scaled[picks], compute_uv=False)
    ranks = np.sum(values > RANK_TOLERANCE * values[:, :1], axis=1)
    owner = np.repeat(np.arange(len(platform.chains)), [len(c.joints) for c in platform.chains.values()])
    sets = []
    for pick, rank, value in zip(picks, ranks, values, strict=True):
        spread = tuple(np.bincount(owner[pick], minlength=len(platform.chains)).tolist())
        condition = float(value[0] / value[-1]) if rank == 6 else float("inf")
        sets.append(ActuatedSet(tuple(names[k] for k in pick), spread, int(rank), condition))
    return tuple(sorted(sets, key=lambda s: (s.condition, s.joints)))
