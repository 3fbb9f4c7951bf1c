"""A quadruped's arm tip moves sideways while the body sees to balance and manipulability.

HIphanT stands on four feet with its arm ready. Its tip goes 0.4 m along +y; its other axes and its
orientation do not move. Meanwhile the tip's manipulability through the stance legs is raised, and the CoM is
drawn to the middle of the feet; a weight of 0 leaves either out.

Source: HIphanT, section 4.3. The paper tells nothing of times but that the first 12.5 s are slow; those here
are chosen.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "hiphant"


def script(
    robot: wb.Robot,
    *,
    start: str = "ready",
    distance: float = 0.4,
    seconds: float = 20.0,
    hold: float = 2.0,
    manipulability: float = 1.0,
    balance: float = 1.2,
    rate: float = 0.03,
    posture: float = 0.14,
    margin: float = 0.05,
    clearance: float = 0.005,
    friction: float = 0.7,
) -> wb.Script:
    """Move the tip sideways with the two objectives, then hold it.

    Args:
        robot: HIphanT.
        start: pose to start from.
        distance: along +y [m].
        seconds: of the motion.
        hold: how long the tip is held afterwards [s].
        manipulability: weight of the tip's manipulability; 0 leaves it out.
        balance: weight of the CoM over the middle of the feet [1/m]; 0 leaves it out.
        rate: log w rises by at most this per second [1/s].
        posture: weight that draws the legs' joints to where they were [1/rad]; legs that end up far from it
            push against each other.
        margin: stability margin kept [m].
        clearance: kept between links, and from the ground [m]; 0 keeps none, as the paper does, and then the
            legs' lean brings the ends of their shanks into the ground.
        friction: of the feet on the ground [-].
    """
    tip = robot.state(start).pose("arm_tip")
    goal = pin.SE3(tip.rotation, tip.translation + np.array([0.0, distance, 0.0]))
    of_legs = {joint: posture for joint in robot.joint_names if not joint.startswith("arm")}
    soft: list[wb.Task] = [wb.PostureTask(weight=of_legs, gain=20.0)]
    if manipulability > 0.0:
        soft.append(wb.ManipulabilityTask("arm_tip", weight=manipulability, rate=rate))
    if balance > 0.0:
        soft.append(wb.BalanceTask(balance, settle=seconds / 4.0))
    ground = [wb.Obstacle("ground", wb.Ground())]
    clear: list[wb.SelfCollision | wb.Obstacles] = []
    if clearance > 0.0:
        clear = [wb.SelfCollision(clearance), wb.Obstacles(ground, clearance)]
    move = wb.Phase(
        "move sideways",
        contacts=[wb.Contact(foot, friction=friction) for foot in robot.feet.values()],
        hard=[wb.PoseTask("arm_tip", wb.MinJerk(tip, goal, seconds))],
        soft=soft,
        limits=[wb.JointLimits(), wb.SupportPolygon(margin=margin), *clear],
        duration=seconds + hold,
    )
    return wb.Script(move, start=start)
