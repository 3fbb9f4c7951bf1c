"""The leg-arm hexapod's poses, roles and collision pairs: what a machine like this can really do."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

ARMS, LEGS = ("limb1", "limb2"), ("leg3", "leg4", "leg5", "leg6")
LIMBS = (*ARMS, *LEGS)
GRAVITY = 9.80665


@pytest.fixture(params=["stand", "manipulate", "folded"])
def pose(request):
    return request.param


def test_pitches_keep_five_degrees_from_their_limits(legarm, pose):
    for joint, value in legarm.states("all")[pose].items():
        if joint.endswith(("joint2", "joint3")):
            k = legarm.model.joints[legarm.model.getJointId(joint)].idx_q
            room = min(value - legarm.model.lowerPositionLimit[k], legarm.model.upperPositionLimit[k] - value)
            assert room >= np.deg2rad(5) - 1e-9, joint


def test_poses_hold_each_limb_in_one_role(legarm, pose):
    values = legarm.states("all")[pose]
    for limb in ARMS:
        held = legarm.states(limb)["arm" if pose == "manipulate" else "leg"]
        assert {joint: values[joint] for joint in held} == held


@pytest.mark.parametrize("limb", ARMS)
def test_roles_fold_and_withdraw(legarm, limb):
    roles = legarm.states(limb)
    leg = {"joint4": np.pi, "joint5": 0.0, "shank2": 0.07, "finger_a": 0.0, "finger_b": 0.0}
    arm = {"shank2": 0.0, "finger_a": np.pi / 2, "finger_b": np.pi / 2}
    assert set(roles) == {"leg", "arm"}
    assert roles["leg"] == pytest.approx({f"{limb}_{k}": v for k, v in leg.items()}, abs=1e-10)
    assert roles["arm"] == pytest.approx({f"{limb}_{k}": v for k, v in arm.items()}, abs=1e-10)


@pytest.mark.parametrize("limb", ARMS)
def test_folded_arm_lies_back_along_shank_1(legarm, limb):
    at = legarm.placements(legarm.q("stand"))
    tip = at[f"{limb}_joint3"].actInv(at[f"{limb}_tip"])
    np.testing.assert_allclose(tip.translation, [0.200 - 0.025 - 0.105, 0, 0], atol=1e-9)
    np.testing.assert_allclose(tip.rotation[:, 0], [-1, 0, 0], atol=1e-9)


def test_stand_is_a_regular_hexagon_of_feet(legarm):
    at = legarm.placements(legarm.q("stand"))
    feet = np.array([at[f"{limb}_foot"].translation for limb in LIMBS])
    assert np.ptp(feet[:, 2]) < 1e-9
    np.testing.assert_allclose(np.hypot(feet[:, 0], feet[:, 1]), 0.520, atol=1e-3)
    azimuth = np.rad2deg(np.arctan2(feet[:, 1], feet[:, 0])) % 360
    np.testing.assert_allclose(azimuth, [120, 60, 0, 300, 240, 180], atol=1e-6)


def test_nothing_reaches_below_the_feet(legarm):
    q = legarm.q("stand")
    ground = legarm.placements(q)["leg3_foot"].translation[2]
    placed = legarm.solids.createData()
    pin.updateGeometryPlacements(legarm.model, legarm.model.createData(), legarm.solids, placed, q)
    for shape, place in zip(legarm.solids.geometryObjects, placed.oMg, strict=True):
        if type(shape.geometry).__name__ == "Sphere":  # a foot on a shank at 60 degrees: 8 mm (1 - sin 60)
            assert place.translation[2] - shape.geometry.radius > ground - 0.0011, shape.name
            continue
        shape.geometry.computeLocalAABB()
        half = (shape.geometry.aabb_local.max_ - shape.geometry.aabb_local.min_) / 2
        assert place.translation[2] - abs(place.rotation[2]) @ half > ground - 1e-4, shape.name


def test_tips_face_each_other_across_the_box(legarm):
    at = legarm.placements(legarm.q("manipulate"))
    left, right = at["limb1_tip"], at["limb2_tip"]
    np.testing.assert_allclose(left.rotation, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(right.rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-9)
    gap = right.translation - left.translation
    np.testing.assert_allclose(gap, [0.3, 0.0, 0.0], atol=5e-3)
    assert left.translation[1] > 0.5


def test_four_legs_carry_the_robot_in_manipulate(legarm):
    q = legarm.q("manipulate")
    at = legarm.placements(q)
    feet = np.array([at[f"{leg}_foot"].translation for leg in LEGS])  # clockwise from above
    assert np.ptp(feet[:, 2]) < 1e-9
    com = pin.centerOfMass(legarm.model, legarm.model.createData(), q)
    for a, b in zip(feet, np.roll(feet, -1, axis=0), strict=True):
        along = (b - a)[:2] / np.linalg.norm((b - a)[:2])
        assert along[1] * (com - a)[0] - along[0] * (com - a)[1] > 0.10


# --- statics: the numbers by which the README reads Table 2


def hip_torque(legarm, q, leg, force):
    """Torque [N m] in joint 2 under an upward force [N] on the foot, less the leg's own weight."""
    model, data = legarm.model, legarm.model.createData()
    weight = pin.computeGeneralizedGravity(model, data, q)
    J = pin.computeFrameJacobian(model, data, q, model.getFrameId(f"{leg}_foot"), pin.LOCAL_WORLD_ALIGNED)
    v = model.joints[model.getJointId(f"{leg}_joint2")].idx_v
    return abs(float(weight[v] - J[2, v] * force))


