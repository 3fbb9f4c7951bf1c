"""How long forces take: a stance's region, and a distribution of forces from a warm start."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from wbplan.statics import ForceQP, equilibrium_region

Array = NDArray[np.float64]

STANCES = 20  #: random ones, for each number of feet
TICKS = 1000  #: of a force distribution


def forces_table() -> Table:
    """Milliseconds of a region and what it takes; microseconds of a force distribution."""
    table = Table(
        title="forces: feet on slopes and at different heights", title_justify="left",
        box=None, header_style="bold", pad_edge=False,
    )  # fmt: skip
    for name in (
        "feet",
        "region [ms]",
        "p90 [ms]",
        "programs",
        "pivots",
        "corners",
        "forces, warm [us]",
        "p99 [us]",
    ):
        table.add_column(name, justify="right")
    for feet in (3, 4, 5, 6):
        milliseconds, regions = [], []
        for seed in range(STANCES):
            stance = rough_stance(feet, seed)
            started = time.perf_counter_ns()
            regions.append(equilibrium_region(*stance))
            milliseconds.append((time.perf_counter_ns() - started) / 1e6)
        asked = (
            np.median(milliseconds),
            np.percentile(milliseconds, 90),
            np.mean([r.programs for r in regions]),
            np.mean([r.pivots for r in regions]),
            np.mean([len(r.polygon.vertices) for r in regions]),
        )
        warm = force_times(feet)
        table.add_row(
            str(feet),
            *(f"{value:.1f}" for value in asked),
            f"{np.median(warm):.1f}",
            f"{np.percentile(warm, 99):.1f}",
        )
    return table


def rough_stance(feet: int, seed: int) -> tuple[Array, Array, Array]:
    """Points (C, 3) [m] about a circle at different heights, normals about 15 degrees off, friction."""
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(feet, dtype=np.float64) / feet
    points = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), rng.uniform(-0.1, 0.1, feet)])
    normals = rng.normal(size=(feet, 3)) * 0.2 + [0.0, 0.0, 1.0]
    return points, normals / np.linalg.norm(normals, axis=1)[:, None], np.full(feet, 0.7)


def force_times(feet: int) -> Array:
    """(TICKS,) [us] of a program of four sides whose wrench goes on a little with every tick."""
    points, normals, friction = rough_stance(feet, 0)
    program = ForceQP(normals, friction)
    about, spent = np.array([0.0, 0.0, 0.3]), np.zeros(TICKS)
    for k in range(TICKS):
        s, c = np.sin(0.01 * k), np.cos(0.013 * k)
        wrench = np.array([8.0 * s, 6.0 * c, 90.0, 3.0 * c, 4.0 * s, 0.5 * s])
        started = time.perf_counter_ns()
        program.carry(points, wrench, about)
        spent[k] = (time.perf_counter_ns() - started) / 1e3
    return spent[20:]
