"""Where the body is to go: curves in the plane, with the body's heading along them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from wbplan.errors import SpecError
from wbplan.paths import number

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class Track:
    """A curve of the body in the plane, by its own length.

    Args:
        length: [m]; of a turn on the spot, that of the arc that the feet go.
        curve: way gone [m], 0 to `length` -> x [m], y [m], yaw [rad]; starts at 0, 0, 0.
    """

    length: float
    curve: Callable[[float], tuple[float, float, float]]

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "length", number(self.length, "Track.length", "a length of 0 or more", least=0.0)
        )
        for way in (0.0, self.length):
            place = np.asarray(self.curve(way), dtype=np.float64)
            if place.shape != (3,) or not np.isfinite(place).all():
                raise SpecError(f"Track.curve({way:g}): expected x, y and yaw, got {place}")

    def place(self, way: float) -> Array:
        """The place x [m], y [m] and yaw [rad] after `way` [m], held at both ends."""
        return np.asarray(self.curve(min(max(way, 0.0), self.length)), dtype=np.float64)

    def pose(self, way: float) -> pin.SE3:
        """The same as a pose at height 0."""
        x, y, yaw = self.place(way)
        return pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))


def straight(distance: float, heading: float = 0.0, turn: float = 0.0) -> Track:
    """A straight line in any direction, the body turning meanwhile if so asked.

    Args:
        distance: [m].
        heading: of the line against the body at the start [rad]; 0 is along its x axis.
        turn: of the body by the end [rad].
    """
    distance = number(distance, "straight: distance", "a positive length [m]", above=0.0)
    heading, turn = _angle(heading, "straight: heading"), _angle(turn, "straight: turn")
    c, s = math.cos(heading), math.sin(heading)
    return Track(distance, lambda way: (c * way, s * way, turn * way / distance))


def arc(distance: float, turn: float, heading: float = 0.0) -> Track:
    """A circle's arc: body and direction of travel turn together.

    Args:
        distance: along the arc [m].
        turn: from its start to its end [rad], positive to the left.
        heading: of travel against the body [rad].
    """
    distance = number(distance, "arc: distance", "a positive length [m]", above=0.0)
    heading, turn = _angle(heading, "arc: heading"), _angle(turn, "arc: turn")

    def curve(way: float) -> tuple[float, float, float]:
        yaw = turn * way / distance
        # The chord of an arc of angle yaw, half of it off the first direction.
        chord = way * float(np.sinc(yaw / (2.0 * np.pi)))
        return chord * math.cos(heading + 0.5 * yaw), chord * math.sin(heading + 0.5 * yaw), yaw

    return Track(distance, curve)


def on_the_spot(turn: float, radius: float) -> Track:
    """A turn on the spot.

    Args:
        turn: [rad], positive to the left.
        radius: of the feet's circle [m]; turn and radius make the track's length.
    """
    turn = _angle(turn, "on_the_spot: turn")
    radius = number(radius, "on_the_spot: radius", "a positive length [m]", above=0.0)
    if turn == 0.0:
        raise SpecError("on_the_spot: turn is 0")
    return Track(abs(turn) * radius, lambda way: (0.0, 0.0, math.copysign(way / radius, turn)))


def through(points: ArrayLike, *, follow: bool = True) -> Track:
    """A smooth curve through points, from the origin.

    Args:
        points: (K, 2) [m], after the origin.
        follow: the body turns with the curve; else it keeps its heading.
    """
    given = np.asarray(points, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 2 or not len(given) or not np.isfinite(given).all():
        raise SpecError(f"through: expected points of shape (K, 2), got shape {given.shape}")
    knots = np.vstack([np.zeros(2), given])
    apart = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    if apart.min() <= 0.0:
        raise SpecError("through: two points in a row are the same")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(apart)]), knots)
    parameter = np.linspace(0.0, float(apart.sum()), 2001)
    slopes = spline(parameter, 1)
    speed = np.linalg.norm(slopes, axis=1)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(parameter))])
    places = CubicSpline(way, spline(parameter))
    heading = np.unwrap(np.arctan2(slopes[:, 1], slopes[:, 0]))
    yaws = CubicSpline(way, heading - heading[0])

    def curve(gone: float) -> tuple[float, float, float]:
        x, y = places(gone)
        return float(x), float(y), float(yaws(gone)) if follow else 0.0

    return Track(float(way[-1]), curve)


def _angle(value: float, what: str) -> float:
    return number(value, what, "a finite angle [rad]")
