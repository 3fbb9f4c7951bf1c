"""Torso and legs of HIphanT: what each link is made of, in its own frame."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians, sin

from hiphant_table import FRONT, LEFT, LEGS, T
from shapes import ORIGIN, Part, Triple, block, box, cylinder, rod, sphere
from writer import Link

HULL = 0.110  # half width of the hull between the hips
DECK = 0.08  # its top above {B}, where the arm is bolted on
WING = 0.190  # half length of the wide middle
DRIVE_Y = 0.115  # axis of the abduction modules, half in the hull: a belt takes them to the joint
BELT = (0.070, 0.088)  # where the belt runs, along x towards the middle from the hip


def module(start: Triple, end: Triple, mass: float | None) -> Iterator[Part]:
    """A modular joint between two points: motor, gear ring, and a band that shows where it turns."""
    middle = [(a + b) / 2 for a, b in zip(start, end, strict=True)]
    step = [(b - a) for a, b in zip(start, end, strict=True)]

    def on(share: float) -> Triple:
        x, y, z = (m + (share - 0.5) * s for m, s in zip(middle, step, strict=True))
        return (x, y, z)

    yield rod(start, end, T.module_radius, "module_black", mass=mass)
    yield rod(on(0.72), on(0.80), T.module_radius + 0.0015, "accent_blue", mass=0.0)
    yield rod(on(0.88), on(1.03), T.module_radius + 0.002, "aluminium", mass=0.0)
    yield rod(on(-0.05), on(0.02), T.module_radius - 0.010, "dark_aluminium", mass=0.0)


def body() -> Link:
    """Hull with a wide middle, four abduction modules beside it, sensors in front and on the back."""
    long, wide = T.torso_length / 2, T.torso_width / 2
    parts = [
        block((-long + 0.02, -HULL, -0.055), (long - 0.02, HULL, DECK - 0.012), "dark_aluminium"),
        block((-WING, -wide, -0.010), (WING, wide, DECK - 0.012), "shell_white"),
        block((-long + 0.05, -HULL - 0.004, DECK - 0.012), (long - 0.05, HULL + 0.004, DECK), "shell_white"),
        block((long - 0.02, -HULL + 0.01, -0.045), (long, HULL - 0.01, DECK - 0.02), "shell_white"),
        block((-long, -HULL + 0.01, -0.045), (-long + 0.02, HULL - 0.01, DECK - 0.02), "shell_white"),
    ]
    for leg in LEGS:
        parts += abduction(leg)
    parts += wings(wide)
    parts += sensors(long)
    covers = (
        block((-long, -HULL, -0.055), (long, HULL, DECK)),
        block((-WING, -wide, -0.010), (WING, wide, DECK)),
        Part(box(0.10, 0.09, 0.12), (-0.33, 0.0, DECK + 0.06)),
        *(
            block((x - 0.0515, y - 0.050, -0.050), (x + 0.0515, y + 0.050, 0.050))
            for x in (-0.2785, 0.2785)
            for y in (-DRIVE_Y, DRIVE_Y)
        ),
        *(part for leg in LEGS for part in belt(leg)),
    )
    return Link("body", tuple(parts), T.torso - 4 * T.module, covers)


def belt(leg: str) -> Iterator[Part]:
    """The belt's case, from the module to the abduction joint; slim there, since the thigh swings past."""
    x, y = FRONT[leg] * T.hip_x, LEFT[leg] * T.hip_y
    a, b = sorted(x - FRONT[leg] * near for near in BELT)
    for start, end, high in ((0.080, 0.170, 0.034), (0.170, abs(y) + 0.010, 0.016)):
        low, top = sorted((LEFT[leg] * start, LEFT[leg] * end))
        yield block((a, low, -high), (b, top, high), "aluminium")


