"""Targets over time: pure functions from a phase's own time [s] to an SE(3) pose or a vector.

A path is complete when it is built, but for one thing: it may start at `AS_IS`, "where it is when the
phase begins". `bind` puts that value in, once, and returns a path without it.

A pose is interpolated as a straight line of its origin and one constant axis of rotation, each with
the same time law, so that a path of equal end points never swings around them.
"""

from __future__ import annotations

import abc
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from wbplan.errors import SpecError

Array = NDArray[np.float64]
Value = Any  # pin.SE3 or Array: pinocchio ships no types


@final
class AsIs:
    """The type of `AS_IS`: the value that something has when its phase begins."""

    def __repr__(self) -> str:
        return "AS_IS"


AS_IS: Final = AsIs()


def checked(value: object, what: str) -> Value:
    """A copy of a pose or vector, refused with a `SpecError` when it is neither or is not finite."""
    if isinstance(value, AsIs):
        return value
    if isinstance(value, pin.SE3):
        matrix = np.asarray(value.homogeneous)
        if not np.isfinite(matrix).all():
            raise SpecError(f"{what}: the pose holds NaN or infinity:\n{matrix}")
        rotation = matrix[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise SpecError(f"{what}: the pose's rotation matrix is not a rotation:\n{rotation}")
        return pin.SE3(value)
    try:
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise SpecError(f"{what}: expected pin.SE3 or an array of numbers, got {value!r}") from None
    if not np.isfinite(vector).all():
        raise SpecError(f"{what}: NaN or infinite value in {vector}")
    vector.setflags(write=False)
    return vector


def _seconds(value: float, what: str) -> float:
    try:
        seconds = float(value)
    except (TypeError, ValueError):
        raise SpecError(f"{what}: expected a time in seconds, got {value!r}") from None
    if not (np.isfinite(seconds) and seconds > 0.0):
        raise SpecError(f"{what}: expected a finite positive time in seconds, got {seconds}")
    return seconds


def _same_kind(values: Sequence[Value], what: str) -> None:
    kinds = {"pose" if isinstance(v, pin.SE3) else f"vector of shape {np.shape(v)}" for v in values if v is not AS_IS}
    if len(kinds) > 1:
        raise SpecError(f"{what}: its points are of different kinds: {', '.join(sorted(kinds))}")


def _blend(start: Value, goal: Value, s: float) -> Value:
    """The point a fraction `s` of the way from `start` to `goal`."""
    if isinstance(start, pin.SE3):
        turn = pin.log3(start.rotation.T @ goal.rotation)
        return pin.SE3(
            start.rotation @ pin.exp3(s * turn), (1.0 - s) * start.translation + s * goal.translation
        )
    return start + s * (goal - start)


class Path(abc.ABC):
    """A target over time. `at(t)` is defined for every t >= 0: a path rests at its end."""

    #: Whether the value may change between two calls with the same time (only `Live`).
    live: bool = False

    @abc.abstractmethod
    def at(self, t: float) -> Value:
        """The target at time `t` [s] of the phase: `pin.SE3` or array."""

    def bind(self, here: Value) -> Path:
        """This path with `AS_IS` replaced by `here`."""
        return self

    @property
    def constant(self) -> bool:
        """Whether the target never moves."""
        return False


@final
@dataclass(frozen=True, eq=False)
class Hold(Path):
    """A target that does not move."""

    value: Value

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", checked(self.value, "Hold"))

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return self.value

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        return Hold(here) if self.value is AS_IS else self

    @property
    def constant(self) -> bool:
        """A hold never moves."""
        return True


def min_jerk(s: float) -> float:
    """The minimum-jerk time law 10 s^3 - 15 s^4 + 6 s^5, held at 0 and 1 outside [0, 1]."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, eq=False)
class _Segment(Path):
    start: Value
    goal: Value
    duration: float

    def __post_init__(self) -> None:
        kind = type(self).__name__
        object.__setattr__(self, "start", checked(self.start, f"{kind}.start"))
        object.__setattr__(self, "goal", checked(self.goal, f"{kind}.goal"))
        object.__setattr__(self, "duration", _seconds(self.duration, f"{kind}.duration"))
        _same_kind((self.start, self.goal), kind)

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        if self.start is not AS_IS and self.goal is not AS_IS:
            return self
        start = here if self.start is AS_IS else self.start
        goal = here if self.goal is AS_IS else self.goal
        return type(self)(start, goal, self.duration)


@final
@dataclass(frozen=True, eq=False)
class MinJerk(_Segment):
    """From rest at `start` to rest at `goal` in `duration` [s], with least jerk."""

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return _blend(self.start, self.goal, min_jerk(t / self.duration))


@final
@dataclass(frozen=True, eq=False)
class Line(_Segment):
    """From `start` to `goal` at constant speed in `duration` [s]; it starts and stops abruptly."""

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return _blend(self.start, self.goal, min(max(t / self.duration, 0.0), 1.0))


@final
@dataclass(frozen=True, eq=False)
class Swing(Path):
    """A foot's step: minimum jerk along the ground with a bump `height` [m] above it.

    Position: p(s) = start + (goal - start) m(s) + z height (4 s (1 - s))^3, s = t / duration, m the
    minimum-jerk law. Speed and acceleration are zero at lift-off and at touch-down.
    """

    start: Value
    goal: Value
    height: float
    duration: float

    def __post_init__(self) -> None:
        for field in ("start", "goal"):
            object.__setattr__(self, field, checked(getattr(self, field), f"Swing.{field}"))
        object.__setattr__(self, "duration", _seconds(self.duration, "Swing.duration"))
        if not np.isfinite(self.height) or self.height < 0.0:
            raise SpecError(f"Swing.height: expected a height in metres of 0 or more, got {self.height}")

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        start = here if self.start is AS_IS else self.start
        goal = here if self.goal is AS_IS else self.goal
        return Swing(start, goal, self.height, self.duration)

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        s = min(max(t / self.duration, 0.0), 1.0)
        point = np.array(_blend(self.start, self.goal, min_jerk(s)))
        point[2] += self.height * (4.0 * s * (1.0 - s)) ** 3
        return point


@final
@dataclass(frozen=True, eq=False)
class Waypoints(Path):
    """A smooth path through `points` at `times` [s], at rest at its two ends.

    Cubic splines with clamped ends; a pose's rotation is splined in the tangent space of its first
    point, which asks that no point be turned by half a turn or more against the first.
    """

    times: tuple[float, ...]
    points: tuple[Value, ...]

    def __post_init__(self) -> None:
        times = tuple(float(t) for t in self.times)
        points = tuple(checked(p, f"Waypoints.points[{i}]") for i, p in enumerate(self.points))
        if len(times) != len(points) or len(times) < 2:
            raise SpecError(f"Waypoints: {len(times)} times for {len(points)} points; needs two or more of each")
        if not np.isfinite(times).all() or np.any(np.diff(times) <= 0.0) or times[0] != 0.0:
            raise SpecError(f"Waypoints.times: expected 0 first, then growing, got {times}")
        _same_kind(points, "Waypoints")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "points", points)
        open_end = any(p is AS_IS for p in points)
        object.__setattr__(self, "_at", None if open_end else self._spline())

    def _spline(self) -> Callable[[float], Value]:
        first, end = self.points[0], self.times[-1]
        if isinstance(first, pin.SE3):
            turns = [pin.log3(first.rotation.T @ p.rotation) for p in self.points]
            rows = np.array([np.concatenate([p.translation, w]) for p, w in zip(self.points, turns, strict=True)])
        else:
            rows = np.array(self.points)
        curve = CubicSpline(np.array(self.times), rows, bc_type="clamped")
        pieces = [tuple(curve.c[:, i]) for i in range(len(self.times) - 1)]
        knots = self.times

        def at(t: float) -> Value:
            t = min(max(t, 0.0), end)
            piece = min(bisect_right(knots, t), len(pieces)) - 1
            a, b, c, d = pieces[piece]
            s = t - knots[piece]
            row = ((a * s + b) * s + c) * s + d
            if isinstance(first, pin.SE3):
                return pin.SE3(first.rotation @ pin.exp3(row[3:]), row[:3])
            return row

        return at

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        if self._at is not None:  # type: ignore[attr-defined]
            return self
        return Waypoints(self.times, tuple(here if p is AS_IS else p for p in self.points))

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        at: Callable[[float], Value] = self._at  # type: ignore[attr-defined]
        return at(t)


@final
class Live(Path):
    """A target that a slider or a controller sets between ticks; `set` replaces it."""

    live = True

    def __init__(self, value: Value) -> None:
        self._value = checked(value, "Live")

    def set(self, value: Value) -> None:
        """Replace the target; refuses a value of another kind, NaN or infinity with `SpecError`."""
        new = checked(value, "Live.set")
        _same_kind((self._value, new), "Live.set")
        self._value = new

    def bind(self, here: Value) -> Path:
        """See `Path.bind`; the path stays the caller's own object, which goes on setting it."""
        if self._value is AS_IS:
            self._value = checked(here, "Live")
        return self

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return self._value


def as_path(target: Path | ArrayLike | AsIs | Value, what: str) -> Path:
    """A target as given by the user (pose, vector, `AS_IS` or path) as a path."""
    return target if isinstance(target, Path) else Hold(checked(target, what))
