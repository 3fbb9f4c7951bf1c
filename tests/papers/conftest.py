"""Rows of the report: each is judged where it is made, and goes into the summary at the end of the run."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from wbplan.papers import DIFFERS, Row

Judge = Callable[[list[Row]], dict[str, Row]]


@pytest.fixture
def judge(record_property: Callable[[str, object], None]) -> Judge:
    """Records rows for the summary, and fails where a value is neither the print's nor a named misprint."""

    def judged(rows: list[Row]) -> dict[str, Row]:
        assert rows
        for row in rows:
            record_property("paper", list(row.cells()))
        wrong = [row.cells() for row in rows if row.verdict == DIFFERS]
        assert wrong == []
        assert all(row.why for row in rows if row.misprint), "a misprint needs its reason"
        return {row.what: row for row in rows}

    return judged
