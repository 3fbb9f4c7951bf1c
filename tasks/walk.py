"""Walking: any robot with legs, in any gait and direction, straight, along an arc or on the spot.

The body keeps moving at the gait's speed from when every foot has stepped once until they take their last
steps; feet land where they work evenly ahead of their stance and behind it.

Source: Zhuang, Gao, Deng, "Gait planning research for an electrically driven large-load-ratio six-legged
robot", 2017 (gaits, walking modes); Zheng, Xu, Tian, Ding, "Different manipulation mode analysis of a radial
symmetrical hexapod robot with leg-arm integration", 2022 (gaits on five legs).
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

import wbplan as wb

ROBOT = "heavy_hexapod"
ROBOTS = "any"


def script(
    robot: wb.Robot,
    *,
    gait: str = "",
    mode: Literal["free", "crab", "ant", "mixed1", "mixed2"] = "free",
    path: Literal["straight", "arc", "spot"] = "straight",
    distance: float | None = None,
    cycles: float = 2.0,
    heading: float = 0.0,
    turn: float = 0.0,
    stroke: float | None = None,
    step_time: float | None = None,
    lift: float | None = None,
    height: float | None = None,
    radius: float | None = None,
    margin: float | None = None,
    closing: float = wb.gaits.CLOSING,
    clearance: float = 0.005,
    friction: float = 0.7,
    terrain: Literal["flat", "rolling"] = "flat",
    relief: float | None = None,
) -> wb.Script:
    """A walk.

    Args:
        robot: with three legs or more.
        gait: its name; 'tripod' of six legs, 'crawl' of four, 'wave' of others where not given. In '4+1',
            '3+2' and 'mixture' a hexapod walks on five and holds the sixth up.
        mode: which way the legs point and the robot goes: crab and mixed1 along x, ant and mixed2 along y;
            'free' leaves the legs as in the robot's pose 'stand'.
        path: a straight line, an arc that the body follows, or a turn on the spot.
        distance: [m]; as many cycles as `cycles` says where not given.
        cycles: see `distance`.
        heading: of travel, against the mode's direction [degrees].
        turn: of the body by the end of the path [degrees].
        stroke: how far a foot goes in the body's frame while it stands [m]; six tenths of what they can where
            not given, and half the body's height at most; half of that on rolling ground.
        step_time: of a step [s]; as short as joints' speeds allow where not given.
        lift: how high feet rise [m]; a tenth of the body's height where not given.
        height: of the body [m]; the pose's where not given, unless legs had no room for a stroke then.
        radius: of the circle that the feet stand on [m]; the pose's stance where not given.
        margin: stability margin kept throughout [m]; almost half of the largest if not given, or a quarter.
        closing: share by which five feet close the gap of the sixth; at 1 they are a regular pentagon.
        clearance: kept between links, and of all but the feet from the ground [m]; 0 keeps none, nor do
            robots without collision shapes.
        friction: of the feet on the ground [-].
        terrain: 'rolling' is a height field of hills and hollows, a few feet apart.
        relief: of their tops over the mean height [m]; a twentieth of the body's height where not given.
    """
    walker = wb.gaits.walker_for(robot, gait)
    way = wb.gaits.mode_named(mode)
    course = way.heading + math.radians(heading)
    even = closing if walker.raised else 0.0
    stance = walker.stance(lean=way.lean, radius=radius, height=height, even=even)
    rise = 0.1 * stance.height if lift is None else lift
    if stroke is None or height is None:
        stance, easy = wb.gaits.comfortable(walker, stance, rise, adjust=height is None, heading=course)
        stroke = (easy if terrain == "flat" else 0.5 * easy) if stroke is None else stroke
    made = wb.gaits.gait_for(walker, gait, stance, course, stroke)
    length = cycles * made.stride(stroke) if distance is None else distance
    if path == "spot":
        track = wb.gaits.on_the_spot(math.radians(turn) or length / stance.radius, stance.radius)
    else:
        bend = wb.gaits.straight if path == "straight" else wb.gaits.arc
        track = bend(length, turn=math.radians(turn), heading=course)
    shape = (
        wb.Ground() if terrain == "flat" else _rolling(stance.radius, length, relief or 0.05 * stance.height)
    )
    ground = wb.Obstacle("ground", shape, (0.0, 0.0, -walker.sole), friction=friction)
    # A height field is many triangles: those are looked at that legs of the robot's size may come near.
    influence = 0.05 if terrain == "flat" else min(0.05, clearance + 0.05 * stance.height)
    obstacles = wb.Obstacles([ground], clearance, influence)
    apart: tuple[Any, ...] = (wb.SelfCollision(clearance), obstacles) if clearance > 0.0 else ()
    if terrain != "flat" and not apart:
        apart = (obstacles,)
    manner = wb.gaits.Manner(
        step_time=step_time,
        height=rise,
        margin=margin,
        friction=friction,
        limits=apart if walker.solid else (),
    )
    feet = wb.gaits.over(obstacles.terrain, -walker.sole, walker.sole)
    return wb.gaits.walk(walker, made, track, stroke, stance=stance, manner=manner, ground=feet).script


def _rolling(radius: float, length: float, relief: float) -> wb.HeightField:
    """Waves of 2.2 and 2.6 radii, wide enough for the whole walk; level with the floor at the start."""
    side = 3.0 * radius + length
    grid = np.linspace(-side, side, 2 * math.ceil(4.0 * side / radius))
    x, y = np.meshgrid(grid, grid, indexing="ij")
    waves = np.sin(2.0 * np.pi * x / (2.2 * radius)) * np.cos(2.0 * np.pi * y / (2.6 * radius))
    return wb.HeightField(grid, grid, relief * waves)
