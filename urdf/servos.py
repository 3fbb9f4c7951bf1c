"""Servos: what they weigh and can do, and the parts that they are drawn with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi, radians

from shapes import Part, Triple, block, box, rod, rotation

KGF_CM = 9.80665e-2  # [N m]


@dataclass(frozen=True)
class Servo:
    """A servo: mass, housing (along, across, axis), where its shaft is, and what it can do."""

    mass: float  # [kg]
    size: Triple  # [m]: long side, short side, along the shaft
    shaft: float  # [m], shaft axis to the nearer end of the long side (assumed)
    effort: float  # [N m], maker's data: stall torque
    speed: float  # [rad/s], maker's data: no load

    def limits(self, span: tuple[float, float]) -> tuple[float, float, float, float]:
        """A joint's limits from its span in degrees: lower, upper [rad], effort [N m], speed [rad/s]."""
        return (radians(span[0]), radians(span[1]), self.effort, self.speed)


# HerkuleX (Dongbu Robot): 14.8 V and 7.4 V. Dynamixel (Robotis): 12 V, turns 300 degrees.
DRS_0401 = Servo(0.123, (0.056, 0.035, 0.038), 0.018, 52 * KGF_CM, radians(60) / 0.147)
DRS_0101 = Servo(0.045, (0.045, 0.024, 0.031), 0.008, 12 * KGF_CM, radians(60) / 0.166)
AX_12A = Servo(0.0546, (0.050, 0.032, 0.040), 0.012, 1.5, 59 * 2 * pi / 60)


def housing(servo: Servo, shaft: Triple, along: str, axis: str, back: bool = True) -> Part:
    """A servo's housing: its shaft through the point `shaft` along `axis`, its long side along +-`along`."""
    order = {"x": 0, "y": 1, "z": 2}
    long, short, deep = servo.size
    low, high = [-short / 2] * 3, [short / 2] * 3
    low[order[axis]], high[order[axis]] = -deep / 2, deep / 2
    far, near = long - servo.shaft, servo.shaft
    low[order[along]], high[order[along]] = (-far, near) if back else (-near, far)
    corner = [tuple(s + v for s, v in zip(shaft, side, strict=True)) for side in (low, high)]
    return block(corner[0], corner[1], "servo_black", mass=servo.mass)  # type: ignore[arg-type]


def seams(servo: Servo, placed: Part, along: str, axis: str) -> Iterator[Part]:
    """The seams between a housing's three shells, across its shaft: drawn only.

    Args:
        servo: what it is.
        placed: its housing.
        along: axis of the housing's long side, "x", "y" or "z".
        axis: axis of its shaft.
    """
    long, short, deep = servo.size
    raised = 0.0006
    thin = [{along: long + raised, axis: 0.0008}.get(name, short + raised) for name in "xyz"]
    for share in (-0.22, 0.28):
        away = rotation(placed.rpy) @ [share * deep if name == axis else 0.0 for name in "xyz"]
        x, y, z = (float(a + b) for a, b in zip(placed.xyz, away, strict=True))
        yield Part(box(thin[0], thin[1], thin[2]), (x, y, z), placed.rpy, "servo_seam", 0.0)


def horns(at: Triple, axis: str, inner: float, outer: float, radius: float = 0.011) -> Iterator[Part]:
    """Two discs on a joint's axis, from `inner` to `outer` on either side: drawn only."""
    unit = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}[axis]
    for side in (1.0, -1.0):
        start, end = (
            (at[0] + side * d * unit[0], at[1] + side * d * unit[1], at[2] + side * d * unit[2])
            for d in (inner, outer)
        )
        yield rod(start, end, radius, "servo_horn", mass=0.0)
