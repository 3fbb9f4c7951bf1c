"""The six-joint arm of HIphanT: what each link is made of, in its own frame; at zero it lies along +x."""

from __future__ import annotations

from collections.abc import Iterator

from hiphant_table import T
from shapes import Part, Triple, block, rod
from writer import Link

Y_OUT = 0.052  # half width of the pitch joints


def barrel(x: float, half: float, radius: float, mass: float | None = None) -> Iterator[Part]:
    """A pitch joint's housing, its axis along y, with a ring and a cap on either side."""
    yield rod((x, -half, 0.0), (x, half, 0.0), radius, "module_black", mass=mass)
    for side in (1.0, -1.0):
        ring = (side * (half - 0.014), side * (half - 0.009))
        yield rod((x, ring[0], 0.0), (x, ring[1], 0.0), radius + 0.0012, "accent_blue", mass=0.0)
        yield rod(
            (x, side * half, 0.0), (x, side * (half + 0.008), 0.0), radius * 0.78, "aluminium", mass=0.0
        )


def cheeks(x0: float, x1: float, inner: float, high: float) -> Iterator[Part]:
    """Two arms of a fork beside a barrel."""
    for side in (1.0, -1.0):
        low, top = sorted((side * inner, side * (inner + 0.010)))
        yield block((x0, low, -high), (x1, top, high), "shell_white")


def tube(x0: float, x1: float, radius: float, material: str = "shell_white", **more: float | None) -> Part:
    """A round part along x."""
    return rod((x0, 0.0, 0.0), (x1, 0.0, 0.0), radius, material, **more)


def pillar(z0: float, z1: float, radius: float, material: str, **more: float | None) -> Part:
    """A round part along z."""
    return rod((0.0, 0.0, z0), (0.0, 0.0, z1), radius, material, **more)


def base(mass: float) -> Link:
    """The foot of the arm, bolted to the deck; joint 1's axis is vertical."""
    parts = [
        block((-0.070, -0.070, 0.0), (0.070, 0.070, 0.010), "aluminium"),
        pillar(0.010, 0.062, 0.054, "module_black"),
        pillar(0.046, 0.050, 0.0555, "accent_blue", mass=0.0),
        *(pillar_at(x, y, 0.010, 0.015, 0.006) for x in (-0.058, 0.058) for y in (-0.058, 0.058)),
    ]
    cover = block((-0.070, -0.070, 0.0), (0.070, 0.070, 0.062))
    return Link("arm_base", tuple(parts), mass, (cover,))


def pillar_at(x: float, y: float, z0: float, z1: float, radius: float) -> Part:
    """A bolt's head."""
    return rod((x, y, z0), (x, y, z1), radius, "dark_aluminium", mass=0.0)


def shoulder(mass: float) -> Link:
    """A turning head with the shoulder's barrel; its frame lies where joint 1 meets joint 2."""
    foot = -T.shoulder + 0.064
    parts = [
        pillar(foot, foot + 0.016, 0.056, "aluminium"),
        block((-0.040, -0.040, foot + 0.010), (0.040, 0.040, -0.020), "shell_white"),
        *barrel(0.0, Y_OUT, 0.050),
    ]
    cover = block((-0.054, -0.058, foot), (0.054, 0.058, 0.050))
    return Link("arm_link1", tuple(parts), mass, (cover,))


def upper(mass: float) -> Link:
    """Fork on the shoulder, tube, and the elbow's barrel."""
    end = T.upper
    parts = [
        *cheeks(-0.045, 0.085, Y_OUT + 0.009, 0.036),
        rod((0.0, -Y_OUT - 0.009, 0.0), (0.0, -Y_OUT - 0.022, 0.0), 0.046, "shell_white"),
        rod((0.0, Y_OUT + 0.009, 0.0), (0.0, Y_OUT + 0.022, 0.0), 0.046, "shell_white"),
        block((0.062, -Y_OUT - 0.009, -0.036), (0.085, Y_OUT + 0.009, 0.036), "shell_white"),
        tube(0.085, 0.100, 0.044, "aluminium"),
        tube(0.100, end - 0.060, 0.036, "carbon"),
        tube(end - 0.075, end - 0.040, 0.040, "aluminium"),
        *barrel(end, 0.044, 0.044),
    ]
    covers = (
        block((-0.046, -0.074, -0.046), (0.085, 0.074, 0.046)),
        rod((0.085, 0.0, 0.0), (end - 0.03, 0.0, 0.0), 0.044),
        rod((end, -0.052, 0.0), (end, 0.052, 0.0), 0.046),
    )
    return Link("arm_link2", tuple(parts), mass, covers)


