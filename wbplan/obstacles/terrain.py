"""Obstacles seen from above: how high the world is at a place, and how it slopes there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.obstacles.obstacle import Obstacle
from wbplan.obstacles.shapes import Box, Cylinder, Ground, HeightField, Mesh, Sphere

Array = NDArray[np.float64]

NOTHING = -np.inf  #: height where there is nothing


@final
class Terrain:
    """The upper surface of a set of obstacles.

    Args:
        obstacles: what the world is made of.

    Raises:
        SpecError: something is no obstacle.
    """

    def __init__(self, obstacles: Iterable[Obstacle]) -> None:
        self.obstacles = tuple(obstacles)
        for item in self.obstacles:
            if not isinstance(item, Obstacle):
                raise SpecError(f"Terrain: expected Obstacle, got {item!r}")

    def height(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height [m] of the highest surface over (x, y), world; -inf where there is nothing.

        Args:
            x: [m], a number or an array.
            y: [m], of the same shape.

        Returns:
            A float, or an array of that shape.
        """
        heights = self._tops(x, y)[0].max(axis=0, initial=NOTHING)
        return float(heights) if heights.ndim == 0 else heights

    def normal(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Unit normal (..., 3) of the highest surface over (x, y), pointing up; up where there is nothing.

        Args:
            x: [m], a number or an array.
            y: [m], of the same shape.
        """
        heights, normals = self._tops(x, y)
        up = np.broadcast_to([0.0, 0.0, 1.0], (*heights.shape[1:], 3)).copy()
        if not len(heights):
            return up
        best = heights.argmax(axis=0)
        found: Array = np.take_along_axis(normals, best[None, ..., None], axis=0)[0]
        return np.where(np.isfinite(heights.max(axis=0))[..., None], found, up)

    def above(self, points: Array) -> Array:
        """How far points (P, 3) [m], world, are above what is under them; inf where there is nothing.

        Negative in a solid: how far its surface is straight above. What is wholly over a point does not
        count; ground and height fields are solid downward.
        """
        found = np.full(len(points), np.inf)
        for item in self.obstacles:
            top = _top(item, points[:, :2])[0]
            over = _bottom(item, points[:, :2]) > points[:, 2]
            gap = points[:, 2] - top  # inf beside it
            found = np.minimum(found, np.where(over, np.inf, gap))
        return found

    def under(self, x: float, y: float) -> Obstacle | None:
        """The obstacle whose surface is the highest over (x, y)."""
        heights = self._tops(x, y)[0]
        if not len(heights) or not np.isfinite(heights.max()):
            return None
        return self.obstacles[int(heights.argmax())]

    def _tops(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(O, ...) heights and (O, ..., 3) normals of every obstacle."""
        xs, ys = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        flat = np.column_stack([xs.ravel(), ys.ravel()])
        heights = np.full((len(self.obstacles), len(flat)), NOTHING)
        normals = np.zeros((len(self.obstacles), len(flat), 3))
        for k, item in enumerate(self.obstacles):
            heights[k], normals[k] = _top(item, flat)
        return heights.reshape(-1, *xs.shape), normals.reshape(-1, *xs.shape, 3)


def _top(item: Obstacle, points: Array) -> tuple[Array, Array]:
    """Height (P,) and normal (P, 3) of one obstacle over points (P, 2), world."""
    R, p = np.array(item.pose.rotation), np.array(item.pose.translation)
    if isinstance(item.shape, HeightField):
        local = (points - p[:2]) @ R[:2, :2]
        height, normal = field_top(item.shape, local)
        return height + p[2], normal @ R.T
    # A vertical line through each point, from below: origin o + s u, in the shape's frame.
    origins = (np.column_stack([points, np.zeros(len(points))]) - p) @ R
    up = R[2]
    s, normal = _exit(item.shape, origins, up)
    return s, normal @ R.T


def _bottom(item: Obstacle, points: Array) -> Array:
    """Height (P,) of an obstacle's underside over points (P, 2), world; -inf where it has none."""
    if isinstance(item.shape, HeightField | Ground):
        return np.full(len(points), -np.inf)
    R, p = np.array(item.pose.rotation), np.array(item.pose.translation)
    origins = (np.column_stack([points, np.zeros(len(points))]) - p) @ R
    return -_exit(item.shape, origins, -R[2])[0]


def _exit(shape: Box | Sphere | Cylinder | Mesh | Ground, origins: Array, up: Array) -> tuple[Array, Array]:
    """Where lines o + s u leave a shape: s (P,), -inf where they miss it, and the normal there (P, 3)."""
    if isinstance(shape, Ground):
        return _through_planes(np.append(shape.normal, 0.0)[None], origins, up)
    if isinstance(shape, Box):
        half = np.array(shape.size) / 2.0
        planes = np.vstack([np.column_stack([sign * np.eye(3), -half]) for sign in (1.0, -1.0)])
        return _through_planes(planes, origins, up)
    if isinstance(shape, Mesh):
        return _through_planes(shape.planes, origins, up)
    if isinstance(shape, Sphere):
        middle = -origins @ up
        beside = ((origins + middle[:, None] * up) ** 2).sum(axis=1)
        deep = shape.radius**2 - beside
        s = np.where(deep >= 0.0, middle + np.sqrt(np.maximum(deep, 0.0)), NOTHING)
        hit = origins + np.where(np.isfinite(s), s, 0.0)[:, None] * up
        return s, hit / shape.radius
    return _through_cylinder(shape, origins, up)


def _through_planes(planes: Array, origins: Array, up: Array) -> tuple[Array, Array]:
    """The last point of a line inside n x + b <= 0 for all planes (K, 4)."""
    normals, offsets = planes[:, :3], planes[:, 3]
    rate, gap = normals @ up, -(origins @ normals.T + offsets)  # inside while rate s <= gap
    flat = np.abs(rate) < 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        at = gap / rate
    leaving = np.where((rate > 0.0) & ~flat, at, np.inf)
    entering = np.where((rate < 0.0) & ~flat, at, -np.inf).max(axis=1)
    s, face = leaving.min(axis=1), leaving.argmin(axis=1)
    missed = (entering > s + 1e-12) | ((gap < -1e-12) & flat).any(axis=1) | ~np.isfinite(s)
    return np.where(missed, NOTHING, s), normals[face]


def _through_cylinder(shape: Cylinder, origins: Array, up: Array) -> tuple[Array, Array]:
    caps = np.array([[0.0, 0.0, 1.0, -shape.length / 2.0], [0.0, 0.0, -1.0, -shape.length / 2.0]])
    count = len(origins)
    a = up[0] ** 2 + up[1] ** 2
    side_from, side_to = np.full(count, -np.inf), np.full(count, np.inf)
    c = (origins[:, :2] ** 2).sum(axis=1) - shape.radius**2
    if a > 1e-24:
        b = origins[:, :2] @ up[:2]
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        side_from, side_to = (-b - root) / a, (-b + root) / a
        missed = b * b - a * c < 0.0
    else:
        missed = c > 1e-12
    top, normal = _through_planes(caps, origins, up)
    if abs(up[2]) > 1e-12:
        bottom = -_through_planes(caps, origins, -up)[0]
    else:  # level lines never leave the caps
        inside = np.abs(origins[:, 2]) <= shape.length / 2.0
        top, bottom = np.where(inside, np.inf, NOTHING), np.full(count, -np.inf)
    s = np.minimum(top, side_to)
    missed |= ~(np.maximum(bottom, side_from) <= s + 1e-12) | ~np.isfinite(s)
    hit = origins + np.where(np.isfinite(s), s, 0.0)[:, None] * up
    outward = np.column_stack([hit[:, :2] / shape.radius, np.zeros(count)])
    normal = np.where((side_to < top)[:, None], outward, normal)
    return np.where(missed, NOTHING, s), normal


def field_top(field: HeightField, points: Array) -> tuple[Array, Array]:
    """Height (P,) and normal (P, 3) of a height field over points (P, 2) of its own frame."""
    x, y, z = field.x, field.y, field.heights
    dx, dy = x[1] - x[0], y[1] - y[0]
    u, v = (points[:, 0] - x[0]) / dx, (points[:, 1] - y[0]) / dy
    inside = (u >= -1e-9) & (u <= len(x) - 1 + 1e-9) & (v >= -1e-9) & (v <= len(y) - 1 + 1e-9)
    i = np.clip(np.floor(u), 0, len(x) - 2).astype(np.int64)
    j = np.clip(np.floor(v), 0, len(y) - 2).astype(np.int64)
    u, v = u - i, v - j
    ahead = u >= v  # the triangle with the corner (i + 1, j), else the one with (i, j + 1)
    along_x = np.where(ahead, z[i + 1, j] - z[i, j], z[i + 1, j + 1] - z[i, j + 1])
    along_y = np.where(ahead, z[i + 1, j + 1] - z[i + 1, j], z[i, j + 1] - z[i, j])
    at = z[i, j] + u * along_x + v * along_y
    normal = np.column_stack([-along_x / dx, -along_y / dy, np.ones(len(points))])
    return np.where(inside, at, NOTHING), normal / np.linalg.norm(normal, axis=1)[:, None]
