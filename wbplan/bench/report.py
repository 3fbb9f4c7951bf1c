"""What the bench leaves: a table, and a file."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from rich.table import Table

from wbplan.bench.race import Lap
from wbplan.errors import BundleError

#: What the others are compared with.
PEER = "placo"


@final
@dataclass(frozen=True)
class Row:
    """A solver's times on a stack.

    Attributes:
        stack, solver: names.
        median_us, p99_us: of its ticks [us].
        ratio_to_placo: its median over that of PlaCo's own solver in the same run.
    """

    stack: str
    solver: str
    median_us: float
    p99_us: float
    ratio_to_placo: float


def rows_of(stack: str, laps: Sequence[Lap]) -> list[Row]:
    """Medians and 99th percentiles, and how they compare with PlaCo's."""
    medians = {lap.solver: float(np.median(lap.nanoseconds)) / 1e3 for lap in laps}
    return [
        Row(
            stack,
            lap.solver,
            round(medians[lap.solver], 2),
            round(float(np.percentile(lap.nanoseconds, 99)) / 1e3, 2),
            round(medians[lap.solver] / medians[PEER], 3),
        )
        for lap in laps
    ]


def table_of(stack: str, laps: Sequence[Lap], missing: Sequence[tuple[str, str]] = ()) -> Table:
    """The stack's table.

    Args:
        stack: its name.
        laps: the solvers' runs.
        missing: (solver, why) of those that could not run.
    """
    table = Table(
        title=f"stack '{stack}'", title_justify="left", box=None, header_style="bold", pad_edge=False
    )
    table.add_column("solver", no_wrap=True)
    for heading in (
        "median\n[us]",
        "mean\n[us]",
        "p99\n[us]",
        "times\nPlaCo",
        "path\n[mm]",
        "feet\n[mm]",
        "loop\n[mm]",
        "margin\n[mm]",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("note", overflow="fold")
    for row, lap in zip(rows_of(stack, laps), laps, strict=True):
        lengths = (_millimetres(length) for length in (lap.tracking, lap.slip, lap.gap, lap.margin))
        note = "; ".join(
            (*(f"NOT THE SAME WORK: {fault}" for fault in lap.faults), *filter(None, [lap.note]))
        )
        table.add_row(
            row.solver,
            f"{row.median_us:.1f}",
            f"{lap.nanoseconds.mean() / 1e3:.1f}",
            f"{row.p99_us:.1f}",
            f"{row.ratio_to_placo:.2f}",
            *lengths,
            note,
        )
    for solver, why in missing:
        table.add_row(solver, *[""] * 8, why)
    return table


def write_json(rows: Sequence[Row], path: Path) -> None:
    """Write the rows as a list of objects; an older file is replaced whole.

    Raises:
        BundleError: the file cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(json.dumps([vars(row) for row in rows], indent=2) + "\n", encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        if beside.exists():
            beside.unlink()
        raise BundleError(f"cannot write '{path}': {error.strerror or error}") from None


def _millimetres(length: float) -> str:
    return "" if np.isnan(length) else f"{1e3 * length:.2g}" if abs(length) < 1e-2 else f"{1e3 * length:.0f}"
