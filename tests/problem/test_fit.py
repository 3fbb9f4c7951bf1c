"""A phase that does not fit its robot is refused before the first tick, with the names that exist."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

FOUR = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
SIX = ("limb1_foot", "limb2_foot", *FOUR)
BOX = wb.Body("box", mass=0.8)


def loop(robot: wb.Robot, pose: str = "stand", feet: tuple[str, ...] = FOUR, **fields: Any) -> wb.Loop:
    contacts = [wb.Contact(foot) for foot in feet]
    return wb.Loop(robot, wb.Phase("try", **{"contacts": contacts, **fields}), robot.state(pose), dt=0.01)


# ----------------------------------------------------------------------------------- names that do not exist


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"contacts": [wb.Contact("leg3_fot")]}, r"phase 'try'\.contacts: .*'leg3_fot'.*leg3_foot"),
        ({"soft": [wb.PoseTask("limb1_tp")]}, r"phase 'try', pose\(limb1_tp\): .*'limb1_tp'.*limb1_tip"),
        ({"hard": [wb.PositionTask("limb1_tp")]}, r"phase 'try', position\(limb1_tp\).*limb1_tip"),
        (
            {"soft": [wb.RelativePoseTask("limb1_tip", root="limb2_tp")]},
            r"phase 'try', relative\(.*'limb2_tp'.*limb2_tip",
        ),
        ({"soft": [wb.PoseTask("box")]}, r"phase 'try', pose\(box\): .*no frame 'box'"),
        (
            {"soft": [wb.PostureTask({"limb1_joint9": 0.0})]},
            "phase 'try', posture: joint 'limb1_joint9' does not exist",
        ),
        (
            {"soft": [wb.PostureTask(weight={"limb1_joint9": 1.0})]},
            "posture: joint 'limb1_joint9' does not exist",
        ),
        ({"soft": [wb.PostureTask(joints=["limb1_joint9"])]}, "posture: joint 'limb1_joint9' does not exist"),
        (
            {"locked": ["limb1_joint9"]},
            "phase 'try': joint 'limb1_joint9' does not exist; there are: .*leg3_joint1",
        ),
        ({"driven": {"limb1_joint9": 0.0}}, "phase 'try': joint 'limb1_joint9' does not exist; there are: "),
        (
            {"roles": {"limb9": "arm"}},
            r"phase 'try'\.roles: limb 'limb9' does not exist; there are: limb1, limb2$",
        ),
        (
            {"roles": {"limb1": "wing"}},
            r"phase 'try'\.roles\['limb1'\]: role 'wing' does not exist; there are: arm, leg$",
        ),
        (
            {"roles": {"leg3": "arm"}},
            r"phase 'try'\.roles: limb 'leg3' does not exist; there are: limb1, limb2$",
        ),
        (
            {"carried": [wb.Carried(BOX, by="limb1_tip", pads=["limb1_pad_c"])]},
            r"carried: body 'box'\.pads: .* no frame 'limb1_pad_c'; closest names: .*limb1_pad_a",
        ),
        (
            {"carried": [wb.Carried(BOX, by="limb1_tp")]},
            r"phase 'try'\.carried: body 'box'\.by: .*'limb1_tp'.*limb1_tip",
        ),
        (
            {"carried": [wb.Carried(wb.Body("leg3_foot", mass=1.0), by="limb1_tip")]},
            r"phase 'try'\.carried: body 'leg3_foot' has the name of a frame",
        ),
    ],
)
def test_a_name_that_does_not_exist_is_refused_with_those_that_do(
    legarm: wb.Robot, fields: dict[str, Any], says: str
) -> None:
    with pytest.raises(wb.SpecError, match=says):
        loop(legarm, **fields)


def test_the_roles_that_limbs_are_in_are_checked_and_filled_in(legarm: wb.Robot) -> None:
    phase, start = wb.Phase("try"), legarm.state("manipulate")
    with pytest.raises(wb.SpecError, match="roles: limb 'limb9' does not exist"):
        wb.Loop(legarm, phase, start, roles={"limb9": "arm"})
    with pytest.raises(wb.SpecError, match=r"roles\['limb1'\]: role 'wing' does not exist"):
        wb.Loop(legarm, phase, start, roles={"limb1": "wing"})
    given = wb.Loop(legarm, phase, start, roles={"limb1": None})
    assert given.compiled.roles == {"limb1": None, "limb2": "arm"}


# ------------------------------------------------------------------------------------------ feet and roles


def test_a_limb_that_is_an_arm_has_no_foot_to_stand_on(legarm: wb.Robot) -> None:
    with pytest.raises(
        wb.SpecError, match="phase 'try': contact 'limb1_foot' needs limb1 in role 'leg', it is in role 'arm'"
    ):
        loop(legarm, "manipulate", SIX)
    loop(legarm, "manipulate", FOUR)
    loop(legarm, "stand", SIX)


@pytest.mark.parametrize(("pose", "role"), [("stand", "arm"), ("manipulate", "leg")])
def test_a_limb_that_changes_its_role_has_no_foot_to_stand_on(legarm: wb.Robot, pose: str, role: str) -> None:
    with pytest.raises(
        wb.SpecError, match=r"phase 'try': contact 'limb1_foot'.*(role 'arm'|changes its role)"
    ):
        loop(legarm, pose, ("limb1_foot", *FOUR), roles={"limb1": role}, duration=5.0)
    loop(legarm, pose, FOUR, roles={"limb1": role}, duration=5.0)


def test_a_change_of_role_that_is_too_fast_says_how_long_it_needs(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SpecError) as caught:
        loop(legarm, roles={"limb1": "arm"}, duration=0.05)
    message = str(caught.value)
    assert message.startswith("phase 'try': joint 'limb1_")
    asked = re.search(r"at ([\d.]+), its limit is ([\d.]+); give the phase ([\d.]+) s or more", message)
    assert asked is not None
    speed, limit, need = map(float, asked.groups())
    assert speed > limit
    # The law's top speed is 15/8 of the mean.
    joint = message.split("'")[3]
    gap = abs(legarm.roles["limb1"]["arm"][joint] - legarm.state("stand").joint(joint))
    assert need == pytest.approx(15.0 / 8.0 * gap / limit, rel=0.05)
    loop(legarm, roles={"limb1": "arm"}, duration=need)  # what it says is enough


def test_a_locked_joint_is_not_moved_by_a_role(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SpecError, match=r"phase 'try'\.locked: limb1_shank2 moves as limb1 becomes 'arm'"):
        loop(legarm, roles={"limb1": "arm"}, locked=["limb1_shank2"], duration=5.0)
    loop(legarm, roles={"limb1": "leg"}, locked=["limb1_shank2"], duration=5.0)


# --------------------------------------------------------------------------------------------- driven joints


def test_a_driven_joint_starts_where_it_is(legarm: wb.Robot) -> None:
    here = legarm.state("manipulate").joint("limb1_joint4")
    with pytest.raises(wb.SpecError, match=r"driven\['limb1_joint4'\]: starts at 1, .* start it at AS_IS"):
        loop(legarm, "manipulate", driven={"limb1_joint4": wb.MinJerk(1.0, 1.2, 1.0)})
    loop(legarm, "manipulate", driven={"limb1_joint4": wb.MinJerk(here, 0.5, 1.0)})


def test_a_driven_joint_stays_within_its_limits(legarm: wb.Robot) -> None:
    upper = legarm.joint_limits("limb1_joint4")[1]
    for path in (upper + 0.1, wb.MinJerk(wb.AS_IS, upper + 0.1, 5.0)):
        with pytest.raises(
            wb.SpecError, match=r"joint 'limb1_joint4' would be driven to .* limits are .* to "
        ):
            loop(legarm, "manipulate", driven={"limb1_joint4": path}, duration=5.0)
    loop(legarm, "manipulate", driven={"limb1_joint4": upper}, duration=5.0)
    loop(legarm, "manipulate", driven={"limb1_joint4": upper + 0.1}, duration=5.0, limits=[])


def test_a_driven_value_is_reached_over_the_phase(legarm: wb.Robot) -> None:
    run = loop(legarm, "manipulate", driven={"limb1_joint4": 0.6}, locked=["limb2_joint4"], duration=1.0)
    index = legarm.joint_index("limb1_joint4")[0]
    before = run.q[index]
    ticks = [run.step() for _ in range(110)]
    moved = np.diff([before, *(tick.q[index] for tick in ticks)])
    assert ticks[-1].q[index] == pytest.approx(0.6, abs=1e-9)
    assert moved.max() < 1.9 * (0.6 - before) * 0.01
    assert ticks[49].q[index] == pytest.approx(0.5 * (before + 0.6), abs=1e-6)


# --------------------------------------------------------------------------------------- support polygons


@pytest.mark.parametrize("feet", [(), ("leg3_foot",), ("leg3_foot", "leg6_foot")])
def test_fewer_than_three_contacts_span_no_support_polygon(legarm: wb.Robot, feet: tuple[str, ...]) -> None:
    names = ", ".join(feet) or "none"
    with pytest.raises(wb.SpecError, match=rf"phase 'try': its contacts \({names}\) span no support polygon"):
        loop(legarm, "stand", feet, limits=[wb.SupportPolygon()])


def test_contacts_on_one_line_span_no_support_polygon(legarm: wb.Robot) -> None:
    """Three frames one above the other: limb 1's root link's, hip's and thigh's."""
    q = np.array(legarm.state("stand").q)
    q[legarm.joint_index("leg4_joint2")[0]] = 0.0
    q[legarm.joint_index("leg4_joint3")[0]] = 0.0
    state = wb.State(legarm.model, q)
    line = ("leg4_foot", "leg4_shank", "leg4_thigh")
    places = np.array([state.pose(frame).translation for frame in line])
    assert np.linalg.matrix_rank(places - places.mean(axis=0), tol=1e-9) == 1
    phase = wb.Phase("try", contacts=[wb.Contact(frame) for frame in line], limits=[wb.SupportPolygon()])
    with pytest.raises(
        wb.SpecError, match=r"leg4_foot, leg4_shank, leg4_thigh\) span no support polygon.*one line"
    ):
        wb.Loop(legarm, phase, q)


# ------------------------------------------------------------------------------------------------- targets


class Odd(wb.Path):
    """Somebody's own path, which gives one value."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def at(self, t: float) -> Any:
        return self.value


