"""Hex-Piderix against the paper: Denavit-Hartenberg chain, thorax, and the numeric example as corrected."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

LEGS = tuple(f"leg{k}" for k in range(1, 7))
AZIMUTHS = dict(zip(LEGS, np.deg2rad([0, 60, 120, 180, 240, 300]), strict=True))
D1, D2, D3 = 0.05761, 0.06454, 0.1411  # the paper prints 11.41 mm for the last
# The example in its own world (y up) [m]: coxae of legs 1, 3, 5, the cups they really belong to, {Q} twice.
P = (
    np.array([[161.549919, 218.769, 193.523252], [116.497, 218.769, 70.298], [30.387, 218.769, 196.766]])
    / 1e3
)
S = np.array([[253.766, 30.166, 253.893], [124.61, 30.166, -39.261], [-68.822, 30.166, 243.952]]) / 1e3
CENTROID = np.array([102.811306, 218.769, 153.529084]) / 1e3
CENTRE = np.array([117.49596, 218.769, 163.52763]) / 1e3
TRIPOD = ("leg1", "leg3", "leg5")


@pytest.fixture(scope="module")
def hexpiderix(machines):
    return machines["hexpiderix"]


@pytest.fixture(scope="module")
def thorax():
    """The thorax's pose in the example: X to P1, Y from P3 to P2, in the middle of its six coxae."""
    middle = (P[1] + P[2]) / 2
    x, y = P[0] - middle, P[1] - P[2]
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return pin.SE3(np.column_stack((x, y, np.cross(x, y))), (P[0] + middle) / 2)


