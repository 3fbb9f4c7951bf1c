"""Primitive solids: what they look like in a URDF, and what they weigh.

A robot's generator lists the parts of each link once; visuals, collisions and inertias come from that one
list, so that a picture and a moment of inertia can never tell two different stories.

All lengths are in metres, masses in kilograms, angles in radians. `rpy` is URDF's: fixed axes x, y, z,
R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin, sqrt
from typing import final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
ORIGIN: Triple = (0.0, 0.0, 0.0)


def rotation(rpy: Sequence[float]) -> Array:
    """Rotation matrix of URDF angles, R = Rz(yaw) Ry(pitch) Rx(roll)."""
    r, p, y = rpy
    cr, sr, cp, sp, cy, sy = cos(r), sin(r), cos(p), sin(p), cos(y), sin(y)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles(matrix: Array) -> Triple:
    """URDF angles of a rotation matrix (roll = 0 where pitch is +-90 degrees, and roll is free)."""
    level = hypot(matrix[0, 0], matrix[1, 0])
    pitch = atan2(-matrix[2, 0], level)
    if level < 1e-9:
        return (0.0, pitch, atan2(-matrix[0, 1], matrix[1, 1]))
    return (atan2(matrix[2, 1], matrix[2, 2]), pitch, atan2(matrix[1, 0], matrix[0, 0]))


Piece = tuple[str, str, Triple, Triple]  # URDF element, its attributes, xyz and rpy in the shape's frame


@final
@dataclass(frozen=True)
class Shape:
    """A solid of uniform density around its own centre, axes along its symmetries.

    Attributes:
        volume: [m^3].
        moments: principal moments of inertia about the centre for one kilogram (3,) [m^2].
        pieces: what URDF can draw of it.
    """

    volume: float
    moments: Triple
    pieces: tuple[Piece, ...]


def box(x: float, y: float, z: float) -> Shape:
    """Cuboid with edges x, y, z [m]."""
    moments = ((y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12)
    return Shape(x * y * z, moments, (_box((x, y, z)),))


def cylinder(radius: float, length: float) -> Shape:
    """Full cylinder along z."""
    across = (3 * radius**2 + length**2) / 12
    drawn = f'radius="{number(radius)}" length="{number(length)}"'
    return Shape(
        pi * radius**2 * length, (across, across, radius**2 / 2), (("cylinder", drawn, ORIGIN, ORIGIN),)
    )


def sphere(radius: float) -> Shape:
    """Full sphere."""
    each = 2 / 5 * radius**2
    drawn = (("sphere", f'radius="{number(radius)}"', ORIGIN, ORIGIN),)
    return Shape(4 / 3 * pi * radius**3, (each, each, each), drawn)


def capsule(radius: float, length: float) -> Shape:
    """Cylinder along z of `length`, closed by two half spheres; drawn as a cylinder and two spheres."""
    tube, ball = cylinder(radius, length), sphere(radius)
    volume = tube.volume + ball.volume
    ends = ball.volume / volume  # of the mass
    # Half spheres: centroid 3/8 r beyond the cylinder's end; about it, across, 2/5 r^2 - (3/8 r)^2.
    end = 2 / 5 * radius**2 - (3 / 8 * radius) ** 2 + (length / 2 + 3 / 8 * radius) ** 2
    across = (1 - ends) * tube.moments[0] + ends * end
    along = (1 - ends) * tube.moments[2] + ends * ball.moments[2]
    element, drawn, _, _ = ball.pieces[0]
    caps = tuple((element, drawn, (0.0, 0.0, z), ORIGIN) for z in (length / 2, -length / 2))
    return Shape(volume, (across, across, along), (*tube.pieces, *caps))


def hexagon(radius: float, thickness: float) -> Shape:
    """Regular hexagonal plate, corners at `radius` on +x and every 60 degrees; drawn as three boxes."""
    along = 5 / 12 * radius**2
    across = along / 2 + thickness**2 / 12
    # A box as wide as one side and as long as the distance of two opposite sides covers the two
    # triangles at those sides; three of them, turned by 60 degrees, cover the hexagon exactly.
    size = (radius, sqrt(3) * radius, thickness)
    drawn = tuple(_box(size, k * pi / 3) for k in range(3))
    return Shape(1.5 * sqrt(3) * radius**2 * thickness, (across, across, along), drawn)


def _box(size: Triple, yaw: float = 0.0) -> Piece:
    return ("box", f'size="{" ".join(map(number, size))}"', ORIGIN, (0.0, 0.0, yaw))


@final
@dataclass(frozen=True)
class Part:
    """A shape at its place in a link.

    Attributes:
        shape: the solid.
        xyz: its centre, in the link's frame (3,) [m].
        rpy: its axes, in the link's frame (3,) [rad].
        material: name of the material it is drawn in.
        mass: own mass [kg] if known (a servo); None: takes its share, by volume, of the mass given to the
            link's structure; 0.0: drawn only (its mass is counted elsewhere).
        visible: drawn.
        solid: also a collision shape.
    """

    shape: Shape
    xyz: Triple = ORIGIN
    rpy: Triple = ORIGIN
    material: str = "aluminium"
    mass: float | None = None
    visible: bool = True
    solid: bool = False

    def inertia_about(self, point: Array, mass: float) -> Array:
        """Inertia about `point` in the link's axes: R diag(moments) R^T + m (|d|^2 1 - d d^T)."""
        axes = rotation(self.rpy)
        d = np.asarray(self.xyz) - point
        own: Array = mass * axes @ np.diag(self.shape.moments) @ axes.T
        away: Array = mass * (float(d @ d) * np.eye(3) - np.outer(d, d))
        return own + away

    def placed(self) -> Iterable[Piece]:
        """The shape's pieces with xyz and rpy in the link's frame."""
        axes = rotation(self.rpy)
        for element, attributes, xyz, rpy in self.shape.pieces:
            x, y, z = np.asarray(self.xyz) + axes @ np.asarray(xyz)
            yield element, attributes, (float(x), float(y), float(z)), angles(axes @ rotation(rpy))


