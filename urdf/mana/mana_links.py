"""The links of MANA: what each is made of, in its own frame.

A leg's frames have x along hip 1, y outward and z up at zero; `inner` is +1 or -1, the side of x at which
the body is.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

from mana_table import SIDES, T
from servos import AX_12A, horns, housing, seams
from shapes import Part, block, box, cylinder, rod, sphere
from writer import Link

FORK = 0.021  # inner face of the forks (half a servo's depth, and 1 mm)
FACE = 0.016  # half a servo's short side


def body() -> Link:
    """Two plates, the four servos of hip 1 between them, batteries, board, and eyes in front."""
    top = T.deck + T.plate / 2
    plate = box(2 * T.plate_x, 2 * T.plate_y, T.plate)
    parts = [Part(plate, (0.0, 0.0, z)) for z in (T.deck, -T.deck)]
    half = (AX_12A.size[2] / 2, AX_12A.size[0] - AX_12A.shaft)
    for front, left in SIDES.values():
        x, y = front * (T.length / 2 - T.drive), left * T.hip_y
        servo = housing(AX_12A, (x, y, 0.0), "y", "x", left > 0)
        parts += [servo, *seams(AX_12A, servo, "y", "x")]
        shaft, end = x + front * half[0], front * (T.length / 2 - 0.0195)
        parts.append(rod((shaft, y, 0.0), (end, y, 0.0), 0.011, "servo_horn", mass=0.0))
        for x in (0.076, 0.046):
            post = (front * x, left * 0.050)
            parts.append(rod((*post, -T.deck), (*post, T.deck), 0.003, "dark_aluminium", mass=0.0))
            for side in (1.0, -1.0):
                bolt = (*post, side * (top + 0.001))
                parts.append(Part(cylinder(0.0035, 0.002), bolt, material="dark_aluminium", mass=0.0))
    for x in (-0.0175, 0.0175):
        parts.append(Part(box(0.033, 0.096, 0.028), (x, 0.0, 0.0), material="battery_blue", mass=T.battery))
    parts += _board(top)
    parts += _eyes(top)
    covers = (
        Part(box(2 * T.plate_x, 2 * T.plate_y, 2 * top)),
        block((-0.067, -0.030, top), (-0.003, 0.030, top + 0.014)),
        block((0.058, -0.026, top), (0.082, 0.026, top + 0.026)),
    )
    return Link("body", tuple(parts), T.mass - 4 * leg_mass() - known(parts), covers)


def known(parts: list[Part]) -> float:
    """Mass of the parts that have their own."""
    return sum(part.mass for part in parts if part.mass is not None)


def leg_mass() -> float:
    """Mass of a leg without the servo of hip 1, which sits in the body."""
    return 2 * AX_12A.mass + T.hip_bracket + T.thigh_plates + T.shank_tube


def _board(top: float) -> Iterator[Part]:
    """The controller on its four posts, with its chips."""
    x = -0.035
    yield Part(box(0.062, 0.058, 0.002), (x, 0.0, top + 0.006), material="board_green", mass=T.board)
    for dx, dy in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        foot = (x + 0.027 * dx, 0.025 * dy)
        yield rod((*foot, top), (*foot, top + 0.005), 0.002, "dark_aluminium", mass=0.0)
    yield Part(box(0.016, 0.016, 0.002), (x, 0.0, top + 0.008), material="servo_black", mass=0.0)
    for y in (-0.022, 0.022):  # connectors
        yield Part(box(0.040, 0.007, 0.006), (x, y, top + 0.010), material="servo_horn", mass=0.0)


def _eyes(top: float) -> Iterator[Part]:
    """A rangefinder: it shows where the front is."""
    x, z = 0.070, top + 0.015
    yield block((x - 0.006, -0.024, top), (x - 0.004, 0.024, top + 0.024), mass=0.0)
    yield Part(box(0.008, 0.046, 0.020), (x, 0.0, z), material="board_green", mass=T.eyes)
    for y in (-0.013, 0.013):
        yield Part(cylinder(0.008, 0.008), (x + 0.008, y, z), (0.0, pi / 2, 0.0), "lens", 0.0)
        yield Part(cylinder(0.006, 0.001), (x + 0.0125, y, z), (0.0, pi / 2, 0.0), "servo_black", 0.0)


def hip(leg: str, inner: float) -> Link:
    """The bracket on the shaft of hip 1, and servo 2, upright, its shaft across."""

    def plate(y0: float, y1: float, z0: float, z1: float) -> Part:
        low, high = sorted((inner * (FACE + 0.0035), inner * FACE))
        return block((low, y0, z0), (high, y1, z1), solid=True)

    servo = housing(AX_12A, (0.0, T.d, -T.l1), "z", "y", back=False)
    low, high = -T.l1 - AX_12A.shaft, -T.l1 + AX_12A.size[0] - AX_12A.shaft
    parts = [
        plate(-0.014, T.d + 0.018, -0.014, high + 0.0025),
        plate(T.d - 0.0185, T.d + 0.018, low, -0.014),
        block((-FACE, T.d - 0.018, high), (FACE, T.d + 0.018, high + 0.0025)),
        Part(servo.shape, servo.xyz, material="servo_black", mass=AX_12A.mass, solid=True),
        *seams(AX_12A, servo, "z", "y"),
        *horns((0.0, T.d, -T.l1), "y", 0.020, 0.0245),
        rod((inner * FACE, 0.0, 0.0), (inner * (FACE - 0.002), 0.0, 0.0), 0.007, "dark_aluminium", mass=0.0),
    ]
    return Link(f"{leg}_hip", tuple(parts), T.hip_bracket)


def _fork(reach: float, wide: float) -> Iterator[Part]:
    """Two cheeks beside the servo at the link's root, and the bridge below its swept circle."""
    for side in (1.0, -1.0):
        low, high = sorted((side * FORK, side * (FORK + 0.0025)))
        yield block((-0.011, low, -0.016), (0.011, high, 0.011))
        yield block((-wide, low, -reach), (wide, high, -0.016))
    yield block((-wide, -FORK, -reach), (wide, FORK, 0.003 - reach))


