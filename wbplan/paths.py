"""Targets over time: pure functions from a phase's own time [s] to an SE(3) pose or a vector.

A path is complete when it is built, but for one thing: it may start at `AS_IS`, "where it is when the
phase begins". `bind` puts that value in, once, and returns a path without it.

A pose is interpolated as a straight line of its origin and one constant axis of rotation, each with
the same time law, so that a path of equal end points never swings around them.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, WbplanError
from wbplan.geometry import LARGEST, within_reckoning
from wbplan.splines import Spline

Array = NDArray[np.float64]
Value = Any  # pin.SE3 or Array: pinocchio ships no types

# What a path's values are, in the words of messages.
POSE = "pin.SE3"
ROTATION = "an array of shape (3, 3)"
POINT = "an array of shape (3,)"
NUMBER = "a number"


@final
class AsIs:
    """The type of `AS_IS`: the value that something has when its phase begins."""

    def __repr__(self) -> str:
        return "AS_IS"

    def __reduce__(self) -> str:
        return "AS_IS"  # copies of it are itself


AS_IS: Final = AsIs()


def checked(value: object, what: str) -> Value:
    """A copy of a pose or array, or `AS_IS`; a `SpecError` where it is not finite or no rotation."""
    if isinstance(value, AsIs):
        return value
    if isinstance(value, pin.SE3):
        matrix = np.asarray(value.homogeneous)
        if not within_reckoning(matrix):
            raise SpecError(f"{what}: the pose holds NaN, infinity or more than {LARGEST:g}:\n{matrix}")
        _check_rotation(matrix[:3, :3], what)
        return pin.SE3(value)
    numbers = numeric(value)
    if numbers is None:
        raise SpecError(f"{what}: expected pin.SE3 or an array of numbers, got {value!r}")
    if not within_reckoning(numbers):
        raise SpecError(f"{what}: NaN, infinite value or more than {LARGEST:g} in {numbers}")
    if numbers.shape == (3, 3):
        _check_rotation(numbers, what)
    numbers.setflags(write=False)
    return numbers


def numeric(value: object) -> Array | None:
    """A copy as an array; `None` for what is not made of numbers, as text that reads like one."""
    try:
        array = np.array(value)
    except ValueError:  # lists of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "biuf" else None


def _check_rotation(matrix: Array, what: str) -> None:
    off = matrix @ matrix.T - np.eye(3)
    if np.abs(off).max() > 1e-6 or np.linalg.det(matrix) < 0.0:
        raise SpecError(f"{what}: not a rotation matrix:\n{matrix}")


def kind_of(value: Value) -> str | None:
    """What a value is, in the words of messages; `None` for `AS_IS`."""
    if isinstance(value, AsIs):
        return None
    if isinstance(value, pin.SE3):
        return POSE
    shape = np.shape(value)
    return f"an array of shape {shape}" if shape else NUMBER


def number(
    value: object, what: str, expected: str, *, least: float = -np.inf, above: float = -np.inf
) -> float:
    """A finite number, `least` or more and more than `above`; refused with a `SpecError` if it is not."""
    scalar = numeric(value)
    found = float(scalar) if scalar is not None and scalar.shape == () else np.nan
    if not (abs(found) <= LARGEST and found >= least and found > above):
        raise SpecError(
            f"{what}: expected {expected}, got {repr(value) if isinstance(value, str) else value}"
        )
    return found


def vector(value: object, size: int, what: str) -> Array:
    """A copy of `size` finite numbers; refused with a `SpecError` if it is not that."""
    found = numeric(value)
    if found is None or found.shape != (size,) or not within_reckoning(found):
        got = value if found is None else f"shape {found.shape}" if found.shape != (size,) else found
        raise SpecError(f"{what}: expected {size} finite numbers, got {got!s:.80}")
    return np.array(found, dtype=np.float64)


def name_of(value: object, what: str) -> str:
    """A name, refused with a `SpecError` where it is empty or no text."""
    if not isinstance(value, str) or not value:
        raise SpecError(f"{what}: expected a name, got {value!r}")
    return value


def _common_kind(values: Sequence[Value], what: str) -> str | None:
    """The one kind of all values; `None` where all are `AS_IS`."""
    kinds = sorted({kind for value in values if (kind := kind_of(value)) is not None})
    if len(kinds) > 1:
        raise SpecError(f"{what}: its points are of different kinds: {', '.join(kinds)}")
    return kinds[0] if kinds else None


def _start(here: Value, kind: str | None) -> Value:
    """The value at a phase's start as a path of this kind wants it."""
    return here.rotation if kind == ROTATION and isinstance(here, pin.SE3) else here


