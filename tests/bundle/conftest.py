"""The small plan that the tests of bundle, checks and plots share."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from wbplan.bundle import Bundle


@pytest.fixture(scope="session")
def machine() -> ModuleType:
    """The module with the robot and its plans."""
    spec = spec_from_file_location("machine", Path(__file__).parents[1] / "bundle" / "machine.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def good(machine: ModuleType) -> Bundle:
    """A plan that keeps every promise."""
    return machine.build()


@pytest.fixture
def folder(good: Bundle, tmp_path: Path) -> Path:
    """A bundle on disk, alone in its parent."""
    return good.write(tmp_path / "plan")
