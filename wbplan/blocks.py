"""What the inequality rows of a tick's program are, by block: kind, unit and names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True)
class RowBlock:
    """Inequality rows of one kind: consecutive rows of C.

    Attributes:
        kind: in reports: 'margin', 'clearance'; unit: of d, 'm' or 'rad'.
        span: where its rows stand.
        keep: called in every tick; what it gives is called when somebody asks what the rows were then, and
            gives one name a row, '' for a row that is not in use.
    """

    kind: str
    unit: str
    span: slice
    keep: Callable[[], Callable[[], list[str]]]