def _blend(start: Value, goal: Value, s: float) -> Value:
    """The point a fraction `s` of the way from `start` to `goal`."""
    if start is AS_IS or goal is AS_IS:
        raise SpecError("a path from or to AS_IS has a value only once its phase begins (or after `bind`)")
    if isinstance(start, pin.SE3):
        along = (1.0 - s) * start.translation + s * goal.translation
        return pin.SE3(_blend(start.rotation, goal.rotation, s), along)
    if start.shape == (3, 3):
        return start @ pin.exp3(s * pin.log3(start.T @ goal))
    return start + s * (goal - start)


class Path(abc.ABC):
    """A target over time. `at(t)` is defined for every t >= 0: a path rests at its end."""

    #: Whether the value may change between two calls with the same time, as a slider's or a device's does.
    #: Other paths are read many ticks ahead.
    live: bool = False
    #: What its values are, in the words of messages; `None` where that is not known before `bind`.
    kind: str | None = None

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


def ask(path: Path, t: float) -> Value:
    """The path's value at time `t` [s]; what somebody's own path raises is a `SpecError`."""
    try:
        return path.at(t)
    except WbplanError:
        raise
    except Exception as error:
        name, raised = type(path).__name__, f"{type(error).__name__}: {error}"
        raise SpecError(f"{name} at {t:.4g} s raised {raised}") from error


@final
@dataclass(frozen=True, eq=False)
class Hold(Path):
    """A target that does not move."""

    value: Value

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", checked(self.value, "Hold"))
        object.__setattr__(self, "kind", kind_of(self.value))

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return pin.SE3(self.value) if isinstance(self.value, pin.SE3) else self.value

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


class _Segment(Path):
    """What the paths from one value to another have in common; their fields are their own."""

    start: Value
    goal: Value
    duration: float

    def __post_init__(self) -> None:
        name = type(self).__name__
        for end in ("start", "goal"):
            object.__setattr__(self, end, checked(getattr(self, end), f"{name}.{end}"))
        seconds = number(self.duration, f"{name}.duration", "a finite positive time in seconds", above=0.0)
        object.__setattr__(self, "duration", seconds)
        object.__setattr__(self, "kind", _common_kind((self.start, self.goal), name))

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        here = _start(here, self.kind)
        ends = {end: here for end in ("start", "goal") if getattr(self, end) is AS_IS}
        return replace(self, **ends) if ends else self  # type: ignore[type-var]  # they are dataclasses


@final
@dataclass(frozen=True, eq=False)
class MinJerk(_Segment):
    """From rest at `start` to rest at `goal` in `duration` [s], with least jerk."""

    start: Value
    goal: Value
    duration: float

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return _blend(self.start, self.goal, min_jerk(t / self.duration))


@final
@dataclass(frozen=True, eq=False)
class Line(_Segment):
    """From `start` to `goal` at constant speed in `duration` [s]; it starts and stops abruptly."""

    start: Value
    goal: Value
    duration: float

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return _blend(self.start, self.goal, min(max(t / self.duration, 0.0), 1.0))


@final
@dataclass(frozen=True, eq=False)
class Swing(_Segment):
    """A foot's step: minimum jerk along the ground with a bump `height` [m] above it.

    Position: p(s) = start + (goal - start) m(s) + z height (4 s (1 - s))^3, s = t / duration, m the
    minimum-jerk law. Speed and acceleration are zero at lift-off and at touch-down. Between poses the foot
    turns about one axis, with the same law.
    """

    start: Value
    goal: Value
    height: float
    duration: float

    def __post_init__(self) -> None:
        super().__post_init__()
        height = number(self.height, "Swing.height", "a height in metres of 0 or more", least=0.0)
        object.__setattr__(self, "height", height)
        if self.kind not in (None, POSE, POINT):
            raise SpecError(f"Swing: expected {POSE} or {POINT} at both ends, got {self.kind}")

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        s = min(max(t / self.duration, 0.0), 1.0)
        place = _blend(self.start, self.goal, min_jerk(s))
        point = place.translation if isinstance(place, pin.SE3) else place
        point[2] += self.height * (4.0 * s * (1.0 - s)) ** 3
        return place


