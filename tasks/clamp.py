"""Coordinated clamping of a box with two leg-arm limbs.

The hexapod stands on six legs, steps legs 3 and 6 forward so that four can carry, turns limbs 1 and 2 into
arms, clamps a box between their palms, lifts it and takes it along a path of six degrees of freedom while
the body makes up for what two limbs of five joints lack, puts it down, and stands on six legs again.

Source: Zheng, Xu, Tian, Ding, "Different manipulation mode analysis of a radial symmetrical hexapod robot
with leg-arm integration", 2022, section 5.1 and figure 21. The paper gives no box, path or times; those
here are chosen.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "legarm_hexapod"

ARMS = ("limb1", "limb2")
STEPPERS = ("leg3_foot", "leg6_foot")
CARRIERS = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
SIX = ("limb1_foot", "limb2_foot", *CARRIERS)
REAR_AND_ARMS = ("limb1_foot", "limb2_foot", "leg4_foot", "leg5_foot")

BOX_SIZE = (0.25, 0.15, 0.12)  # [m]
BACK = -0.06  # where the body is kept [m] along y while the arms are ahead of it
TALL = 0.29  # body height [m] for stepping: lower down, the shanks' limit leaves feet no room to rise
STEP = 0.03  # how high feet rise [m]
CLEARANCE = 0.005  # [m], of all that is not meant to touch
INFLUENCE = 0.02  # [m], within which things are held apart; further ones are not reached in a tick
ACROSS = np.radians(100.0)  # joint 4 with arm 1 across the shank: there the foot can pass behind it
PALMS = tuple((f"{limb}_{link}", "box") for limb in ARMS for link in ("arm2", "jaw_a", "jaw_b"))
HIGH = 0.32  # body height [m] aimed at while four legs carry: the taller, the less their hips' servos hold


def script(
    robot: wb.Robot,
    *,
    box_x: float = 0.0,
    box_y: float = 0.46,
    box_z: float = 0.06,
    mass: float = 0.8,
    lift: float = 0.10,
    margin: float = 0.04,
    stride: float = 0.16,
    friction: float = 0.7,
) -> wb.Script:
    """The experiment's steps (a) to (i).

    Args:
        robot: the leg-arm hexapod.
        box_x: where the box stands at first and at last [m], world.
        box_y: likewise; +y is ahead, between the two limbs.
        box_z: height of the box's centre [m]; 0.06 stands on the ground.
        mass: of the box [kg].
        lift: how high the box is lifted [m].
        margin: stability margin kept throughout [m].
        stride: how far legs 3 and 6 step forward [m]; the less, the nearer the CoM comes to their edge.
        friction: of the feet on the ground [-].
    """
    stand = robot.state("stand")
    home = {foot: stand.pose(foot).translation for foot in SIX}
    ahead = {
        foot: home[foot] + np.array([-stride / 2 * np.sign(home[foot][0]), stride, 0.0]) for foot in STEPPERS
    }
    raised = {f"{limb}_foot": home[f"{limb}_foot"] + np.array([0.0, 0.0, STEP]) for limb in ARMS}
    box = wb.Body("box", mass=mass, size=BOX_SIZE, pose=_pose((box_x, box_y, box_z)))
    arms_out = {joint: value for joint, value in robot.poses["manipulate"].items() if joint.startswith(ARMS)}
    legs_under = {f"{limb}_joint{k}": stand.joint(f"{limb}_joint{k}") for limb in ARMS for k in (1, 2, 3)}
    ground = wb.Obstacle("ground", wb.Ground(), friction=friction)

    def limits(touching: Iterable[str | tuple[str, str]]) -> list[Any]:
        """All that every phase keeps; `touching` may touch the ground, or what they are named with."""
        return [
            wb.JointLimits(speed=0.8),
            wb.SupportPolygon(margin=margin),
            wb.SelfCollision(CLEARANCE, INFLUENCE),
            wb.Obstacles([ground], CLEARANCE, INFLUENCE, except_for=tuple(touching)),
        ]

    def phase(
        name: str,
        feet: Iterable[str],
        role: str,
        seconds: float,
        touching: Iterable[str | tuple[str, str]] = (),
        **fields: Any,
    ) -> wb.Phase:
        return wb.Phase(
            name,
            contacts=[wb.Contact(foot, friction=friction) for foot in feet],
            roles=dict.fromkeys(ARMS, role),
            limits=limits(touching),
            duration=seconds,
            **fields,
        )

    def body(height: float, seconds: float) -> list[wb.Task]:
        """The body level at a height over its place, the joints towards their stance."""
        goal = wb.MinJerk(wb.AS_IS, _pose((0.0, 0.0, height)), seconds)
        return [wb.PoseTask("body", goal, weight=(10.0, 10.0)), _posture(robot.poses["stand"], seconds, 0.1)]

    def free_body(seconds: float) -> list[wb.Task]:
        """The body where the arms need it, else near its stance."""
        near = wb.MinJerk(wb.AS_IS, _pose((0.0, BACK, HIGH)), seconds)
        return [
            wb.PoseTask("body", near, weight=((0.5, 0.5, 20.0), 0.5)),
            _posture(robot.poses["stand"], seconds, 0.1),
        ]

    def arms(joints: Iterable[str], seconds: float) -> wb.PostureTask:
        """Both limbs' joints of these names to their place in the pose 'manipulate'."""
        wanted = {joint: value for joint, value in arms_out.items() if joint.endswith(tuple(joints))}
        return _posture(wanted, seconds, 1.0, name="arms")

    def palms(gap: float, seconds: float) -> list[wb.Task]:
        """Both palms `gap` [m] from the box's sides and facing them; they may turn about their own axis."""
        tasks = []
        for limb, side in (("limb1", -1.0), ("limb2", 1.0)):
            inward = _pose((side * (BOX_SIZE[0] / 2 + gap), 0.0, 0.0), (0.0, 0.0, 0.0 if side < 0 else 180.0))
            path = wb.MinJerk(wb.AS_IS, box.pose * inward, seconds)
            tasks.append(wb.PoseTask(f"{limb}_tip", path, weight=(200.0, (0.0, 100.0, 100.0))))
        return tasks

    def feet_to(places: Mapping[str, np.ndarray], seconds: float) -> list[wb.Task]:
        """Feet straight to their places, from rest to rest."""
        return [wb.PositionTask(foot, wb.MinJerk(wb.AS_IS, place, seconds)) for foot, place in places.items()]

    def step_to(places: Mapping[str, np.ndarray], seconds: float) -> list[wb.Task]:
        """Legs 3 and 6 through the air to their places."""
        return [wb.PositionTask(foot, wb.Swing(wb.AS_IS, places[foot], STEP, seconds)) for foot in STEPPERS]

    def carry(name: str, path: wb.Path, seconds: float, touching: Iterable[str] = ()) -> wb.Phase:
        """The box, clamped between both palms, along a path."""
        return phase(
            name,
            CARRIERS,
            "arm",
            seconds,
            touching,
            carried=[wb.Carried(box, by="limb1_tip", grip=wb.Grip("limb2_tip", friction=friction))],
            hard=[wb.RelativePoseTask("limb2_tip", root="limb1_tip")],
            soft=[wb.PoseTask("box", path, weight=(400.0, 200.0)), *free_body(seconds)],
        )

    def beside(xyz: tuple[float, float, float], rpy_deg: tuple[float, float, float]) -> Any:
        """A pose of the box against where it stands."""
        return _pose(tuple(box.pose.translation + np.array(xyz)), rpy_deg)

    above = beside((0.0, 0.0, lift), (0.0, 0.0, 0.0))
    tour = wb.Waypoints(
        (0.0, 2.0, 4.0, 6.0, 8.0),
        (
            wb.AS_IS,
            beside((0.005, 0.00, lift + 0.03), (3.0, 0.0, 1.0)),
            beside((0.00, 0.02, lift + 0.02), (3.0, 3.0, 0.0)),
            beside((-0.005, 0.00, lift + 0.03), (3.0, 0.0, -1.0)),
            above,
        ),
    )
    shoulder, elbow, wrist = ("joint1", "joint2", "joint3"), ("joint4",), ("joint5",)
    folding = {
        f"{limb}_{joint}": wb.MinJerk(wb.AS_IS, value, 1.2)
        for limb in ARMS
        for joint, value in (("joint4", ACROSS), ("joint5", 0.0), ("finger_a", 0.0), ("finger_b", 0.0))
    }
    unfolding = {
        f"{limb}_{joint}": wb.MinJerk(wb.AS_IS, value, 1.6)
        for limb in ARMS
        for joint, value in (("joint4", ACROSS), ("shank2", 0.0))
    }
    return wb.Script(
        # (a) six-legged stance; the body rises to give the feet room
        phase("a stand", SIX, "leg", 1.2, soft=body(TALL, 1.2)),
        # (b) legs 3 and 6 step forward, the body moves over the four that will carry
        phase("b step forward", REAR_AND_ARMS, "leg", 1.5, hard=step_to(ahead, 1.5), soft=body(TALL, 1.5)),
        phase("b shift", SIX, "leg", 0.8, soft=free_body(0.8)),
        # (c) limbs 1 and 2 lift and become arms: elbow half way and shank first, then all the rest
        phase("c lift", CARRIERS, "leg", 0.8, hard=feet_to(raised, 0.8), soft=free_body(0.8)),
        phase("c raise", CARRIERS, "leg", 1.2, soft=[arms(shoulder, 1.2), *free_body(1.2)]),
        phase(
            "c unfold", CARRIERS, "leg", 1.6, driven=unfolding, soft=[arms(shoulder, 1.6), *free_body(1.6)]
        ),
        phase("c open", CARRIERS, "arm", 1.2, soft=[arms((*shoulder, *elbow, *wrist), 1.2), *free_body(1.2)]),
        # (d) both palms reach the box and clamp it
        phase("d reach", CARRIERS, "arm", 2.5, soft=[*palms(0.04, 2.5), *free_body(2.5)]),
        phase("d clamp", CARRIERS, "arm", 1.0, PALMS, soft=[*palms(0.0, 1.0), *free_body(1.0)]),
        # (e) lift it, and take it along a path of six degrees of freedom
        carry("e lift", wb.MinJerk(wb.AS_IS, above, 2.0), 2.0, ["box"]),
        carry("e move", tour, 8.0),
        # (f) put it down; arms back and folded, in the reverse order
        carry("f lower", wb.MinJerk(wb.AS_IS, box.pose, 2.0), 2.2, ["box"]),
        phase("f release", CARRIERS, "arm", 1.0, PALMS, soft=[*palms(0.04, 1.0), *free_body(1.0)]),
        phase(
            "f withdraw", CARRIERS, "arm", 2.0, soft=[arms((*shoulder, *elbow, *wrist), 2.0), *free_body(2.0)]
        ),
        phase(
            "f close",
            CARRIERS,
            "arm",
            1.2,
            driven=folding,
            soft=[arms(shoulder, 1.2), *free_body(1.2)],
        ),
        phase("f fold", CARRIERS, "leg", 1.6, soft=[arms(shoulder, 1.6), *free_body(1.6)]),
        # (g) limbs 1 and 2 return to the ground
        phase(
            "g lower",
            CARRIERS,
            "leg",
            1.5,
            soft=[_posture(legs_under, 1.5, 1.0, name="limbs"), *body(TALL, 1.2)],
        ),
        phase(
            "g touch",
            CARRIERS,
            "leg",
            0.8,
            hard=feet_to({foot: home[foot] for foot in raised}, 0.8),
            soft=body(TALL, 0.8),
        ),
        # (h) legs 3 and 6 step back
        phase("h step back", REAR_AND_ARMS, "leg", 1.5, hard=step_to(home, 1.5), soft=body(TALL, 1.5)),
        # (i) six-legged stance
        phase("i stand", SIX, "leg", 1.5, soft=body(stand.q[2], 1.2)),
        bodies=[box],
    )


def _pose(xyz: Iterable[float], rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """A pose from a place [m] and a rotation vector [degrees]."""
    return pin.SE3(pin.exp3(np.radians(rpy_deg)), np.array(tuple(xyz)))


def _posture(
    joints: Mapping[str, float], seconds: float, weight: float, name: str = "posture"
) -> wb.PostureTask:
    """Joints from where they are to their values, from rest to rest."""
    return wb.PostureTask(
        {joint: wb.MinJerk(wb.AS_IS, value, seconds) for joint, value in joints.items()},
        weight=weight,
        gain=10.0,
        name=name,
    )
