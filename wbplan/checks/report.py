"""The result of the checks: one row a promise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wbplan.errors import CheckFailed

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True)
class Tolerances:
    """What counts as having moved; see `check`."""

    slip: float
    closure: float
    rotation: float
    ground: float


@dataclass(frozen=True)
class Row:
    """The worst value of one promise.

    Attributes:
        promise: what is promised.
        worst: the value that comes nearest to breaking it, or breaks it most, in `unit`.
        bound: what it may be at most (at least, where `at_least`).
        unit: of both.
        at_least: whether the bound is a lower one.
        time: [s], when it fell.
        phase: the name of the phase whose promise it is.
        where: the joint, frame, loop or object.
        held: whether the promise holds at every sample.
    """

    promise: str
    worst: float
    bound: float
    unit: str
    at_least: bool
    time: float
    phase: str
    where: str
    held: bool

    def __str__(self) -> str:
        place = " ".join(part for part in (self.where, f"in {self.phase!r}" if self.phase else "") if part)
        return (
            f"{self.promise}: {self.worst:.4g} {self.unit} "
            f"({'at least' if self.at_least else 'at most'} {self.bound:.4g}) at t = {self.time:.3f} s"
            + (f", {place}" if place else "")
        )


class Worst:
    """Collects the worst value of one promise from many arrays; nan is worse than any number."""

    def __init__(self, promise: str, unit: str, *, at_least: bool = False, slack: float = 0.0) -> None:
        """Start with nothing seen.

        Args:
            promise: the row's name.
            unit: of its values.
            at_least: whether bounds are lower ones.
            slack: how far a bound may be overstepped, for rounding.
        """
        self._promise, self._unit, self._at_least, self._slack = promise, unit, at_least, slack
        self._row: Row | None = None
        self._excess = -math.inf

    def see(
        self,
        values: ArrayLike,
        bound: ArrayLike,
        time: ArrayLike,
        phase: Sequence[str] | str,
        where: Sequence[str],
        units: Sequence[str] = (),
    ) -> None:
        """Take in the values (K, M) of M things at K times.

        Args:
            values: (K, M), or (K,) for one thing.
            bound: a number, or one for each thing (M,) or sample (K, 1).
            time: (K,) [s].
            phase: name of the phase, or one for each sample.
            where: (M,) names of the things.
            units: (M,) units, where the things have not the same one.
        """
        found = np.asarray(values, dtype=np.float64)
        if not found.size:
            return
        found = found.reshape(len(found), -1)
        bounds = np.broadcast_to(np.asarray(bound, dtype=np.float64), found.shape)
        excess = np.where(found == bounds, 0.0, (found - bounds) * (-1.0 if self._at_least else 1.0))
        k, j = np.unravel_index(int(np.argmax(excess)), excess.shape)  # argmax stops at the first nan
        if self._row is not None and (excess[k, j] <= self._excess or math.isnan(self._excess)):
            return
        self._excess = float(excess[k, j])
        self._row = Row(
            promise=self._promise,
            worst=float(found[k, j]),
            bound=float(bounds[k, j]),
            unit=units[int(j)] if units else self._unit,
            at_least=self._at_least,
            time=float(np.asarray(time)[k]),
            phase=phase if isinstance(phase, str) else phase[int(k)],
            where=where[int(j)],
            held=bool(self._excess <= self._slack),
        )

    def rows(self) -> list[Row]:
        """The row, or none where nothing was seen."""
        return [] if self._row is None else [self._row]


@dataclass(frozen=True)
class CheckReport:
    """All promises of a plan, each with its worst value."""

    rows: tuple[Row, ...]

    @property
    def ok(self) -> bool:
        """Whether every promise holds."""
        return all(row.held for row in self.rows)

    @property
    def broken(self) -> tuple[Row, ...]:
        """The rows that do not hold."""
        return tuple(row for row in self.rows if not row.held)

    def __getitem__(self, promise: str) -> Row:
        """The row of a promise, by its name."""
        for row in self.rows:
            if row.promise == promise:
                return row
        raise KeyError(f"no row {promise!r}; rows are {', '.join(row.promise for row in self.rows)}")

    def require(self) -> CheckReport:
        """Return itself if every promise holds.

        Raises:
            CheckFailed: naming each broken promise with its worst value, time and place.
        """
        if not self.ok:
            raise CheckFailed(
                "\n".join(
                    [f"{len(self.broken)} broken of {len(self.rows)} promises:", *map(str, self.broken)]
                ),
                [row.promise for row in self.broken],
            )
        return self

    def to_dict(self) -> dict[str, Any]:
        """The report in JSON's types; numbers that are not finite become None."""
        rows = [
            {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in asdict(row).items()}
            for row in self.rows
        ]
        return {"ok": self.ok, "rows": rows}

    def table(self) -> Table:
        """The report as a table for the terminal."""
        from rich.table import Table
        from rich.text import Text

        table = Table(title="promises, recomputed from q", title_justify="left")
        table.add_column("")
        table.add_column("promise", no_wrap=True)
        for name in ("worst", "bound"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("t [s]", justify="right", no_wrap=True)
        table.add_column("where", overflow="fold")
        for row in self.rows:
            place = " / ".join(part for part in (row.phase, row.where) if part)
            table.add_row(
                Text("holds", style="green") if row.held else Text("BROKEN", style="bold red"),
                Text(row.promise),
                Text(f"{row.worst:.3g} {row.unit}"),
                Text(f"{'≥' if row.at_least else '≤'} {row.bound:.3g}"),
                Text(f"{row.time:.2f}"),
                Text(place),
            )
        return table
