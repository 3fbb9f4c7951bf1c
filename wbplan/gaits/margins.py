"""Stability margins along a gait, before any robot: which steps can be held, and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog

from wbplan.errors import GaitError, SpecError, listing
from wbplan.gaits.gait import Gait
from wbplan.geometry import HalfPlanes, support_polygon

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class StepMargin:
    """How well a body can be held in one step of a gait.

    Attributes:
        step: its number, from 0.
        swing: legs in the air.
        support: legs on the ground.
        centre: margin [m] of the body's nominal place; negative outside the support.
        best: largest margin [m] of any point.
        place: that point (2,) [m].
    """

    step: int
    swing: tuple[str, ...]
    support: tuple[str, ...]
    centre: float
    best: float
    place: Array


def regular_stance(legs: Sequence[str], radius: float = 1.0, first: float = 0.0) -> dict[str, Array]:
    """Feet on a regular polygon round the body: leg -> (2,) [m].

    Args:
        legs: in their order round the body, counter-clockwise.
        radius: CR, of the circle through the feet [m].
        first: direction of the first one [rad].
    """
    angles = first + 2.0 * np.pi * np.arange(len(legs)) / len(legs)
    return {leg: radius * np.array([np.cos(a), np.sin(a)]) for leg, a in zip(legs, angles, strict=True)}


def step_margins(
    gait: Gait, stance: Mapping[str, ArrayLike], centre: ArrayLike = (0.0, 0.0)
) -> tuple[StepMargin, ...]:
    """Every step's margins with the feet at a stance, the body standing still.

    Args:
        gait: the gait.
        stance: leg -> foot (2,) or (3,) [m].
        centre: nominal place of the centre of mass (2,) [m].

    Raises:
        SpecError: the stance misses a leg.
        GaitError: the feet of a step are on one line.
    """
    feet = _stance(gait, stance)
    found = []
    for k, swing in enumerate(gait.steps):
        polygon = _polygon(gait, k, [feet[leg] for leg in gait.support(k)])
        place, best = polygon.chebyshev()
        at = polygon.margin(np.asarray(centre, dtype=np.float64))
        found.append(StepMargin(k, swing, gait.support(k), at, best, place))
    return tuple(found)


def cycle_margins(
    gait: Gait,
    stance: Mapping[str, ArrayLike],
    travel: ArrayLike,
    samples: int = 50,
) -> tuple[Array, Array]:
    """Margin of the nominal body point over one cycle of steady walking on a straight line.

    Every foot stands so that the body passes its stance half-way through the foot's time on the ground.

    Args:
        gait: the gait.
        stance: leg -> foot against the body (2,) or (3,) [m].
        travel: of the body in a cycle (2,) [m]; its length is the stride.
        samples: in each step.

    Returns:
        Times (K,) as shares of the cycle, and margins (K,) [m]; each step's last sample has the time of the
        next one's first.
    """
    feet, along = _stance(gait, stance), np.asarray(travel, dtype=np.float64)
    ends = np.concatenate([[0.0], np.cumsum(gait.lasting)])
    times, margins = [], []
    for k in range(gait.step_count):
        placed = _placed(gait, feet, along, k)
        polygon = _polygon(gait, k, list(placed.values()))
        share = np.linspace(0.0, 1.0, samples)
        body = (sum(gait.advance[:k]) + gait.advance[k] * share)[:, None] * along
        times.append(ends[k] + (ends[k + 1] - ends[k]) * share)
        margins.append(polygon.margins(body))
    return np.concatenate(times), np.concatenate(margins)


def best_margin(
    gait: Gait, stance: Mapping[str, ArrayLike], travel: ArrayLike, *, straight: bool = False
) -> float:
    """The largest margin [m] that a body can keep all through a cycle of steady walking.

    In a step the support does not change, so that a body on a straight line between points inside it stays
    inside: with c_k the body where step k begins,

        max m   over c_1 .. c_n and m
        with    N_k c_k <= d_k - m,   N_k c_(k+1) <= d_k - m,   c_(n+1) = c_1 + travel

    which is a linear program.

    Args:
        gait: the gait.
        stance: leg -> foot against the body (2,) or (3,) [m].
        travel: of the body in a cycle (2,) [m].
        straight: the body stays on its nominal line and goes as the gait's advance says.
    """
    feet, along = _stance(gait, stance), np.asarray(travel, dtype=np.float64)
    polygons = [
        _polygon(gait, k, list(_placed(gait, feet, along, k).values())) for k in range(gait.step_count)
    ]
    if straight:
        return float(cycle_margins(gait, stance, along, samples=2)[1].min())
    chain = [[polygons[k - 1], polygons[k]] for k in range(gait.step_count)]
    shifts = [along if k == 0 else np.zeros(2) for k in range(gait.step_count)]
    rows, bounds, count = [], [], 2 * gait.step_count + 1
    for k, (before, now) in enumerate(chain):
        # The step before the first is the last of the cycle before, a stride behind.
        for polygon, shift in ((before, -shifts[k]), (now, np.zeros(2))):
            block = np.zeros((len(polygon.offsets), count))
            block[:, 2 * k : 2 * k + 2] = polygon.normals
            block[:, -1] = 1.0
            rows.append(block)
            bounds.append(polygon.offsets + polygon.normals @ shift)
    cost = np.zeros(count)
    cost[-1] = -1.0
    found = linprog(cost, A_ub=np.vstack(rows), b_ub=np.concatenate(bounds), bounds=[(None, None)] * count)
    return float(found.x[-1])


def possible(
    gait: Gait,
    stance: Mapping[str, ArrayLike],
    travel: ArrayLike,
    margin: float = 0.0,
    *,
    straight: bool = False,
) -> bool:
    """Whether a body can be held with more than a margin [m] all through a gait; see `best_margin`."""
    return best_margin(gait, stance, travel, straight=straight) > margin + 1e-9


def require(
    gait: Gait, stance: Mapping[str, ArrayLike], margin: float, travel: ArrayLike = (0.0, 0.0)
) -> None:
    """Refuse a gait that cannot be held with a margin.

    Args:
        gait: the gait.
        stance: leg -> foot against the body (2,) or (3,) [m].
        margin: [m].
        travel: of the body in a cycle (2,) [m].

    Raises:
        GaitError: names the first step in which the body cannot be held, the margin that there is, and the
            stride or the stance that would hold.
    """
    along = np.asarray(travel, dtype=np.float64)
    for step in step_margins(gait, stance):
        if step.best < margin:
            raise GaitError(
                f"gait '{gait.name}': the body cannot be held in step {step.step + 1} ({listing(step.swing)} "
                f"swing, {listing(step.support)} stand): the largest margin there is {step.best:.4f} m, "
                f"{margin:.4f} m is asked; a stance {margin / step.best:.2f} times as wide would hold"
                if step.best > 0.0
                else f"gait '{gait.name}': the body cannot be held in step {step.step + 1}",
                step=step.step,
                margin=step.best,
            )
    best = best_margin(gait, stance, along)
    if best >= margin - 1e-9:
        return
    share = _longest(lambda s: best_margin(gait, stance, s * along) >= margin)
    length = float(np.linalg.norm(along))
    worst = _worst_pair(gait, stance, along)
    way = (
        f"a stride of {share * length:.4f} m would hold"
        if share > 0.0
        else "not even a stride of 0 would hold: pause between steps (Gait.paused), or widen the stance"
    )
    raise GaitError(
        f"gait '{gait.name}': the body cannot go from step {worst + 1} to the next with a margin of "
        f"{margin:.4f} m; the largest there is {best:.4f} m with a stride of {length:.4f} m; {way}",
        step=worst,
        margin=best,
        stride=share * length or None,
    )


def _worst_pair(gait: Gait, stance: Mapping[str, ArrayLike], along: Array) -> int:
    """The step whose support and the next one's have the smallest circle in common."""
    feet, count = _stance(gait, stance), gait.step_count
    common = []
    for k in range(count):
        now = _polygon(gait, k, list(_placed(gait, feet, along, k).values()))
        after = _polygon(gait, k + 1, list(_placed(gait, feet, along, (k + 1) % count).values()))
        shift = along if k == count - 1 else np.zeros(2)
        rows = np.vstack([now.normals, after.normals])
        offsets = np.concatenate([now.offsets, after.offsets + after.normals @ shift])
        found = linprog(
            [0.0, 0.0, -1.0],
            A_ub=np.column_stack([rows, np.ones(len(rows))]),
            b_ub=offsets,
            bounds=[(None, None)] * 3,
        )
        common.append(float(found.x[2]))
    return int(np.argmin(common))


