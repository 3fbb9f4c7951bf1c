"""What all tests share."""

from __future__ import annotations

import os
import shutil
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


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium; the test skips where there is none."""
    wanted = os.environ.get("WBPLAN_CHROMIUM")
    for name in filter(None, (wanted, "chromium", "chromium-browser", "google-chrome")):
        if found := shutil.which(name):
            return found
    pytest.skip("no Chromium (Debian: apt-get install chromium, or set WBPLAN_CHROMIUM)")
