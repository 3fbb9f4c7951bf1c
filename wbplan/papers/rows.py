"""One line of the report: what a paper prints, what comes out here, and what to make of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

REPRODUCED, MISPRINT, FOUND, FASTER, DIFFERS = "reproduced", "misprint", "not printed", "faster", "DIFFERS"
REACHED, BESIDE = "reached", "beside"


@dataclass(frozen=True)
class Row:
    """One number, or one statement, of a paper.

    Attributes:
        paper: MANA, Zheng, Hex-Piderix, HIphanT or Zhuang.
        table: the table, figure, equation or section it is printed in.
        what: which quantity.
        printed: the printed value; None where the paper gives none.
        ours: the value computed here.
        tolerance: largest difference that counts as agreement, the print's rounding included.
        unit: of both.
        why: for a misprint what is wrong with it; otherwise a remark.
        misprint: whether the print is expected to be wrong.
        time: whether both are times, of which the shorter is the better.
        goal: for what depends on a robot that the paper does not give: "least" or "most", where ours has to
            be at least or at most the printed value, "beside" where it only stands beside it.
    """

    paper: str
    table: str
    what: str
    printed: float | str | None
    ours: float | str
    tolerance: float = 0.0
    unit: str = ""
    why: str = ""
    misprint: bool = False
    time: bool = False
    goal: str = ""

    @property
    def agrees(self) -> bool:
        """Whether the printed value is ours, within the tolerance."""
        if isinstance(self.printed, str) or isinstance(self.ours, str) or self.printed is None:
            return self.printed == self.ours
        return math.isclose(self.printed, self.ours, rel_tol=0.0, abs_tol=self.tolerance)

    @property
    def verdict(self) -> str:
        """How ours stands to the print; DIFFERS where it is none of the ways that count, a fault here."""
        if self.printed is None:
            return FOUND
        if self.goal:
            return self._aimed()
        if self.time:
            faster = (
                not isinstance(self.ours, str)
                and not isinstance(self.printed, str)
                and self.ours < self.printed
            )
            return FASTER if faster else DIFFERS
        if self.misprint:
            return DIFFERS if self.agrees else MISPRINT
        return REPRODUCED if self.agrees else DIFFERS

    def _aimed(self) -> str:
        if self.goal == "beside":
            return BESIDE
        if isinstance(self.ours, str) or isinstance(self.printed, str) or self.printed is None:
            return DIFFERS
        better = self.ours - self.printed if self.goal == "least" else self.printed - self.ours
        return REACHED if better >= 0.0 else DIFFERS

    def cells(self) -> tuple[str, str, str, str, str, str, str]:
        """Paper, table, quantity, printed, ours, verdict and remark, as text."""
        unit = f" {self.unit}" if self.unit else ""
        printed = "-" if self.printed is None else f"{_text(self.printed)}{unit}"
        return self.paper, self.table, self.what, printed, f"{_text(self.ours)}{unit}", self.verdict, self.why


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
