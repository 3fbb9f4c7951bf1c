"""Obstacles as Meshcat objects."""

from __future__ import annotations

from typing import Any

import numpy as np
from meshcat import geometry as mc
from numpy.typing import NDArray

from wbplan.obstacles import Box, Cylinder, Ground, HeightField, Mesh, Obstacle, Sphere
from wbplan.view import shapes

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

STONE, STONE_EDGE = 0xB4BBC2, 0x66717C
SIDES = 32  #: of a cylinder
SLAB = 3.0  #: half the width [m] in which a slope is drawn
LEVEL = 0.01  #: a level ground this near [m] to z = 0 is the grid that is drawn anyway


def is_grid(item: Obstacle) -> bool:
    """Whether the view's own grid shows this obstacle."""
    if not isinstance(item.shape, Ground):
        return False
    normal = item.pose.rotation @ np.array(item.shape.normal)
    return bool(normal[2] > 1.0 - 1e-9 and abs(item.pose.translation[2]) < LEVEL)


def things(item: Obstacle) -> dict[str, Any]:
    """What an obstacle is drawn with, by name, in its own frame."""
    shape = item.shape
    if isinstance(shape, Box):
        return {
            "sides": mc.Mesh(mc.Box(list(shape.size)), shapes.matte(STONE)),
            "edges": shapes.box_edges(shape.size, STONE_EDGE),
        }
    if isinstance(shape, Sphere):
        return {"sides": mc.Mesh(mc.Sphere(shape.radius), shapes.matte(STONE))}
    vertices, faces = triangles(shape)
    corners = vertices[faces].reshape(-1, 3)  # each face with corners of its own, so that edges stay sharp
    geometry = mc.TriangularMeshGeometry(corners, np.arange(len(corners)).reshape(-1, 3))
    return {"sides": mc.Mesh(geometry, mc.MeshLambertMaterial(color=STONE, side=2))}


def triangles(shape: Cylinder | Mesh | HeightField | Ground) -> tuple[Array, Faces]:
    """Corners (V, 3) and faces (F, 3) of a shape, in its own frame."""
    if isinstance(shape, Mesh):
        return shape.vertices, shape.faces
    if isinstance(shape, HeightField):
        x, y = np.meshgrid(shape.x, shape.y, indexing="ij")
        at = np.arange(x.size).reshape(x.shape)
        a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
        faces = np.vstack(
            [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
        )
        return np.column_stack([x.ravel(), y.ravel(), shape.heights.ravel()]), faces
    if isinstance(shape, Ground):
        normal = np.array(shape.normal)
        along = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
        along /= np.linalg.norm(along)
        across = np.cross(normal, along)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * SLAB @ np.array([along, across])
        return corners, np.array([[0, 1, 2], [0, 2, 3]])
    turn = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * shape.radius
    half = shape.length / 2.0
    vertices = np.vstack(
        [np.column_stack([ring, np.full(SIDES, z)]) for z in (-half, half)] + [[[0, 0, -half], [0, 0, half]]]
    )
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    bottom, top = np.full(SIDES, 2 * SIDES), np.full(SIDES, 2 * SIDES + 1)
    columns = ((i, j, j + SIDES), (i, j + SIDES, i + SIDES), (j, i, bottom), (i + SIDES, j + SIDES, top))
    return vertices, np.vstack([np.column_stack(corners) for corners in columns])
