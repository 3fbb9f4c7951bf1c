"""A quadruped's arm tip stays where it is while its manipulability rises.

HIphanT stands on four feet with its arm ready. The tip's pose is held hard; body and arm move behind it to
where the tip is most mobile through the stance legs, and come to rest there.

Source: HIphanT, section 4.2. The paper's w goes from 6.54 to 6.835, by 4.5 %; its arm's geometry is not
given, so w itself cannot be compared. The rate at which w rises is chosen.
"""

from __future__ import annotations

import wbplan as wb

ROBOT = "hiphant"


def script(
    robot: wb.Robot,
    *,
    start: str = "ready",
    seconds: float = 14.0,
    kind: str = "whole",
    rate: float = 0.03,
    legs: float = 0.0,
    posture: float = 0.2,
    margin: float = 0.05,
    friction: float = 0.7,
) -> wb.Script:
    """Raise the manipulability with the tip at rest.

    Args:
        robot: HIphanT.
        start: pose to start from.
        seconds: for it.
        kind: of manipulability: translation, rotation or whole.
        rate: log w rises by at most this per second [1/s].
        legs: what a stance leg's joint counts beside one of the arm [-]; 0 as in the paper.
        posture: weight that draws the legs' joints to where they were [1/rad]; legs that end up far from it
            push against each other.
        margin: stability margin kept [m].
        friction: of the feet on the ground [-].
    """
    of_legs = {joint: posture for joint in robot.joint_names if not joint.startswith("arm")}
    raise_w = wb.Phase(
        "raise manipulability",
        contacts=[wb.Contact(foot, friction=friction) for foot in robot.feet.values()],
        hard=[wb.PoseTask("arm_tip")],
        soft=[
            wb.ManipulabilityTask("arm_tip", kind=kind, rate=rate, legs=legs),
            wb.PostureTask(weight=of_legs, gain=20.0),
        ],
        limits=[
            wb.JointLimits(),
            wb.SupportPolygon(margin=margin),
            wb.SelfCollision(),
            wb.Obstacles([wb.Obstacle("ground", wb.Ground())]),
        ],
        duration=seconds,
    )
    return wb.Script(raise_w, start=start)
