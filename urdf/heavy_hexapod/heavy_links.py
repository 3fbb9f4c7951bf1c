"""The links of the heavy hexapod: what each is made of, in its own frame."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, radians, sin, sqrt

from heavy_table import T
from shapes import ORIGIN, Part, Triple, block, box, cylinder, hexagon, rod, sphere
from writer import Link

CHEEK = 0.066  # inner face of the thigh's cheeks
WALL = 0.012  # their thickness
FORK = CHEEK + WALL + 0.004  # inner face of the shin's fork, outside the cheeks


def across(x: float, low: float, high: float, radius: float, material: str, **more: float | None) -> Part:
    """A round part along y."""
    return rod((x, low, 0.0), (x, high, 0.0), radius, material, **more)


def both(
    x: float, inner: float, outer: float, radius: float, material: str, **more: float | None
) -> Iterator[Part]:
    """A round part along y on either side."""
    for side in (1.0, -1.0):
        yield across(x, side * inner, side * outer, radius, material, **more)


def pair(low: Triple, high: Triple, material: str) -> Iterator[Part]:
    """A plate at positive y and its twin."""
    for side in (1.0, -1.0):
        y0, y1 = sorted((side * low[1], side * high[1]))
        yield block((low[0], y0, low[2]), (high[0], y1, high[2]), material)


def at(radius: float, azimuth: float, z: float) -> Triple:
    """A point from cylinder coordinates, azimuth in degrees."""
    return (radius * cos(radians(azimuth)), radius * sin(radians(azimuth)), z)


def body() -> Link:
    """Two plates, drives of the abductors at their corners, batteries between, cabinet and deck above."""
    top = T.plate_height + T.plate / 2
    deck = T.deck_height - 0.006
    parts = [
        Part(hexagon(T.plate_radius, T.plate), (0.0, 0.0, T.plate_height)),
        Part(hexagon(T.plate_radius, T.plate), (0.0, 0.0, -T.plate_height)),
        Part(hexagon(T.deck_radius, 0.012), (0.0, 0.0, deck), material="tread"),
        Part(box(0.34, 0.34, 0.10), (0.0, 0.0, top + 0.05), material="cabinet_grey", mass=T.cabinet),
    ]
    for y in (-0.11, 0.11):
        parts.append(Part(box(0.36, 0.17, 0.13), (0.0, y, 0.0), material="battery_blue", mass=T.battery))
    parts += [part for azimuth in T.azimuths for part in corner(azimuth, top)]
    parts += [part for azimuth in T.azimuths for part in side(azimuth + 30.0, top, deck)]
    for y in (0.171, -0.171):  # louvres of the cabinet
        for k in range(4):
            parts.append(
                Part(box(0.20, 0.004, 0.006), (0.0, y, top + 0.025 + 0.016 * k), material="tread", mass=0.0)
            )
    front = (0.171, 0.10, top + 0.05)
    parts.append(Part(box(0.004, 0.06, 0.06), front, material="yellow", mass=0.0))
    parts.append(rod(front, (0.195, 0.10, front[2]), 0.018, "red", mass=0.0))
    for x in (-0.16, -0.08, 0.0, 0.08, 0.16):  # ribs of the deck
        wide = 0.5 * (sqrt(3.0) * T.deck_radius) if abs(x) < 0.1 else 0.44
        parts.append(
            Part(box(0.012, wide, 0.004), (x, 0.0, deck + 0.0045), material="dark_aluminium", mass=0.0)
        )
    covers = (
        Part(hexagon(T.body_radius, 2 * top), ORIGIN),
        Part(hexagon(T.deck_radius, T.deck_height - top), (0.0, 0.0, (top + T.deck_height) / 2)),
    )
    return Link("body", tuple(parts), T.frame, covers)


def corner(azimuth: float, top: float) -> Iterator[Part]:
    """An abductor's drive above its bearing."""
    low, flange, high = (at(T.body_radius, azimuth, z) for z in (top, top + 0.018, top + 0.115))
    yield rod(low, flange, 0.066, "dark_aluminium", mass=0.0)
    yield rod(low, high, 0.050, "motor_black", mass=T.abductor.mass)
    yield rod(high, at(T.body_radius, azimuth, top + 0.128), 0.040, "aluminium", mass=0.0)
    yield rod(
        at(T.body_radius, azimuth, -top),
        at(T.body_radius, azimuth, -top - 0.022),
        0.055,
        "dark_aluminium",
        mass=0.0,
    )


def side(azimuth: float, top: float, deck: float) -> Iterator[Part]:
    """One side of the hexagon: a post, a panel between the plates, a bumper, a post of the deck."""
    turn = (0.0, 0.0, radians(azimuth))
    yield Part(cylinder(0.014, 2 * T.plate_height), at(0.30, azimuth, 0.0), material="dark_aluminium")
    yield Part(box(0.006, 0.20, 0.150), at(0.350, azimuth, 0.0), turn, "cabinet_grey", 0.0)
    yield Part(box(0.016, 0.17, 0.034), at(0.360, azimuth, 0.0), turn, "orange", 0.0)
    post = at(0.255, azimuth, 0.0)
    yield rod((post[0], post[1], top), (post[0], post[1], deck), 0.011, "dark_aluminium")
    yield Part(box(0.020, 0.28, 0.018), at(0.275, azimuth, deck), turn, "orange", 0.0)


