"""Rounds that take turns, and what each solver made of the path."""

from __future__ import annotations

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bench.scenes import Scene
from wbplan.bench.solver import Solver

Array = NDArray[np.float64]

#: Ticks that a solver takes before the next one has its turn. A prime, so that no solver's own rhythm, as of
#: targets looked up for many ticks at once, falls on the same place of every turn.
ROUND = 53
#: Of these, the first ones do not count: the caches are still those of the solver before.
COLD = 5
#: What still counts as the same work [m]: error of the first tracked frame; slip of a foot, gap of the loop.
FOLLOWS, STAYS = 1e-3, 1e-4


@final
@dataclass(frozen=True, eq=False)
class Lap:
    """A solver's run.

    Attributes:
        solver: its name; note: what it says of itself.
        nanoseconds: (n,) of every tick that counts.
        tracking: worst error of the first tracked frame [m]; slip: of a foot [m]; gap: of the loop [m];
            margin: least of the CoM in the polygon [m]. NaN where there is none.
    """

    solver: str
    note: str
    nanoseconds: Array
    tracking: float = np.nan
    slip: float = np.nan
    gap: float = np.nan
    margin: float = np.nan

    @property
    def faults(self) -> tuple[str, ...]:
        """Why its time is not that of the same work; empty where it is."""
        found = []
        for name, value, bound in (
            ("path missed", self.tracking, FOLLOWS),
            ("foot slips", self.slip, STAYS),
            ("loop opens", self.gap, STAYS),
        ):
            if value > bound:
                found.append(f"{name} by {1e3 * value:.2g} mm")
        return tuple(found)


def race(scene: Scene, solvers: Sequence[Solver]) -> list[Lap]:
    """Run all solvers along the scene's path, in turns.

    Args:
        scene: the stack, and how many ticks.
        solvers: at the scene's start.
    """
    ticks = np.arange(scene.ticks)
    taken = np.zeros((len(solvers), scene.ticks))
    passed = np.zeros((len(solvers), scene.ticks, len(scene.q)))
    clock = time.perf_counter_ns
    was_on = gc.isenabled()
    gc.disable()
    try:
        for first in range(0, scene.ticks, ROUND):
            gc.collect()
            for i, solver in enumerate(solvers):
                for k in range(first, min(first + ROUND, scene.ticks)):
                    started = clock()
                    solver.tick(k + 1)
                    taken[i, k] = clock() - started
                    passed[i, k] = solver.q
    finally:
        if was_on:
            gc.enable()
    counted = ticks % ROUND >= min(COLD, scene.ticks - 1)
    return [
        Lap(s.name, s.note, taken[i, counted], *(_measure(scene, passed[i]) if s.moves else ()))
        for i, s in enumerate(solvers)
    ]


def _measure(scene: Scene, path: Array) -> tuple[float, float, float, float]:
    """Worst tracking error, slip and gap, and least margin [m], from the configurations alone."""
    model = scene.compiled.model
    data = model.createData()

    def place(frame: str) -> pin.SE3:
        return data.oMf[model.getFrameId(frame, pin.BODY)]

    pin.framesForwardKinematics(model, data, scene.q)
    feet = {foot: place(foot).translation.copy() for foot in scene.feet}
    closed = place(scene.loop[0]).actInv(place(scene.loop[1])) if scene.loop else None
    tracking, slip, gap, margin = 0.0, 0.0, np.nan, np.nan
    main = scene.tracked[0]
    for target, q in zip(main.poses[1:], path, strict=True):
        pin.framesForwardKinematics(model, data, q)
        tracking = max(tracking, _distance(target.translation, place(main.frame).translation))
        slip = max(slip, *(_distance(there, place(foot).translation) for foot, there in feet.items()))
        if scene.loop is not None and closed is not None:
            open_by = place(scene.loop[0]).actInv(place(scene.loop[1])).translation
            gap = np.fmax(gap, _distance(closed.translation, open_by))
        if scene.compiled.polygon is not None:
            com = pin.centerOfMass(model, data, q, False)
            margin = np.fmin(margin, scene.compiled.polygon.margin(com[:2]))
    return tracking, slip, float(gap), float(margin)


def _distance(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))