def abduction(leg: str) -> Iterator[Part]:
    """Module of joint 1 beside the hull, its belt, and the bearing that carries the hip."""
    x, y = FRONT[leg] * T.hip_x, LEFT[leg] * T.hip_y
    inner, outer, end = (x - FRONT[leg] * far for far in (BELT[1] + T.module_length, BELT[1], BELT[1] + 0.03))
    yield from module((inner, LEFT[leg] * DRIVE_Y, 0.0), (outer, LEFT[leg] * DRIVE_Y, 0.0), T.module)
    yield from belt(leg)
    yield rod((end, y, 0.0), (outer, y, 0.0), 0.010, "dark_aluminium")
    pulley = x - FRONT[leg] * (BELT[1] + 0.002)
    yield rod((outer, y, 0.0), (pulley, y, 0.0), 0.0105, "accent_blue", mass=0.0)


def wings(wide: float) -> Iterator[Part]:
    """Trim of the wide middle: battery doors, cooling slots, handles."""
    for side in (1.0, -1.0):
        low, high = sorted((side * wide, side * (wide + 0.003)))
        yield block((-0.165, low, 0.0), (0.165, high, 0.052), "dark_aluminium", mass=0.0)
        yield block((-0.165, low, 0.056), (0.165, high, 0.064), "accent_blue", mass=0.0)
        for k in range(6):
            x = -0.12 + 0.048 * k
            low, high = sorted((side * (wide + 0.003), side * (wide + 0.0045)))
            yield block((x - 0.014, low, 0.010), (x + 0.014, high, 0.040), "sensor_black", mass=0.0)
        y = side * 0.205
        for x in (-0.11, 0.11):
            yield rod((x, y, 0.066), (x, y, 0.105), 0.007, "carbon", mass=0.0)
        yield rod((-0.125, y, 0.105), (0.125, y, 0.105), 0.009, "carbon", mass=0.0)
    for x in (-0.15, 0.15):
        yield block((x - 0.010, -0.13, DECK), (x + 0.010, 0.13, DECK + 0.004), "aluminium", mass=0.0)


def sensors(long: float) -> Iterator[Part]:
    """Depth camera ahead, lidar and computer on the back, an emergency stop."""
    tilt = (0.0, radians(15.0), 0.0)
    eye = (long + 0.012, 0.0, 0.035)
    yield Part(box(0.028, 0.13, 0.034), eye, tilt, "sensor_black", 0.0)
    for y in (-0.042, 0.0, 0.042):
        lens = (eye[0] + 0.014 * cos(tilt[1]), y, eye[2] - 0.014 * sin(tilt[1]))
        yield Part(cylinder(0.010, 0.004), lens, (0.0, radians(105.0), 0.0), "lens", 0.0)
    for y in (-0.085, 0.085):
        yield Part(box(0.004, 0.030, 0.012), (long + 0.001, y, 0.02), ORIGIN, "lidar_silver", 0.0)
    x = -0.33
    yield Part(box(0.10, 0.09, 0.03), (x, 0.0, DECK + 0.015), ORIGIN, "dark_aluminium", 0.0)
    for z, high, radius, material in (
        (0.030, 0.020, 0.040, "lidar_silver"),
        (0.050, 0.034, 0.041, "sensor_black"),
        (0.084, 0.022, 0.040, "lidar_silver"),
    ):
        yield rod((x, 0.0, DECK + z), (x, 0.0, DECK + z + high), radius, material, mass=0.0)
    yield rod((-0.42, 0.07, DECK), (-0.42, 0.07, DECK + 0.018), 0.018, "dark_aluminium", mass=0.0)
    yield rod((-0.42, 0.07, DECK + 0.018), (-0.42, 0.07, DECK + 0.034), 0.015, "signal_red", mass=0.0)


INNER, OUTER = -0.060, -0.040  # faces of the thigh along y; the shank and its balloon turn past them at 0


def hip(leg: str) -> Link:
    """The bracket on the abduction axis, around the module of joint 2 that lies along y."""
    side, back = LEFT[leg], -FRONT[leg]
    inner, outer = side * (T.offset + INNER - 0.002 - T.module_length), side * (T.offset + INNER - 0.002)
    face = back * (T.module_radius + 0.018)
    wall = sorted((face, face - back * 0.014))
    low, high = sorted((inner + side * 0.010, outer - side * 0.014))
    spine = sorted((face - back * 0.010, back * 0.020))
    parts = [
        *module((0.0, inner, 0.0), (0.0, outer, 0.0), T.module),
        block((wall[0], -0.042, -0.042), (wall[1], 0.042, 0.042)),
        block((spine[0], low, -0.046), (spine[1], high, 0.046), "dark_aluminium"),
    ]
    ends = sorted((inner, outer))
    reach = T.module_radius
    cover = block((min(wall[0], -reach), ends[0], -reach), (max(wall[1], reach), ends[1], reach))
    return Link(f"{leg}_hip", tuple(parts), T.hip_shell, (cover,))


