"""What the inequality rows of a tick's program are, by block: kind, unit and names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbplan.compiled.phase import CompiledPhase


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


def edge_names(phase: CompiledPhase) -> list[str]:
    """Name of every edge of a phase's support polygon: its two feet, or a side of the region."""
    if phase.polygon is None:
        return []
    if phase.region:
        angles = np.degrees(np.arctan2(*phase.polygon.normals.T[::-1]))
        return [f"support region, side towards {angle:.0f} deg" for angle in angles]
    feet = [c.frame for c in phase.phase.contacts]
    return [f"support polygon edge {feet[i]}-{feet[j]}" for i, j in phase.polygon.edges]


def name_rows(
    blocks: Sequence[RowBlock], names: Sequence[Callable[[], list[str]]]
) -> list[tuple[str, str, str]]:
    """(name, kind, unit) of every row, from what each block's `keep` gave."""
    return [
        (name, block.kind, block.unit)
        for block, called in zip(blocks, names, strict=True)
        for name in called()
    ]
