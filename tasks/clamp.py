"""Coordinated clamping of a box with two leg-arm limbs.

The hexapod stands on six legs, steps legs 3 and 6 forward so that four can carry, turns limbs 1 and 2 into
arms, clamps a box between their palms, lifts it and takes it along a path of six degrees of freedom while
the body makes up for what two limbs of five joints lack, puts it down, and stands on six legs again.

Source: Zheng, Xu, Tian, Ding, "Different manipulation mode analysis of a radial symmetrical hexapod robot
with leg-arm integration", 2022, section 5.1 and figure 21.
"""

import numpy as np
import pinocchio as pin

import wbplan as wb

ROBOT = "legarm_hexapod"

ARMS = ("limb1", "limb2")
CARRIERS = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
SIX = ("limb1_foot", "limb2_foot", *CARRIERS)
STEPPERS = ("leg3_foot", "leg6_foot")


def script(
    robot: wb.Robot,
    *,
    box_x: float = 0.0,
    box_y: float = 0.44,
    box_z: float = 0.06,
    mass: float = 0.8,
    lift: float = 0.10,
    margin: float = 0.04,
    step_forward: float = 0.22,
    friction: float = 0.7,
) -> wb.Script:
    """The experiment's steps (a) to (i).

    Args:
        robot: the leg-arm hexapod.
        box_x, box_y, box_z: centre of the box [m], world, where it stands at first and at last.
        mass: of the box [kg].
        lift: how high the box is lifted [m].
        margin: stability margin kept throughout [m].
        step_forward: how far legs 3 and 6 step towards the box [m].
        friction: of the feet on the ground [-].
    """
    stand = robot.state("stand")
    home = {foot: stand.pose(foot).translation for foot in SIX}
    ahead = {foot: home[foot] + np.array([-0.045 * np.sign(home[foot][0]), step_forward, 0.0]) for foot in STEPPERS}
    start = pin.SE3(np.eye(3), np.array([box_x, box_y, box_z]))
    box = wb.Body("box", mass=mass, size=(0.25, 0.15, 0.12), pose=start)
    palms = {"limb1": -0.125, "limb2": 0.125}  # [m] along the box's x axis

    limits = [wb.JointLimits(speed=0.8), wb.SupportPolygon(margin=margin)]
    keep = wb.PostureTask(stand, weight=0.1, name="keep posture")
    level = wb.PoseTask("body", stand.pose("body"), weight=((0.5, 0.5, 0.2), 0.5), gain=1.0, name="body")

    def body_to(height, seconds):
        """The body level over its place at a height [m]."""
        goal = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        return wb.PoseTask("body", wb.MinJerk(wb.AS_IS, goal, seconds), weight=(10.0, 10.0), name="body")

    tall, low = 0.285, 0.22
    unfolded = {j: v for j, v in robot.poses["manipulate"].items() if j.startswith(ARMS)}

    def on(feet):
        return [wb.Contact(foot, friction=friction) for foot in feet]

    def joints_to(names, seconds, weight=1.0):
        target = {j: wb.MinJerk(wb.AS_IS, unfolded[j], seconds) for j in names}
        return wb.PostureTask(target, weight=weight, gain=20.0, name="limbs")

    def palms_at(offset, seconds):
        """Both palms in line with the box's faces, `offset` [m] away from them; free to turn about that line."""
        tasks = []
        for limb, x in palms.items():
            side = np.sign(x)
            facing = pin.SE3(pin.exp3(np.array([0.0, 0.0, np.pi if side > 0 else 0.0])), np.array([x + side * offset, 0, 0]))
            goal = wb.MinJerk(wb.AS_IS, start * facing, seconds)
            tasks.append(wb.PoseTask(f"{limb}_tip", goal, weight=(20.0, (0.0, 10.0, 10.0))))
        return tasks

    def swing(feet, goals, seconds):
        return [wb.PositionTask(foot, wb.Swing(wb.AS_IS, goals[foot], 0.04, seconds)) for foot in feet]

    def move(translation, rotation_deg):
        return pin.SE3(pin.exp3(np.radians(rotation_deg)), start.translation + np.array(translation))

    tour = wb.Waypoints(
        (0.0, 2.0, 4.0, 6.0, 8.0),
        (
            wb.AS_IS,
            move((0.03, 0.00, lift + 0.03), (4.0, 0.0, 6.0)),
            move((0.00, 0.02, lift + 0.02), (2.0, 6.0, 0.0)),
            move((-0.03, 0.00, lift + 0.03), (4.0, 0.0, -6.0)),
            move((0.0, 0.0, lift), (0.0, 0.0, 0.0)),
        ),
    )
    clamp = dict(
        contacts=on(CARRIERS),
        carried=[wb.Carried(box, by="limb1_tip")],
        hard=[wb.RelativePoseTask("limb2_tip", root="limb1_tip")],
        limits=limits,
    )

    def carry(name, path, seconds):
        return wb.Phase(name, soft=[wb.PoseTask("box", path, weight=(100.0, 50.0)), keep, level], duration=seconds, **clamp)

    up, down = move((0.0, 0.0, lift), (0.0, 0.0, 0.0)), start
    first_three = [j for j in unfolded if j.endswith(("joint1", "joint2", "joint3"))]
    wrists = [j for j in unfolded if j.endswith(("joint1", "joint2", "joint3", "joint4", "joint5"))]
    raised = {f"{limb}_foot": home[f"{limb}_foot"] + np.array([0.0, 0.0, 0.05]) for limb in ARMS}

    def lift_feet(goals, seconds):
        return [wb.PositionTask(foot, wb.MinJerk(wb.AS_IS, goals[foot], seconds)) for foot in raised]

    arms = {"roles": {limb: "arm" for limb in ARMS}, "contacts": on(CARRIERS), "limits": limits}
    legs = {"roles": {limb: "leg" for limb in ARMS}, "limits": limits}
    return wb.Script(
        # (a) six-legged stance
        wb.Phase("a stand", contacts=on(SIX), soft=[keep, body_to(tall, 1.0)], duration=1.2, **legs),
        # (b) legs 3 and 6 step forward
        wb.Phase(
            "b step forward", contacts=on(set_minus(SIX, STEPPERS)), hard=swing(STEPPERS, ahead, 1.5),
            soft=[keep, body_to(tall, 1.0)], duration=1.5, **legs,
        ),
        # (c) limbs 1 and 2 lift and become arms
        wb.Phase("c unload", contacts=on(SIX), soft=[keep, level], duration=0.5, **legs),
        wb.Phase("c lift", contacts=on(CARRIERS), hard=lift_feet(raised, 0.8), soft=[keep, level], duration=0.8, **legs),
        wb.Phase("c raise", contacts=on(CARRIERS), soft=[joints_to(first_three, 1.2), level], duration=1.2, **legs),
        wb.Phase("c unfold", soft=[joints_to(wrists, 2.0), level], duration=2.0, **arms),
        # (d) both palms reach the box and clamp it
        wb.Phase("d reach", soft=[*palms_at(0.04, 2.5), keep, level], duration=2.5, **arms),
        wb.Phase("d clamp", soft=[*palms_at(0.0, 1.0), keep, level], duration=1.2, **arms),
        # (e) lift it, take it along a path of six degrees of freedom
        carry("e lift", wb.MinJerk(wb.AS_IS, up, 2.0), 2.0),
        carry("e move", tour, 8.0),
        # (f) put it down, withdraw, limbs become legs
        carry("f lower", wb.MinJerk(wb.AS_IS, down, 2.0), 2.2),
        wb.Phase("f release", soft=[*palms_at(0.04, 1.0), keep, level], duration=1.0, **arms),
        wb.Phase("f withdraw", soft=[joints_to(wrists, 2.0), level], duration=2.0, **arms),
        wb.Phase("f fold", contacts=on(CARRIERS), soft=[keep, level], duration=2.0, **legs),
        # (g) limbs 1 and 2 return to the ground
        wb.Phase("g lower", contacts=on(CARRIERS), hard=lift_feet(raised, 1.2), soft=[keep, level], duration=1.2, **legs),
        wb.Phase("g touch", contacts=on(CARRIERS), hard=lift_feet(home, 0.8), soft=[keep, level], duration=0.8, **legs),
        # (h, i) legs 3 and 6 step back; stand on six
        wb.Phase(
            "h step back", contacts=on(set_minus(SIX, STEPPERS)), hard=swing(STEPPERS, home, 1.5),
            soft=[keep, body_to(tall, 1.0)], duration=1.5, **legs,
        ),
        wb.Phase("i stand", contacts=on(SIX), soft=[keep, level], duration=1.0, **legs),
        bodies=[box],
    )


def set_minus(feet, without):
    """The feet that stay."""
    return tuple(foot for foot in feet if foot not in without)
