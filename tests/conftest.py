"""What all tests share."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings
from rich.console import Console

from wbplan.bundle import Bundle
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
    """What the papers print beside what came out in this run, where their tests ran."""
    reports = [r for outcome in ("passed", "failed") for r in terminalreporter.stats.get(outcome, [])]
    rows = [tuple(cells) for r in reports for key, cells in r.user_properties if key == "paper"]
    if rows:
        console = Console(width=150, markup=False, highlight=False, emoji=False)
        with console.capture() as text:
            console.print(summary(sorted(rows, key=lambda cells: cells[0])))
        terminalreporter.write(f"\n{text.get()}")
