"""What all tests share."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings
from rich.console import Console

from wbplan.bundle import Bundle
from wbplan.cli.survey import Walked, table
from wbplan.papers import summary

# The same examples each time: a red run can be run again, and a slow machine is no failure.
settings.register_profile("wbplan", deadline=None, derandomize=True)
settings.load_profile("wbplan")


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's folder."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def machine() -> ModuleType:
    """A small four-legged robot and plans of it, for the tests of bundle, checks and plots."""
    spec = spec_from_file_location("machine", Path(__file__).parent / "bundle" / "machine.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def good(machine: ModuleType) -> Bundle:
    """A plan that keeps every promise."""
    return machine.build()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What the papers print beside what came out in this run, and the figures of all gaits walked in it."""
    reports = [r for outcome in ("passed", "failed") for r in terminalreporter.stats.get(outcome, [])]
    found = [(key, value) for r in reports for key, value in r.user_properties]
    rows = [tuple(cells) for key, cells in found if key == "paper"]
    walks = [Walked(**fields) for key, fields in found if key == "gait"]
    console = Console(width=150, markup=False, highlight=False, emoji=False)
    with console.capture() as text:
        if rows:
            console.print(summary(sorted(rows, key=lambda cells: cells[0])))
        if walks:
            walks.sort(key=lambda row: (row.robot, row.mode != "free", row.mode, row.gait))
            console.print(table(walks, "gaits as walked in these tests"))
    if rows or walks:
        terminalreporter.write(f"\n{text.get()}")
