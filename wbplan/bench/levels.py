"""What strict priorities cost: the same tasks in one level, in two, and each in its own."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wbplan.bench.race import COLD, ROUND
from wbplan.bench.scenes import Scene
from wbplan.tick import Loop


def level_costs(scene: Scene) -> dict[int, float]:
    """Median microseconds of a tick by number of levels, in rounds that take turns."""
    tasks = scene.phase.soft_tasks
    splits: Mapping[int, Any] = {
        1: tasks,
        **({2: (tasks[:1], tasks[1:])} if len(tasks) > 1 else {}),
        **({len(tasks): tuple((task,) for task in tasks)} if len(tasks) > 2 else {}),
    }
    loops = {
        count: Loop(scene.robot, replace(scene.phase, soft=soft), scene.q, scene.dt, placed=scene.placed)
        for count, soft in splits.items()
    }
    taken: dict[int, list[int]] = {count: [] for count in loops}
    for first in range(0, scene.ticks, ROUND):
        for count, loop in loops.items():
            for k in range(first, min(first + ROUND, scene.ticks)):
                started = time.perf_counter_ns()
                loop.step()
                if k - first >= min(COLD, scene.ticks - 1):
                    taken[count].append(time.perf_counter_ns() - started)
    return {count: float(np.median(times)) / 1e3 for count, times in taken.items()}


def levels_text(scene: Scene) -> str:
    """One line: the tick by number of levels, and what one more level costs."""
    costs = level_costs(scene)
    most, least = max(costs), min(costs)
    text = ", ".join(
        f"{median:.1f} us with {count} level{'s' * (count > 1)}" for count, median in costs.items()
    )
    if most == least:
        return f"soft tasks of '{scene.name}': {text}"
    each = (costs[most] - costs[least]) / (most - least)
    return f"soft tasks of '{scene.name}' by strict priority: {text}; {each:.0f} us a level"