def thigh(leg: str) -> Link:
    """Fork on hip 2, and servo 3 at the knee, upright."""
    knee = (0.0, 0.0, -T.l2)
    servo = housing(AX_12A, knee, "z", "y", back=False)
    top = AX_12A.size[0] - AX_12A.shaft - T.l2
    parts = [
        *_fork(0.032, 0.011),
        block((-0.011, -0.016, top), (0.011, 0.016, -0.032)),
        servo,
        *seams(AX_12A, servo, "z", "y"),
        *horns(knee, "y", 0.020, 0.0245),
    ]
    covers = (
        block((-0.011, -FORK - 0.0025, -0.032), (0.011, FORK + 0.0025, 0.011)),
        block((-FACE, -FORK - 0.0025, -T.l2 - AX_12A.shaft), (FACE, FORK + 0.0025, top)),
    )
    return Link(f"{leg}_thigh", tuple(parts), T.thigh_plates, covers)


def shank(leg: str) -> Link:
    """Fork on the knee, a tapered tube, and the rubber ball whose centre is the foot's frame."""
    ball = (0.0, 0.0, -T.l3)
    parts = [
        *_fork(0.0325, 0.007),
        rod((0.0, 0.0, -0.0325), (0.0, 0.0, -0.046), 0.009, "dark_aluminium"),
        rod((0.0, 0.0, -0.046), (0.0, 0.0, 0.010 - T.l3), 0.006),
        rod((0.0, 0.0, 0.014 - T.l3), ball, 0.0066, "rubber"),
        Part(sphere(T.foot), ball, material="rubber", solid=True),
    ]
    covers = (
        block((-0.011, -FORK - 0.0025, -0.0325), (0.011, FORK + 0.0025, 0.011)),
        rod((0.0, 0.0, -0.0325), ball, 0.009),
    )
    return Link(f"{leg}_shank", tuple(parts), T.shank_tube, covers)
