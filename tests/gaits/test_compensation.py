"""The body makes up for the freedom that a limb of five joints lacks: the QP beside the paper's closed form.

The arm's tip follows a pose of six freedoms as a hard task, and so does the body in all but its shift across
the way; what the shift may be is said by the rows of the support polygon alone.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan import gaits
from wbplan.geometry import support_polygon
from wbplan.mechanism import FiveJointLimb, limb_chain

RADIUS, HEIGHT, ALONG = 0.38, 0.34, np.pi / 2.0
ARM, TIP = "limb1", "limb1_tip"
#: Joints of the arm [degrees]: tool pitched (case 2), upright (case 1), and the limb across the way.
PITCHED = (140.0, -45.0, 35.0, 35.0, -25.0)
UPRIGHT = (150.0, -42.0, 35.0, 7.0, -20.0)
ACROSS = (180.0, -45.0, 35.0, 35.0, -25.0)
#: Legs that stand in the second step of the mixture gait.
FEET = ("limb2", "leg4", "leg5")
ROBOT = wb.load_robot("legarm_hexapod")
FIVE = gaits.Walker(ROBOT, raised=(ARM,))
LIMB = FiveJointLimb.of(limb_chain(ROBOT, ARM, TIP))
PENTAGON = gaits.Switch(gaits.Walker(ROBOT), ARM, RADIUS, HEIGHT).pentagon


def standing(joints: tuple[float, ...]) -> wb.State:
    """On the pentagon, limb 1 an arm."""
    q = np.array(FIVE.stand(PENTAGON).q)
    values = {
        **ROBOT.roles[ARM]["arm"],
        **{f"{ARM}_joint{k}": np.radians(v) for k, v in enumerate(joints, 1)},
    }
    for name, value in values.items():
        q[ROBOT.joint_index(name)[0]] = value
    return ROBOT.state(q)


def tip(joints: tuple[float, ...], by: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """The tip in the body at joints [degrees], moved by so much."""
    pose = LIMB.placement * LIMB.pose(np.radians(joints))
    return pin.SE3(pose.rotation, pose.translation + np.array(by))


def reach(goal: Any, margin: float, seconds: float) -> wb.Phase:
    """The tip goes to a pose in the body's nominal place, the body goes nowhere but across the way."""
    body = pin.SE3(np.eye(3), np.array([0.0, 0.0, HEIGHT]))
    on_way = wb.PoseTask(FIVE.root, wb.Hold(body), weight=((0.0, 30.0, 30.0), 30.0), name="body on its way")
    beside = wb.PositionTask(
        FIVE.root, wb.Hold(body.translation), weight=(2.0, 0.0, 0.0), gain=2.0, name="body beside its way"
    )
    idle = tuple(joint for limb in PENTAGON.feet if limb not in FEET for joint in ROBOT.limbs[limb])
    return wb.Phase(
        "reach",
        contacts=[wb.Contact(f"{limb}_foot") for limb in FEET],
        # Limbs in the air stay as they are: else they would be counterweights.
        hard=[wb.PoseTask(TIP, wb.MinJerk(wb.AS_IS, body * goal, 2.0)), on_way, wb.PostureTask(joints=idle)],
        soft=[beside],
        limits=[wb.JointLimits(), wb.SupportPolygon(margin)],
        duration=seconds,
    )


@pytest.mark.parametrize(
    ("case", "joints", "goal"),
    [
        ("2.3", PITCHED, tip(PITCHED, (0.03, 0.0, 0.0))),
        ("2.3", PITCHED, tip((143.0, -43.0, 35.0, 39.0, -30.0), (-0.035, 0.0, 0.0))),
        ("2.4", ACROSS, tip(ACROSS, (0.01, 0.0, 0.0))),
        ("1.4", UPRIGHT, tip((146.0, -44.0, 36.0, 8.0, -15.0))),
        ("1.3", UPRIGHT, tip(UPRIGHT, (-0.03, 0.01, 0.0))),
    ],
)
def test_zheng_section_4_3_the_planned_shift_is_the_closed_forms(
    case: str, joints: tuple[float, ...], goal: Any
) -> None:
    assert LIMB.solve(LIMB.placement.actInv(goal), ALONG).case == case
    shift = gaits.shifts(FIVE, ARM, [goal], ALONG, gaits.SHIFT * RADIUS)[0]
    assert (abs(shift) > 0.01) == (case in ("2.3", "1.3"))
    plan = wb.plan(ROBOT, reach(goal, 0.02, 6.0 if case == "1.3" else 3.0), start=standing(joints))
    assert plan.check().ok, [row for row in plan.check().rows if not row.held]
    assert plan.trajectory.errors[f"pose({TIP}).position"].max() < 2e-5
    # At the edge of its reach the arm is straight, where it gets ever more slowly.
    assert plan.trajectory.q[-1, 0] == pytest.approx(shift, abs=1e-4 if case == "2.3" else 1e-3)


