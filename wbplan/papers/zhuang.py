"""Zhuang's large-load hexapod: leg kinematics."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from wbplan.mechanism import Platform, ThreeJointLeg
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

row = partial(Row, "Zhuang")
#: Directions of legs 1 to 6 [deg].
PHI = (120.0, 180.0, 240.0, 300.0, 360.0, 60.0)


def legs() -> dict[str, ThreeJointLeg]:
    """The six legs of the shipped robot."""
    robot = load_robot("heavy_hexapod")
    return dict(Platform.of_robot(robot, robot.state("stand")).legs)


def forward() -> list[Row]:
    """Equations 3 and 5 to 15: the foot of every leg."""
    random = np.random.default_rng(0)
    worst = inverse = standing = 0.0
    for phi, leg in zip(np.radians(PHI), legs().values(), strict=True):
        lc, lt, ls = leg.l1, leg.l2, leg.l3
        for _ in range(40):
            theta, hip, knee = random.uniform(-0.5, 0.5), random.uniform(-1.5, 1.5), random.uniform(-2.6, 0.0)
            span = lc + lt * math.cos(hip) + ls * math.cos(hip + knee)
            height = ls * math.sin(hip + knee) + lt * math.sin(hip)
            printed, turned_back = (
                leg.placement.translation
                + [span * math.cos(s * phi + theta), span * math.sin(s * phi + theta), height]
                for s in (1.0, -1.0)
            )
            foot = leg.foot([theta, hip, knee])
            worst = max(worst, float(np.abs(printed - foot).max()))
            inverse = max(inverse, float(np.abs(turned_back - foot).max()))
        # beta (thigh and shin together) in 0 to 150 deg, the hip at most 90: how deep is the foot then?
        hips, betas = np.meshgrid(np.radians(np.arange(-90, 91, 2)), np.radians(np.arange(0, 151, 2)))
        standing = min(standing, float((lt * np.sin(hips) + ls * np.sin(betas)).min()))
    tucked = float(legs()["leg1"].l2)
    return [
        row("eqs 12-15", "foot of every leg, worst error", 0.0, worst, 1e-9, "m"),
        row(
            "eq 3",
            "foot with the printed rotation",
            0.0,
            inverse,
            1e-6,
            "m",
            "it is the inverse, Rz(-Phi)",
            True,
        ),
        row(
            "section 3.1",
            "shin points down for some beta in 0 to 150 deg",
            "yes",
            "no" if standing >= -tucked - 1e-12 else "yes",
            why="beta < 0 stands: read it as |gamma| or downwards",
            misprint=True,
        ),
    ]


def equation_19() -> list[Row]:
    """Inverse kinematics: the printed radicands, and with the square that they lack."""
    leg = legs()["leg1"]
    lc, lt, ls = leg.l1, leg.l2, leg.l3
    tried = printed = squared = up = ours = 0
    for theta in np.radians(np.linspace(-30, 30, 5)):
        for hip in np.radians(np.linspace(-60, 80, 15)):
            for knee in np.radians(np.linspace(5, 145, 15)):
                span = lc + lt * math.cos(hip) + ls * math.cos(hip + knee)
                height = lt * math.sin(hip) + ls * math.sin(hip + knee)
                rho = span - lc
                xi = rho**2 + height**2 - ls**2
                if rho <= 0.02 or xi + lt**2 <= 0.0 or abs(math.atan2(height, rho)) > 1.5:
                    continue
                tried += 1
                printed += _solves(4 * ls**2 * lt**2 - (xi - lt**2), xi, height, lt, hip)
                squared += _solves(4 * ls**2 * lt**2 - (xi - lt**2) ** 2, xi, height, lt, hip)
                foot = leg.foot([theta, hip, knee])
                free = ThreeJointLeg(lc, lt, ls, placement=leg.placement)
                found = free.solve(foot)
                ours += any(np.abs(s.joints - [theta, hip, knee]).max() < 1e-8 for s in found.within)
                up += any(s.joints[2] < 0.0 for s in found.within)
    share = 100.0 / tried
    return [
        row(
            "eq 19",
            f"hip solved, radicands as printed (of {tried})",
            100.0,
            printed * share,
            1e-6,
            "%",
            "(xi - lt^2) lacks its square",
            True,
        ),
        row("eq 19", "hip solved, radicands with the square", 100.0, squared * share, 1e-6, "%"),
        row("eq 19", "all joints recovered, atan2 form", 100.0, ours * share, 1e-6, "%"),
        row(
            "eq 19",
            "knee-up solution found too",
            None,
            up * share,
            unit="%",
            why="eq 19 gives gamma >= 0 only; standing needs < 0",
        ),
    ]


def _solves(radicand: float, xi: float, height: float, lt: float, hip: float) -> bool:
    """Whether eq. 19's hip angle, with this radicand in both places, is the right one."""
    if radicand < -1e-15:
        return False
    root = math.sqrt(max(radicand, 0.0))
    norm = math.sqrt((xi + lt**2) ** 2 + max(radicand, 0.0))
    sine = 2 * lt * height / norm
    if abs(sine) > 1.0 + 1e-12:
        return False
    return abs(math.asin(min(max(sine, -1.0), 1.0)) - math.atan(root / (xi + lt**2)) - hip) < 1e-8


TABLES = (forward, equation_19)
