"""A four-legged robot stands on a slope and a step, and presses on a wall with its arm.

Two feet stand on a slope of 20 degrees, two on a step: the hull of the feet does not tell where the robot may
lean. The plan keeps its CoM in the static-equilibrium region, without the push and with it. The hand goes to
the wall and presses, the body leans and straightens meanwhile, and the hand lets go. A plan knows no springs:
position servos, as simulated, give way, and the wall feels 17 to 24 of the 30 N.

Source: ours; the robot is that of the HIphanT paper, which has no such experiment.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "hiphant"

REAR, FRONT = ("rr_foot", "lr_foot"), ("rf_foot", "lf_foot")
TIP = "arm_tip"
BALL = 0.032  # radius of a foot [m]: on a slope it touches beside its lowest point
DEPTH = 0.4  # of slope and step [m], along x


def script(
    robot: wb.Robot,
    *,
    slope: float = 20.0,
    step: float = 0.12,
    force: float = 30.0,
    wall: float = 0.95,
    height: float = 0.85,
    margin: float = 0.05,
    friction: float = 0.6,
) -> wb.Script:
    """Reach, touch, press, lean, let go.

    Args:
        robot: HIphanT.
        slope: under the rear feet, rising ahead [deg].
        step: height of what the front feet stand on [m].
        force: on the wall [N].
        wall: where its face is [m], along x.
        height: of the hand on it [m].
        margin: of the CoM in its region [m].
        friction: of feet and hand [-].
    """
    stand = robot.state("ready")
    tilt = np.radians(slope)
    rise = DEPTH / 2 * np.tan(tilt)  # of the slope's surface, at its middle
    feet = {foot: stand.pose(foot).translation + [0.0, 0.0, rise] for foot in REAR}
    feet |= {foot: stand.pose(foot).translation + [0.0, 0.0, step] for foot in FRONT}
    start = _standing(robot, stand, feet)
    normals = dict.fromkeys(REAR, (-np.sin(tilt), 0.0, np.cos(tilt))) | dict.fromkeys(FRONT, (0.0, 0.0, 1.0))
    world = _world(feet, tilt, step, wall, friction)
    obstacles = wb.Obstacles(world, except_for=[("arm_link6", "wall")])
    limits = [
        wb.JointLimits(speed=0.6),
        wb.SupportPolygon(margin=margin),
        wb.Forces(),
        obstacles,
        wb.SelfCollision(),
    ]
    contacts = [wb.Contact(foot, friction=friction, normal=normals[foot]) for foot in feet]
    body = start.pose("body")
    touch = pin.SE3(np.eye(3), np.array([wall, 0.0, height]))
    near = pin.SE3(np.eye(3), np.array([wall - 0.08, 0.0, height]))

    def phase(
        name: str, seconds: float, *, hand: Any = None, pushing: bool = False, lean: Any = None
    ) -> wb.Phase:
        goal = wb.MinJerk(wb.AS_IS, body * (lean or pin.SE3.Identity()), seconds)
        soft: list[wb.Task] = [
            wb.PoseTask("body", goal, weight=(5.0, 5.0)),
            wb.PostureTask(robot.poses["ready"], weight=0.1),
        ]
        if hand is not None:
            soft.append(wb.PoseTask(TIP, wb.MinJerk(wb.AS_IS, hand, seconds), weight=(100.0, 50.0)))
        held: list[wb.Task] = [wb.PoseTask(TIP)] if hand is None else []
        pushes = [wb.Push(TIP, (force, 0.0, 0.0))] if pushing else []
        return wb.Phase(
            name, contacts=contacts, hard=held, soft=soft, limits=limits, pushes=pushes, duration=seconds
        )

    lean = pin.SE3(np.eye(3), np.array([0.0, 0.04, 0.02]))
    return wb.Script(
        phase("reach", 2.5, hand=near),
        phase("touch", 1.0, hand=touch),
        phase("press", 1.5, pushing=True),
        phase("lean", 2.0, pushing=True, lean=lean),
        phase("straighten", 2.0, pushing=True),
        phase("let go", 1.0, hand=near),
        start=start,
    )


def _world(
    feet: dict[str, np.ndarray], tilt: float, step: float, wall: float, friction: float
) -> list[wb.Obstacle]:
    """Ground, slope, step and wall; the slope is as much lower as feet touch it beside their lowest point."""
    thick, wide = 0.1, 0.9
    turn = pin.exp3(np.array([0.0, -tilt, 0.0]))
    rear = np.mean([feet[foot] for foot in REAR], axis=0)
    front = np.mean([feet[foot] for foot in FRONT], axis=0)
    top = rear - np.array([0.0, 0.0, BALL * (1.0 / np.cos(tilt) - 1.0)])
    return [
        wb.Obstacle("ground", wb.Ground(), friction=friction),
        wb.Obstacle(
            "slope",
            wb.Box((DEPTH, wide, thick)),
            pin.SE3(turn, top - turn @ np.array([0.0, 0.0, thick / 2])),
            friction=friction,
        ),
        wb.Obstacle("step", wb.Box((DEPTH, wide, step)), (front[0], 0.0, step / 2), friction=friction),
        wb.Obstacle("wall", wb.Box((thick, 0.3, 1.1)), (wall + thick / 2, 0.0, 0.55), friction=friction),
    ]


def _standing(robot: wb.Robot, stand: wb.State, feet: dict[str, np.ndarray]) -> wb.State:
    """The ready pose with its feet at other heights, the body raised by their mean."""
    raised = stand.pose("body")
    raised.translation = raised.translation + [0.0, 0.0, np.mean([place[2] for place in feet.values()])]
    tasks: list[wb.Task] = [
        wb.PositionTask(foot, place, weight=100.0, gain=20.0) for foot, place in feet.items()
    ]
    tasks += [wb.PoseTask("body", raised, weight=(50.0, 50.0), gain=20.0), wb.PostureTask(stand, weight=0.05)]
    loop = wb.Loop(robot, wb.Phase("stand on it", soft=tasks, duration=4.0), stand, dt=0.02)
    for _ in range(200):
        loop.step()
    return robot.state(loop.q)