def thigh(leg: str) -> Link:
    """A flat beam inside the leg's plane; the module of joint 3 at the knee looks inward."""
    side, knee = LEFT[leg], -T.thigh

    def slab(
        x: float, z0: float, z1: float, y0: float, y1: float, material: str, **more: float | None
    ) -> Part:
        low, high = sorted((side * y0, side * y1))
        return block((-x, low, z0), (x, high, z1), material, **more)

    def disc(z: float, radius: float, y0: float, y1: float, material: str, **more: float | None) -> Part:
        return rod((0.0, side * y0, z), (0.0, side * y1, z), radius, material, **more)

    parts = [
        slab(0.036, knee, 0.0, INNER, OUTER, "shell_white"),
        disc(0.0, 0.054, INNER, OUTER, "shell_white"),
        disc(knee, 0.048, INNER, OUTER, "shell_white"),
        slab(0.022, knee + 0.075, -0.075, OUTER, OUTER + 0.002, "dark_aluminium", mass=0.0),
        disc(0.0, 0.036, OUTER, OUTER + 0.003, "dark_aluminium", mass=0.0),
        disc(0.0, 0.026, OUTER + 0.003, OUTER + 0.004, "accent_blue", mass=0.0),
        *module((0.0, side * (INNER - T.module_length), knee), (0.0, side * INNER, knee), T.module),
    ]
    low, high = sorted((side * INNER, side * OUTER))
    body_low, body_high = sorted((side * (INNER - T.module_length), side * INNER))
    covers = (
        rod((0.0, low, 0.0), (0.0, high, 0.0), 0.054),
        block((-0.036, low, knee), (0.036, high, 0.0)),
        rod((0.0, low, knee), (0.0, high, knee), 0.048),
        block((-0.05, body_low, knee - 0.05), (0.05, body_high, knee + 0.05)),
    )
    return Link(f"{leg}_thigh", tuple(parts), T.thigh_shell, covers)


def shank(leg: str) -> Link:
    """A carbon tube in the leg's plane, outside the thigh, so that it can turn all round; a balloon below.

    In the pose `stand` the balloon's lowest point is the foot's frame: its centre stands straight above.
    """
    side, foot = LEFT[leg], -T.shank
    lean = radians(T.crouch)  # the shank leans so much; its own "up" is turned by this
    ball = (T.balloon * sin(lean), 0.0, foot + T.balloon * cos(lean))
    parts = [
        rod((0.0, side * (OUTER + 0.006), 0.0), (0.0, side * 0.020, 0.0), 0.040, "aluminium"),
        rod((0.0, side * 0.020, 0.0), (0.0, side * 0.026, 0.0), 0.030, "dark_aluminium"),
        rod((0.0, 0.0, -0.020), (0.0, 0.0, -0.085), 0.019, "aluminium"),
        rod((0.0, 0.0, -0.075), (0.0, 0.0, foot + 0.075), 0.0145, "carbon"),
        rod((0.0, 0.0, -0.110), (0.0, 0.0, -0.120), 0.016, "accent_blue", mass=0.0),
        rod((0.0, 0.0, foot + 0.085), (0.0, 0.0, foot + 0.055), 0.0175, "aluminium"),
        rod((0.0, 0.0, foot + 0.058), (ball[0], 0.0, ball[2]), 0.020, "dark_aluminium"),
        Part(sphere(T.balloon), ball, material="balloon", solid=True),
    ]
    low, high = sorted((side * (OUTER + 0.006), side * 0.026))
    covers = (
        block((-0.040, low, -0.040), (0.040, high, 0.040)),
        rod((0.0, 0.0, 0.0), (0.0, 0.0, foot + 0.045), 0.019),
    )
    return Link(f"{leg}_shank", tuple(parts), T.shank_shell, covers)