@pytest.mark.parametrize(
    ("task", "says"),
    [
        (
            wb.PoseTask("body", Odd(np.zeros(3))),
            r"pose\(body\)\.target: expected pin\.SE3, got an array of sha",
        ),
        (wb.PoseTask("body", Odd(wb.AS_IS)), r"pose\(body\)\.target: expected pin\.SE3, got AS_IS"),
        (
            wb.PositionTask("body", Odd(np.zeros(2))),
            r"position\(body\)\.target: expected .*, got an array of",
        ),
        (wb.PositionTask("body", Odd([0.0, np.nan, 0.0])), r"position\(body\)\.target: NaN"),
        (wb.OrientationTask("body", Odd(np.zeros((3, 3)))), r"orientation\(body\)\.target: not a rotation"),
        (wb.ComTask(Odd(0.0)), r"com\.target: expected an array of shape \(3,\), got a number"),
        (
            wb.PostureTask({"limb1_joint1": Odd(np.zeros(2))}),
            r"posture\.target\['limb1_joint1'\]: expected a num",
        ),
        (wb.PoseTask("body", Odd(None)), r"pose\(body\)\.target: expected pin\.SE3 or an array"),
    ],
)
def test_a_path_of_another_kind_is_refused_when_the_phase_begins(
    legarm: wb.Robot, task: wb.Task, says: str
) -> None:
    with pytest.raises(wb.SpecError, match=f"phase 'try', {says}"):
        loop(legarm, soft=[task])


