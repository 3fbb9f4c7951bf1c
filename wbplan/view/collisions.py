"""Collision shapes over a robot's looks, and the two things that are nearest to each other at each moment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from meshcat import geometry as mc
from numpy.typing import NDArray

from wbplan.bundle import Bundle
from wbplan.checks.clearance import nearest
from wbplan.view import shapes
from wbplan.view.drawing import Drawing, node
from wbplan.view.keys import quaternions
from wbplan.view.messages import Track
from wbplan.view.robot_meshes import LinkMesh, robot_meshes

Array = NDArray[np.float64]

SHAPE, GAP = 0xE08A1E, 0xD8342C


def draw_collisions(
    draw: Drawing,
    bundle: Bundle,
    samples: NDArray[np.int64],
    time: Array,
    package_dirs: Sequence[str | Path] = (),
) -> list[Track]:
    """Draws a plan's collision shapes, and returns the tracks of the nearest pair.

    Args:
        draw: where the robot is drawn already.
        bundle: the plan.
        samples: (N,) which of its samples are shown.
        time: (N,) [s] when.
        package_dirs: where the robot's meshes are looked for.
    """
    draw_shapes(draw, robot_meshes(bundle.urdf, package_dirs=package_dirs, collisions=True))
    return draw_nearest(draw, bundle, samples, time, [Path(folder) for folder in package_dirs])


def draw_shapes(draw: Drawing, meshes: Sequence[LinkMesh]) -> None:
    """Draws collision shapes below their links' nodes, so that they go where these go."""
    for i, mesh in enumerate(meshes):
        geometry = mc.TriangularMeshGeometry(mesh.vertices, mesh.faces)
        material = mc.MeshLambertMaterial(color=SHAPE, opacity=0.35, transparent=True)
        draw.put(f"{node('robot', mesh.link)}/shape{i}", mc.Mesh(geometry, material))
        edges = mc.MeshBasicMaterial(color=SHAPE, wireframe=True, opacity=0.5, transparent=True)
        draw.put(f"{node('robot', mesh.link)}/edges{i}", mc.Mesh(geometry, edges))


def draw_nearest(
    draw: Drawing, bundle: Bundle, samples: NDArray[np.int64], time: Array, folders: Sequence[Path]
) -> list[Track]:
    """A rod between the nearest points of the pair that is nearest, of those that promise a distance."""
    found = nearest(bundle, samples, tuple(folders))
    ends = np.array([[a, b] for _, _, a, b in found])
    known = np.isfinite(ends).all(axis=(1, 2))
    if not known.any():
        return []
    ends = np.where(known[:, None, None], ends, 0.0)
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-5)
    z = way / length[:, None]
    x = np.cross(np.where(np.abs(z[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]]), z)
    x /= np.linalg.norm(x, axis=1)[:, None]
    turn = np.stack([x, np.cross(z, x), z], axis=2)
    rod, tracks = node("nearest", "rod"), []
    draw.put(rod, shapes.rod(0.0025 * draw.unit, GAP))
    stretch = np.column_stack([np.ones(len(length)), np.ones(len(length)), length])
    for key, values in (("position", start), ("quaternion", quaternions(turn)), ("scale", stretch)):
        tracks.append(Track(rod, key, time, values))
    for k, name in enumerate(("one", "other")):
        path = node("nearest", name)
        draw.put(path, shapes.sphere(0.006 * draw.unit, GAP))
        tracks.append(Track(path, "position", time, ends[:, k]))
    return tracks
