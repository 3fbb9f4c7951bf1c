"""The links of Hex-Piderix: what each is made of, in its own Denavit-Hartenberg frame.

Coxa: x outward, z up. Femur and tibia: x along the limb, y up at zero, z along the knee's axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin

from hexpiderix_table import LEGS, T, coxa
from servos import AX_12A, horns, housing, seams
from shapes import Part, block, box, cylinder, rod
from writer import Link

FORK = 0.021  # inner face of the forks (half a servo's depth, and 1 mm)
CHEEK = 0.0235  # outer face
FACE = 0.016  # half a servo's short side
LONG = AX_12A.size[0] - AX_12A.shaft  # from the shaft to the far end


def thorax() -> Link:
    """Two plates on the six servos of the coxae; battery, pumps, valves and board on top."""
    top = T.deck + T.plate / 2
    parts = [
        Part(box(2 * T.plate_x, 2 * T.plate_y, T.plate), (0.0, 0.0, side * T.deck), material=material)
        for side, material in ((1.0, "aluminium"), (-1.0, "dark_aluminium"))
    ]
    covers = [Part(box(2 * T.plate_x, 2 * T.plate_y, 2 * top))]
    for leg in LEGS:
        (x, y, _), azimuth = coxa(leg)
        back = AX_12A.size[0] / 2 - AX_12A.shaft  # from the shaft to the middle of the housing
        middle = (x - back * cos(azimuth), y - back * sin(azimuth), 0.0)
        servo = Part(box(*AX_12A.size), middle, (0.0, 0.0, azimuth), "servo_black", AX_12A.mass, solid=True)
        parts += [servo, *seams(AX_12A, servo, "x", "z")]
        parts += horns((x, y, 0.0), "z", 0.020, 0.0245)
    for x, y in ((0.032, 0.040), (-0.032, 0.040), (0.032, -0.040), (-0.032, -0.040)):
        for side in (1.0, -1.0):
            bolt = (x, y, side * (top + 0.001))
            parts.append(Part(cylinder(0.0035, 0.002), bolt, material="dark_aluminium", mass=0.0))
    parts += _battery(top)
    parts += _vacuum(top)
    covers.append(block((-0.036, -0.070, top), (0.036, 0.072, top + 0.030)))
    return Link("thorax", tuple(parts), T.chassis, tuple(covers))


def _battery(top: float) -> Iterator[Part]:
    """The battery across the middle, strapped, and the board over the rear."""
    yield Part(box(0.068, 0.034, 0.025), (0.0, 0.0, top + 0.0125), material="battery_blue", mass=T.battery)
    for x in (-0.020, 0.020):
        yield block((x - 0.004, -0.0175, top), (x + 0.004, 0.0175, top + 0.0258), "servo_black", mass=0.0)
    board = (0.0, -0.046, top + 0.009)
    yield Part(box(0.064, 0.046, 0.002), board, material="board_green", mass=T.board)
    for x in (-0.028, 0.028):
        for y in (-0.065, -0.027):
            yield rod((x, y, top), (x, y, top + 0.008), 0.002, "dark_aluminium", mass=0.0)
        plug = block(
            (x - 0.003, -0.064, top + 0.010), (x + 0.003, -0.028, top + 0.016), "aluminium", mass=0.0
        )
        yield plug
    yield Part(box(0.014, 0.014, 0.002), (0.0, -0.046, top + 0.011), material="servo_black", mass=0.0)


def _vacuum(top: float) -> Iterator[Part]:
    """Two vacuum pumps and a manifold with six valves in front."""
    for x in (-0.015, 0.015):
        lying = (pi / 2, 0.0, 0.0)
        yield Part(cylinder(0.012, 0.026), (x, 0.036, top + 0.013), lying, "servo_horn", T.pump * 0.6)
        yield Part(box(0.026, 0.014, 0.028), (x, 0.056, top + 0.014), material="carbon", mass=T.pump * 0.4)
    yield block((-0.033, 0.064, top), (0.033, 0.072, top + 0.008), "brass", mass=0.0)
    for k in range(6):
        valve = (-0.0275 + 0.011 * k, 0.068, top + 0.014)
        yield Part(box(0.009, 0.008, 0.012), valve, material="carbon", mass=T.valve)
        yield rod(valve, (valve[0], valve[1], top + 0.024), 0.002, "hose", mass=0.0)


def coxa_link(leg: str) -> Link:
    """Fork on servo 1, plate, and servo 2: upright, its shaft across."""
    femur = (T.d1, 0.0, 0.0)
    servo = housing(AX_12A, femur, "z", "y", back=False)
    wall = T.d1 - FACE
    parts = []
    for side in (1.0, -1.0):
        low, high = sorted((side * FORK, side * CHEEK))
        parts.append(block((-0.011, -0.011, low), (0.030, 0.011, high), solid=True))
    parts += [
        block((0.0285, -0.013, -CHEEK), (0.031, 0.013, CHEEK), solid=True),
        block((0.031, -0.008, -0.010), (wall - 0.0025, 0.008, 0.018), "dark_aluminium", solid=True),
        block((wall - 0.0025, -0.018, -0.012), (wall, 0.018, LONG), solid=True),
        block((wall - 0.0025, -0.018, LONG), (T.d1 + FACE, 0.018, LONG + 0.0025), solid=True),
        Part(servo.shape, servo.xyz, material="servo_black", mass=AX_12A.mass, solid=True),
        *seams(AX_12A, servo, "z", "y"),
        *horns(femur, "y", 0.020, 0.0245),
    ]
    return Link(f"{leg}_coxa", tuple(parts), T.coxa_bracket)


def femur(leg: str) -> Link:
    """Two plates from servo 2 to servo 3, and the bridge between them."""
    parts = []
    for side in (1.0, -1.0):
        low, high = sorted((side * FORK, side * CHEEK))
        for x0, x1, half in ((-0.011, 0.013, 0.011), (0.013, T.d2 - 0.013, 0.0075)):
            parts.append(block((x0, -half, low), (x1, half, high)))
        parts.append(block((T.d2 - 0.013, -0.011, low), (T.d2 + 0.011, 0.011, high)))
    middle = T.d2 / 2
    parts.append(block((middle - 0.002, -0.007, -FORK), (middle + 0.002, 0.007, FORK)))
    cover = block((-0.011, -0.011, -CHEEK), (T.d2 + 0.011, 0.011, CHEEK))
    return Link(f"{leg}_femur", tuple(parts), T.femur_plates, (cover,))


def tibia(leg: str) -> Link:
    """Servo 3, a shin of four struts, and the suction cup whose lip's centre is the foot's frame."""
    end = T.d3 - 0.032  # of the shin
    servo = housing(AX_12A, (0.0, 0.0, 0.0), "x", "z", back=False)
    parts = [
        servo,
        *seams(AX_12A, servo, "x", "z"),
        *horns((0.0, 0.0, 0.0), "z", 0.020, 0.0245),
        block((LONG, -FACE, -0.019), (LONG + 0.003, FACE, 0.019)),
        block((end - 0.010, -0.0075, -0.0085), (end, 0.0075, 0.0085), "dark_aluminium"),
    ]
    for y, z in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        start, stop = (LONG + 0.002, 0.0125 * y, 0.0155 * z), (end - 0.003, 0.005 * y, 0.006 * z)
        parts.append(rod(start, stop, 0.0026))
    parts += [
        rod((LONG + 0.003, 0.0, 0.0), (end - 0.010, 0.0, 0.0), 0.002, "hose", mass=0.0),
        rod((end, 0.0, 0.0), (T.d3 - 0.018, 0.0, 0.0), 0.005, "brass"),
        *_cup(),
    ]
    covers = (
        block((-AX_12A.shaft, -FACE, -CHEEK), (LONG + 0.003, FACE, CHEEK)),
        block((LONG + 0.003, -0.012, -0.015), (end, 0.012, 0.015)),
        rod((end, 0.0, 0.0), (T.d3, 0.0, 0.0), 0.0135),
    )
    return Link(f"{leg}_tibia", tuple(parts), T.tibia_and_cup, covers)


def _cup() -> Iterator[Part]:
    """A bellows cup: rings that get wider down to the lip."""
    rings = ((0.018, 0.0070), (0.0155, 0.0105), (0.012, 0.0080), (0.0095, 0.0115), (0.006, 0.0135))
    edges = [height for height, _ in rings[1:]] + [0.003]
    for (start, radius), stop in zip(rings, edges, strict=True):
        yield rod((T.d3 - start, 0.0, 0.0), (T.d3 - stop, 0.0, 0.0), radius, "silicone")
    yield rod((T.d3 - 0.003, 0.0, 0.0), (T.d3, 0.0, 0.0), T.cup, "silicone")
