"""Paths at many times at once.

A tick needs its targets at one time; asking each path for each tick costs several microseconds a path.
The paths that scripts use most are evaluated for a stretch of ticks in a few array operations instead.
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wbplan.errors import SpecError
from wbplan.paths import Line, MinJerk, Path, Swing, Value, Waypoints, ask, checked

Array = NDArray[np.float64]
Samples = tuple[Array, Array]


@singledispatch
def sample(path: Path, times: Array) -> Samples:
    """Points (N, 3) [m] and rotations (N, 3, 3) of a path in space at times (N,) [s].

    Points of a path of rotations are zero, rotations of a path of points are the identity.
    """
    return _one_by_one(path, times)


def _one_by_one(path: Path, times: Array) -> Samples:
    """Any path, a user's own too: what it answers is checked here, once for each time."""
    points, rotations = np.zeros((len(times), 3)), np.tile(np.eye(3), (len(times), 1, 1))
    for k, t in enumerate(times):
        value = checked(ask(path, float(t)), f"{type(path).__name__} at {t:.4g} s")
        if isinstance(value, pin.SE3):
            points[k], rotations[k] = value.translation, value.rotation
        elif np.shape(value) == (3, 3):
            rotations[k] = value
        elif np.shape(value) == (3,):
            points[k] = value
        else:
            raise SpecError(
                f"{type(path).__name__} at {t:.4g} s: expected a pose, point or rotation, got {value}"
            )
    return points, rotations


def _between(start: Value, goal: Value, shares: Array) -> Samples:
    """The points these shares of the way from start to goal."""
    n = len(shares)
    points, rotations = np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1))
    if isinstance(start, pin.SE3):
        points = start.translation + shares[:, None] * (goal.translation - start.translation)
        start, goal = start.rotation, goal.rotation
    elif np.shape(start) != (3, 3):
        return start + shares[:, None] * (goal - start), rotations
    turn = pin.log3(start.T @ goal)
    if np.abs(turn).max() > 0.0:
        return points, start @ Rotation.from_rotvec(shares[:, None] * turn).as_matrix()
    return points, np.tile(start, (n, 1, 1))


@sample.register
def _(path: MinJerk, times: Array) -> Samples:
    s = np.clip(times / path.duration, 0.0, 1.0)
    return _between(path.start, path.goal, s * s * s * (10.0 + s * (6.0 * s - 15.0)))


@sample.register
def _(path: Line, times: Array) -> Samples:
    return _between(path.start, path.goal, np.clip(times / path.duration, 0.0, 1.0))


@sample.register
def _(path: Swing, times: Array) -> Samples:
    s = np.clip(times / path.duration, 0.0, 1.0)
    points, rotations = _between(path.start, path.goal, s * s * s * (10.0 + s * (6.0 * s - 15.0)))
    points[:, 2] += path.height * (4.0 * s * (1.0 - s)) ** 3
    return points, rotations


@sample.register
def _(path: Waypoints, times: Array) -> Samples:
    if path.spline is None or np.shape(path.spline.first) == (3, 3):
        return _one_by_one(path, times)
    rows, first = path.spline.rows(times), path.spline.first
    if isinstance(first, pin.SE3):
        return rows[:, :3], first.rotation @ Rotation.from_rotvec(rows[:, 3:]).as_matrix()
    return rows, np.tile(np.eye(3), (len(times), 1, 1))