def _longest(holds: object, steps: int = 20) -> float:
    """The largest share in 0 to 1 that holds, by bisection; 0 where none does."""
    assert callable(holds)
    low, high = 0.0, 1.0
    if not holds(0.0):
        return 0.0
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _placed(gait: Gait, feet: Mapping[str, Array], along: Array, step: int) -> dict[str, Array]:
    """Where the supporting feet of a step stand, with the body at 0 where the cycle begins."""
    count, placed = gait.step_count, {}
    total = np.concatenate([[0.0], np.cumsum(gait.advance)])
    for stand in gait.stands:
        # A stance may have begun in this cycle or in the one before.
        for cycle in (0, -1):
            first = stand.first + cycle * count
            if first <= step < first + stand.steps:
                begin = total[stand.first] + cycle
                placed[stand.leg] = feet[stand.leg] + (begin + 0.5 * stand.stroke) * along
    return {leg: placed[leg] for leg in gait.support(step)}


def _stance(gait: Gait, stance: Mapping[str, ArrayLike]) -> dict[str, Array]:
    missing = [leg for leg in gait.legs if leg not in stance]
    if missing:
        raise SpecError(f"gait '{gait.name}': the stance has no foot for {listing(missing)}")
    return {leg: np.asarray(stance[leg], dtype=np.float64)[:2] for leg in gait.legs}


def _polygon(gait: Gait, step: int, feet: list[Array]) -> HalfPlanes:
    try:
        return support_polygon(np.array(feet))
    except SpecError as error:
        step %= gait.step_count
        raise GaitError(
            f"gait '{gait.name}': the body cannot be held in step {step + 1} "
            f"({listing(gait.steps[step])} swing): {error}",
            step=step,
            margin=0.0,
        ) from None