@final
@dataclass(frozen=True, eq=False)
class Waypoints(Path):
    """A smooth path through `points` at `times` [s], at rest at its two ends.

    Cubic splines with clamped ends; rotations are splined in the tangent space of the first one, as
    rotation vectors that may pass half a turn. No point may be turned by half a turn against the one before.
    """

    times: tuple[float, ...]
    points: tuple[Value, ...]
    spline: Spline | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        for name in ("times", "points"):
            if isinstance(getattr(self, name), str) or not isinstance(getattr(self, name), Iterable):
                raise SpecError(f"Waypoints.{name}: expected a list, got {getattr(self, name)!r}")
        times = tuple(number(t, f"Waypoints.times[{i}]", "seconds") for i, t in enumerate(self.times))
        points = tuple(checked(p, f"Waypoints.points[{i}]") for i, p in enumerate(self.points))
        if len(times) != len(points) or len(times) < 2:
            raise SpecError(
                f"Waypoints: {len(times)} times for {len(points)} points; needs two or more of each"
            )
        if times[0] != 0.0 or min(np.diff(times)) <= 0.0:
            raise SpecError(f"Waypoints.times: expected 0 first, then growing, got {times}")
        object.__setattr__(self, "kind", _common_kind(points, "Waypoints"))
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "points", points)
        if not any(p is AS_IS for p in points):
            object.__setattr__(self, "spline", Spline(times, points))

    def bind(self, here: Value) -> Path:
        """See `Path.bind`."""
        if self.spline is not None:
            return self
        here = _start(here, self.kind)
        return Waypoints(self.times, tuple(here if p is AS_IS else p for p in self.points))

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return _blend(AS_IS, AS_IS, t) if self.spline is None else self.spline(t)


@final
@dataclass(frozen=True, eq=False)
class Curve(Path):
    """Along any curve in `duration` [s], from rest to rest: `curve(s)` for s from 0 to 1, with least jerk.

    Args:
        curve: share of the way, 0 to 1 -> `pin.SE3`, point (3,) or rotation (3, 3); a pure function.
        duration: [s].
    """

    curve: Callable[[float], Value]
    duration: float

    def __post_init__(self) -> None:
        seconds = number(self.duration, "Curve.duration", "a finite positive time in seconds", above=0.0)
        object.__setattr__(self, "duration", seconds)
        if not callable(self.curve):
            raise SpecError(f"Curve.curve: expected a function of the share of the way, got {self.curve!r}")
        kinds = [kind_of(checked(self.curve(s), f"Curve.curve({s})")) for s in (0.0, 0.5, 1.0)]
        object.__setattr__(self, "kind", kinds[0])
        if len(set(kinds)) > 1:
            raise SpecError(f"Curve.curve: its values are of different kinds: {', '.join(map(str, kinds))}")

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return checked(self.curve(min_jerk(t / self.duration)), f"Curve at {t:.4g} s")


@final
class Live(Path):
    """A target that a slider or a controller sets between ticks; `set` replaces it."""

    live = True

    def __init__(self, value: Value) -> None:
        self._value = checked(value, "Live")
        self.kind = kind_of(self._value)

    def set(self, value: Value) -> None:
        """Replace the target; refuses a value of another kind, NaN or infinity with `SpecError`."""
        new = checked(value, "Live.set")
        self.kind = _common_kind((self._value, new), "Live.set")
        self._value = new

    def bind(self, here: Value) -> Path:
        """See `Path.bind`; the path stays the caller's own object, which goes on setting it."""
        if self._value is AS_IS:
            self._value = checked(here, "Live")
            self.kind = kind_of(self._value)
        return self

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return pin.SE3(self._value) if isinstance(self._value, pin.SE3) else self._value


def as_path(target: Path | ArrayLike | AsIs | Value, what: str) -> Path:
    """A target as given by the user (pose, vector, `AS_IS` or path) as a path."""
    return target if isinstance(target, Path) else Hold(checked(target, what))
