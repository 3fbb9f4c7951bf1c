"""MANA on its feet, and every robot that is shipped, each loaded once."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from wbplan import Robot, catalog, load_robot
from wbplan.mechanism import Platform
from wbplan.papers import mana


@pytest.fixture(scope="session")
def robots() -> dict[str, Robot]:
    return {name: load_robot(name) for name in catalog.robots()}


@pytest.fixture(scope="session")
def standing() -> tuple[Platform, Mapping[str, float]]:
    return mana.stance()
