"""MANA against the paper: dimensions, ranges, initial pose (Table 4), inverse displacement (Tables 5, 6)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

LEGS = ("leg1", "leg2", "leg3", "leg4")
LEFT = ("leg1", "leg4")
JOINTS = ("hip1", "hip2", "knee")
CORNERS = {"leg1": (1, 1), "leg2": (1, -1), "leg3": (-1, -1), "leg4": (-1, 1)}
D, L1, L2, L3 = 0.040, 0.030, 0.075, 0.097
# Body angles and joint angles [rad], as printed.
TABLE_4 = {"leg1": (0, 0.94, -1.6143), "leg2": (0, -0.94, 1.6143)}
TABLE_4 |= {"leg3": TABLE_4["leg1"], "leg4": TABLE_4["leg2"]}
TABLE_5 = (np.deg2rad([15, 10, 15]), np.array([0.020, 0.020, -0.020]))
TABLE_6 = {
    "leg1": (-0.61946, 1.12860, -2.1264),
    "leg2": (0.59703, -1.39350, 1.8965),
    "leg3": (0.16013, 0.87966, -1.7571),
    "leg4": (-0.18813, -0.99065, 1.4017),
}


@pytest.fixture(scope="module")
def mana(machines):
    return machines["mana"]


def joints(table):
    return {f"{leg}_{name}": value for leg in LEGS for name, value in zip(JOINTS, table[leg], strict=True)}


def test_limbs_are_their_joints_in_order(mana):
    assert mana.robot.limbs == {leg: tuple(f"{leg}_{name}" for name in JOINTS) for leg in LEGS}
    assert mana.robot.feet == {leg: f"{leg}_foot" for leg in LEGS}
    assert mana.robot.hands == {}


# --- dimensions and axes


@pytest.mark.parametrize("leg", LEGS)
def test_places_of_joints_and_feet_with_straight_legs(mana, leg):
    at = mana.placements(mana.q({}))
    front, left = CORNERS[leg]
    hip1 = np.array([front * 0.105, left * 0.040, 0.0])
    hip2 = hip1 + [0.0, left * D, -L1]
    for frame, place in (
        ("hip1", hip1),
        ("hip2", hip2),
        ("knee", hip2 - [0.0, 0.0, L2]),
        ("foot", hip2 - [0.0, 0.0, L2 + L3]),
    ):
        np.testing.assert_allclose(at[f"{leg}_{frame}"].translation, place, atol=1e-12, err_msg=frame)


@pytest.mark.parametrize("leg", LEGS)
def test_leg_kinematics_of_equation_1_turned_by_180_degrees_on_the_right(mana, leg):
    turned = np.diag([1.0, 1.0, 1.0] if leg in LEFT else [-1.0, -1.0, 1.0])
    rng = np.random.default_rng(3)
    for a, b, c in rng.uniform(-1.0, 1.0, (20, 3)) * np.deg2rad([60, 95, 130]):
        at = mana.placements(mana.q(joints(dict.fromkeys(LEGS, (a, b, c)))))
        foot = at[f"{leg}_foot"]
        reach = L1 + L2 * np.cos(b) + L3 * np.cos(b + c)
        x = -L2 * np.sin(b) - L3 * np.sin(b + c)
        y, z = D * np.cos(a) + reach * np.sin(a), D * np.sin(a) - reach * np.cos(a)
        root = np.array([*np.multiply(CORNERS[leg], (0.105, 0.040)), 0.0])
        np.testing.assert_allclose(foot.translation, root + turned @ [x, y, z], atol=1e-12)
        turn = pin.utils.rotate("x", a) @ pin.utils.rotate("y", b + c)
        np.testing.assert_allclose(foot.rotation, turned @ turn, atol=1e-12)


def test_feet_are_the_centres_of_balls_of_15_mm(mana):
    at = mana.placements(mana.q("stand"))
    placed = mana.solids.createData()
    pin.updateGeometryPlacements(mana.model, mana.model.createData(), mana.solids, placed, mana.q("stand"))
    balls = [
        (shape.geometry.radius, place.translation)
        for shape, place in zip(mana.solids.geometryObjects, placed.oMg, strict=True)
        if type(shape.geometry).__name__ == "Sphere"
    ]
    assert [radius for radius, _ in balls] == pytest.approx([0.0075] * 4)
    for leg, (_, centre) in zip(LEGS, balls, strict=True):
        np.testing.assert_allclose(at[f"{leg}_foot"].translation, centre, atol=1e-12)


def test_ranges_of_section_5_1(mana):
    for leg in LEGS:
        for name, degrees in zip(JOINTS, (60, 95, 130), strict=True):
            lower, upper = mana.robot.joint_limits(f"{leg}_{name}")
            np.testing.assert_allclose(np.rad2deg([lower, upper]), [-degrees, degrees], atol=1e-9)


# --- Tables 4 to 6


def test_initial_pose_of_table_4(mana):
    assert mana.states("all")["stand"] == pytest.approx(joints(TABLE_4), abs=1e-12)
    state = mana.robot.state("stand")
    assert state.pose("body").translation == pytest.approx([0, 0, 0.150005], abs=5e-7)
    for leg, (front, left) in CORNERS.items():
        foot = state.pose(f"{leg}_foot").translation
        np.testing.assert_allclose(foot, [front * 0.104995, left * 0.080, 0.0], atol=5e-7)


def test_body_pose_of_table_5_with_joints_of_table_6_meets_the_feet(mana):
    stand = mana.robot.state("stand")
    (roll, pitch, yaw), shift = TABLE_5
    turn = pin.rpy.rpyToMatrix(roll, pitch, yaw)  # R = Rz(yaw) Ry(pitch) Rx(roll)
    q = mana.q(joints(TABLE_6))
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(turn, stand.pose("body").translation + shift))
    moved = mana.robot.state(q)
    for leg in LEGS:
        off = moved.pose(f"{leg}_foot").translation - stand.pose(f"{leg}_foot").translation
        assert np.linalg.norm(off) < 1e-5, leg


def test_centre_of_mass_stands_over_the_centre_of_the_feet(mana):
    state = mana.robot.state("stand")
    assert mana.robot.total_mass == pytest.approx(2.0, abs=1e-9)
    np.testing.assert_allclose(state.com[:2], 0.0, atol=1e-6)
    assert 0.0 < state.pose("body").translation[2] - state.com[2] < 0.025


# --- what it can do


def test_it_goes_to_the_body_pose_of_table_5_and_back(mana, sway):
    (roll, pitch, yaw), shift = TABLE_5
    plan = sway(mana.robot, "stand", shift, pin.log3(pin.rpy.rpyToMatrix(roll, pitch, yaw)))
    assert plan.check().ok
    farthest = plan.trajectory.q[len(plan.trajectory.q) // 2]
    for joint, value in joints(TABLE_6).items():
        assert farthest[mana.robot.joint_index(joint)[0]] == pytest.approx(value, abs=2e-3), joint


def test_a_leg_folded_inward_touches_the_body(mana):
    # The test of all poses could see it.
    active = mana.solids_with(set(mana.disabled()), keep=False)
    inward = dict(zip(("leg1_hip1", "leg1_hip2", "leg1_knee"), np.deg2rad([-40, 90, 90]), strict=True))
    assert ("body", "leg1_shank") in mana.hits(active, mana.q(inward))