def rod(
    start: Triple, end: Triple, radius: float, material: str = "aluminium", **more: bool | float | None
) -> Part:
    """A round rod from `start` to `end`, in the link's frame."""
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, (start[2] + end[2]) / 2)
    rpy = (0.0, atan2(hypot(x, y), z), atan2(y, x))
    return Part(cylinder(radius, sqrt(x * x + y * y + z * z)), middle, rpy, material, **more)  # type: ignore[arg-type]


def block(low: Triple, high: Triple, material: str = "aluminium", **more: bool | float | None) -> Part:
    """A box between two opposite corners, edges along the link's axes."""
    x, y, z = (b - a for a, b in zip(low, high, strict=True))
    middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)
    return Part(box(x, y, z), middle, ORIGIN, material, **more)  # type: ignore[arg-type]


@final
@dataclass(frozen=True)
class Inertia:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], in the link's axes."""

    mass: float
    com: Array
    about_com: Array


def inertia_of(parts: Sequence[Part], structure: float = 0.0) -> Inertia:
    """Inertia of a link: parts of known mass, and `structure` kilograms shared by volume among the others.

    Args:
        parts: all parts of the link.
        structure: mass of the parts that have none of their own [kg].

    Raises:
        ValueError: there is mass to share and no part to take it, or a part to fill and no mass.
    """
    volume = sum(p.shape.volume for p in parts if p.mass is None)
    if (volume > 0) != (structure > 0):
        raise ValueError(f"structure of {structure} kg for parts of {volume} m^3 without own mass")
    masses = [p.shape.volume / volume * structure if p.mass is None else p.mass for p in parts]
    total = sum(masses)
    com = sum((m * np.asarray(p.xyz) for m, p in zip(masses, parts, strict=True)), np.zeros(3)) / total
    about = sum((p.inertia_about(com, m) for m, p in zip(masses, parts, strict=True)), np.zeros((3, 3)))
    return Inertia(total, com, about)


def number(value: float, digits: int = 12) -> str:
    """A number as text: the same on every machine (last bits of sin and cos are cut off), never '-0'."""
    return f"{0.0 if abs(value) < 1e-13 else value:.{digits}g}"
