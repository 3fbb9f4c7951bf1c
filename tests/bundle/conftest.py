"""A bundle on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from wbplan.bundle import Bundle


@pytest.fixture
def folder(good: Bundle, tmp_path: Path) -> Path:
    """A bundle on disk, alone in its parent."""
    return good.write(tmp_path / "plan")
