"""The links of the leg-arm hexapod: what each is made of, in its own frame."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, radians, sin

from legarm_table import SIDE, T
from servos import DRS_0101, DRS_0401, horns, housing
from shapes import ORIGIN, Part, block, box, cylinder, hexagon, rod, sphere
from writer import Link


def body() -> Link:
    """Two hexagonal plates; camera in front, two computers behind (negative y), IMU in the middle."""
    top = T.plate_height + T.plate / 2
    parts = [
        Part(hexagon(T.plate_radius, T.plate), (0.0, 0.0, T.plate_height), mass=T.upper_chassis),
        Part(hexagon(T.plate_radius, T.plate), (0.0, 0.0, -T.plate_height), mass=T.under_chassis),
        Part(box(0.057, 0.042, 0.024), (0.0, 0.0, top + 0.012), material="imu_orange", mass=T.imu),
    ]
    for x in (-0.045, 0.045):  # Pico-ITX boards, 72 x 100 mm, with their coolers
        board = (x, -0.130, top + 0.016)
        parts.append(Part(box(0.072, 0.100, 0.024), board, material="board_green", mass=T.computer))
        for k in range(5):
            fin = (x - 0.02 + 0.01 * k, -0.130, top + 0.033)
            parts.append(Part(box(0.003, 0.06, 0.010), fin, material="dark_aluminium", mass=0.0))
    eye = (0.0, 0.125, top + 0.075)
    tilt = (radians(-12.0), 0.0, 0.0)
    parts.append(Part(box(0.180, 0.035, 0.050), eye, tilt, "camera_black", T.camera))
    for x, radius in ((-0.055, 0.009), (0.0, 0.009), (0.035, 0.006)):
        lens = (x, eye[1] + 0.018 * cos(tilt[0]), eye[2] + 0.018 * sin(tilt[0]))
        parts.append(Part(cylinder(radius, 0.004), lens, (tilt[0] + pi / 2, 0.0, 0.0), "lens", 0.0))
    parts.append(rod((0.0, 0.12, top), (0.0, 0.12, eye[2] - 0.02), 0.009, "dark_aluminium", mass=0.0))
    for k in range(6):
        edge = radians(30.0 + 60.0 * k)
        x, y = 0.15 * cos(edge), 0.15 * sin(edge)
        parts.append(rod((x, y, -T.plate_height), (x, y, T.plate_height), 0.006, "dark_aluminium", mass=0.0))
        corner = radians(60.0 * k)
        for side in (1.0, -1.0):
            bearing = (T.body_radius * cos(corner), T.body_radius * sin(corner), side * (top + 0.001))
            parts.append(Part(cylinder(0.015, 0.003), bearing, material="dark_aluminium", mass=0.0))
    collisions = (
        *(Part(hexagon(T.plate_radius, T.plate), (0.0, 0.0, z)) for z in (T.plate_height, -T.plate_height)),
        Part(box(0.162, 0.100, 0.040), (0.0, -0.130, top + 0.020)),
        Part(box(0.180, 0.060, 0.100), (0.0, 0.125, top + 0.050)),
    )
    return Link("body", tuple(parts), collisions=collisions)


FORK = 0.020  # inner face of the forks that hold a DRS-0401 (half its depth, and 1 mm)


def fork(reach: float = 0.032) -> Iterator[Part]:
    """Two cheeks beside the servo at the link's root, and the bridge in front of its swept circle."""
    for side in (1.0, -1.0):
        low, high = sorted((side * FORK, side * (FORK + 0.0025)))
        yield block((-0.012, low, -0.013), (reach, high, 0.013))
    yield block((reach - 0.003, -FORK, -0.013), (reach, FORK, 0.013))


def hip(limb: str, structure: float) -> Link:
    """Servos 1 (shaft up, in the chassis) and 2 (shaft across), and the bracket between them."""
    parts = [
        housing(DRS_0401, ORIGIN, "x", "z"),
        housing(DRS_0401, (T.hip, 0.0, 0.0), "x", "y"),
        block((0.018, -0.019, -0.0175), (T.hip - 0.038, 0.019, 0.0175)),
        block((0.010, -0.017, 0.0190), (0.050, 0.017, 0.0210)),
        block((0.010, -0.017, -0.0210), (0.050, 0.017, -0.0190)),
        *horns(ORIGIN, "z", 0.019, 0.0235),
        *horns((T.hip, 0.0, 0.0), "y", 0.019, 0.0240),
    ]
    return Link(
        f"{limb}_hip",
        tuple(parts),
        structure,
        (block((-0.020, -0.019, -0.021), (T.hip + 0.018, 0.019, 0.021)),),
    )


