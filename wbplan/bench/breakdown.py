"""Where the tick of a wbplan backend goes, by timing its parts from outside."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
import pinocchio as pin
from rich.table import Table

from wbplan.backends import BACKENDS
from wbplan.bench.race import COLD
from wbplan.bench.scenes import Scene
from wbplan.bench.solvers import Wbplan
from wbplan.program.stack import Stack

#: What is timed, and what is told of it.
PARTS: Mapping[str, str] = {
    "advance": "targets move on",
    "assemble": "Jacobians, rows, cost, limits",
    "solve": "the backend, without assemble",
    "integrate": "q plus the step",
    "measure": "poses, CoM and errors at the new q",
    "rest": "checks, corrections, the report; and this clock",
}


@contextmanager
def _timed(spent: dict[str, int], backend: str) -> Iterator[None]:
    """Adds the nanoseconds of every call to `spent`; of `solve`, those of the `assemble` within it too."""

    def clocked(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            started = time.perf_counter_ns()
            try:
                return function(*args, **kwargs)
            finally:
                spent[name] += time.perf_counter_ns() - started

        return call

    with ExitStack() as patches:
        methods = [(Stack, name) for name in ("advance", "assemble", "measure")]
        for owner, name in (*methods, (BACKENDS[backend], "solve"), (pin, "integrate")):
            patches.enter_context(patch.object(owner, name, clocked(name, getattr(owner, name))))
        yield


def breakdown(scene: Scene, backend: str) -> dict[str, float]:
    """Median microseconds of each part of a tick, by the names of `PARTS`, and of the whole, `tick`."""
    solver = Wbplan(scene, backend)
    samples: dict[str, list[float]] = {name: [] for name in (*PARTS, "tick")}
    spent = dict.fromkeys(PARTS, 0)
    with _timed(spent, backend):
        for k in range(scene.ticks):
            spent.update(dict.fromkeys(PARTS, 0))
            started = time.perf_counter_ns()
            solver.tick(k + 1)
            whole = time.perf_counter_ns() - started
            spent["solve"] -= spent["assemble"]
            spent["rest"] = whole - sum(spent.values())
            for name, value in (*spent.items(), ("tick", whole)):
                samples[name].append(value / 1e3)
    first = min(COLD, scene.ticks - 1)
    return {name: float(np.median(values[first:])) for name, values in samples.items()}


def breakdown_table(scene: Scene) -> Table:
    """The parts of both backends' ticks, beside each other."""
    parts = {backend: breakdown(scene, backend) for backend in BACKENDS}
    table = Table(
        title=f"parts of a tick, stack '{scene.name}' [us, medians]", title_justify="left",
        box=None, header_style="bold", pad_edge=False,
    )  # fmt: skip
    table.add_column("part")
    for backend in parts:
        table.add_column(f"wbplan-{backend}", justify="right")
    table.add_column("what")
    for name, what in {**PARTS, "tick": "the whole tick, clock included"}.items():
        table.add_row(name, *(f"{found[name]:.1f}" for found in parts.values()), what)
    return table
