"""Small tasks, and the command line called in this process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from wbplan.cli.commands import main

# Four feet would do, but six are what "stand" stands on; the body sways by `sway`.
SWAY = '''"""Sway: the body moves sideways on six feet.

Source: none, a task for tests.
"""

import numpy as np

import wbplan as wb

ROBOT = "legarm_hexapod"


def script(
    robot,
    *,
    sway: float = 0.01,
    duration: float = 0.2,
    feet: int = 6,
    name: str = "sway",
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0),
) -> wb.Script:
    stand = robot.state("stand")
    contacts = [wb.Contact(foot, friction=0.7) for foot in list(robot.feet.values())[:feet]]
    aside = wb.MinJerk(stand.com, stand.com + sway * np.array(axis), duration=duration)
    return wb.Script(
        wb.Phase(
            name,
            contacts=contacts,
            soft=[wb.ComTask(aside, weight=20.0), wb.PostureTask(weight=0.1)],
            limits=[wb.JointLimits(), wb.SupportPolygon(margin=0.02)],
            duration=duration,
        )
    )
'''


@dataclass(frozen=True)
class Ran:
    """What a call of the command line returned and printed."""

    code: int
    out: str
    err: str


Call = Callable[..., Ran]


@pytest.fixture
def wbplan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Calls the command line in an empty folder that holds `sway.py`."""
    (tmp_path / "sway.py").write_text(SWAY, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def call(*args: str) -> Ran:
        code = main(list(args))
        said = capsys.readouterr()
        return Ran(code, said.out, said.err)

    return call


@pytest.fixture
def refused(wbplan: Call) -> Callable[..., str]:
    """Calls the command line, expects exit code 2 and one line on stderr, and returns that line."""

    def call(*args: str) -> str:
        ran = wbplan(*args)
        assert ran.code == 2, ran
        assert ran.err.startswith("wbplan: ")
        assert ran.err.count("\n") == 1, ran.err
        return ran.err

    return call
