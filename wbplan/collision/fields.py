"""Height fields as what they are made of: a prism under each triangle, built when it is first asked for."""

from __future__ import annotations

import math
from typing import Any, final

import coal
import numpy as np
from numpy.typing import NDArray

from wbplan.collision.model import convex
from wbplan.obstacles import HeightField, Obstacle

Array = NDArray[np.float64]

#: How far [m] prisms reach below the field's lowest point.
DEEP = 1.0

#: Triangles of a prism: top 0 1 2, bottom 3 4 5, outward.
PRISM = ((0, 1, 2), (3, 5, 4), (0, 3, 1), (1, 3, 4), (1, 4, 2), (2, 4, 5), (2, 5, 0), (0, 5, 3))


@final
class Field:
    """A height field, cell by cell.

    Attributes:
        pose: coal's pose of all of it.
        highest: its highest point, in its own frame [m].
    """

    def __init__(self, item: Obstacle) -> None:
        if not isinstance(item.shape, HeightField):
            raise TypeError("no height field")
        self._shape = item.shape
        self._R, self._p = np.array(item.pose.rotation), np.array(item.pose.translation)
        self.pose = coal.Transform3s(self._R, self._p)
        x, y, z = item.shape.x, item.shape.y, item.shape.heights
        steps = (float(x[1] - x[0]), float(y[1] - y[0]))
        self._grid = (float(x[0]), float(y[0])), steps, (len(x) - 1, len(y) - 1)
        self._bottom = float(z.min()) - DEEP
        self._top = np.maximum(np.maximum(z[:-1, :-1], z[1:, :-1]), np.maximum(z[:-1, 1:], z[1:, 1:]))
        self.highest = float(z.max())
        self._prisms: dict[int, Any] = {}

    def near(self, low: list[float], high: list[float], reach: float) -> list[tuple[int, Any]]:
        """Number and prism of every triangle within `reach` [m] of a box of the field's own frame."""
        (x, y), (dx, dy), (nx, ny) = self._grid
        i0, j0 = max(math.floor((low[0] - reach - x) / dx), 0), max(math.floor((low[1] - reach - y) / dy), 0)
        i1, j1 = math.ceil((high[0] + reach - x) / dx), math.ceil((high[1] + reach - y) / dy)
        found = []
        for i, j in np.argwhere(self._top[i0 : min(i1, nx), j0 : min(j1, ny)] >= low[2] - reach).tolist():
            cell = 2 * ((i0 + i) * ny + j0 + j)
            for number in (cell, cell + 1):
                if number not in self._prisms:
                    self._prisms[number] = self._prism(i0 + i, j0 + j, number - cell)
                found.append((number, self._prisms[number]))
        return found

    def local_boxes(self, centres: Array, rotations: Array, halves: Array) -> tuple[Array, Array]:
        """Lowest and highest corners (S, 3), in the field's frame, of boxes in the world."""
        middles = (centres - self._p) @ self._R
        extents = np.einsum("sij,sj->si", np.abs(self._R.T @ rotations), halves)
        return middles - extents, middles + extents

    def _prism(self, i: int, j: int, half: int) -> Any:
        x, y, z = self._shape.x, self._shape.y, self._shape.heights
        corners = [(i, j), (i + 1, j), (i + 1, j + 1)] if half == 0 else [(i, j), (i + 1, j + 1), (i, j + 1)]
        top = np.array([[x[a], y[b], z[a, b]] for a, b in corners])
        bottom = top.copy()
        bottom[:, 2] = self._bottom
        return convex(np.vstack([top, bottom]), PRISM)