def fore(mass: float) -> Link:
    """Fork on the elbow and the roll's housing; its frame is the elbow."""
    parts = [
        *cheeks(0.0, 0.075, 0.053, 0.032),
        rod((0.0, -0.053, 0.0), (0.0, -0.065, 0.0), 0.042, "shell_white"),
        rod((0.0, 0.053, 0.0), (0.0, 0.065, 0.0), 0.042, "shell_white"),
        block((0.055, -0.053, -0.032), (0.075, 0.053, 0.032), "shell_white"),
        tube(0.075, 0.165, 0.040, "module_black"),
        tube(0.145, 0.150, 0.0412, "accent_blue", mass=0.0),
    ]
    covers = (
        block((-0.042, -0.065, -0.042), (0.075, 0.065, 0.042)),
        rod((0.075, 0.0, 0.0), (0.165, 0.0, 0.0), 0.041),
    )
    return Link("arm_link3", tuple(parts), mass, covers)


def roll(mass: float) -> Link:
    """Behind the roll: tube and the fork of the wrist, at whose centre its frame is."""
    start = 0.167 - T.fore
    parts = [
        tube(start, start + 0.014, 0.037, "aluminium"),
        tube(start + 0.014, -0.055, 0.029, "carbon"),
        block((-0.066, -0.046, -0.026), (-0.046, 0.046, 0.026), "shell_white"),
        *cheeks(-0.048, 0.0, 0.038, 0.026),
        rod((0.0, 0.038, 0.0), (0.0, 0.048, 0.0), 0.030, "shell_white"),
        rod((0.0, -0.038, 0.0), (0.0, -0.048, 0.0), 0.030, "shell_white"),
    ]
    covers = (
        rod((start, 0.0, 0.0), (-0.055, 0.0, 0.0), 0.034),
        block((-0.066, -0.050, -0.030), (0.030, 0.050, 0.030)),
    )
    return Link("arm_link4", tuple(parts), mass, covers)


def wrist(mass: float) -> Link:
    """The wrist's barrel and the last roll's housing ahead of it."""
    parts = [
        rod((0.0, -0.036, 0.0), (0.0, 0.036, 0.0), 0.031, "module_black"),
        tube(0.020, 0.066, 0.032, "module_black"),
        tube(0.050, 0.054, 0.033, "accent_blue", mass=0.0),
    ]
    cover = block((-0.031, -0.036, -0.033), (0.066, 0.036, 0.033))
    return Link("arm_link5", tuple(parts), mass, (cover,))


def hand(mass: float) -> Link:
    """Flange and a parallel gripper, half open; the tip lies between the fingers' ends."""
    tip = T.hand
    parts: list[Part] = [
        tube(0.068, 0.078, 0.033, "aluminium"),
        block((0.078, -0.048, -0.024), (0.116, 0.048, 0.024), "shell_white"),
        block((0.112, -0.046, -0.010), (0.118, 0.046, 0.010), "dark_aluminium"),
    ]
    for side in (1.0, -1.0):
        for corner, size, material in finger(tip):
            low, high = sorted((side * corner[1], side * size[1]))
            parts.append(block((corner[0], low, corner[2]), (size[0], high, size[2]), material))
    covers = (
        block((0.066, -0.048, -0.033), (0.118, 0.048, 0.033)),
        block((0.118, -0.042, -0.012), (tip, 0.042, 0.012)),
    )
    return Link("arm_link6", tuple(parts), mass, covers)


def finger(tip: float) -> Iterator[tuple[Triple, Triple, str]]:
    """Opposite corners of one finger's parts, at positive y."""
    yield (0.118, 0.028, -0.011), (0.140, 0.042, 0.011), "finger_steel"
    yield (0.134, 0.030, -0.010), (tip, 0.040, 0.010), "finger_steel"
    yield (tip - 0.036, 0.026, -0.011), (tip, 0.030, 0.011), "balloon"
