"""The things drawn around a robot, as Meshcat objects; lengths in metres, z up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from meshcat import geometry as mc
from numpy.typing import ArrayLike, NDArray

from wbplan.view.robot_meshes import LinkMesh

Array = NDArray[np.float64]
Colour = int

BACKGROUND = (0.933, 0.945, 0.957)
GREEN, AMBER, RED = 0x2A9D5C, 0xF0A020, 0xD8342C
TOUCHING, LIFTED = 0x12836F, 0x9AA6B2
SUPPORT = 0x2F74B5
GHOST, FORCE, PLANNED = 0x3A7BD5, 0xC2417C, 0x7A4FC0
WOOD, WOOD_EDGE = 0xC99A5B, 0x6E4B22
TRAILS = (0xC2417C, 0x7A4FC0, 0xD9772B, 0x2A8FA8, 0x6B8E23, 0x8C6D5A, 0x4C6FBF, 0x9C4F4F)
#: The red, green and blue of a frame's x, y and z axes.
AXES = ((0.86, 0.20, 0.18), (0.18, 0.62, 0.28), (0.16, 0.40, 0.86))


class ShadowMaterial(mc.GenericMaterial):  # type: ignore[misc]
    """Three.js's material that shows nothing but the shadows on it."""

    _type = "ShadowMaterial"


def matte(colour: Colour, opacity: float = 1.0) -> Any:
    """A material lit by the lamps."""
    return mc.MeshLambertMaterial(color=colour, opacity=opacity)


def flat(colour: Colour, opacity: float = 1.0) -> Any:
    """A material of one even colour; see-through ones do not hide what is behind them."""
    return mc.MeshBasicMaterial(color=colour, opacity=opacity, depthWrite=opacity == 1.0)


def link(mesh: LinkMesh) -> Any:
    """A link's triangles in their own colours."""
    geometry = mc.TriangularMeshGeometry(mesh.vertices, mesh.faces, color=mesh.colours)
    return mc.Mesh(
        geometry,
        mc.MeshPhongMaterial(vertexColors=True, opacity=mesh.opacity, shininess=25, specular=0x222222),
    )


def ghost(mesh: LinkMesh) -> Any:
    """A link's triangles as of blue glass."""
    geometry = mc.TriangularMeshGeometry(mesh.vertices, mesh.faces)
    return mc.Mesh(geometry, mc.MeshLambertMaterial(color=GHOST, opacity=0.35, transparent=True))


def arrow(radius: float, colour: Colour = FORCE) -> Any:
    """An arrow from the origin to (0, 0, 1)."""
    vertices, faces = _spike(np.zeros(3), np.array([0.0, 0.0, 1.0]), radius, pointed=True)
    return mc.Mesh(mc.TriangularMeshGeometry(vertices, faces), flat(colour, 0.9))


def cone(normal: ArrayLike, friction: float, height: float, colour: Colour) -> Any:
    """A friction cone: its tip at the origin, open along the normal, its slant side a height [m] long."""
    turn = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    ring = np.column_stack([friction * np.cos(turn), friction * np.sin(turn), np.ones(24)])
    ring = ring @ _upright(normal).T * (height / np.hypot(1.0, friction))
    i = np.arange(24)
    sides = np.column_stack([np.full(24, 24), i, (i + 1) % 24])
    vertices = np.vstack([ring, np.zeros((1, 3))])
    return mc.Mesh(mc.TriangularMeshGeometry(vertices, sides), flat(colour, 0.16))


def rod(radius: float, colour: Colour) -> Any:
    """A rod from the origin to (0, 0, 1), seen through whatever is before it."""
    vertices, faces = _spike(np.zeros(3), np.array([0.0, 0.0, 1.0]), radius, pointed=False)
    material = mc.MeshBasicMaterial(color=colour, depthTest=False, transparent=True, opacity=0.95)
    return mc.Mesh(mc.TriangularMeshGeometry(vertices, faces), material)


def sphere(radius: float, colour: Colour) -> Any:
    """A ball that is seen through whatever is before it."""
    material = mc.MeshLambertMaterial(color=colour, opacity=0.9, depthTest=False)
    return mc.Mesh(mc.Sphere(radius), material)


def box(size: ArrayLike) -> Any:
    """A wooden box of three edge lengths."""
    return mc.Mesh(mc.Box([float(length) for length in np.asarray(size)]), matte(WOOD))


def box_edges(size: ArrayLike, colour: Colour = WOOD_EDGE) -> Any:
    """The twelve edges of a box."""
    corners = (
        np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.asarray(size) * 0.5005
    )
    pairs = [(a, b) for a in range(8) for b in range(a) if (a ^ b).bit_count() == 1]
    ends = corners[np.array(pairs).reshape(-1)]
    return mc.LineSegments(mc.PointsGeometry(ends.T.astype(np.float32)), mc.LineBasicMaterial(color=colour))


