"""Obstacles as plan.json has them: nothing but names and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from wbplan.errors import SpecError, listing
from wbplan.obstacles.obstacle import Obstacle
from wbplan.obstacles.shapes import Box, Cylinder, Ground, HeightField, Mesh, Shape, Sphere

#: Kind in the file -> the shape, and its fields.
KINDS: Mapping[str, tuple[Any, tuple[str, ...]]] = {
    "box": (Box, ("size",)),
    "sphere": (Sphere, ("radius",)),
    "cylinder": (Cylinder, ("radius", "length")),
    "mesh": (Mesh, ("vertices", "faces")),
    "height_field": (HeightField, ("x", "y", "heights")),
    "ground": (Ground, ("normal",)),
}


def to_record(obstacle: Obstacle) -> dict[str, Any]:
    """An obstacle in JSON's types: `name`, `kind`, the kind's fields, `pose` (7,) and `friction`."""
    kind = next(name for name, (shape, _) in KINDS.items() if isinstance(obstacle.shape, shape))
    fields = {name: np.asarray(getattr(obstacle.shape, name)).tolist() for name in KINDS[kind][1]}
    return {
        "name": obstacle.name,
        "kind": kind,
        **fields,
        "pose": [float(x) for x in pin.SE3ToXYZQUAT(obstacle.pose)],
        "friction": obstacle.friction,
    }


def from_record(record: Any) -> Obstacle:
    """The obstacle of an entry of plan.json.

    Raises:
        SpecError: a field is missing or not what it has to be.
    """
    if not isinstance(record, Mapping):
        raise SpecError(f"expected an object, found {record!r}")
    kind = record.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise SpecError(f"kind: expected one of {listing(list(KINDS))}, found {kind!r}")
    shape_of, fields = KINDS[kind]
    missing = [name for name in ("name", "pose", "friction", *fields) if name not in record]
    if missing:
        raise SpecError(f"missing {', '.join(missing)}; found {listing([str(key) for key in record])}")
    pose = record["pose"]
    try:
        numbers = np.array(pose, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape != (7,) or not abs(float(np.linalg.norm(numbers[3:])) - 1.0) <= 1e-6:
        raise SpecError(f"pose: expected x y z and a quaternion qx qy qz qw of length 1, found {pose!r}")
    numbers[3:] /= np.linalg.norm(numbers[3:])
    shape: Shape = shape_of(**{name: record[name] for name in fields})
    return Obstacle(record["name"], shape, pin.XYZQUATToSE3(numbers), record["friction"])
