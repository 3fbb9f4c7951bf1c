"""Paths of feet through the air, and pieces of longer motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.paths import POINT, POSE, Path, Value, checked, kind_of, number
from wbplan.sampling import Samples, sample

Array = NDArray[np.float64]
Law = Callable[[Array], Array]


class SwingPath(Protocol):
    """What a foot's path has to tell: where it is at times (N,) [s] -> (N, 3) [m]."""

    start: Any
    goal: Any
    duration: float

    def points(self, times: Array) -> Array:
        """Places at times."""
        ...


def _quintic(s: Array) -> Array:
    """0 to 1 with speed and acceleration zero at both ends, held outside."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s * s * s * (10.0 + s * (6.0 * s - 15.0)))


class _Swing(Path):
    """What both kinds have in common: ends, height, duration."""

    start: Any
    goal: Any
    height: float
    duration: float

    def __post_init__(self) -> None:
        at = type(self).__name__
        for end in ("start", "goal"):
            value = checked(getattr(self, end), f"{at}.{end}")
            if kind_of(value) != POINT:
                raise SpecError(f"{at}.{end}: expected a point (3,) [m], got {value!r}")
            object.__setattr__(self, end, value)
        height = number(self.height, f"{at}.height", "a height of 0 or more [m]", least=0.0)
        seconds = number(self.duration, f"{at}.duration", "a finite positive time in seconds", above=0.0)
        object.__setattr__(self, "height", height)
        object.__setattr__(self, "duration", seconds)
        object.__setattr__(self, "kind", POINT)

    def points(self, times: Array) -> Array:
        """Places (N, 3) [m] at times (N,) [s]."""
        raise NotImplementedError

    @property
    def apex(self) -> float:
        """The highest point [m]: `height` above the higher one of both ends."""
        return float(max(self.start[2], self.goal[2]) + self.height)

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        return self.points(np.array([t]))[0]


@final
@dataclass(frozen=True, eq=False)
class QuinticSwing(_Swing):
    """Up, across and down by quintics, without a jump of speed or acceleration.

    With m the law 10 s^3 - 15 s^4 + 6 s^5 and T the duration: z rises by m(2t/T) to the apex, `height`
    above the higher end, and comes down alike; x and y go by m((t/T - e)/(1 - 2e)), so that the foot leaves
    and meets the ground upright where e > 0.

    Args:
        start: (3,) [m].
        goal: (3,) [m].
        height: of the apex above the higher end [m].
        duration: [s].
        early: e, share of the time at either end in which it only rises or sinks, 0 to 0.4.
    """

    start: Any
    goal: Any
    height: float
    duration: float
    early: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        early = number(self.early, "QuinticSwing.early", "a share of 0 to 0.4", least=0.0)
        if early > 0.4:
            raise SpecError(f"QuinticSwing.early: expected a share of 0 to 0.4, got {early}")
        object.__setattr__(self, "early", early)

    def points(self, times: Array) -> Array:
        """Places (N, 3) [m] at times (N,) [s]."""
        s = np.clip(times / self.duration, 0.0, 1.0)
        across = _quintic((s - self.early) / (1.0 - 2.0 * self.early))
        found: Array = self.start + across[:, None] * (self.goal - self.start)
        up = self.start[2] + (self.apex - self.start[2]) * _quintic(2.0 * s)
        down = self.goal[2] + (self.apex - self.goal[2]) * _quintic(2.0 - 2.0 * s)
        found[:, 2] = np.where(s < 0.5, up, down)
        return found


@final
@dataclass(frozen=True, eq=False)
class CosineSwing(_Swing):
    """Zhuang's swing (equations 20 to 22), corrected so that position is continuous.

    With t1 the time of the first lift h, t2 = T - t1 and c(t) = cos(pi (t + t2 - 2 t1)/(t2 - t1)):
    the foot rises straight up by h in t1; then x = start + (goal - start)(1 + c)/2 while z makes a cosine
    bump up to `height`; then it sinks straight down from t2 on (printed: -v t for -v (t - t2)). Where the
    goal is at another height, the bump's two halves end at their own levels. The vertical speed still jumps
    at lift-off, t1, t2 and touch-down, as in print; `smooth` replaces the straight pieces by quintics, which
    leaves no jump of speed.

    Args:
        start: (3,) [m].
        goal: (3,) [m].
        height: h_max, of the apex above the higher end [m].
        duration: T [s].
        lift: h_TB, how far it rises and sinks straight [m]; `height` at most.
        lifting: t1 as a share of T, above 0 and below 0.5.
        smooth: rise and sink by quintics.
    """

    start: Any
    goal: Any
    height: float
    duration: float
    lift: float = 0.0
    lifting: float = 0.2
    smooth: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        lift = number(self.lift, "CosineSwing.lift", "a height of 0 or more [m]", least=0.0)
        share = number(self.lifting, "CosineSwing.lifting", "a share above 0 and below 0.5", above=0.0)
        if lift > self.height or share >= 0.5:
            raise SpecError(
                f"CosineSwing: expected lift up to height and lifting below 0.5, got lift={lift}, "
                f"height={self.height}, lifting={share}"
            )
        object.__setattr__(self, "lift", lift)
        object.__setattr__(self, "lifting", share)

    def points(self, times: Array) -> Array:
        """Places (N, 3) [m] at times (N,) [s]."""
        s = np.clip(times / self.duration, 0.0, 1.0)
        one, two = self.lifting, 1.0 - self.lifting
        middle = np.clip(s, one, two)
        phase = np.pi * (middle + two - 2.0 * one) / (two - one)
        found: Array = self.start + 0.5 * (1.0 + np.cos(phase))[:, None] * (self.goal - self.start)
        law = _quintic if self.smooth else (lambda share: np.clip(share, 0.0, 1.0))
        bump = 0.5 * (1.0 - np.cos(2.0 * phase))

        def side(end: float, share: Array) -> Array:
            return end + self.lift * law(share) + (self.apex - end - self.lift) * bump

        up, down = side(self.start[2], s / one), side(self.goal[2], (1.0 - s) / one)
        found[:, 2] = np.where(s < 0.5, up, down)
        return found


@final
@dataclass(frozen=True, eq=False)
class Excerpt(Path):
    """A piece of a longer motion, as a phase's own path.

    Args:
        points: times (N,) [s] of the whole motion -> (N, 3) [m].
        begin: when the phase starts [s].
        duration: of the phase [s]; the path rests at its end.
        yaw: times (N,) -> (N,) [rad]; the path is one of poses then, level, else one of points.
    """

    points: Law
    begin: float
    duration: float
    yaw: Law | None = None

    def __post_init__(self) -> None:
        number(self.begin, "Excerpt.begin", "a finite time in seconds")
        number(self.duration, "Excerpt.duration", "a finite positive time in seconds", above=0.0)
        object.__setattr__(self, "kind", POINT if self.yaw is None else POSE)

    def samples(self, times: Array) -> Samples:
        """Points (N, 3) [m] and rotations (N, 3, 3) at the phase's times (N,) [s]."""
        whole = self.begin + np.clip(times, 0.0, self.duration)
        rotations = np.tile(np.eye(3), (len(whole), 1, 1))
        if self.yaw is not None:
            angles = self.yaw(whole)
            c, s = np.cos(angles), np.sin(angles)
            rotations[:, 0, 0], rotations[:, 0, 1], rotations[:, 1, 0], rotations[:, 1, 1] = c, -s, s, c
        return self.points(whole), rotations

    def at(self, t: float) -> Value:
        """See `Path.at`."""
        points, rotations = self.samples(np.array([t]))
        return points[0] if self.yaw is None else pin.SE3(rotations[0], points[0])


@sample.register
def _(path: Excerpt, times: Array) -> Samples:
    return path.samples(times)


@sample.register
def _(path: QuinticSwing, times: Array) -> Samples:
    return path.points(times), np.tile(np.eye(3), (len(times), 1, 1))


@sample.register
def _(path: CosineSwing, times: Array) -> Samples:
    return path.points(times), np.tile(np.eye(3), (len(times), 1, 1))
