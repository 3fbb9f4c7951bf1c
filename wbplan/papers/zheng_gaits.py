"""Zheng's gaits on five legs: speeds, and margins while the body moves."""

from __future__ import annotations

from functools import partial

import numpy as np

from wbplan.gaits import cycle_margins, pentapod, regular_stance, step_margins
from wbplan.papers.rows import Row

row = partial(Row, "Zheng")
LEGS = tuple("23456")
#: The regular pentagon that is left when limb 1 is an arm: legs 2 to 6 from 36 degrees on.
STANCE = regular_stance(LEGS, first=np.radians(36.0))


def speeds() -> list[Row]:
    """Section 4.3: speeds by stroke s and swing time tau, at s = tau = 1."""
    gaits = pentapod(LEGS)
    mean = {name: gait.speed(1.0, gait.cycle) for name, gait in gaits.items()}
    longest = {name: gait.speed(1.0, gait.cycle, longest=True) for name, gait in gaits.items()}
    between = mean["4+1"] < mean["mixture"] < mean["3+2"]
    strictly = longest["4+1"] < longest["mixture"] < longest["3+2"]
    return [
        row("section 4.3", "speed of 4+1", 0.25, mean["4+1"], 1e-12, "s/tau"),
        row("section 4.3", "speed of the mixture gait", 0.5, mean["mixture"], 1e-12, "s/tau"),
        row("section 4.3", "speed of 3+2, s its mean stroke", 1.0 / 1.5, mean["3+2"], 1e-12, "s/tau"),
        row("section 4.3", "mixture between both, by mean stroke", "yes", "yes" if between else "no"),
        row(
            "section 4.3",
            "mixture between both, by longest stroke",
            "yes",
            "yes" if strictly else "no",
            why="as fast as 3+2 then: s/(2 tau)",
            misprint=True,
        ),
        *(
            row("section 4.3", f"duty factor of {name}", duty, gaits[name].duty_factor, 1e-12)
            for name, duty in (("4+1", 0.8), ("3+2", 0.6), ("mixture", 2 / 3))
        ),
    ]


def margins() -> list[Row]:
    """Section 4.2: margins of every step, and of a moving body with the worst heading."""
    out = []
    for name, gait in pentapod(LEGS).items():
        least = min(step.centre for step in step_margins(gait, STANCE))
        out.append(row("section 4.2", f"{name}: margin of the body's middle", 0.309, least, 5e-4, "CR"))
        for pace in (0.05, 0.10):
            worst = min(
                float(
                    cycle_margins(gait, STANCE, gait.step_count * pace * np.array([np.cos(a), np.sin(a)]))[
                        1
                    ].min()
                )
                for a in np.linspace(0.0, 2.0 * np.pi, 73)
            )
            what = f"{name}: the same, moving by {pace:.2f} CR a step"
            out.append(row("section 4.2", what, None, worst, unit="CR"))
    return out


TABLES = (speeds, margins)
