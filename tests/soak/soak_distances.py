"""Distances between a robot's links, by Pinocchio, from the URDF and SRDF alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

import wbplan as wb


class Distances:
    """Every pair of links that may come together; bodies that are carried are left out.

    Pairs on one joint, on a joint and the one before it, and those that the SRDF leaves out have none.
    """

    def __init__(self, robot: wb.Robot, model: Any) -> None:
        root = ElementTree.fromstring(robot.urdf_text)
        for mesh in root.iter("mesh"):
            mesh.set("filename", str(robot.mesh_path(mesh.get("filename", ""))))
        for link in root.iter("link"):
            for visual in link.findall("visual"):
                link.remove(visual)
        text = ElementTree.tostring(root, encoding="unicode")
        self.geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
        never = _never(robot.srdf_path)
        shapes = self.geometry.geometryObjects
        names = [model.frames[shape.parentFrame].name for shape in shapes]
        for shape in shapes:
            if isinstance(shape.geometry, coal.BVHModelBase):
                shape.geometry.buildConvexHull(True, "Qt")
                shape.geometry = shape.geometry.convex
        for i, a in enumerate(shapes):
            for j in range(i + 1, len(shapes)):
                one, other = a.parentJoint, shapes[j].parentJoint
                if one == other or model.parents[one] == other or model.parents[other] == one:
                    continue
                if frozenset((names[i], names[j])) not in never:
                    self.geometry.addCollisionPair(pin.CollisionPair(i, j))
        self.model, self.data = model, model.createData()
        self.found = self.geometry.createData()

    def at(self, q: Any, enough: float) -> Any:
        """(pairs,) [m]; negative where two go into each other, infinite where all have `enough`."""
        nearest = pin.computeDistances(self.model, self.data, self.geometry, self.found, q)
        if not self.geometry.collisionPairs or self.found.distanceResults[nearest].min_distance >= enough:
            return np.full(len(self.geometry.collisionPairs), np.inf)
        return np.array([result.min_distance for result in self.found.distanceResults])


def _never(srdf: Path | None) -> set[frozenset[str]]:
    if srdf is None or not srdf.exists():  # a generated robot's files are gone, and its SRDF names no pairs
        return set()
    pairs = ElementTree.fromstring(srdf.read_text(encoding="utf-8")).iter("disable_collisions")
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs}
