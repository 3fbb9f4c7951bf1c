"""Zheng's equations 22, 26, 27 and 31 as printed, beside what is right."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wbplan.mechanism import FiveJointLimb
from wbplan.papers.rows import Row
from wbplan.papers.zheng import limb

Array = NDArray[np.float64]
row = partial(Row, "Zheng")


def _same(first: float, second: float) -> bool:
    """Equal modulo a turn."""
    return abs(math.remainder(first - second, 2.0 * math.pi)) < 1e-8


def equation_31(count: int = 300) -> list[Row]:
    """Joints 2 and 3 from the wrist: printed with atan2(ta, tb) and arccos(...) - pi for both signs."""
    arm, random = limb(), np.random.default_rng(6)
    printed = right = 0
    for _ in range(count):
        q = random.uniform(arm.lower, arm.upper)
        ta = arm.l2 * math.cos(q[1]) + arm.l31 * math.cos(q[1] + q[2])
        tb = arm.l2 * math.sin(q[1]) + arm.l31 * math.sin(q[1] + q[2])
        s = math.hypot(ta, tb)
        hip = math.acos((s**2 + arm.l2**2 - arm.l31**2) / (2 * s * arm.l2))
        knee = math.acos(np.clip((arm.l2**2 + arm.l31**2 - s**2) / (2 * arm.l2 * arm.l31), -1.0, 1.0))
        signs = (1.0, -1.0)
        as_printed = [(math.atan2(ta, tb) + k * hip, k * knee - math.pi) for k in signs]
        corrected = [(math.atan2(tb, ta) + k * hip, k * (knee - math.pi)) for k in signs]
        printed += any(_same(a, q[1]) and _same(b, q[2]) for a, b in as_printed)
        right += any(_same(a, q[1]) and _same(b, q[2]) for a, b in corrected)
    why = "atan2(tb, ta), +-(arccos - pi)"
    return [
        row("eq 31", "hip and knee solved, as printed", float(count), float(printed), why=why, misprint=True),
        row("eq 31", "hip and knee solved, corrected", float(count), float(right)),
        *_reach(arm),
    ]


def equations_26_27(count: int = 200) -> list[Row]:
    """Case 1: joint 5's angle for r33 = 1 and -1, the root for the shift, and the largest a."""
    arm, random = limb(), np.random.default_rng(7)
    printed = unsigned = right = tried = far = 0
    excess = 0.0
    for k in range(count):
        q, down = random.uniform(arm.lower, arm.upper), 1.0 if k % 2 else -1.0
        q[3] = (0.0 if down > 0.0 else math.pi) - q[1] - q[2]
        r = arm.pose(q).rotation
        tried += 1
        printed += _same((math.atan2(r[0, 0], r[1, 0]) - q[0]) / down, q[4])
        unsigned += _same((math.atan2(r[1, 0], r[0, 0]) - q[0]) / down, q[4])
        right += _same((math.atan2(down * r[1, 0], down * r[0, 0]) - q[0]) / down, q[4])
        # dl^2 + B dl + C = 0 for a wrist just out of reach, on the side that makes B negative
        b = -random.uniform(0.1, 1.0)
        c = random.uniform(0.0, b * b / 4.0)
        plus, minus = ((-b + sign * math.sqrt(b * b - 4.0 * c)) / 2.0 for sign in (1.0, -1.0))
        far += abs(plus) > abs(minus)
        depth = random.uniform(-0.25, 0.25)
        most = arm.l1 + math.sqrt((arm.l2 + arm.l31 + arm.l4) ** 2 - depth**2)
        x = random.uniform(0.0, math.pi)
        reach = math.hypot(most - arm.l1 - arm.l4 * math.cos(x), depth - arm.l4 * math.sin(x))
        excess = max(excess, reach - arm.reach[1])
    all_ = float(tried)
    return [
        row(
            "eq 26", "theta5 solved, as printed", all_, float(printed), why="arguments swapped", misprint=True
        ),
        row(
            "eq 26",
            "theta5 solved, arguments (y, x) only",
            all_,
            float(unsigned),
            why="half a turn off for r33 = -1",
            misprint=True,
        ),
        row("eq 26", "theta5 solved, atan2(r33 r21, r33 r11)", all_, float(right)),
        row(
            "eq 27",
            "B < 0: printed root is the smaller shift",
            all_,
            all_ - float(far),
            why="'+' is then the far one",
            misprint=True,
        ),
        row(
            "eq 27",
            "reach beyond 320 mm at the printed largest a",
            0.0,
            excess * 1e3,
            1e-6,
            "mm",
            "a_max = l1 + l4 cos thetax + sqrt(320^2 - (b - l4 sin thetax)^2)",
            True,
        ),
    ]


def _reach(arm: FiveJointLimb, count: int = 40000) -> list[Row]:
    """Eq. 22's disc against what joints 2 to 4 can really reach for a given thetax."""
    random = np.random.default_rng(4)
    disc = arm.l2 + arm.l31 + arm.l4
    radius, angle = disc * np.sqrt(random.uniform(size=count)), random.uniform(0, 2 * np.pi, count)
    x = random.uniform(-np.pi, np.pi, count)
    ta = radius * np.cos(angle) - arm.l4 * np.cos(x)
    tb = radius * np.sin(angle) - arm.l4 * np.sin(x)
    inside = (np.hypot(ta, tb) >= arm.reach[0]) & (np.hypot(ta, tb) <= arm.reach[1])
    lost = 100.0 * float(1.0 - inside.mean())
    return [
        row(
            "eq 22",
            "share of its disc out of reach for a given thetax",
            0.0,
            lost,
            0.5,
            "%",
            "only necessary: 80 <= S <= 320 mm",
            True,
        ),
        row("eq 31", "least distance of joint 4 from joint 2", None, arm.reach[0] * 1e3, unit="mm"),
        row("eq 31", "largest distance of joint 4 from joint 2", None, arm.reach[1] * 1e3, unit="mm"),
    ]


TABLES = (equations_26_27, equation_31)
