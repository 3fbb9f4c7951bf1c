"""A quadruped's body along a helix over its four feet.

The body centre goes from (0, 0, 150) to (50, 0, 150), three turns up a helix of radius 50 and pitch 10 about
the vertical through the start, to (50, 0, 180), and back to (0, 0, 180), in millimetres above the plane of
the foot-ball centres; its orientation stays.

Source: MANA, a quadruped as a parallel manipulator with four SRRR limbs, section 5.3.1. The paper gives no
times; those here are chosen.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "mana"
CLEARANCE = 0.005  # [m], between links, and of all but the feet from the ground
BALL = 0.0075  # [m], radius of the feet's balls, whose centres are the feet's frames


def script(
    robot: wb.Robot,
    *,
    radius: float = 0.05,
    pitch: float = 0.01,
    turns: float = 3.0,
    seconds_per_turn: float = 3.0,
    margin: float = 0.02,
    friction: float = 0.7,
) -> wb.Script:
    """Out to the helix, along it, and back over the start.

    Args:
        robot: MANA.
        radius: of the helix [m].
        pitch: rise of one turn [m].
        turns: how many.
        seconds_per_turn: [s].
        margin: stability margin kept [m].
        friction: of the feet on the ground [-].
    """
    height = 0.150
    start = robot.state("stand")

    def at(x: float, y: float, z: float) -> Any:
        return pin.SE3(np.eye(3), np.array([x, y, z]))

    def helix(s: float) -> Any:
        angle = 2.0 * np.pi * turns * s
        return at(radius * np.cos(angle), radius * np.sin(angle), height + pitch * turns * s)

    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -BALL), friction=friction)

    def phase(name: str, path: wb.Path, seconds: float) -> wb.Phase:
        """The body exactly along a path: with four feet on the ground that leaves no joint any choice."""
        return wb.Phase(
            name,
            contacts=[wb.Contact(foot, friction=friction) for foot in robot.feet.values()],
            hard=[wb.PoseTask("body", path)],
            limits=[
                wb.JointLimits(),
                wb.SupportPolygon(margin=margin),
                wb.SelfCollision(CLEARANCE),
                wb.Obstacles([ground], CLEARANCE),
            ],
            duration=seconds,
        )

    first, last = helix(0.0), helix(1.0)
    above = at(0.0, 0.0, float(last.translation[2]))
    seconds = turns * seconds_per_turn
    level = at(0.0, 0.0, height)
    return wb.Script(
        phase("settle", wb.MinJerk(start.pose("body"), level, 0.5), 0.5),
        phase("out", wb.MinJerk(level, first, 1.5), 1.5),
        phase("helix", wb.Curve(helix, seconds), seconds),
        phase("back", wb.MinJerk(last, above, 1.5), 1.5),
    )
