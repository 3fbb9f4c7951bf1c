"""The robot that these tests drive."""

from __future__ import annotations

import pytest

import wbplan as wb


@pytest.fixture(scope="session")
def legarm() -> wb.Robot:
    """The leg-arm hexapod; tests do not change it."""
    return wb.load_robot("legarm_hexapod")
