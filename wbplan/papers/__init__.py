"""The papers' kinematics, table by table: printed value, ours, verdict; computed when asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rich.table import Table

from wbplan.errors import SpecError, listing
from wbplan.papers import (
    hexpiderix,
    hiphant,
    hiphant_motion,
    mana,
    mana_motion,
    mana_simulated,
    zheng,
    zheng_case,
    zheng_gaits,
    zheng_switch,
    zhuang,
    zhuang_gaits,
)
from wbplan.papers.rows import DIFFERS, Row
from wbplan.papers.zheng_switch import figure_16

__all__ = ["DIFFERS", "PAPERS", "Row", "figure_16", "report", "summary"]

PAPERS: Mapping[str, tuple[Callable[[], list[Row]], ...]] = {
    "mana": mana.TABLES + mana_motion.TABLES + mana_simulated.TABLES,
    "zheng": zheng.TABLES + zheng_case.TABLES + zheng_gaits.TABLES + zheng_switch.TABLES,
    "hexpiderix": hexpiderix.TABLES,
    "hiphant": hiphant.TABLES + hiphant_motion.TABLES,
    "zhuang": zhuang.TABLES + zhuang_gaits.TABLES,
}
"""Paper -> its tables, each a function that computes the rows."""


def report(paper: str | None = None) -> list[Row]:
    """Computes the rows of one paper, or of all.

    Args:
        paper: a key of `PAPERS`.

    Raises:
        SpecError: there is no such paper.
    """
    if paper is not None and paper not in PAPERS:
        raise SpecError(f"no paper {paper!r}; papers: {listing(list(PAPERS))}")
    chosen = PAPERS if paper is None else {paper: PAPERS[paper]}
    return [row for tables in chosen.values() for table in tables for row in table()]


def summary(cells: list[tuple[str, ...]]) -> Table:
    """A table of rows, as their `cells`."""
    table = Table(title="What the papers print, and what comes out here")
    for heading in ("paper", "table", "quantity", "printed", "ours", "verdict", "remark"):
        table.add_column(heading, overflow="fold")
    for row in cells:
        table.add_row(*row)
    return table
