"""From a gait, a track and the ground to phases."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import GaitError, SpecError, listing
from wbplan.gaits.building import USUAL, Fields, Manner, Walk, build
from wbplan.gaits.gait import Gait
from wbplan.gaits.library import crawls, distinct, gait_named, gaits_of, pentapod
from wbplan.gaits.margins import best_margin
from wbplan.gaits.schedule import Ground, beats_of, count_for, flat, schedule
from wbplan.gaits.stance import Mode, Stance, Walker
from wbplan.gaits.tracks import Track
from wbplan.paths import number
from wbplan.robot import Robot

Array = NDArray[np.float64]

#: Share of the joints' speed limits that an automatic step time uses.
PACE = 0.7
#: Acceleration of a swinging foot [m/s^2] that an automatic step time allows: at twice of it, every other
#: tick of the small hexapod had no step after which all joints could stop together.
GENTLE = 1.2
#: Acceleration of the centre of mass over the feet [m/s^2] that an automatic step time allows.
CALM = 1.0
#: Step times are whole numbers of these [s], so that phases end on ticks.
GRAIN = 0.04
#: Time [s] between the places by which the body's acceleration is found.
INSTANT = 0.02
#: Share by which five feet close the gap of the sixth: more leaves less room for strokes, less less margin.
CLOSING = 0.6
#: Strides of the walks by which a shorter stride is looked for.
TRIED = 2.5


def walk(
    robot: Robot | Walker,
    gait: Gait,
    track: Track,
    stroke: float,
    *,
    stance: Stance | None = None,
    manner: Manner | None = None,
    ground: Ground = flat,
    place: Callable[[str, Array], Array] | None = None,
    fields: Fields | None = None,
) -> Walk:
    """A robot on a track in a gait.

    The body speeds up while every foot takes its first step and slows down while each takes its last;
    between, its speed is the gait's for the stroke.

    Args:
        robot: the robot, or its legs in another pose than 'stand'.
        gait: of its limbs.
        track: where to.
        stroke: how far a foot goes in the body's frame while it stands [m].
        stance: of the feet; as in the pose where not given.
        manner: times, heights, margin.
        ground: its height [m] at x, y.
        place: see `schedule`.
        fields: see `build`.

    Raises:
        SpecError: the gait is of other limbs than the robot's.
        GaitError: no motion keeps the margin, or a leg does not reach; says in which step, how much margin
            there is, and what stride or stance would hold.
    """
    walker = robot if isinstance(robot, Walker) else Walker(robot)
    manner, stance = manner or Manner(), stance or walker.stance()
    strange = set(gait.legs) ^ set(stance.feet)
    if strange:
        raise SpecError(
            f"gait '{gait.name}': of legs {listing(gait.legs)}, the stance has {listing(list(stance.feet))}"
        )
    stroke = number(stroke, "walk: stroke", "a positive length [m]", above=0.0)

    def planned(share: float, manner: Manner, known: Walk | None = None, usual: float = USUAL) -> Walk:
        stride = gait.stride(share * stroke)
        course = track if share == 1.0 else Track(min(track.length, TRIED * stride), track.curve)
        beats = beats_of(gait, count_for(gait, course.length, stride))
        speed = stride / (gait.cycle * manner.beat)
        made = schedule(beats, stance, course, manner.beat, ground, place, speed)
        return build(walker, made, stance, manner, ground, fields, known, usual)

    try:
        try:
            done = planned(1.0, manner)
        except GaitError:
            if manner.margin is not None:
                raise
            done = planned(1.0, manner, usual=0.5 * USUAL)  # with less sway legs may reach
        if manner.step_time is None:
            manner = replace(manner, step_time=_step_time(done, manner))
            done = planned(1.0, manner, done)
    except GaitError as error:
        still = best_margin(gait, stance.feet, (0.0, 0.0))
        wider = manner.margin / still if manner.margin is not None and still > 0.0 else 0.0
        raise _with_a_way_out(
            error, lambda share: planned(share, manner), gait.stride(stroke), wider
        ) from None
    return replace(done, gait=gait, stride=done.speed * gait.cycle * manner.beat)


def walker_for(robot: Robot, name: str) -> Walker:
    """A robot's legs for a gait: all; of six, for Zheng's gaits of five, all but one that is held up.

    That one is a limb that can be an arm, where there is one.

    Args:
        robot: the robot.
        name: of the gait.
    """
    walker = Walker(robot)
    if len(walker.legs) != 6 or name not in pentapod(tuple("abcde")):
        return walker
    arms = [limb for limb in walker.legs if "arm" in robot.roles.get(limb, {})]
    return Walker(robot, raised=(arms[0] if arms else walker.ring[0],))


def gaits_for(robot: Robot, mode: Mode | None = None) -> tuple[str, ...]:
    """Names of all gaits that a robot may be asked to walk in, each under one name.

    Args:
        robot: the robot.
        mode: which way its legs point; the modes are those of six legs.
    """
    walker = Walker(robot)
    names = distinct(gaits_of(walker.ring))
    five = len(walker.legs) == 6 and (mode is None or mode.lean is None)
    return (*names, *pentapod(tuple("abcde"))) if five else names


def gait_for(walker: Walker, name: str, stance: Stance, heading: float, stroke: float) -> Gait:
    """A robot's gait by name; without one, or as 'crawl', that which suits it best.

    Args:
        walker: the legs.
        name: of a built-in gait; '' is 'tripod' of six legs, 'crawl' of four, 'wave' of others. Of the crawls
            it is the one whose body is best held while it goes straight.
        stance: of the feet.
        heading: of travel in the body [rad].
        stroke: [m].

    Raises:
        SpecError: the robot's legs have no such gait.
    """
    ring = walker.ring
    name = name or {4: "crawl", 6: "tripod"}.get(len(ring), "4+1" if len(ring) == 5 else "wave")
    if name != "crawl" or len(ring) != 4:
        return gait_named(name, ring)
    ahead = np.array([math.cos(heading), math.sin(heading)])

    def held(gait: Gait) -> float:
        return best_margin(gait, stance.feet, gait.stride(stroke) * ahead, straight=True)

    return max(crawls(ring), key=held).renamed("crawl")


def _step_time(done: Walk, manner: Manner) -> float:
    """As short as the joints' speed allows and feet and body go gently, from a walk with steps of 1 s."""
    longest = max(
        (float(np.linalg.norm(np.diff(ends, axis=0))) for s in done.steps for ends in s.swing.values()),
        default=0.0,
    )
    # Largest accelerations of the quintic swing: 5.78 way / time^2, its time shorter by both ends' shares.
    gentle = math.sqrt(5.78 * max(longest / 0.64, 4.0 * manner.height) / GENTLE)
    times = np.arange(0.0, done.schedule.course.duration, INSTANT, dtype=np.float64).reshape(-1)
    body = np.diff(done.com.at(np.asarray(times)), 2, axis=0) / INSTANT**2
    calm = math.sqrt(float(np.linalg.norm(body, axis=1).max(initial=0.0)) / CALM)
    least = max(done.fastest.share / (PACE * manner.speed), gentle, calm)
    return GRAIN * math.ceil(least / GRAIN)


def _with_a_way_out(
    error: GaitError, planned: Callable[[float], Walk], stride: float, wider: float
) -> GaitError:
    """The same error with the longest stride that would hold, or the stance.

    Args:
        error: the error.
        planned: share of the stride -> the walk.
        stride: [m].
        wider: a stance so many times as wide has the margin asked, the body standing still.
    """
    if error.stride is not None or "step_time" in str(error):
        return error
    low, high = 0.0, 1.0
    for share in (0.05, 0.5):
        if _holds(planned, share):
            low = share
        else:
            high = share
            break
    while high - low > 0.03 and low > 0.0:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _holds(planned, middle) else (low, middle)
    way = (
        f"a stride of {low * stride:.3f} m (of {stride:.3f} m) would hold"
        if low > 0.0
        else f"no shorter stride would hold; with short ones a stance over {wider:.2f} times as wide would"
        if wider > 1.0
        else "no shorter stride would hold: widen the stance, ask for less margin, or pause between steps"
    )
    return GaitError(f"{error}; {way}", step=error.step, margin=error.margin, stride=low * stride or None)


def _holds(planned: Callable[[float], Walk], share: float) -> bool:
    try:
        planned(share)
    except GaitError:
        return False
    return True
