"""Carrying an object in one limb while walking on the other five.

The hexapod walks in its 3+3 gait, switches to the pentapod gait without stopping while limb 1 becomes an arm,
takes an object off its stand as it passes, carries and turns it while walking in the mixture gait, puts it on
another stand, and switches back. The body shifts sideways to make up for what a limb of five joints lacks.

Source: Zheng, Xu, Tian, Ding, "Different manipulation mode analysis of a radial symmetrical hexapod robot
with leg-arm integration", 2022, sections 4 and 5.3 and figure 23. The paper gives no object, places, paths,
stride or times; those here are chosen, within what the joints' ranges leave.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "legarm_hexapod"

ARM = "limb1"
HAND = f"{ARM}_tip"
PADS = (f"{ARM}_pad_a", f"{ARM}_pad_b")
SPEED = 0.9  # share of the joints' speed limits
CLEARANCE = 0.005  # [m], of all that is not meant to touch
INFLUENCE = 0.02  # [m], within which things are held apart; further ones are not reached in a tick
FINGERS = tuple((f"{ARM}_jaw_{letter}", "object") for letter in "ab")
SIZE = (0.024, 0.008, 0.040)  # of the object [m]: along the gripper, across it, upright
ABOVE = 0.03  # over its stand, from where the object is lowered [m]
REACH = 0.030  # from the palm to the object's middle [m]
GRAB = (150.0, -42.0, 35.0, 7.0, -20.0)  # joints 1 to 5 [degrees] that reach for it: arm and tool level
AWAY = (110.0, -48.0, 38.0, 12.0, -20.0)  # likewise, turned away from what it has put down
CLEAR = (120.0, -15.0, 50.0)  # joints 1 to 3 of the limb as a leg in the air
ACROSS = {f"{ARM}_joint4": math.radians(100.0)}  # arm 1 across the shank: the foot passes behind it
ORDER = (
    ("joint4", "shank2"),
    ("joint4", "joint5", "finger_a", "finger_b"),
)  # else it would hit its own shank
TOUR = (  # joints 1 to 5 of the poses through which the object is carried
    (150.0, -45.0, 35.0, 22.0, -20.0),
    (152.0, -45.0, 35.0, 25.0, -22.0),
    (147.0, -43.0, 33.0, 30.0, -25.0),
    (150.0, -47.0, 37.0, 25.0, -15.0),
    (150.0, -42.0, 35.0, 20.0, -20.0),
    GRAB,
)


def script(
    robot: wb.Robot,
    *,
    radius: float = 0.40,
    height: float = 0.34,
    stride: float = 0.02,
    step_time: float = 1.0,
    margin: float = 0.06,
    mass: float = 0.1,
    grip: float = 10,
    friction: float = 0.7,
) -> wb.Script:
    """The experiment's steps (a) to (i).

    Args:
        robot: the leg-arm hexapod.
        radius: CR, of the circle that the feet stand on [m].
        height: of the body [m].
        stride: how far the body goes in a step [m].
        step_time: of a step [s].
        margin: stability margin kept throughout [m].
        mass: of the object [kg].
        grip: force of each finger [N].
        friction: of the feet on the ground [-].
    """
    walker = wb.gaits.Walker(robot)
    switch = wb.gaits.Switch(walker, ARM, radius, height)
    walking, carrying = switch.hexapod, switch.pentapod("mixture")
    beats = [
        *_named("a", wb.gaits.beats_of(walking, 5)),
        *_named("b", switch.to_pentapod()[:1]),
        *_named("d", switch.to_pentapod()[1:]),
        *_named("f", wb.gaits.beats_of(carrying, 22)),
        *_named("back", switch.to_hexapod()),
        *_named("end", wb.gaits.beats_of(walking, 4)),
    ]
    way = wb.gaits.straight(stride * (len(beats) - 2), math.pi / 2.0)
    made = wb.gaits.schedule(beats, switch.hexagon, way, step_time)
    rises = next(k for k, beat in enumerate(beats) if beat.raised)
    lands = next(k for k, beat in enumerate(beats) if ARM in beat.swing and k > rises)
    folding = wb.gaits.Unfolding(
        walker,
        ARM,
        _joints(GRAB),
        tuple(tuple(f"{ARM}_{joint}" for joint in group) for group in ORDER),
        _joints(CLEAR),
        step_time,
        via=ACROSS,
    )

    def clear(*touching: tuple[str, str]) -> tuple[Any, ...]:
        """The distances that are kept; what `touching` names may touch."""
        ground = wb.Obstacle("ground", wb.Ground(), friction=friction)
        return (
            wb.SelfCollision(CLEARANCE, INFLUENCE),
            wb.Obstacles([ground], CLEARANCE, INFLUENCE, except_for=touching),
        )

    def body(k: int, share: float = 0.0) -> Any:
        """The body's nominal pose in step k."""
        return wb.gaits.nominal(made.course, made.steps[k].begin + share * step_time, height)

    def hand(path: wb.Path) -> wb.Task:
        return wb.PoseTask(HAND, path, weight=(400.0, 200.0))

    def reach(k: int, path: wb.Path, **more: Any) -> dict[str, Any]:
        """Fields of step k: the hand on a path, the body beside its way."""
        free = wb.gaits.beside_way(walker, made.course, made.steps[k].begin, height)
        return {"hard": (hand(path),), "soft": (), "body": free, **more}

    def fingers(value: float, seconds: float) -> dict[str, wb.Path]:
        return {f"{ARM}_finger_{letter}": wb.MinJerk(wb.AS_IS, value, seconds) for letter in "ab"}

    out = folding.out(made.steps[rises - 1].support[ARM])
    back = replace(folding, pose=_joints(AWAY)).back()
    acts: dict[int, Any] = {rises + k: fields for k, fields in enumerate(out)}
    near = rises + len(out)  # first step as an arm
    takes = near + 2
    puts = takes + len(TOUR) + 2
    grasp, place = (body(k, 0.5) * _hand(robot, GRAB) for k in (takes, puts + 1))
    up = pin.SE3(np.eye(3), np.array([0.0, 0.0, ABOVE]))
    before = pin.SE3(np.eye(3), np.array([-0.06, 0.0, 0.0]))
    thing = wb.Body("object", mass=mass, size=SIZE, pose=grasp * _held())
    wide = robot.roles[ARM]["arm"][f"{ARM}_finger_a"]
    shut = _finger(SIZE[1] / 2.0, REACH - SIZE[0] / 2.0)
    held = {
        "carried": [wb.Carried(thing, by=HAND, pads=PADS, squeeze=grip)],
        "driven": {f"{ARM}_finger_{letter}": shut for letter in "ab"},
    }
    grasping = {"limits": (wb.JointLimits(speed=SPEED), wb.SupportPolygon(margin=margin), *clear(*FINGERS))}
    acts[near] = reach(near, wb.MinJerk(wb.AS_IS, grasp * before, step_time))
    acts[near + 1] = reach(near + 1, wb.MinJerk(wb.AS_IS, grasp, step_time))
    acts[takes] = reach(takes, wb.Hold(grasp), driven=fingers(shut, 0.5 * step_time), **grasping)
    acts[takes + 1] = reach(takes + 1, wb.MinJerk(wb.AS_IS, up * grasp, step_time), **held)
    for k, pose in enumerate(TOUR, start=takes + 2):
        goal = wb.MinJerk(wb.AS_IS, _hand(robot, pose), step_time)
        acts[k] = reach(k, wb.gaits.WithBody(made.course, made.steps[k].begin, goal, height), **held)
    acts[puts] = reach(puts, wb.MinJerk(wb.AS_IS, up * place, step_time), **held)
    acts[puts + 1] = reach(puts + 1, wb.MinJerk(wb.AS_IS, place, step_time), **held)
    acts[puts + 2] = reach(puts + 2, wb.Hold(place), driven=fingers(wide, 0.7 * step_time), **grasping)
    acts[puts + 3] = reach(puts + 3, wb.MinJerk(wb.AS_IS, place * before, step_time))
    acts |= {puts + 4 + k: fields for k, fields in enumerate(back)}
    acts |= {k: {"soft": (folding.posture(_joints(CLEAR)),)} for k in range(puts + 4 + len(back), lands - 1)}
    acts[lands - 1] = folding.lowered(made.steps[lands].swing[ARM][1], body(lands - 1, 1.0))
    manner = wb.gaits.Manner(
        step_time=step_time,
        height=0.01,
        margin=margin,
        friction=friction,
        speed=SPEED,
        settle=0.5,
        limits=clear(),
    )
    walk = wb.gaits.perform(switch, made, manner, acts)
    return wb.Script(walk.phases, bodies=[thing], start=walk.start)