def denavit_hartenberg(theta, alpha, a, d):
    """Equation (6)."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def test_limbs_are_their_joints_in_order(hexpiderix):
    robot = hexpiderix.robot
    assert robot.limbs == {leg: tuple(f"{leg}_joint{k}" for k in (1, 2, 3)) for leg in LEGS}
    assert robot.feet == {leg: f"{leg}_foot" for leg in LEGS}
    assert robot.hands == {}


# --- the chain of a leg, and where the legs are


@pytest.mark.parametrize("leg", LEGS)
def test_leg_is_the_denavit_hartenberg_chain_of_table_1(hexpiderix, leg):
    coxa = hexpiderix.placements(hexpiderix.q({}))[f"{leg}_joint1"]
    rng = np.random.default_rng(4)
    low, high = np.array([hexpiderix.robot.joint_limits(f"{leg}_joint{k}") for k in (1, 2, 3)]).T
    for q1, q2, q3 in rng.uniform(low, high, (20, 3)):
        at = hexpiderix.placements(
            hexpiderix.q({f"{leg}_joint{k}": v for k, v in enumerate((q1, q2, q3), 1)})
        )
        chain = (
            denavit_hartenberg(q1, np.pi / 2, D1, 0.0)
            @ denavit_hartenberg(q2, 0.0, D2, 0.0)
            @ denavit_hartenberg(q3, 0.0, D3, 0.0)
        )
        found = coxa.actInv(at[f"{leg}_foot"]).homogeneous
        np.testing.assert_allclose(found, chain, atol=1e-11)


def test_coxae_form_two_isosceles_triangles_and_legs_point_outward_every_60_degrees(hexpiderix):
    at = hexpiderix.placements(hexpiderix.q({}))
    place = {leg: at[f"{leg}_joint1"].translation for leg in LEGS}
    for apex, one, other in (TRIPOD, ("leg4", "leg2", "leg6")):
        assert np.linalg.norm(place[one] - place[other]) == pytest.approx(0.153, abs=1e-9)
        for side in (one, other):
            assert np.linalg.norm(place[apex] - place[side]) == pytest.approx(0.131203, abs=1e-9)
    np.testing.assert_allclose(sum(place.values()), 0.0, atol=1e-11)
    for leg, azimuth in AZIMUTHS.items():
        outward = [np.cos(azimuth), np.sin(azimuth), 0.0]
        np.testing.assert_allclose(at[f"{leg}_joint1"].rotation[:, 0], outward, atol=1e-11)
    np.testing.assert_allclose(
        at["centroid"].translation, np.mean([place[leg] for leg in TRIPOD], axis=0), atol=1e-11
    )


# --- the numeric example, corrected


def test_example_puts_the_cups_of_legs_1_3_5_on_their_points(hexpiderix, thorax):
    at = hexpiderix.placements(hexpiderix.q("example"))
    for leg, p, s in zip(TRIPOD, P, S, strict=True):
        np.testing.assert_allclose(thorax.act(at[f"{leg}_joint1"].translation), p, atol=5e-7, err_msg=leg)
        np.testing.assert_allclose(thorax.act(at[f"{leg}_foot"].translation), s, atol=5e-7, err_msg=leg)


def test_example_has_the_angles_of_its_inverse_kinematics(hexpiderix):
    angles = hexpiderix.states("all")["example"]
    found = [np.rad2deg([angles[f"{leg}_joint{k}"] for k in (2, 3)]) for leg in TRIPOD]
    expected = [[-47.7935, -38.4473], [-47.7605, -38.6381], [-47.7605, -38.6382]]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_frames_of_the_example(hexpiderix, thorax):
    centroid = hexpiderix.placements(hexpiderix.q("example"))["centroid"]
    np.testing.assert_allclose(thorax.act(centroid.translation), CENTROID, atol=1e-7)
    np.testing.assert_allclose(thorax.translation, CENTRE, atol=1e-7)
    np.testing.assert_allclose(
        thorax.rotation.T, [[0.82659, 0, 0.56281], [0.56281, 0, -0.82659], [0, 1, 0]], atol=1e-5
    )


def test_all_six_cups_are_on_one_plane_in_every_pose(hexpiderix):
    for pose in hexpiderix.states("all"):
        state = hexpiderix.robot.state(pose)
        heights = [state.pose(f"{leg}_foot").translation[2] for leg in LEGS]
        np.testing.assert_allclose(heights, 0.0, atol=1e-9, err_msg=pose)
    assert hexpiderix.robot.state("example").q[2] == pytest.approx(0.188603, abs=1e-9)


def test_a_tibia_of_the_printed_length_reaches_no_cup(hexpiderix):
    # Joint 2 to cup, by what each link reaches: |d2 - d3| to d2 + d3.
    at = hexpiderix.placements(hexpiderix.q("example"))
    for leg in TRIPOD:
        distance = np.linalg.norm(at[f"{leg}_foot"].translation - at[f"{leg}_joint2"].translation)
        assert D2 + 0.01141 < distance < D2 + D3


@pytest.mark.parametrize("pose", ["stand", "low"])
def test_cups_lie_flat(hexpiderix, pose):
    at = hexpiderix.placements(hexpiderix.q(pose))
    for leg in LEGS:
        np.testing.assert_allclose(at[f"{leg}_foot"].rotation[:, 0], [0, 0, -1], atol=1e-11)


# --- what it can do


def test_thorax_turns_and_shifts_on_six_cups(hexpiderix, sway):
    plan = sway(hexpiderix.robot, "stand", (0.015, 0.010, 0.010), (0.08, 0.05, 0.12), margin=0.05)
    assert plan.check().ok
    assert plan.bundle.phases[0]["tasks"][0]["position"] < 1e-3


def test_neighbours_turned_at_each_other_touch(hexpiderix):
    # The test of all poses could see it.
    active = hexpiderix.solids_with(set(hexpiderix.disabled()), keep=False)
    values = hexpiderix.states("all")["stand"] | {"leg1_joint1": 1.0, "leg2_joint1": -1.0}
    hits = hexpiderix.hits(active, hexpiderix.q(values))
    assert any({one.split("_")[0], other.split("_")[0]} == {"leg1", "leg2"} for one, other in hits)
