"""Height fields as what they are made of: a prism under each triangle, built when it is first asked for."""

from __future__ import annotations

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
    """

    def __init__(self, item: Obstacle) -> None:
        if not isinstance(item.shape, HeightField):
            raise TypeError("no height field")
        self._shape = item.shape
        self._R, self._p = np.array(item.pose.rotation), np.array(item.pose.translation)
        self.pose = coal.Transform3s(self._R, self._p)
        x, y, z = item.shape.x, item.shape.y, item.shape.heights
        self._origin, self._step = np.array([x[0], y[0]]), np.array([x[1] - x[0], y[1] - y[0]])
        self._cells = np.array([len(x) - 1, len(y) - 1])
        self._bottom = float(z.min()) - DEEP
        self._top = np.maximum(np.maximum(z[:-1, :-1], z[1:, :-1]), np.maximum(z[:-1, 1:], z[1:, 1:]))
        self._prisms: dict[int, Any] = {}

    def near(self, low: Array, high: Array, reach: float) -> list[tuple[int, Any]]:
        """Number and prism of every triangle within `reach` [m] of a box of the field's own frame."""
        first = np.floor((low[:2] - reach - self._origin) / self._step).astype(int).clip(0, self._cells)
        last = np.ceil((high[:2] + reach - self._origin) / self._step).astype(int).clip(0, self._cells)
        found = []
        for i in range(first[0], last[0]):
            for j in range(first[1], last[1]):
                if self._top[i, j] >= low[2] - reach:
                    for half in (0, 1):
                        number = 2 * (i * int(self._cells[1]) + j) + half
                        if number not in self._prisms:
                            self._prisms[number] = self._prism(i, j, half)
                        found.append((number, self._prisms[number]))
        return found

    def local_box(self, centre: Array, rotation: Array, half: Array) -> tuple[Array, Array]:
        """Lowest and highest corner, in the field's frame, of a box in the world."""
        middle = (centre - self._p) @ self._R
        extent = np.abs(self._R.T @ rotation) @ half
        return middle - extent, middle + extent

    def _prism(self, i: int, j: int, half: int) -> Any:
        x, y, z = self._shape.x, self._shape.y, self._shape.heights
        corners = [(i, j), (i + 1, j), (i + 1, j + 1)] if half == 0 else [(i, j), (i + 1, j + 1), (i, j + 1)]
        top = np.array([[x[a], y[b], z[a, b]] for a, b in corners])
        bottom = top.copy()
        bottom[:, 2] = self._bottom
        return convex(np.vstack([top, bottom]), PRISM)
