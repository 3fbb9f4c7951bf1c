"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

# The same examples each time: a red run can be run again, and a slow machine is no failure.
settings.register_profile("wbplan", deadline=None, derandomize=True)
settings.load_profile("wbplan")


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's folder."""
    return Path(__file__).resolve().parent.parent