def coxa(leg: str, structure: float) -> Link:
    """The abductor's hub between the plates, and the hip's drive across."""
    x = T.coxa
    parts = [
        rod((0.0, 0.0, -0.076), (0.0, 0.0, 0.076), 0.052, "dark_aluminium"),
        block((0.0, -0.046, -0.060), (x - 0.055, 0.046, 0.060)),
        block((0.045, -0.056, -0.046), (x - 0.045, 0.056, 0.046)),
        across(x, -0.062, 0.062, 0.058, "motor_black", mass=T.hip.mass),
        across(x, -0.064, -0.054, 0.060, "aluminium", mass=0.0),
        across(x, 0.054, 0.064, 0.060, "aluminium", mass=0.0),
    ]
    for z in (-0.062, 0.060):  # stiffening ribs
        parts.append(block((-0.02, -0.012, z), (x - 0.06, 0.012, z + 0.010), "dark_aluminium", mass=0.0))
    cover = block((-0.052, -0.062, -0.070), (x + 0.058, 0.062, 0.070))
    return Link(f"{leg}_coxa", tuple(parts), structure, (cover,))


def thigh(leg: str, structure: float) -> Link:
    """Two cheeks with the knee's motor between them along the thigh, and its gear across at the knee."""
    knee, outer = T.thigh, CHEEK + WALL
    parts = [
        *pair((0.0, CHEEK, -0.058), (0.17, outer, 0.058), "aluminium"),
        *pair((0.17, CHEEK, -0.046), (knee, outer, 0.046), "aluminium"),
        *both(0.0, CHEEK, outer, 0.072, "aluminium"),
        *both(knee, CHEEK, outer, 0.056, "aluminium"),
        block((0.105, -CHEEK, -0.050), (0.120, CHEEK, 0.050), "dark_aluminium"),
        block((0.375, -CHEEK, -0.044), (0.390, CHEEK, 0.044), "dark_aluminium"),
        block((0.120, -CHEEK, 0.050), (0.375, CHEEK, 0.056), "cabinet_grey", mass=0.0),
        block((0.150, -0.030, 0.056), (0.345, 0.030, 0.060), "orange", mass=0.0),
        rod((0.120, 0.0, 0.0), (0.330, 0.0, 0.0), 0.043, "motor_black", mass=0.65 * T.knee.mass),
        rod((0.330, 0.0, 0.0), (0.375, 0.0, 0.0), 0.034, "dark_aluminium", mass=0.0),
        across(knee, -0.062, 0.062, 0.050, "dark_aluminium", mass=0.35 * T.knee.mass),
        # The hip's motor looks out of one cheek, its brake out of the other.
        *both(0.0, outer, outer + 0.012, 0.048, "dark_aluminium", mass=0.0),
        *both(0.0, outer + 0.012, outer + 0.045, 0.036, "motor_black", mass=0.0),
    ]
    for side in (1.0, -1.0):  # lightening holes, drawn as dark pockets
        for x in (0.225, 0.305, 0.425):
            parts.append(across(x, side * outer, side * (outer + 0.0015), 0.026, "tread", mass=0.0))
    covers = (
        block((-0.072, -outer, -0.072), (0.17, outer, 0.060)),
        block((0.17, -outer, -0.050), (knee + 0.056, outer, 0.060)),
    )
    return Link(f"{leg}_thigh", tuple(parts), structure, covers)


def shin(leg: str, structure: float) -> Link:
    """Fork, tube, and the buffer at the end: a spring on its rod above a rubber foot."""
    ball, outer = T.shin - T.foot, FORK + WALL
    parts = [
        *pair((0.0, FORK, -0.042), (0.135, outer, 0.042), "aluminium"),
        *both(0.0, FORK, outer, 0.050, "aluminium"),
        *both(0.0, outer, outer + 0.008, 0.032, "dark_aluminium", mass=0.0),
        block((0.100, -FORK, -0.036), (0.135, FORK, 0.036)),
        rod((0.135, 0.0, 0.0), (0.155, 0.0, 0.0), 0.052, "dark_aluminium"),
        rod((0.155, 0.0, 0.0), (0.325, 0.0, 0.0), 0.040),
        rod((0.205, 0.0, 0.0), (0.235, 0.0, 0.0), 0.0415, "orange", mass=0.0),
        rod((0.325, 0.0, 0.0), (0.345, 0.0, 0.0), 0.046, "dark_aluminium"),
        rod((0.345, 0.0, 0.0), (ball - 0.02, 0.0, 0.0), 0.016, "steel"),
        rod((ball - 0.040, 0.0, 0.0), (ball - 0.026, 0.0, 0.0), 0.042, "dark_aluminium"),
        Part(sphere(T.foot), (ball, 0.0, 0.0), material="rubber", solid=True),
    ]
    for k in range(6):
        x = 0.350 + 0.0125 * k
        parts.append(Part(cylinder(0.033, 0.006), (x, 0.0, 0.0), (0.0, pi / 2, 0.0), "steel", 0.0))
    covers = (
        block((-0.050, -outer, -0.042), (0.135, outer, 0.042)),
        rod((0.135, 0.0, 0.0), (ball, 0.0, 0.0), 0.046),
    )
    return Link(f"{leg}_shin", tuple(parts), structure, covers)
