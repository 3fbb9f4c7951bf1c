"""Zheng's figures 14 to 16 and 23 on the robot: footholds, support and margins of the change of gait."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from wbplan.gaits import SHIFT, Beat, Switch, Walker
from wbplan.geometry import support_polygon
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

row = partial(Row, "Zheng")
#: CR and height [m] with the most room for strokes: taller, and feet nearer, than in the pose 'stand'.
RADIUS, HEIGHT = 0.40, 0.34


def switching() -> list[Row]:
    """Where the feet go, and the margins at the centre in every step of the change, by circle radius."""
    switch = Switch(Walker(load_robot("legarm_hexapod")), "limb1", RADIUS, HEIGHT)
    ahead = switch.hexagon.feet["limb1"]
    arm = math.atan2(ahead[1], ahead[0])
    places = {
        leg: math.degrees((arm - math.atan2(foot[1], foot[0])) % (2.0 * math.pi))
        for leg, foot in switch.pentagon.feet.items()
    }
    printed = {"limb2": 36.0, "leg3": 108.0, "leg4": 180.0, "leg5": 252.0, "leg6": 324.0}
    off = max(abs(places[leg] - angle) for leg, angle in printed.items())
    rows = [row("Fig 14", "feet from the arm's direction, off 36 + 72 k, worst", 0.0, off, 1e-9, "deg")]
    feet = dict(switch.hexagon.feet)
    expected = {"Fig 14": (0.5, 0.309), "Fig 15": (0.309, 0.5)}
    for figure, beats in (("Fig 14", switch.to_pentapod()), ("Fig 15", switch.to_hexapod())):
        for beat, margin in zip(beats, expected[figure], strict=True):
            legs = " ".join(leg for leg in feet if leg not in (*beat.swing, *beat.raised))
            found = _centre(feet, beat)
            rows.append(row(figure, f"centre margin on {legs}", margin, found, 5e-4, "CR"))
    five = switch.pentagon.feet
    for swing in switch.pentapod().steps:
        legs = " ".join(leg for leg in five if leg not in swing)
        margin = _margin(np.array([foot for leg, foot in five.items() if leg not in swing]))
        rows.append(row("Fig 19", f"centre margin on {legs}", 0.309, margin, 5e-4, "CR"))
    return [*rows, row("section 4.3", "default bound of the body's shift", 0.118, SHIFT, 1e-9, "CR")]


def _centre(feet: dict[str, np.ndarray], beat: Beat) -> float:
    """Margin of the body's centre [CR] in a step; `feet` is brought to its end."""
    for leg in (*beat.swing, *beat.raised):
        feet.pop(leg, None)
    margin = _margin(np.array(list(feet.values())))
    if beat.stance is not None:
        feet.update({leg: beat.stance.feet[leg] for leg in beat.swing})
    return margin


def _margin(feet: np.ndarray) -> float:
    return float(support_polygon(feet).margin(np.zeros(2))) / RADIUS


TABLES = (switching,)