def thigh(limb: str, structure: float) -> Link:
    """Fork, aluminium tube, and servo 3 at the knee."""
    knee = (T.thigh, 0.0, 0.0)
    parts = [
        *fork(),
        rod((0.032, 0.0, 0.0), (T.thigh - 0.038, 0.0, 0.0), 0.013),
        block((T.thigh - 0.042, -0.019, -0.0175), (T.thigh - 0.038, 0.019, 0.0175)),
        housing(DRS_0401, knee, "x", "y"),
        *horns(knee, "y", 0.019, 0.0240),
    ]
    cover = block((-0.012, -0.0225, -0.0175), (T.thigh + 0.018, 0.0225, 0.0175))
    return Link(f"{limb}_thigh", tuple(parts), structure, (cover,))


def shank(limb: str, structure: float) -> Link:
    """A leg's shank: fork, tube, rubber foot whose far side is the foot's frame."""
    ball = T.shank - T.foot
    parts = [
        *fork(),
        rod((0.032, 0.0, 0.0), (0.060, 0.0, 0.0), 0.013),
        rod((0.060, 0.0, 0.0), (ball - 0.022, 0.0, 0.0), 0.009),
        rod((ball - 0.030, 0.0, 0.0), (ball, 0.0, 0.0), 0.0075, "rubber"),
        Part(sphere(T.foot), (ball, 0.0, 0.0), material="rubber", solid=True),
    ]
    covers = (
        block((-0.012, -0.0225, -0.013), (0.032, 0.0225, 0.013)),
        rod((0.032, 0.0, 0.0), (ball, 0.0, 0.0), 0.011),
    )
    return Link(f"{limb}_shank", tuple(parts), structure, covers)


def shank1(limb: str, structure: float) -> Link:
    """A channel, open below, that takes the folded arm; servo 4 outside, shank 2's rail on its back.

    Servo 4 holds arm 1 from the outer side alone: on the inner side, to which arm 2 turns, the channel ends
    before it.
    """
    side = SIDE[limb]
    outer, inner = side * 0.022, -side * 0.022
    plates = []
    for face, end in ((outer, T.shank1 - 0.008), (inner, T.shank1 - 0.035)):
        low, high = sorted((face, face * (0.0245 / 0.022)))
        plates.append(block((-0.012, low, -0.014), (0.040, high, 0.014), solid=True))
        plates.append(block((0.040, low, -0.014), (end, high, 0.0225), solid=True))
    low, high = sorted((outer, outer * (0.0245 / 0.022)))
    plates.append(block((T.shank1 - 0.008, low, -0.010), (T.shank1 + 0.010, high, 0.010), solid=True))
    low, high = sorted((side * 0.0245, side * (0.0245 + DRS_0101.size[2])))
    servo = housing(DRS_0101, (T.shank1, (low + high) / 2, 0.0), "x", "y")
    parts = [
        *plates,
        block((0.040, -0.022, 0.0210), (0.125, 0.022, 0.0225), solid=True),
        Part(servo.shape, servo.xyz, material="servo_black", mass=DRS_0101.mass, solid=True),
        *(block((x, -0.008, 0.0225), (x + 0.016, 0.008, 0.0365), "blue", mass=0.0) for x in (0.056, 0.106)),
    ]
    return Link(f"{limb}_shank1", tuple(parts), structure)


def slide(limb: str, structure: float) -> Link:
    """Shank 2: a rail on the back of shank 1 and a neck down to the foot; its frame is where the foot is."""
    ball = (-T.foot, 0.0, 0.0)
    elbow, tail = (-0.040, 0.0, 0.0305), (-0.148, 0.0, 0.0305)
    parts = [
        rod(tail, elbow, 0.005, "carbon", solid=True),
        Part(sphere(0.005), elbow, material="carbon"),
        rod(elbow, ball, 0.005, "carbon", solid=True),
        Part(sphere(T.foot), ball, material="rubber", solid=True),
    ]
    return Link(f"{limb}_slide", tuple(parts), structure)


