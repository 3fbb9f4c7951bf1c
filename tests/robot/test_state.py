"""States: named poses, configurations, and what cannot be changed."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin
import pytest

from wbplan.errors import SpecError
from wbplan.robot import load_robot
from wbplan.state import State


@pytest.fixture
def robot(make, write):
    return load_robot(write(make.biped(), make.srdf))


def height(state, frame):
    return state.pose(frame).translation[2]


def test_a_named_pose_is_level_with_its_lowest_foot_on_the_ground(robot):
    state = robot.state("stand")  # the left leg is 0.5 + 0.1 long, the right one 0.4
    assert state.q[:7] == pytest.approx([0, 0, 0.6, 0, 0, 0, 1])
    assert state.joint("left_knee") == 0.1
    assert height(state, "left_foot") == pytest.approx(0, abs=1e-12)
    assert height(state, "right_foot") == pytest.approx(0.2)
    assert robot.standing_feet(state.q) == ("left_foot", "right_foot")
    assert np.array_equal(robot.state().q, state.q)


def test_feet_of_arms_do_not_count(robot):
    state = robot.state("reach")  # the left limb is an arm here
    assert robot.role_of("left", state.q) == "arm"
    assert robot.role_of("right", state.q) is None
    assert robot.standing_feet(state.q) == ("right_foot",)
    assert height(state, "right_foot") == pytest.approx(0, abs=1e-12)
    assert height(state, "left_foot") == pytest.approx(0.4 - 0.8)


def test_a_limb_in_neither_role_has_no_foot_to_stand_on(robot):
    neutral = robot.state("neutral")
    assert robot.role_of("left", neutral.q) is None
    assert robot.standing_feet(neutral.q) == ("right_foot",)
    assert height(neutral, "right_foot") == pytest.approx(0, abs=1e-12)


def test_roles_hold_within_a_millionth(robot):
    q = np.array(robot.state("stand").q)
    index = robot.joint_index("left_knee")[0]
    for shift, role in ((9e-7, "leg"), (2e-6, None), (-9e-7, "leg")):
        q[index] = 0.1 + shift
        assert robot.role_of("left", q) == role
    with pytest.raises(SpecError, match=r"shape \(3,\), expected \(11,\)"):
        robot.role_of("left", [0, 0, 0])


def test_joints_that_a_pose_does_not_name_are_as_near_to_zero_as_may_be(make, write):
    text = make.biped().replace('lower="-1"', 'lower="0.3"', 1).replace('upper="2"', 'upper="0.9"', 1)
    robot = load_robot(write(text), feet={"r": "right_foot"})
    assert robot.pose_names == ("stand", "neutral")
    for pose in robot.pose_names:  # without an SRDF, stand is neutral
        assert robot.state(pose).joint("left_hip") == 0.3
        assert robot.state(pose).joint("left_knee") == 0.0
        assert height(robot.state(pose), "right_foot") == pytest.approx(0, abs=1e-12)


def test_without_feet_the_base_is_at_the_origin(make, write):
    assert np.array_equal(load_robot(write(make.biped())).state().q[:3], [0, 0, 0])


def test_unknown_pose_lists_the_valid_ones(robot):
    with pytest.raises(SpecError, match=r"no pose 'sit'; poses: neutral, reach, stand"):
        robot.state("sit")


def test_a_configuration_is_taken_as_it_is(robot):
    q = pin.randomConfiguration(robot.model, -np.ones(11), np.ones(11))
    state = robot.state(q)
    assert np.allclose(state.q, q, rtol=0, atol=1e-15)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for name in ("body", "left_thigh", "right_foot"):
        assert state.pose(name).isApprox(data.oMf[robot.model.getFrameId(name)], 1e-12)
    assert np.allclose(state.com, pin.centerOfMass(robot.model, data, q))
    assert robot.state(list(q)).joint("right_knee") == pytest.approx(q[10])


def test_centre_of_mass_of_a_known_case(robot):
    # Three of the five equal links at the base's height, two shanks 0.1 (left) and 0 below it.
    assert robot.state("stand").com == pytest.approx([0, 0, 0.6 - 0.1 / 5])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: q[:-1], r"shape \(10,\), expected \(11,\)"),
        (lambda q: q.reshape(1, -1), r"shape \(1, 11\)"),
        (lambda q: np.where(np.arange(11) == 8, np.nan, q), r"q\[8\] of robot 'toy' is nan"),
        (lambda q: np.where(np.arange(11) == 2, np.inf, q), r"q\[2\] of robot 'toy' is inf"),
        (lambda q: np.where(np.arange(11) == 6, 1.001, q), r"norm 1 .*q\[3:7\] has norm 1\.001"),
        (lambda q: np.where(np.arange(11) == 6, 0.0, q), r"norm 1 .*q\[3:7\] has norm 0"),
        (lambda q: ["a"] * 11, "not an array of numbers"),
        (lambda q: None, "q of robot 'toy'"),
    ],
)
def test_bad_configurations_are_refused(robot, change, words):
    with pytest.raises(SpecError, match=words):
        robot.state(change(np.array(robot.state().q)))


def test_a_rounded_quaternion_is_normalised(robot):
    q = np.array(robot.state().q)
    q[3:7] = np.array([0.1, 0.2, 0.3, np.sqrt(0.86)]) * (1 + 5e-7)
    given = q.copy()
    state = State(robot.model, q)
    assert np.linalg.norm(state.q[3:7]) == pytest.approx(1, abs=1e-15)
    assert np.allclose(state.q, given, rtol=0, atol=1e-6)
    assert np.array_equal(q, given)


def test_nothing_from_outside_changes_a_state(robot):
    q = np.array(robot.state("stand").q)
    state = State(robot.model, q)
    before = (state.q.copy(), state.com.copy(), state.pose("left_foot").homogeneous)
    q[:3] = 9
    state.com[:] = 9
    pose = state.pose("left_foot")
    pose.translation = np.full(3, 9.0)
    State(robot.model, q)  # another state of the same model
    assert np.array_equal(state.q, before[0])
    assert np.array_equal(state.com, before[1])
    assert np.array_equal(state.pose("left_foot").homogeneous, before[2])
    with pytest.raises(ValueError, match="read-only"):
        state.q[0] = 1
    for name in ("q", "_q", "other"):
        with pytest.raises(AttributeError, match="immutable"):
            setattr(state, name, 1)
    with pytest.raises(AttributeError, match="immutable"):
        del state._q
    assert copy.deepcopy(state) is copy.copy(state) is state


def test_unknown_frames_and_joints(robot):
    state = robot.state()
    for name in ("left_fot", "universe", "root_joint", "", None):
        with pytest.raises(SpecError, match="no frame"):
            state.pose(name)
    with pytest.raises(SpecError, match=r"no frame 'left_fot'.*left_foot"):
        state.pose("left_fot")
    with pytest.raises(
        SpecError, match=r"no joint 'hip'; valid names: left_hip, left_knee, right_hip, right_knee"
    ):
        state.joint("hip")
    assert "toy" in repr(state)


def test_a_joint_of_two_coordinates_has_no_single_value():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    with pytest.raises(SpecError, match="'wheel' has 2 coordinates"):
        State(model, [1.0, 0.0]).joint("wheel")
