"""Convex polygons in the horizontal plane: hulls, half-planes and signed margins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from wbplan.errors import SpecError

Array = NDArray[np.float64]

#: Numbers beyond this, in any unit, count as infinite: squares and products of them have to be numbers too.
LARGEST = 1e30

#: Points nearer to a line than this share of the points' extent count as lying on it.
FLAT = 1e-10
EPSILON = float(np.finfo(np.float64).eps)
#: Places whose margin is this share short of the largest one count as the best as well.
NEARLY = 0.01
#: Coordinates [m] from here on are not those of a polygon: their products would overflow.
FAR = 1e100


def within_reckoning(numbers: Array) -> bool:
    """Whether all are finite, and none beyond `LARGEST`."""
    return bool((np.abs(numbers) <= LARGEST).all())


@dataclass(frozen=True, eq=False)
class HalfPlanes:
    """A convex polygon as the points x with `normals @ x <= offsets`.

    Edge e runs from `vertices[e]` to `vertices[e + 1]` (the last one back to the first).

    Attributes:
        normals: (E, 2) unit normals, pointing outward.
        offsets: (E,) [m], distance of each edge's line from the origin along its normal.
        vertices: (E, 2) [m], counter-clockwise.
        edges: the two input points of each edge, as indices, in the vertices' order.
    """

    normals: Array
    offsets: Array
    vertices: Array
    edges: tuple[tuple[int, int], ...]

    def margin(self, xy: ArrayLike) -> float:
        """Signed distance [m] of one point to the nearest edge line, positive inside.

        `min over edges of (offset - normal @ x)`: inside it is the Euclidean distance to the boundary;
        outside it is minus the distance to the line of the most violated edge (near a corner this is
        less than the distance to the polygon).

        Args:
            xy: (2,) [m].
        """
        return float(np.min(self.offsets - self.normals @ np.asarray(xy, dtype=np.float64)))

    def margins(self, points_xy: ArrayLike) -> Array:
        """`margin` of many points at once: (N, 2) [m] -> (N,) [m]."""
        points = np.asarray(points_xy, dtype=np.float64).reshape(-1, 2)
        worst: Array = np.min(self.offsets - points @ self.normals.T, axis=1)
        return worst

    def inset(self, margin: float) -> Array:
        """Vertices of the polygon of all points with at least this margin.

        Args:
            margin: [m], not negative.

        Returns:
            (W, 2) [m], counter-clockwise; (0, 2) where no area is left.

        Raises:
            SpecError: the margin is negative or not finite.
        """
        if not 0.0 <= margin < np.inf:
            raise SpecError(f"inset: margin must be finite and not negative [m], found {margin}")
        left = self.vertices
        for normal, offset in zip(self.normals, self.offsets - margin, strict=True):
            left = _clip(left, normal, offset)
        flat = FLAT * _extent(self.vertices)
        return _without_flat_corners(left, list(range(len(left))), flat)[0]

    def common(self, other: HalfPlanes) -> Array:
        """Corners (W, 2) [m], counter-clockwise, of what two polygons share; (0, 2) if nothing."""
        left = self.vertices
        for normal, offset in zip(other.normals, other.offsets, strict=True):
            left = _clip(left, normal, offset)
        return left

    def chebyshev(self) -> tuple[Array, float]:
        """Centre (2,) [m] and radius [m] of the largest circle inside.

        `max r` over (c, r) with `normals @ c + r <= offsets`: the point of the largest margin. Between
        parallel edges many points have it, and this is any one of them.
        """
        rows = np.column_stack([self.normals, np.ones(len(self.offsets))])
        found = linprog(
            [0.0, 0.0, -1.0], A_ub=rows, b_ub=self.offsets, bounds=[(None, None)] * 2 + [(0, None)]
        )
        return np.array(found.x[:2]), float(found.x[2])

    def middle(self) -> Array:
        """The middle (2,) [m] of where the margin is the largest, or less than that by 1 %.

        The centroid of the polygon inset by 0.99 r, r the radius of the largest circle inside. The point of
        the largest margin itself would jump along a rectangle for a foot that is off by a hair.
        """
        best = self.inset((1.0 - NEARLY) * self.chebyshev()[1])
        x, y = best[:, 0], best[:, 1]
        cross = x * np.roll(y, -1) - np.roll(x, -1) * y
        sums = (best + np.roll(best, -1, axis=0)) * cross[:, None]
        centroid: Array = sums.sum(axis=0) / (3.0 * cross.sum())
        return centroid


def support_polygon(points_xy: ArrayLike) -> HalfPlanes:
    """The convex hull of points in the plane.

    Corners that stand out by less than `FLAT` times the extent are left out, so that no edge is too
    short to have a direction; the polygon can only become smaller by it.

    Args:
        points_xy: (P, 2) [m], in any order, duplicates allowed.

    Raises:
        SpecError: fewer than three points that are not on one line, or points that are not finite.
    """
    points = np.asarray(points_xy, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise SpecError(f"support polygon: expected points of shape (P, 2), found {points.shape}")
    if not (np.abs(points) < FAR).all():
        raise SpecError(
            f"support polygon: points must be finite (and below {FAR:g} m), found {_show(points)}"
        )
    # Far from the origin rounding alone moves points off a line.
    flat = FLAT * _extent(points) + 4.0 * EPSILON * float(np.abs(points).max(initial=0.0))
    if len(points) < 3 or _width(points) <= 2.0 * flat:
        raise SpecError(
            "support polygon: needs three points that are not on one line, "
            f"found {len(points)}: {_show(points)}"
        )
    # Qhull's own tolerances grow with the coordinates: work near the origin, with points of size 1.
    center = points.mean(axis=0)
    hull = ConvexHull((points - center) / _extent(points))
    order = [int(i) for i in hull.vertices]
    first = order.index(min(order))
    order = order[first:] + order[:first]
    vertices, order = _without_flat_corners(points[order], order, flat)
    along = np.roll(vertices, -1, axis=0) - vertices
    along /= np.linalg.norm(along, axis=1)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    offsets = np.sum(normals * vertices, axis=1)
    for array in (normals, offsets, vertices):
        array.setflags(write=False)
    return HalfPlanes(normals, offsets, vertices, tuple(zip(order, order[1:] + order[:1], strict=True)))


def _extent(points: Array) -> float:
    """Largest side of the box around the points [m]."""
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def _width(points: Array) -> float:
    """Spread of the points across their longest direction [m] (0 where they are on a line)."""
    centered = points - points.mean(axis=0)
    far = centered[int(np.argmax(np.linalg.norm(centered, axis=1)))]
    length = float(np.linalg.norm(far))
    if length == 0.0:
        return 0.0
    return float(np.ptp((centered[:, 0] * far[1] - centered[:, 1] * far[0]) / length))


def _clip(polygon: Array, normal: Array, offset: float) -> Array:
    """The part of a convex polygon (V, 2) where `normal @ x <= offset`."""
    kept: list[Array] = []
    slack = offset - polygon @ normal
    for i, point in enumerate(polygon):
        j = (i + 1) % len(polygon)
        if slack[i] >= 0.0:
            kept.append(point)
        if (slack[i] > 0.0) != (slack[j] > 0.0) and slack[i] != slack[j]:
            kept.append(point + (polygon[j] - point) * (slack[i] / (slack[i] - slack[j])))
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def _without_flat_corners(polygon: Array, names: list[int], flat: float) -> tuple[Array, list[int]]:
    """Drop corners nearer than `flat` to the line through their neighbours, the flattest first."""
    while len(polygon) >= 3:
        before, after = np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0)
        chord, arm = after - before, polygon - before
        length = np.linalg.norm(chord, axis=1)
        area = arm[:, 0] * chord[:, 1] - arm[:, 1] * chord[:, 0]
        # Neighbours that coincide leave no line: the corner is then a spike, which has no area either.
        height = np.divide(area, length, out=np.zeros_like(area), where=length > flat)
        flattest = int(np.argmin(height))
        if height[flattest] > flat:
            return polygon, names
        polygon = np.delete(polygon, flattest, axis=0)
        names = names[:flattest] + names[flattest + 1 :]
    return np.zeros((0, 2)), []


def _show(points: Array) -> str:
    return "; ".join(f"({x:.6g}, {y:.6g})" for x, y in points) or "none"