def arm1(limb: str, structure: float) -> Link:
    """Cheeks on joint 4, plates above and below joint 5; open behind, where the withdrawn foot goes in."""
    parts = []
    for y in (-0.0185, 0.0160):
        parts.append(block((-0.009, y, -0.020), (0.010, y + 0.0025, 0.020), "blue", solid=True))
        for z in (-0.020, 0.017):  # lugs out to the plates, clear of the swinging arm 2
            parts.append(block((0.010, y, z), (T.arm1 + 0.009, y + 0.0025, z + 0.003), "blue", solid=True))
    for z in (-0.020, 0.018):
        parts.append(block((0.0165, -0.0160, z), (T.arm1 + 0.009, 0.0160, z + 0.0020), "blue", solid=True))
    discs = horns((T.arm1, 0.0, 0.0), "z", 0.0155, 0.0180, 0.007)
    pins = horns(ORIGIN, "y", 0.0185, 0.0220, 0.005)
    return Link(f"{limb}_arm1", (*parts, *discs, *pins), structure)


def arm2(limb: str, structure: float) -> Link:
    """Servo 5, the fingers' servo, and the palm: two rubber strips, between them the fingers' slot."""
    face = T.arm2
    parts = [
        housing(DRS_0101, ORIGIN, "x", "z", back=False),
        block((0.037, -0.010, -0.012), (0.046, 0.010, 0.012), "blue"),
        block((0.046, -0.012, -0.0155), (0.091, 0.012, 0.0155), "servo_black", mass=DRS_0101.mass),
    ]
    for low, high in ((0.0040, 0.0155), (-0.0155, -0.0040)):
        parts.append(block((0.091, -0.0165, low), (face - 0.006, 0.0165, high), "blue"))
        parts.append(block((face - 0.006, -0.0165, low), (face, 0.0165, high), "palm_rubber"))
    covers = (
        block((-0.008, -0.012, -0.0155), (0.091, 0.012, 0.0155)),
        block((0.091, -0.0165, -0.0155), (face, 0.0165, 0.0155)),
    )
    return Link(f"{limb}_arm2", tuple(parts), structure, covers)


RUBBER = 0.0080  # a finger's rubber face beside the line from its hinge
PAD = 0.0310  # the face's middle, from the hinge


def jaw(limb: str, letter: str, structure: float) -> Link:
    """A gripper finger (limb 1) or a scissor blade (limb 2), along +x from its hinge when closed."""
    side = 1.0 if letter == "a" else -1.0
    end = T.hinge + T.finger

    def slab(
        x0: float, x1: float, y0: float, y1: float, z0: float, z1: float, material: str, solid: bool
    ) -> Part:
        (y0, y1), (z0, z1) = sorted((side * y0, side * y1)), sorted((side * z0, side * z1))
        return block((x0, y0, z0), (x1, y1, z1), material, solid=solid)

    if limb == "limb1":
        parts = [
            rod((0.0, 0.0, -0.0035), (0.0, 0.0, 0.0035), 0.004, "dark_aluminium"),
            slab(0.0, end, -0.0055, -0.0010, -0.0035, 0.0035, "aluminium", False),
            slab(0.014, end, -0.0055, -0.0030, -0.0090, 0.0090, "aluminium", False),
            slab(0.014, end, -RUBBER, -0.0055, -0.0090, 0.0090, "palm_rubber", False),
        ]
        cover = slab(0.0, end, -0.0080, -0.0010, -0.0090, 0.0090, "aluminium", False)
    else:
        parts = [
            rod((0.0, 0.0, 0.0), (0.0, 0.0, side * 0.0035), 0.0045, "dark_aluminium"),
            slab(0.0, 0.026, -0.0030, 0.0060, 0.0003, 0.0023, "steel", False),
            slab(0.026, end, -0.0030, 0.0025, 0.0003, 0.0023, "steel", False),
        ]
        cover = slab(0.0, end, -0.0030, 0.0060, 0.0003, 0.0023, "steel", False)
    return Link(f"{limb}_jaw_{letter}", tuple(parts), structure, (cover,))
