"""The plan as files: plan.json, robot.urdf, trajectory.npz and what people look at."""

from __future__ import annotations

from wbplan.bundle.data import Bundle, Trajectory
from wbplan.bundle.files import FILES, is_bundle
from wbplan.bundle.rules import NO_MARGIN, SCHEMA

__all__ = ["FILES", "NO_MARGIN", "SCHEMA", "Bundle", "Trajectory", "is_bundle"]