def test_four_evenly_loaded_legs_hold_robot_and_box_below_stall(legarm):
    q = legarm.q("manipulate")
    share = (pin.computeTotalMass(legarm.model) + 0.8) * GRAVITY / 4
    worst = max(hip_torque(legarm, q, leg, share) for leg in LEGS)
    assert worst == pytest.approx(4.07, abs=0.01)
    assert worst < 5.1


# --- collisions


def test_crossed_limbs_do_touch(legarm):
    # Limbs 1 and 2 turned at each other: the test of all poses could see it.
    active = legarm.solids_with(set(legarm.disabled()), keep=False)
    q = legarm.q(legarm.states("all")["stand"] | {"limb1_joint1": 0.0, "limb2_joint1": np.pi})
    assert ("limb1_thigh", "limb2_thigh") in legarm.hits(active, q)


def test_a_limb_changes_its_role_without_touching_itself(legarm):
    # Joint 4 to 100 degrees and shank 2 together, then all the rest: inside the channel the arm cannot turn,
    # and the foot passes only behind an arm that stands across.
    active = legarm.solids_with(set(legarm.disabled()), keep=False)
    leg, arm = legarm.states("all")["stand"], legarm.states("all")["manipulate"]
    for s in np.linspace(0.0, 1.0, 81):
        values = dict(arm)
        for limb in ARMS:
            name = f"{limb}_joint4"
            values[name] = np.interp(2.0 * s, [0.0, 1.0, 2.0], [leg[name], np.radians(100.0), arm[name]])
            for joint in ("shank2", "joint5", "finger_a", "finger_b"):
                name, late = f"{limb}_{joint}", joint != "shank2"
                values[name] = leg[name] + float(np.clip(2 * s - late, 0, 1)) * (arm[name] - leg[name])
        assert legarm.least(active, legarm.q(values)) > 0.0054, f"at {s:.2f}"


def test_a_folded_limb_keeps_five_millimetres_however_the_knee_bends(legarm):
    active = legarm.solids_with(set(legarm.disabled()), keep=False)
    for knee in np.radians(np.linspace(-30.0, 60.0, 31)):
        values = legarm.states("all")["stand"] | {f"{limb}_joint3": knee for limb in ARMS}
        assert legarm.least(active, legarm.q(values)) > 0.0054