def _named(letter: str, beats: Any) -> list[Any]:
    """Beats with the figure's letter before their names."""
    return [replace(beat, name=f"{letter} {beat.name}") for beat in beats]


def _joints(degrees: tuple[float, ...]) -> dict[str, float]:
    """Limb 1's first joints, by name."""
    return {f"{ARM}_joint{k}": math.radians(value) for k, value in enumerate(degrees, start=1)}


def _hand(robot: wb.Robot, degrees: tuple[float, ...]) -> Any:
    """The hand in the body at joints 1 to 5."""
    q = np.array(robot.state("manipulate").q)
    q[:7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    for joint, value in _joints(degrees).items():
        q[robot.joint_index(joint)[0]] = value
    return robot.state(q).pose(HAND)


def _held() -> Any:
    """The object in the hand."""
    return pin.SE3(np.eye(3), np.array([REACH, 0.0, 0.0]))


def _finger(half: float, ahead: float) -> float:
    """Angle [rad] at which a finger's rubber face meets an edge `half` [m] beside the hand's axis.

    The face is 8 mm inside the line from the finger's hinge, which is 9 mm beside the axis and 9 mm behind
    the palm; the edge is `ahead` [m] of the palm.
    """
    x, y = ahead + 0.009, half - 0.009
    return math.asin(0.008 / math.hypot(x, y)) + math.atan2(y, x)
