from __future__ import annotations

import pytest

from wbplan.errors import SpecError
from wbplan.papers import PAPERS, Row, report, summary


def row(printed: float | str | None, ours: float | str, **more: object) -> Row:
    return Row("P", "Table 1", "x", printed, ours, 0.01, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("made", "verdict"),
    [
        (row(1.0, 1.009), "reproduced"),
        (row(1.0, 1.02), "DIFFERS"),
        (row(1.0, float("nan")), "DIFFERS"),
        (row(1.0, 1.02, misprint=True, why="w"), "misprint"),
        (row(1.0, 1.0, misprint=True, why="w"), "DIFFERS"),
        (row(None, 1.0), "not printed"),
        (row("yes", "yes"), "reproduced"),
        (row("yes", "no"), "DIFFERS"),
        (row(90.0, 0.1, time=True), "faster"),
        (row(90.0, 91.0, time=True), "DIFFERS"),
    ],
)
def test_the_verdict_follows_from_the_numbers(made: Row, verdict: str) -> None:
    assert made.verdict == verdict


def test_an_unknown_paper_is_named_with_the_known_ones() -> None:
    with pytest.raises(SpecError, match=r"no paper 'mama'.*mana"):
        report("mama")


def test_every_table_is_there_once() -> None:
    tables = [table for tables in PAPERS.values() for table in tables]
    assert len(tables) == len(set(tables)) == 36


def test_the_summary_has_a_line_a_row() -> None:
    assert summary([row(1.0, 1.0).cells(), row(1.0, 2.0).cells()]).row_count == 2