@pytest.mark.parametrize(
    ("case", "joints", "goal"),
    [
        ("2.1", ACROSS, tip(ACROSS, (0.0, 0.02, 0.0))),
        ("1.1", UPRIGHT, tip(UPRIGHT, (0.0, 0.0, 0.5))),
    ],
)
def test_a_pose_that_no_shift_reaches_is_refused_by_both(
    case: str, joints: tuple[float, ...], goal: Any
) -> None:
    with pytest.raises(wb.GaitError, match=rf"case {re.escape(case)}"):
        gaits.shifts(FIVE, ARM, [goal], ALONG, 1.0)
    with pytest.raises(wb.SolveError, match=rf"no step keeps all of: .*pose\({TIP}\)") as error:
        wb.plan(ROBOT, reach(goal, 0.02, 3.0), start=standing(joints))
    assert "support" not in str(error.value)


def margin_after(shift: float, start: wb.State) -> float:
    """The margin [m] that is left when the body has shifted by so much [m] across its way."""
    plan = wb.plan(ROBOT, reach(tip(PITCHED, (shift, 0.0, 0.0)), 0.02, 3.0), start=start)
    assert plan.trajectory.q[-1, 0] == pytest.approx(shift, abs=1e-4)
    return float(plan.trajectory.margin[-1])


def test_a_shift_beyond_what_stability_allows_is_refused_with_its_size() -> None:
    """0.118 CR is 0.0448 m: the polygon's rows bound the shift there, and the error says both numbers."""
    start, limit, by = standing(PITCHED), gaits.SHIFT * RADIUS, 0.05
    margin, goal = margin_after(-limit, start), tip(PITCHED, (-by, 0.0, 0.0))
    closed = rf"case 2\.2.*shift by -{by:.4f} m .*{limit:.4f} m is allowed"
    with pytest.raises(wb.GaitError, match=closed):
        gaits.shifts(FIVE, ARM, [goal], ALONG, limit)
    with pytest.raises(wb.SolveError, match="support polygon edge limb2_foot-leg5_foot: hard tasks") as error:
        wb.plan(ROBOT, reach(goal, margin, 3.0), start=start)
    asked, kept, much, possible = numbers(
        r"ask for a margin of (\S+) m, (\S+) m is to be kept.*give way by (\S+) m, (\S+) m is", error
    )
    assert asked == pytest.approx(margin_after(-by, start), abs=2e-4)
    assert kept == pytest.approx(margin, abs=1e-4)
    assert much == pytest.approx(by, abs=1e-4)
    assert limit - 2e-3 < possible <= limit + 1e-4
    # Just inside of it there is a plan.
    inside = wb.plan(ROBOT, reach(tip(PITCHED, (2e-3 - limit, 0.0, 0.0)), margin, 3.0), start=start)
    assert inside.check().ok
    assert inside.trajectory.q[-1, 0] == pytest.approx(2e-3 - limit, abs=1e-4)


def numbers(pattern: str, error: Any) -> list[float]:
    """The numbers of a message."""
    found = re.search(pattern, str(error.value))
    assert found is not None, error.value
    return [float(text) for text in found.groups()]


def test_the_centre_of_three_feet_of_a_pentagon_may_shift_by_the_papers_bound() -> None:
    """A margin of 0.191 CR leaves the body's middle 0.118 CR in the worst direction, and more in others."""
    steps = gaits.step_margins(gaits.gait_named("mixture", FIVE.ring), PENTAGON.feet)
    margin = min(step.centre for step in steps) - gaits.SHIFT * RADIUS
    assert margin / RADIUS == pytest.approx(0.191, abs=5e-4)
    polygon = support_polygon(np.array([PENTAGON.feet[limb] for limb in FEET]))
    angles = np.linspace(0.0, 2.0 * np.pi, 361)
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    room = ((polygon.offsets - margin) / np.maximum(ways @ polygon.normals.T, 1e-9)).min(axis=1)
    assert room.min() / RADIUS == pytest.approx(gaits.SHIFT, abs=1e-3)