def disc(
    radius: float, colour: Colour, *, hole: float = 0.0, opacity: float = 1.0, normal: ArrayLike = (0, 0, 1)
) -> Any:
    """A flat ring around the origin; without a hole, a disc.

    Args:
        radius: outer radius.
        colour: red, green and blue in one number.
        hole: inner radius.
        opacity: 1 is solid.
        normal: (3,), the disc's upper side.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    side = np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)]) @ _upright(normal).T
    vertices = np.vstack([side * hole, side * radius])
    inner = np.arange(32)
    faces = np.vstack(
        [np.column_stack([inner, inner + 33, inner + 34]), np.column_stack([inner, inner + 34, inner + 1])]
    )
    return mc.Mesh(mc.TriangularMeshGeometry(vertices, faces), flat(colour, opacity))


def triad(length: float) -> Any:
    """Three thin arrows along x, y and z, from the origin, seen through whatever is before them."""
    parts = []
    for axis in range(3):
        direction = np.eye(3)[axis]
        for start, end, radius in ((0.0, 0.78, 0.028), (0.78, 1.0, 0.075)):
            parts.append((*_spike(direction * start, direction * end, radius, start > 0.0), AXES[axis]))
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts)])
    vertices = np.vstack([vertices for vertices, _, _ in parts]) * length
    faces = np.vstack([faces + start for (_, faces, _), start in zip(parts, starts, strict=False)])
    colours = np.vstack([np.tile(rgb, (len(vertices), 1)) for vertices, _, rgb in parts])
    geometry = mc.TriangularMeshGeometry(vertices, faces, color=colours)
    material = mc.MeshBasicMaterial(vertexColors=True, depthTest=False, transparent=True, opacity=0.95)
    return mc.Mesh(geometry, material)


def filled(polygon: ArrayLike, z: float, colour: Colour, opacity: float) -> Any:
    """A convex polygon (V, 2) at a height."""
    corners = _at(polygon, z)
    fan = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)])
    return mc.Mesh(mc.TriangularMeshGeometry(corners, fan), flat(colour, opacity))


def outlined(polygon: ArrayLike, z: float, width: float, colour: Colour, opacity: float = 1.0) -> Any:
    """The edges of a polygon (V, 2) as flat ribbons of a width, at a height."""
    corners = _at(polygon, z)
    vertices: list[Array] = []
    faces: list[list[int]] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12) * (width / 2.0)
        across = np.array([-along[1], along[0], 0.0])
        first = len(vertices)
        vertices += [a - along - across, a - along + across, b + along + across, b + along - across]
        faces += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return mc.Mesh(mc.TriangularMeshGeometry(np.array(vertices), np.array(faces)), flat(colour, opacity))


def polyline(points: ArrayLike, colour: Colour) -> Any:
    """A line through points (P, 3)."""
    geometry = mc.PointsGeometry(np.asarray(points, dtype=np.float32).reshape(-1, 3).T)
    return mc.Line(geometry, mc.LineBasicMaterial(color=colour, linewidth=2))


def grid(half: float, step: float, *, strong: int = 5) -> Any:
    """Lines on the ground that fade into the background, every `strong`-th one stronger.

    Args:
        half: reach from the origin along x and y.
        step: between two lines.
        strong: lines from one strong line to the next.
    """
    lines = np.arange(-int(half / step), int(half / step) + 1)
    # Each line in pieces of two steps, since a piece fades evenly from end to end.
    marks = np.arange(lines[0], lines[-1] + 1, 2)
    across, start = (a.ravel() for a in np.meshgrid(lines, marks[:-1], indexing="ij"))
    ends = np.stack([np.column_stack([start + d, across, 0 * across]) for d in (0, 2)], axis=1) * step
    strength = np.where(across % strong == 0, 0.24, 0.11)
    fade = np.clip(1.0 - np.linalg.norm(ends, axis=2) / half, 0.0, 1.0)
    seen = fade.any(axis=1)
    points = ends[seen].reshape(-1, 3)
    colours = np.asarray(BACKGROUND) - (strength[seen, None] * fade[seen]).reshape(-1, 1)
    points = np.vstack([points, points[:, [1, 0, 2]]]).astype(np.float32)
    geometry = mc.PointsGeometry(points.T, color=np.vstack([colours, colours]).T.astype(np.float32))
    return mc.LineSegments(geometry, mc.LineBasicMaterial(vertexColors=True))


def ground(half: float) -> Any:
    """The ground, of which only the shadows on it are seen."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half
    geometry = mc.TriangularMeshGeometry(corners, [[0, 1, 2], [0, 2, 3]])
    return mc.Mesh(geometry, ShadowMaterial(color=0x1B2A38, opacity=0.22, transparent=True))


def _at(polygon: ArrayLike, z: float) -> Array:
    flat_points = np.asarray(polygon, dtype=np.float64).reshape(-1, 2)
    return np.column_stack([flat_points, np.full(len(flat_points), z)])


def _upright(normal: ArrayLike) -> Array:
    """A rotation that turns z to the normal."""
    z = np.asarray(normal, dtype=np.float64)
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _spike(start: Array, end: Array, radius: float, pointed: bool) -> tuple[Array, NDArray[np.int64]]:
    """A thin eight-sided rod, or a cone that ends in a point."""
    turn = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(8)]) @ _upright(end - start).T * radius
    vertices = np.vstack([start + ring, end + ring * (0.0 if pointed else 1.0), start[None], end[None]])
    i = np.arange(8)
    j, bottom, top = (i + 1) % 8, np.full(8, 16), np.full(8, 17)
    columns = ((i, j, j + 8), (i, j + 8, i + 8), (j, i, bottom), (i + 8, j + 8, top))
    faces = [np.column_stack(corners) for corners in columns]
    return vertices, np.vstack(faces)


def swatch(names: Sequence[str]) -> dict[str, Colour]:
    """One colour of the trails for each name."""
    return {name: TRAILS[i % len(TRAILS)] for i, name in enumerate(names)}
