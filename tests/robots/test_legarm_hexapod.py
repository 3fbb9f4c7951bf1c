"""The leg-arm hexapod against the paper's tables: lengths, masses, ranges, forward kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

ARMS, LEGS = ("limb1", "limb2"), ("leg3", "leg4", "leg5", "leg6")
LIMBS = (*ARMS, *LEGS)


# --- names


def test_limbs_are_their_joints_in_order(legarm):
    groups = {g.attrib["name"]: [m.attrib["name"] for m in g] for g in legarm.meaning.findall("group")}
    arm = ["joint1", "joint2", "joint3", "joint4", "joint5", "shank2", "finger_a", "finger_b"]
    for limb in LIMBS:
        assert groups[limb] == [f"{limb}_{joint}" for joint in (arm if limb in ARMS else arm[:3])]
    assert groups["all"] == list(LIMBS)
    assert groups["feet"] == [f"{limb}_foot" for limb in LIMBS]
    assert groups["hands"] == [f"{limb}_tip" for limb in ARMS]
    assert sorted(j for limb in LIMBS for j in groups[limb]) == sorted(legarm.model.names[2:])


# --- Table 1


@pytest.mark.parametrize("limb", LIMBS)
def test_lengths_of_table_1(legarm, limb):
    at = legarm.placements(legarm.q({f"{x}_shank2": 0.07 for x in ARMS}))

    def along(frame, base):
        return list(np.round(at[base].actInv(at[frame]).translation, 9))

    assert np.linalg.norm(at[f"{limb}_joint1"].translation) == pytest.approx(0.200)
    assert along(f"{limb}_joint2", f"{limb}_joint1") == [0.065, 0, 0]
    assert along(f"{limb}_joint3", f"{limb}_joint2") == [0.120, 0, 0]
    assert along(f"{limb}_foot", f"{limb}_joint3") == [0.270, 0, 0]
    if limb in ARMS:
        assert along(f"{limb}_joint4", f"{limb}_joint3") == [0.200, 0, 0]
        assert along(f"{limb}_joint5", f"{limb}_joint4") == [0.025, 0, 0]
        assert along(f"{limb}_tip", f"{limb}_joint5") == [0.105, 0, 0]
        at = legarm.placements(legarm.q({f"{limb}_shank2": 0.0}))
        assert along(f"{limb}_foot", f"{limb}_joint3") == [0.200, 0, 0]


def test_limbs_stand_every_60_degrees_and_90_degrees_is_outward_in_the_legs(legarm):
    at = legarm.placements(legarm.q({}))
    for limb, azimuth in zip(LIMBS, np.deg2rad([120, 60, 0, -60, -120, 180]), strict=True):
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        np.testing.assert_allclose(at[f"{limb}_joint1"].translation, 0.2 * outward, atol=1e-11)
        y = at[f"{limb}_joint1"].rotation[:, 1]
        np.testing.assert_allclose(y, outward if limb in LEGS else [0, 1, 0], atol=1e-11)


# --- Table 2


def test_masses_of_table_2(legarm):
    model = legarm.model
    found = dict.fromkeys(("body", *LIMBS), 0.0)
    for name, inertia in zip(model.names[1:], model.inertias[1:], strict=True):
        found["body" if name == "root_joint" else name.split("_")[0]] += inertia.mass
    body = 0.393 + 0.377 + 0.450 + 2 * 0.420 + 0.055
    expected = {"body": body, **dict.fromkeys(ARMS, 0.862), **dict.fromkeys(LEGS, 0.667)}
    assert found == pytest.approx(expected, abs=1e-9)
    assert pin.computeTotalMass(model) == pytest.approx(6.507, abs=1e-9)


def test_components_sit_behind_to_balance_the_arms(legarm):
    # "The distribution of components (battery, slave computer) can be set with a negative y-axis offset."
    x, y, _ = legarm.model.inertias[1].lever
    assert y < -0.01
    assert x == pytest.approx(0.0, abs=1e-9)


# --- Table 3, and the servos that Table 2 names: stall torque [N m] and speed [rad/s]

DRS_0401, DRS_0101 = (52 * 0.0980665, 7.124), (12 * 0.0980665, 6.308)
RANGES = {
    "joint1": ((0, 180), DRS_0401),
    "joint2": ((-60, 60), DRS_0401),
    "joint3": ((-30, 60), DRS_0401),
    "joint4": ((0, 180), DRS_0101),
    "joint5": ((0, 180), DRS_0101),
    "finger_a": ((0, 90), DRS_0101),
    "finger_b": ((0, 90), DRS_0101),
}


def test_ranges_of_table_3_and_what_the_servos_can_do(legarm):
    model = legarm.model
    for joint in model.names[2:]:
        limb, name = joint.split("_", 1)
        q, v = model.joints[model.getJointId(joint)].idx_q, model.joints[model.getJointId(joint)].idx_v
        found = (model.lowerPositionLimit[q], model.upperPositionLimit[q])
        drive = (model.effortLimit[v], model.velocityLimit[v])
        if name == "shank2":
            assert (found, drive) == ((0.0, 0.07), (60.0, 0.1))
            continue
        span, servo = RANGES[name]
        span = (-180, 0) if (limb, name) == ("limb1", "joint5") else span  # mirrored
        np.testing.assert_allclose(np.rad2deg(found), span, atol=1e-9, err_msg=joint)
        np.testing.assert_allclose(drive, servo, rtol=1e-4, err_msg=joint)


# --- equations 19 and 20, corrected: theta = (60, -10, 30, 40, 50) degrees

EXAMPLE = np.deg2rad([60, -10, 30, 40, 50])


def arm_at(legarm, limb, angles):
    return legarm.q({f"{limb}_joint{k}": angle for k, angle in enumerate(angles, start=1)})


@pytest.mark.parametrize("limb", ARMS)
def test_forward_kinematics_of_the_arm(legarm, limb):
    # {O_i} is parallel to {COB}: position and rotation of the tip count from where joint 1 is.
    root = legarm.placements(legarm.q({}))[f"{limb}_joint1"].translation
    tip = legarm.placements(arm_at(legarm, limb, EXAMPLE))[f"{limb}_tip"]
    np.testing.assert_allclose(tip.translation - root, [0.139022437, 0.401663258, -0.127667274], atol=1e-9)
    rows = [[-0.502717, -0.748182, 0.433013], [0.661357, -0.010313, 0.75], [-0.556670, 0.663414, 0.5]]
    np.testing.assert_allclose(tip.rotation, rows, atol=1e-6)


def test_limb_1_mirrors_limb_2_within_its_own_ranges(legarm):
    mirrored = EXAMPLE * [-1, 1, 1, 1, -1] + [np.pi, 0, 0, 0, 0]
    left, right = arm_at(legarm, "limb1", mirrored), arm_at(legarm, "limb2", EXAMPLE)
    for q in (left, right):
        assert np.all(q[7:] >= legarm.model.lowerPositionLimit[7:])
        assert np.all(q[7:] <= legarm.model.upperPositionLimit[7:])
    a, b = legarm.placements(right)["limb2_tip"], legarm.placements(left)["limb1_tip"]
    np.testing.assert_allclose(a.translation * [-1, 1, 1], b.translation, atol=1e-11)
    np.testing.assert_allclose(a.rotation[:, 0] * [-1, 1, 1], b.rotation[:, 0], atol=1e-11)
