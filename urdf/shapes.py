"""Primitive solids: what they look like in a URDF, and what they weigh.

A robot's generator lists the parts of each link once; visuals, collisions and inertias come from that one list,
so that a picture and a moment of inertia can never tell two different stories.

All lengths are in metres, masses in kilograms, angles in radians. `rpy` is URDF's: fixed axes x, y, z,
R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
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


class Shape(ABC):
    """A solid around its own centre, with axes along its symmetries."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume [m^3]."""

    @abstractmethod
    def moments(self, mass: float) -> Triple:
        """Principal moments of inertia about the centre [kg m^2], uniform density."""

    @abstractmethod
    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        """What URDF can draw: (element, attributes, xyz, rpy) for each piece, in the shape's frame."""


@final
@dataclass(frozen=True)
class Box(Shape):
    """Cuboid with edges x, y, z [m]."""

    x: float
    y: float
    z: float

    @property
    def volume(self) -> float:
        return self.x * self.y * self.z

    def moments(self, mass: float) -> Triple:
        x2, y2, z2 = self.x**2, self.y**2, self.z**2
        return (mass * (y2 + z2) / 12, mass * (x2 + z2) / 12, mass * (x2 + y2) / 12)

    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        size = f"{number(self.x)} {number(self.y)} {number(self.z)}"
        return (("box", {"size": size}, ORIGIN, ORIGIN),)


@final
@dataclass(frozen=True)
class Cylinder(Shape):
    """Full cylinder along z."""

    radius: float
    length: float

    @property
    def volume(self) -> float:
        return pi * self.radius**2 * self.length

    def moments(self, mass: float) -> Triple:
        across = mass * (3 * self.radius**2 + self.length**2) / 12
        return (across, across, mass * self.radius**2 / 2)

    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        return (("cylinder", {"radius": number(self.radius), "length": number(self.length)}, ORIGIN, ORIGIN),)


@final
@dataclass(frozen=True)
class Sphere(Shape):
    """Full sphere."""

    radius: float

    @property
    def volume(self) -> float:
        return 4 / 3 * pi * self.radius**3

    def moments(self, mass: float) -> Triple:
        each = 2 / 5 * mass * self.radius**2
        return (each, each, each)

    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        return (("sphere", {"radius": number(self.radius)}, ORIGIN, ORIGIN),)


@final
@dataclass(frozen=True)
class Capsule(Shape):
    """Cylinder along z of `length`, closed by two half spheres; drawn as a cylinder and two spheres."""

    radius: float
    length: float

    @property
    def volume(self) -> float:
        return pi * self.radius**2 * (self.length + 4 / 3 * self.radius)

    def moments(self, mass: float) -> Triple:
        r, h = self.radius, self.length
        middle = mass * h / (h + 4 / 3 * r)
        ends = mass - middle
        # Half spheres: centroid 3/8 r beyond the cylinder's end, own moment 2/5 m r^2 - m (3/8 r)^2 across.
        across = middle * (3 * r**2 + h**2) / 12
        across += ends * (2 / 5 * r**2 - (3 / 8 * r) ** 2 + (h / 2 + 3 / 8 * r) ** 2)
        return (across, across, middle * r**2 / 2 + ends * 2 / 5 * r**2)

    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        half, ball = self.length / 2, {"radius": number(self.radius)}
        return (
            ("cylinder", {**ball, "length": number(self.length)}, ORIGIN, ORIGIN),
            ("sphere", ball, (0.0, 0.0, half), ORIGIN),
            ("sphere", ball, (0.0, 0.0, -half), ORIGIN),
        )


@final
@dataclass(frozen=True)
class Hexagon(Shape):
    """Regular hexagonal plate, corners at `radius` on +x and every 60 degrees; drawn as three boxes."""

    radius: float
    thickness: float

    @property
    def volume(self) -> float:
        return 1.5 * sqrt(3) * self.radius**2 * self.thickness

    def moments(self, mass: float) -> Triple:
        flat = mass * 5 / 12 * self.radius**2
        across = flat / 2 + mass * self.thickness**2 / 12
        return (across, across, flat)

    def pieces(self) -> tuple[tuple[str, dict[str, str], Triple, Triple], ...]:
        # A box as wide as one side and as long as the distance of two opposite sides covers the two
        # triangles at those sides; three of them, turned by 60 degrees, cover the hexagon exactly.
        size = f"{number(self.radius)} {number(sqrt(3) * self.radius)} {number(self.thickness)}"
        return tuple(("box", {"size": size}, ORIGIN, (0.0, 0.0, k * pi / 3)) for k in range(3))


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
        own = axes @ np.diag(self.shape.moments(mass)) @ axes.T
        return own + mass * (d @ d * np.eye(3) - np.outer(d, d))

    def placed(self) -> Iterable[tuple[str, dict[str, str], Triple, Triple]]:
        """The shape's pieces with xyz and rpy in the link's frame."""
        axes = rotation(self.rpy)
        for element, attributes, xyz, rpy in self.shape.pieces():
            x, y, z = np.asarray(self.xyz) + axes @ np.asarray(xyz)
            yield element, attributes, (float(x), float(y), float(z)), angles(axes @ rotation(rpy))


def rod(start: Triple, end: Triple, radius: float, material: str = "aluminium", **more: bool | float | None) -> Part:
    """A round rod from `start` to `end`, in the link's frame."""
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, (start[2] + end[2]) / 2)
    rpy = (0.0, atan2(hypot(x, y), z), atan2(y, x))
    return Part(Cylinder(radius, sqrt(x * x + y * y + z * z)), middle, rpy, material, **more)  # type: ignore[arg-type]


def block(low: Triple, high: Triple, material: str = "aluminium", **more: bool | float | None) -> Part:
    """A box between two opposite corners, edges along the link's axes."""
    x, y, z = (b - a for a, b in zip(low, high, strict=True))
    middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)
    return Part(Box(x, y, z), middle, ORIGIN, material, **more)  # type: ignore[arg-type]


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
    text = f"{0.0 if abs(value) < 1e-13 else value:.{digits}g}"
    return text