@pytest.mark.parametrize(
    ("task", "frame"),
    [
        (wb.PoseTask("limb1_tip"), "limb1_tip"),
        (wb.PositionTask("limb1_tip"), "limb1_tip"),
        (wb.OrientationTask("limb1_tip"), "limb1_tip"),
        (wb.RelativePoseTask("limb1_tip", root="body"), "limb1_tip"),
        (wb.PositionTask("limb1_tip", wb.Waypoints((0, 1), (wb.AS_IS, pin.SE3.Identity()))), "limb1_tip"),
        (wb.PositionTask("limb1_tip", wb.Swing(wb.AS_IS, pin.SE3.Identity(), 0.1, 1.0)), "limb1_tip"),
        (wb.PositionTask("limb1_tip", wb.Live(wb.AS_IS)), "limb1_tip"),
        (wb.OrientationTask("limb1_tip", wb.MinJerk(wb.AS_IS, np.eye(3), 1.0)), "limb1_tip"),
        (wb.OrientationTask("limb1_tip", wb.MinJerk(wb.AS_IS, pin.SE3.Identity(), 1.0)), "limb1_tip"),
        (wb.PoseTask("limb1_tip", weight=(1.0, 0.0)), "limb1_tip"),
        (wb.OrientationTask("limb1_tip", weight=0.0), "limb1_tip"),
        (wb.ComTask(), None),
        (wb.ComTask(wb.MinJerk(wb.AS_IS, np.zeros(3), 1.0)), None),
        (wb.PostureTask(), None),
        (wb.PostureTask({"limb1_joint4": wb.MinJerk(wb.AS_IS, 1.0, 1.0)}), None),
    ],
    ids=lambda value: getattr(value, "label", None),
)
def test_as_is_is_no_error_at_the_start_for_any_task(
    legarm: wb.Robot, task: wb.Task, frame: str | None
) -> None:
    run = loop(legarm, "manipulate", soft=[task])
    errors = run.stack.errors()
    assert all(value < 1e-7 for value in errors.values()), errors
    run.step()


