"""A quadruped's body shifted and turned over its four feet, out and back.

The body is moved by (40, 30, 30) mm and back, then turned by 20 degrees about x, y and z, each alone, out and
back, from its centre 150 mm above the plane of the foot-ball centres.

Source: MANA, section 5.3.2. The paper combines the shift with all three turns at once; that is out of the
legs' reach, at 0.62 of it at most, and `simultaneous=true` shows so. What can be done is the shift, then each
turn by itself. The paper gives no periods; those here are chosen.
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
    shift_x: float = 0.04,
    shift_y: float = 0.03,
    shift_z: float = 0.03,
    turn: float = 20.0,
    seconds: float = 3.0,
    simultaneous: bool = False,
    margin: float = 0.02,
    friction: float = 0.7,
) -> wb.Script:
    """The shift, then a turn about each axis, out and back.

    Args:
        robot: MANA.
        shift_x: how far the body is shifted along x [m].
        shift_y: likewise along y.
        shift_z: likewise up.
        turn: about each axis [degrees].
        seconds: of each way out and back.
        simultaneous: all at once, as printed; no plan exists, and the message says how far it gets.
        margin: stability margin kept [m].
        friction: of the feet on the ground [-].
    """
    height = 0.150
    shift, angle = np.array([shift_x, shift_y, shift_z]), np.radians(turn)

    def out_and_back(by: np.ndarray, rpy: np.ndarray) -> wb.Curve:
        def curve(s: float) -> Any:
            share = np.sin(np.pi * s)
            rotation = pin.rpy.rpyToMatrix(*(share * rpy))
            return pin.SE3(rotation, np.array([0.0, 0.0, height]) + share * by)

        return wb.Curve(curve, seconds)

    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -BALL), friction=friction)

    def phase(name: str, path: wb.Path, lasting: float) -> wb.Phase:
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
            duration=lasting,
        )

    level = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
    settle = phase("settle", wb.MinJerk(robot.state("stand").pose("body"), level, 0.5), 0.5)
    still = np.zeros(3)
    if simultaneous:
        everything = out_and_back(shift, np.full(3, angle))
        return wb.Script(settle, phase("shift and turn", everything, seconds))
    turns = {"x": (angle, 0.0, 0.0), "y": (0.0, angle, 0.0), "z": (0.0, 0.0, angle)}
    return wb.Script(
        settle,
        phase("shift", out_and_back(shift, still), seconds),
        [
            phase(f"turn about {axis}", out_and_back(still, np.array(rpy)), seconds)
            for axis, rpy in turns.items()
        ],
    )
