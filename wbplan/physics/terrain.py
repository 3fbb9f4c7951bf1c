"""What the feet tread on: the plan's obstacles, and ground where the plan has none."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.obstacles import Box, Cylinder, Ground, HeightField, Mesh, Obstacle, Sphere, Terrain
from wbplan.physics.engine import mujoco
from wbplan.physics.motion import Motion
from wbplan.physics.spec import FLOOR

Array = NDArray[np.float64]

STEP = 0.06  #: half the width [m] of the ground patch under a foot that treads beside the floor
FLAT = 0.002  #: a place within this [m] of the floor is on the floor
TREAD = 0.03  #: thickness [m] of patches and stands
SOLE = 0.03  #: a foot's frame is at most this [m] over what it stands on,
SUNK = 0.005  #: and at most this [m] in it
DEEP = 0.2  #: how far [m] a height field is solid below its lowest point


def add_ground(spec: Any, motion: Motion, obstacles: Iterable[Obstacle] = ()) -> float:
    """Obstacles; and where feet tread on none of them, a floor at the lowest of these places, with a patch
    under every one that is higher or tilted.

    Returns:
        The floor's height [m]; without a floor, that of the lowest foothold.
    """
    terrain = Terrain(obstacles)
    for item in terrain.obstacles:
        _add_obstacle(spec, item)
    places, normals = _footholds(motion)
    on_floor = [k for k, place in enumerate(places) if not _stands_on(terrain, place)]
    if not on_floor:
        return float(places[:, 2].min())
    floor = float(places[on_floor, 2].min())
    if not any(isinstance(item.shape, Ground) for item in terrain.obstacles):
        spec.worldbody.add_geom(
            name="floor", type=mujoco().mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], pos=[0, 0, floor],
            contype=FLOOR, conaffinity=0, condim=3,
        )  # fmt: skip
    done: set[tuple[float, ...]] = set()
    for place, normal in zip(places[on_floor], normals[on_floor], strict=True):
        key = tuple(np.round([*place, *normal], 3))
        if (place[2] - floor < FLAT and normal[2] > 0.9999) or key in done:
            continue
        done.add(key)
        turn = np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).coeffs())
        spec.worldbody.add_geom(
            name=f"tread{len(done)}", type=mujoco().mjtGeom.mjGEOM_BOX, size=[STEP, STEP, TREAD],
            pos=place - TREAD * normal, quat=turn[[3, 0, 1, 2]], contype=FLOOR, conaffinity=0, condim=3,
        )  # fmt: skip
    return floor


def _footholds(motion: Motion) -> tuple[Array, Array]:
    """(K, 3) places and normals of all footholds, where each begins."""
    begins = np.diff(motion.phase, prepend=-1) != 0
    first = motion.touching & begins[:, None]
    if not first.any():
        first = motion.touching
    return motion.places[first], motion.normals[first]


def _stands_on(terrain: Terrain, place: Array) -> bool:
    return bool(-SUNK <= place[2] - terrain.height(place[0], place[1]) <= SOLE)


def _add_obstacle(spec: Any, item: Obstacle) -> None:
    """An obstacle as a shape of the world; of a mesh its hull, as in planning."""
    kinds, shape = mujoco().mjtGeom, item.shape
    pose = np.array(pin.SE3ToXYZQUAT(item.pose))
    place, turn = pose[:3], pose[[6, 3, 4, 5]]
    given: dict[str, Any] = {}
    if isinstance(shape, Box):
        given = {"type": kinds.mjGEOM_BOX, "size": np.array(shape.size) / 2.0}
    elif isinstance(shape, Sphere):
        given = {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0, 0]}
    elif isinstance(shape, Cylinder):
        given = {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, shape.length / 2.0, 0]}
    elif isinstance(shape, Mesh):
        corners, faces = shape.hull
        spec.add_mesh(name=item.name, uservert=corners.ravel(), userface=faces.ravel())
        given = {"type": kinds.mjGEOM_MESH, "meshname": item.name}
    elif isinstance(shape, HeightField):
        low, span = float(shape.heights.min()), max(float(np.ptp(shape.heights)), 1e-6)
        middle = np.array([shape.x[0] + shape.x[-1], shape.y[0] + shape.y[-1], 2.0 * low]) / 2.0
        spec.add_hfield(
            name=item.name, nrow=len(shape.y), ncol=len(shape.x),
            size=[np.ptp(shape.x) / 2.0, np.ptp(shape.y) / 2.0, span, DEEP],
            userdata=((shape.heights.T - low) / span).ravel(),
        )  # fmt: skip
        given = {"type": kinds.mjGEOM_HFIELD, "hfieldname": item.name}
        place = place + item.pose.rotation @ middle
    else:
        slope = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(shape.normal))
        turn = np.array((pin.Quaternion(item.pose.rotation) * slope).coeffs())[[3, 0, 1, 2]]
        given = {"type": kinds.mjGEOM_PLANE, "size": [0, 0, 0.05]}
    spec.worldbody.add_geom(
        name=f"obstacle:{item.name}", pos=place, quat=turn, contype=FLOOR, conaffinity=0, condim=3,
        friction=[item.friction, 0.005, 0.0001], **given,
    )  # fmt: skip