def test_an_orientation_path_between_matrices_turns_as_one_between_poses(legarm: wb.Robot) -> None:
    goal = pin.exp3(np.array([0.0, 0.0, 0.2]))
    ends = []
    for target in (goal, pin.SE3(goal, np.ones(3))):
        task = wb.OrientationTask("body", wb.MinJerk(wb.AS_IS, target, 0.5), weight=20.0)
        run = loop(legarm, soft=[task, wb.PositionTask("body", weight=20.0)])
        ends.append([run.step() for _ in range(60)][-1].q)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    np.testing.assert_allclose(wb.State(legarm.model, ends[0]).pose("body").rotation, goal, atol=1e-3)


def test_a_hard_posture_does_not_name_joints_that_are_not_its_to_move(legarm: wb.Robot) -> None:
    for fields in ({}, {"driven": {"limb1_joint4": 0.3}}, {"locked": ["limb1_joint4"]}):
        joint = "limb1_joint4" if fields else "limb1_shank2"
        with pytest.raises(wb.SpecError, match=f"phase 'try', posture: {joint} is locked, driven or held"):
            loop(legarm, "manipulate", hard=[wb.PostureTask({joint: 0.0})], **fields)
    soft = loop(legarm, "manipulate", soft=[wb.PostureTask({"limb1_shank2": 0.05})])
    assert soft.step().q[legarm.joint_index("limb1_shank2")[0]] == 0.0


def test_a_posture_is_that_of_a_state_of_the_same_robot(legarm: wb.Robot) -> None:
    other = wb.State(pin.buildSampleModelHumanoid(), pin.neutral(pin.buildSampleModelHumanoid()))
    with pytest.raises(
        wb.SpecError, match=r"posture\.target: a state of '.*', expected one of 'legarm_hexapod'"
    ):
        loop(legarm, soft=[wb.PostureTask(other)])


def test_a_posture_weighs_the_joints_that_it_names(legarm: wb.Robot) -> None:
    """Joints without a weight are left alone; the weighted one goes where it is asked to."""
    asked = {"limb1_joint4": 0.4, "limb2_joint4": 0.4}
    task = wb.PostureTask(asked, weight={"limb1_joint4": 5.0}, gain=20.0)
    run = loop(legarm, "manipulate", soft=[task], limits=[wb.JointLimits()])
    before = run.q.copy()
    q = [run.step() for _ in range(60)][-1].q
    one, two = (legarm.joint_index(joint)[0] for joint in asked)
    assert q[one] == pytest.approx(0.4, abs=1e-3)
    assert q[two] == pytest.approx(before[two], abs=1e-6)
