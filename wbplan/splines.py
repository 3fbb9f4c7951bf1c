"""Smooth curves through poses, points or rotations."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from wbplan.errors import SpecError

Array = NDArray[np.float64]
Value = Any  # pin.SE3 or Array: pinocchio ships no types


@final
class Spline:
    """The clamped cubic spline through points of one kind.

    Attributes:
        first: the first point, in whose tangent space rotations are splined.
    """

    def __init__(self, times: tuple[float, ...], points: tuple[Value, ...]) -> None:
        self.first, self._times = points[0], times
        if isinstance(self.first, pin.SE3):
            turns = rotation_vectors([p.rotation for p in points])
            rows = np.column_stack([[p.translation for p in points], turns])
        else:
            rows = rotation_vectors(points) if self.first.shape == (3, 3) else np.array(points)
        self._curve = CubicSpline(np.array(times), rows, bc_type="clamped")
        self._pieces = [tuple(self._curve.c[:, i]) for i in range(len(times) - 1)]

    def rows(self, times: Array) -> Array:
        """(N, ...) coordinates at times (N,) [s]: of a pose, its origin and its rotation vector."""
        rows: Array = self._curve(np.clip(times, 0.0, self._times[-1]))
        return rows

    def __call__(self, t: float) -> Value:
        """The point at time `t` [s], of the points' kind; the ends hold outside."""
        t = min(max(t, 0.0), self._times[-1])
        piece = min(bisect_right(self._times, t), len(self._pieces)) - 1
        a, b, c, d = self._pieces[piece]
        s = t - self._times[piece]
        row = ((a * s + b) * s + c) * s + d
        if isinstance(self.first, pin.SE3):
            return pin.SE3(self.first.rotation @ pin.exp3(row[3:]), row[:3])
        return self.first @ pin.exp3(row) if self.first.shape == (3, 3) else row


def rotation_vectors(rotations: Sequence[Array]) -> Array:
    """(N, 3) [rad], about the axes of the first rotation; each the one nearest to that before it.

    A rotation by `angle` about `axis` is one by `angle + 2 pi k` too.
    """
    vectors = [np.zeros(3)]
    for i, rotation in enumerate(rotations[1:], 1):
        if np.linalg.norm(pin.log3(rotations[i - 1].T @ rotation)) > np.pi - 1e-6:
            raise SpecError(
                f"Waypoints.points[{i}]: turned by half a turn against points[{i - 1}], so that the way "
                "round is open; put a point between"
            )
        vector = pin.log3(rotations[0].T @ rotation)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 1e-9 else vectors[-1] / max(float(np.linalg.norm(vectors[-1])), 1e-9)
        vector = vector + axis * 2.0 * np.pi * np.round((vectors[-1] - vector) @ axis / (2.0 * np.pi))
        vectors.append(vector)
    return np.array(vectors)
