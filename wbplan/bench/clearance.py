"""What promised distances cost: the same scene without them and with them, in turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wbplan.bench.race import COLD
from wbplan.bench.scenes import Scene
from wbplan.obstacles import Ground, Obstacle
from wbplan.problem.limits import Obstacles, SelfCollision
from wbplan.tick import Loop

#: Ticks in a row before the other one has its turn.
ROUND = 50

#: What the scenes keep: [m], and within which [m].
DISTANCE, INFLUENCE = 0.005, 0.02


@dataclass(frozen=True)
class ClearanceCost:
    """Medians over a scene's ticks.

    Attributes:
        without, along: time of a tick [us], without and with distances.
        pairs: pairs of shapes in the phase; checked: measured exactly in a tick; rows: active in a tick.
    """

    without: float
    along: float
    pairs: int
    checked: float
    rows: float


def clearance_cost(scene: Scene) -> ClearanceCost:
    """Ticks a scene with and without a promised clearance."""
    below = min(float(scene.compiled.contact_points[:, 2].min()), 0.0) - DISTANCE
    ground = Obstacle("ground", Ground(), (0.0, 0.0, below))
    limits = (SelfCollision(DISTANCE, INFLUENCE), Obstacles((ground,), DISTANCE, INFLUENCE))
    promising = replace(scene.phase, limits=(*scene.phase.limits, *limits))
    loops = [
        Loop(scene.robot, phase, scene.q, scene.dt, placed=scene.placed) for phase in (scene.phase, promising)
    ]
    clearance = loops[1].stack.clearance
    if clearance is None:
        raise RuntimeError("a phase that promises a clearance has one")
    spent: list[list[float]] = [[], []]
    checked, rows = [], []
    for start in range(0, scene.ticks, ROUND):
        for k, loop in enumerate(loops):
            for i in range(min(ROUND, scene.ticks - start)):
                tick = loop.step()
                if i >= min(COLD, scene.ticks // 2):
                    spent[k].append(tick.microseconds)
                if k == 1:
                    checked.append(clearance.checked)
                    rows.append(clearance.active)
    return ClearanceCost(
        float(np.median(spent[0])),
        float(np.median(spent[1])),
        len(clearance.spare),
        float(np.median(checked)),
        float(np.median(rows)),
    )


def clearance_text(scene: Scene) -> str:
    """One line: pairs checked, rows active, and the tick with and without them."""
    cost = clearance_cost(scene)
    return (
        f"clearance of '{scene.name}': {cost.along:.1f} us a tick with it, {cost.without:.1f} without "
        f"({cost.along / cost.without:.2f} times); of {cost.pairs} pairs {cost.checked:.0f} measured, "
        f"{cost.rows:.0f} rows active"
    )
