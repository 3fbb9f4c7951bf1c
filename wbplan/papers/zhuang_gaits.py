"""Zhuang's gaits: sequences, speeds, swing and stance of the feet, walking modes."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wbplan.gaits import (
    MODES,
    CosineSwing,
    Manner,
    QuinticSwing,
    Walker,
    mode_named,
    pentagon,
    quadrangular,
    regular_stance,
    shares,
    step_margins,
    straight,
    tripod,
    walk,
)
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

Array = NDArray[np.float64]

row = partial(Row, "Zhuang")
LEGS = tuple("123456")
#: Table 2: the pairs that swing, in order.
TABLE_2 = (
    "25 36 14, 25 14 36, 36 25 14, 36 14 25, 14 25 36, 14 36 25, 24 36 15, 24 15 36, 36 24 15, "
    "36 15 24, 15 24 36, 15 36 24, 14 26 35, 14 35 26, 26 14 35, 26 35 14, 35 14 26, 35 26 14"
)
#: The swing in the checks: T_sw 1 s, t1 0.15 s, h_TB 0.05 m, h_max 0.34 m (the paper gives h_max only).
SWING, FIRST, LIFT, HIGH = 1.0, 0.15, 0.05, 0.34


def sequences() -> list[Row]:
    """Table 2 by its rule, and why its pairs are those."""
    found = {tuple("".join(sorted(pair)) for pair in gait.steps) for gait in quadrangular(LEGS)}
    printed = {tuple(order.split()) for order in TABLE_2.split(", ")}
    hexagon = regular_stance(LEGS)
    least = min(s.centre for g in quadrangular(LEGS) for s in step_margins(g, hexagon))
    return [
        row("Table 2", "sequences, by the rule", 18.0, float(len(found))),
        row("Table 2", "sequences printed and found", 18.0, float(len(found & printed))),
        row("Table 2", "margin of the body's middle, worst pair", 0.5, least, 1e-12, "R"),
    ]


def speeds() -> list[Row]:
    """Section 3.3: v = s n / (T u), at s = T = 1."""
    gaits = ((tripod(LEGS), 2.0), (quadrangular(LEGS)[0], 1.5), (pentagon(LEGS), 1.2))
    return [
        row("section 3.3", f"speed of {gait.name.split('-')[0]}", factor, gait.speed(1.0, 1.0), 1e-12, "s/T")
        for gait, factor in gaits
    ]


def swing() -> list[Row]:
    """Equations 20 to 22 as printed, corrected, and blended."""
    ahead, lift = np.array([0.6, 0.0, 0.0]), FIRST / SWING
    speed, second = LIFT / FIRST, SWING - FIRST
    plain = CosineSwing(np.zeros(3), ahead, HIGH, SWING, LIFT, lift)
    blended = CosineSwing(np.zeros(3), ahead, HIGH, SWING, LIFT, lift, smooth=True)
    quintic = QuinticSwing(np.zeros(3), ahead, HIGH, SWING)
    # From t2 on, printed: z = P1z + h_TB - v t, though the foot is at P1z + h_TB then.
    jump = -speed * second
    tiny = 1e-7
    before, after = plain.points(np.array([second - tiny, second + tiny]))[:, 2]
    return [
        row("eq 22", "z at t2, jump", 0.0, jump, 1e-6, "m", "-v t for -v (t - t2)", True),
        row("eq 22", "z at t2, jump, with -v (t - t2)", 0.0, float(after - before), 1e-6, "m"),
        row("eq 20", "vertical speed at lift-off", 0.0, _speed(plain, tiny), 1e-4, "m/s", "jumps to v", True),
        row("eq 20", "vertical speed at lift-off, blended", 0.0, _speed(blended, tiny), 1e-4, "m/s"),
        row("eq 20", "vertical speed at lift-off, quintic", 0.0, _speed(quintic, tiny), 1e-4, "m/s"),
        row(
            "eq 21",
            "highest point",
            HIGH,
            float(plain.points(np.linspace(0, 1, 1001))[:, 2].max()),
            1e-6,
            "m",
        ),
        row("eq 22", "end of the swing, x", 0.6, float(plain.at(SWING)[0]), 1e-12, "m"),
    ]


def _speed(path: CosineSwing | QuinticSwing, step: float) -> float:
    """Vertical speed [m/s] just after lift-off."""
    return float(path.points(np.array([step]))[0, 2] / step)


def stance() -> list[Row]:
    """Equations 23 to 25: do all standing feet go at one speed?"""
    out = []
    for table, name, others in (("eq 24", "quadrangular", 2), ("eq 25", "pentagon", 5)):
        own = np.linspace(0.0, 1.0 / others, 201)[:, None]
        # One half cosine over the whole stance, `others` groups of feet evenly behind one another.
        speed = 0.5 * math.pi * np.sin(math.pi * (own + np.arange(others) / others))
        gap = float((speed.max(axis=1) - speed.min(axis=1)).max())
        out.append(
            row(
                table,
                f"{name}: feet differ in speed by, of its mean",
                0.0,
                gap,
                1e-9,
                "",
                "they would slip",
                True,
            )
        )
    return out


def modes() -> list[Row]:
    """Which joint moves the body: share of the foot's speed along travel that abductors make."""
    walker = Walker(load_robot("heavy_hexapod"))
    outer, inner = ("leg1", "leg3", "leg4", "leg6"), ("leg2", "leg5")
    wanted = {
        "crab": ((outer, "NC"), (inner, "NC")),
        "ant": ((outer, "MC"), (inner, "MC")),
        "mixed1": ((outer, "MC"), (inner, "NC")),
        "mixed2": ((outer, "MC"), (inner, "MC")),
    }
    found = []
    for name, parts in wanted.items():
        mode = MODES[name]
        made = shares(walker, walker.stance(lean=mode.lean), mode.heading)
        for legs, word in parts:
            share = float(np.mean([made[leg][0] for leg in legs]))
            ours = "NC" if share < 1e-6 else "MC" if share > 0.5 else "AC"
            wrong = ours != word
            why = f"its share of the foot's speed is {share:.2f}"
            if (
                wrong and name == "mixed2"
            ):  # the crab's row has sin^2 of the lean, NC at 0 to MC at 60 degrees
                why += ": cos^2 60 deg, as it is sin^2 60 deg in mixed1; hip and knee make the rest"
            what = f"{name}: abductors of legs {', '.join(leg[-1] for leg in legs)}"
            found.append(row("section 4", what, word, ours, why=why, misprint=wrong and name == "mixed2"))
    return found


def experiment() -> list[Row]:
    """Section 5.1: the ant walk goes two strokes in a cycle."""
    walker = Walker(load_robot("heavy_hexapod"))
    mode = mode_named("ant")
    gait = tripod(walker.ring)
    done = walk(
        walker,
        gait,
        straight(1.2, mode.heading),
        0.2,
        stance=walker.stance(lean=mode.lean),
        manner=Manner(height=0.06),
    )
    lands = [s.swing["leg1"][1] for s in done.steps if "leg1" in s.swing]
    apart = float(np.linalg.norm(lands[2] - lands[1]))
    return [
        row("section 5.1", "way in a cycle, ant walk, strokes of 0.2 m", 0.4, done.stride or 0.0, 0.008, "m"),
        row("section 5.1", "footholds of leg 1 apart", 0.4, apart, 0.008, "m"),
    ]


TABLES = (sequences, speeds, swing, stance, modes, experiment)
