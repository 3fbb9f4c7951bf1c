"""A hexapod's thorax moved on three suction cups.

Standing on legs 1, 3 and 5 with the other three lifted, the thorax is raised and tilted within a quarter of a
second, held, and brought back; then all six feet are on the ground again.

Source: Hex-Piderix, thorax motion on three legs by screw theory; the stance is that of its numeric example,
as corrected in the robot's README. The paper shows the experiment's motion only in figures, so its size is
chosen.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "hexpiderix"
CLEARANCE = 0.005  # [m], between links, and of all but the feet from the ground

STANCE = ("leg1_foot", "leg3_foot", "leg5_foot")
LIFTED = ("leg2_foot", "leg4_foot", "leg6_foot")


def script(
    robot: wb.Robot,
    *,
    heave: float = -0.015,
    tilt: float = 4.0,
    seconds: float = 0.25,
    lift: float = 0.02,
    acceleration: float = 80.0,
    margin: float = 0.02,
    friction: float = 0.7,
) -> wb.Script:
    """Lift three legs, move the thorax, hold, move back, put the legs down.

    Args:
        robot: Hex-Piderix.
        heave: how far the thorax rises [m].
        tilt: about its x axis [degrees].
        seconds: of the motion, as in the paper's figures.
        lift: how high the free feet are lifted [m].
        acceleration: of the joints at most [rad/s^2]; the paper's quarter of a second takes 64.
        margin: stability margin kept [m].
        friction: of the cups on the ground [-].
    """
    start = robot.state("example")
    home = start.pose("thorax")
    moved = pin.SE3(
        pin.exp3(np.array([np.radians(tilt), 0.0, 0.0])), home.translation + np.array([0.0, 0.0, heave])
    )
    ground = {foot: start.pose(foot).translation for foot in LIFTED}
    raised = {foot: point + np.array([0.0, 0.0, lift]) for foot, point in ground.items()}

    floor = wb.Obstacle("ground", wb.Ground(), friction=friction)

    def phase(
        name: str,
        feet: tuple[str, ...],
        thorax: wb.Path,
        lasting: float,
        free: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> wb.Phase:
        """The thorax along a path on these feet, the free feet to their places."""
        moves = [wb.PositionTask(foot, wb.MinJerk(wb.AS_IS, goal, lasting)) for foot, goal in free.items()]
        return wb.Phase(
            name,
            contacts=[wb.Contact(foot, friction=friction) for foot in feet],
            hard=[wb.PoseTask("thorax", thorax), *moves],
            limits=[
                wb.JointLimits(acceleration=acceleration),
                wb.SupportPolygon(margin=margin),
                wb.SelfCollision(CLEARANCE),
                wb.Obstacles([floor], CLEARANCE),
            ],
            duration=lasting,
        )

    return wb.Script(
        phase("stand", (*STANCE, *LIFTED), wb.Hold(home), 0.2),
        phase("lift", STANCE, wb.Hold(home), 0.6, free=raised),
        phase("move", STANCE, wb.MinJerk(home, moved, seconds), seconds, free=raised),
        phase("hold", STANCE, wb.Hold(moved), 0.3, free=raised),
        phase("return", STANCE, wb.MinJerk(moved, home, seconds), seconds, free=raised),
        phase("lower", STANCE, wb.Hold(home), 0.6, free=ground),
        phase("stand again", (*STANCE, *LIFTED), wb.Hold(home), 0.2),
        start=start,
    )
