"""From beats and a track to footholds: when each foot lifts, where it lands, where the body is meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly

from wbplan.errors import SpecError, listing
from wbplan.gaits.gait import Gait
from wbplan.gaits.stance import Stance
from wbplan.gaits.tracks import Track
from wbplan.paths import name_of, number

Array = NDArray[np.float64]
#: Height [m] of the ground at x, y [m].
Ground = Callable[[float, float], float]


def flat(x: float, y: float) -> float:
    """The ground at height 0."""
    return 0.0


@final
@dataclass(frozen=True, eq=False)
class Beat:
    """One step of a walk, before it is known where.

    Args:
        swing: limbs whose feet go through the air and land at the end of it.
        raised: limbs whose feet leave the ground at its start and stay off it (an arm, say).
        stance: where feet that land from here on stand against the body; as before where not given.
        lasting: time against the others'.
        pace: speed of the body against the others'.
        name: for reports.
    """

    swing: tuple[str, ...] = ()
    raised: tuple[str, ...] = ()
    stance: Stance | None = None
    lasting: float = 1.0
    pace: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        put = partial(object.__setattr__, self)
        for key in ("swing", "raised"):
            put(key, tuple(name_of(limb, f"Beat.{key}") for limb in getattr(self, key)))
        both = set(self.swing) & set(self.raised)
        if both:
            raise SpecError(f"Beat: {listing(sorted(both))} both swings and stays raised")
        put("lasting", number(self.lasting, "Beat.lasting", "a positive number", above=0.0))
        put("pace", number(self.pace, "Beat.pace", "a number of 0 or more", least=0.0))


@final
@dataclass(frozen=True, eq=False)
class Step:
    """One step of a walk, placed.

    Attributes:
        name: of its phase.
        begin, duration: [s].
        swing: limb -> from where to where its foot goes (2, 3) [m], world.
        support: limb -> where its foot stands (3,) [m], world.
        raised: limbs whose feet are in the air and do not land.
    """

    name: str
    begin: float
    duration: float
    swing: Mapping[str, Array]
    support: Mapping[str, Array]
    raised: tuple[str, ...] = ()

    @property
    def end(self) -> float:
        """[s]."""
        return self.begin + self.duration


@final
@dataclass(frozen=True, eq=False)
class Course:
    """The body's nominal motion: along a track, from rest to rest.

    Attributes:
        track: the curve.
        way: time [s] -> way gone [m].
        duration: [s].
        speed: between speeding up and slowing down [m/s], where the beats' pace is 1.
    """

    track: Track
    way: PPoly
    duration: float
    speed: float
    _places: CubicSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        knots = self.way.x
        times = np.unique(np.concatenate([knots, np.linspace(knots[0], knots[-1], 2 * len(knots))]))
        places = np.array([self.track.place(float(w)) for w in self.way(times)])
        object.__setattr__(self, "_places", CubicSpline(times, places, bc_type="clamped"))

    def gone(self, t: float) -> float:
        """Way gone at a time [m]."""
        return float(self.way(min(max(t, 0.0), self.duration)))

    def place(self, t: float) -> Array:
        """The place x [m], y [m], yaw [rad] at a time."""
        return np.asarray(self._places(min(max(t, 0.0), self.duration)))

    def places(self, times: Array) -> Array:
        """x, y, yaw (N, 3) at times (N,) [s]."""
        return np.asarray(self._places(np.clip(times, 0.0, self.duration)))


@final
@dataclass(frozen=True, eq=False)
class Schedule:
    """Steps in order, and the body's nominal motion meanwhile.

    Attributes:
        steps: see `Step`.
        course: see `Course`.
        feet: where the feet are at the end, limb -> (3,) [m].
    """

    steps: tuple[Step, ...]
    course: Course
    feet: Mapping[str, Array]


def beats_of(gait: Gait, count: int, first: int = 0) -> tuple[Beat, ...]:
    """So many steps of a gait, as beats; its longest swing lasts 1.

    Args:
        gait: the gait.
        count: of steps.
        first: number of the first one in the cycle.
    """
    found = []
    for k in range(first, first + count):
        share, advance = gait.lasting[k % gait.step_count], gait.advance[k % gait.step_count]
        swing = gait.steps[k % gait.step_count]
        name = f"{gait.name} {' '.join(swing) or 'pause'}"
        found.append(Beat(swing, lasting=share * gait.cycle, pace=advance / share, name=name))
    return tuple(found)


def count_for(gait: Gait, distance: float, stride: float) -> int:
    """Least number of steps that takes a body so far, from rest to rest, with no longer a stride.

    Args:
        gait: the gait.
        distance: [m].
        stride: [m] a cycle at most.
    """
    count = gait.step_count
    while True:
        beats = beats_of(gait, count)
        if beats[-1].swing and distance / _time_at_speed(beats, gait.legs) <= stride / gait.cycle * (
            1 + 1e-9
        ):
            return count
        count += 1


def ramps(beats: Sequence[Beat], limbs: Sequence[str]) -> tuple[float, float]:
    """How long [beats] a body speeds up and slows down: until every foot has stepped once, and since."""
    ends = np.cumsum([beat.lasting for beat in beats])
    first: dict[str, float] = {}
    last: dict[str, float] = {}
    for beat, end in zip(beats, ends, strict=True):
        for limb in (*beat.swing, *beat.raised):
            first.setdefault(limb, float(end) - beat.lasting)
            last[limb] = float(end)
    never = [limb for limb in limbs if limb not in first]
    if never:
        raise SpecError(f"walk: {listing(never)} never steps in {len(beats)} steps")
    return max(first.values()), float(ends[-1]) - min(last.values())


def _time_at_speed(beats: Sequence[Beat], limbs: Sequence[str]) -> float:
    """Time [beats, paces counted in] in which the way would be gone at full speed."""
    return float(_paced(beats, *ramps(beats, limbs))[1][-1])


def _paced(beats: Sequence[Beat], up: float, down: float, fine: int = 16) -> tuple[Array, Array, Array]:
    """Times [beats], way gone and speed there, for a full speed of 1.

    The speed is the beats' pace times quintic ramps at both ends; where ramps overlap, their product.
    """
    ends = np.cumsum([beat.lasting for beat in beats])
    begins = np.concatenate([[0.0], ends[:-1]])
    level = len({round(beat.pace, 9) for beat in beats}) == 1
    times = np.unique(
        np.concatenate([np.linspace(b, e, fine + 1) for b, e in zip(begins, ends, strict=True)])
    )
    if level:
        pace = np.full(len(times), beats[0].pace)
    else:  # each step goes its own way: cubics join the speeds at its ends, means of both paces
        own = np.array([beat.pace for beat in beats])
        knots = np.concatenate([own[:1], 0.5 * (own[1:] + own[:-1]), own[-1:]])
        index = np.minimum(np.searchsorted(ends, times, side="right"), len(beats) - 1)
        s = np.clip((times - begins[index]) / (ends - begins)[index], 0.0, 1.0)
        middle = 2.0 * own - 0.5 * (knots[1:] + knots[:-1])
        half = np.where(s < 0.5, 2.0 * s, 2.0 - 2.0 * s)
        edge = np.where(s < 0.5, knots[index], knots[index + 1])
        pace = edge + (middle[index] - edge) * half * half * (3.0 - 2.0 * half)
    pace = pace * _ramp(times, up) * _ramp(ends[-1] - times, down)
    step = np.diff(times)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * step)])
    return times, way, pace


def _ramp(times: Array, length: float) -> Array:
    if length <= 0.0:
        return np.ones(len(times))
    s = np.clip(times / length, 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))


def course_of(
    beats: Sequence[Beat], limbs: Sequence[str], track: Track, beat_time: float, speed: float | None = None
) -> Course:
    """The body along a track, at rest at both ends, its speed as smooth as the beats' pace allows.

    It speeds up until every foot has stepped once, and slows down from where the first one has stepped for
    the last time. Both take longer where the track would be gone too soon at the speed asked.

    Args:
        beats: the steps.
        limbs: that walk.
        track: of the body.
        beat_time: of a beat with `lasting` 1 [s].
        speed: at full pace [m/s], at most; what the beats' time asks where not given.
    """
    up, down = ramps(beats, limbs)
    times, way, pace = _paced(beats, up, down)
    if speed is not None and way[-1] > 0.0:
        spare = way[-1] - track.length / (speed * beat_time)  # of the ways of both ramps
        longer = min(max(spare, 0.0), max(0.5 * (times[-1] - up - down), 0.0))
        times, way, pace = _paced(beats, up + longer, down + longer)
    if not way[-1] > 0.0:
        raise SpecError("walk: the body never moves: every beat has a pace of 0")
    scale = track.length / way[-1]
    times = times * beat_time
    spline = CubicHermiteSpline(times, way * scale, pace * scale / beat_time)
    return Course(track, spline, float(times[-1]), scale / beat_time)


def schedule(
    beats: Sequence[Beat],
    stance: Stance,
    track: Track,
    beat_time: float,
    ground: Ground = flat,
    place: Callable[[str, Array], Array] | None = None,
    speed: float | None = None,
) -> Schedule:
    """Footholds of all beats.

    A foot lands where its stance will be when the body is half-way between landing and lifting again, so that
    it works evenly ahead and behind; the last time, where it is when the body is at the end.

    Args:
        beats: the steps in order.
        stance: of the feet at the start, and to land at.
        track: of the body.
        beat_time: of a beat with `lasting` 1 [s].
        ground: its height [m] at x, y.
        place: a limb and its foothold (3,) [m] -> a better one nearby, where the ground asks for it.
        speed: see `course_of`.

    Raises:
        SpecError: a limb of a beat has no place in the stance.
    """
    beat_time = number(beat_time, "schedule: beat_time", "a positive time [s]", above=0.0)
    limbs = tuple(stance.feet)
    course = course_of(beats, limbs, track, beat_time, speed)
    begins = np.concatenate([[0.0], np.cumsum([beat.lasting for beat in beats])]) * beat_time
    feet = {limb: _on_ground(foot, np.zeros(3), ground) for limb, foot in stance.feet.items()}
    raised: list[str] = []
    steps = []
    for k, beat in enumerate(beats):
        stance = beat.stance or stance
        for limb in beat.raised:
            feet.pop(limb, None)
        raised = [limb for limb in [*raised, *beat.raised] if limb not in beat.swing]
        swing = {}
        for limb in beat.swing:
            if limb not in stance.feet:
                raise SpecError(
                    f"walk, step {k + 1}: '{limb}' has no place in the stance: {listing(list(stance.feet))}"
                )
            goal = _on_ground(stance.feet[limb], _middle(beats, begins, course, limb, k), ground)
            goal = goal if place is None else np.asarray(place(limb, goal))
            swing[limb] = np.array([feet.get(limb, goal), goal])
        support = {limb: foot for limb, foot in feet.items() if limb not in beat.swing}
        name = f"{k + 1:03d} {beat.name or ' '.join(beat.swing) or 'pause'}"
        steps.append(
            Step(
                name,
                float(begins[k]),
                float(begins[k + 1] - begins[k]),
                MappingProxyType(swing),
                MappingProxyType(support),
                tuple(dict.fromkeys(raised)),
            )
        )
        feet.update({limb: ends[1] for limb, ends in swing.items()})
    return Schedule(tuple(steps), course, MappingProxyType(feet))


def _middle(beats: Sequence[Beat], begins: Array, course: Course, limb: str, k: int) -> Array:
    """The body when it passes over a foot that lands at the end of beat k."""
    again = next((j for j in range(k + 1, len(beats)) if limb in beats[j].swing + beats[j].raised), None)
    if again is None:
        return course.place(course.duration)
    way = 0.5 * (course.gone(float(begins[k + 1])) + course.gone(float(begins[again])))
    return course.track.place(way)


def _on_ground(foot: Any, place: Array, ground: Ground) -> Array:
    c, s = np.cos(place[2]), np.sin(place[2])
    x = place[0] + c * foot[0] - s * foot[1]
    y = place[1] + s * foot[0] + c * foot[1]
    return np.array([x, y, float(ground(float(x), float(y)))])
