"""The heavy hexapod against its paper: layout, equations 5 to 15, ranges, what its drives hold, a plan."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

LEGS = tuple(f"leg{k}" for k in range(1, 7))
PHI = dict(zip(LEGS, np.deg2rad([120, 180, 240, 300, 360, 60]), strict=True))
COXA, THIGH, SHIN, RADIUS = 0.18, 0.5, 0.5, 0.4
GRAVITY = 9.80665
LOAD = 1519.0  # [N]


@pytest.fixture(scope="module")
def heavy(machines):
    return machines["heavy_hexapod"]


@pytest.fixture(scope="module")
def robot(heavy) -> wb.Robot:
    return heavy.robot


def leg_angles(state: wb.State, leg: str) -> tuple[float, float, float]:
    theta, hip, gamma = (state.joint(f"{leg}_{joint}") for joint in ("abductor", "hip", "knee"))
    return theta, hip, gamma


# --- layout and masses


def test_names_are_the_papers(robot):
    assert dict(robot.limbs) == {x: (f"{x}_abductor", f"{x}_hip", f"{x}_knee") for x in LEGS}
    assert dict(robot.feet) == {leg: f"{leg}_foot" for leg in LEGS}
    assert dict(robot.hands) == {}
    assert set(robot.poses) == {"stand", "crab", "low"}


@pytest.mark.parametrize("leg", LEGS)
def test_abductors_stand_on_a_hexagon_and_links_have_their_lengths(heavy, leg):
    at = heavy.placements(heavy.q({}))
    outward = np.array([np.cos(PHI[leg]), np.sin(PHI[leg]), 0.0])
    np.testing.assert_allclose(at[f"{leg}_abductor"].translation, RADIUS * outward, atol=1e-11)
    places = [(f"{leg}_hip", COXA), (f"{leg}_knee", COXA + THIGH), (f"{leg}_foot", COXA + THIGH + SHIN)]
    for frame, reach in places:
        np.testing.assert_allclose(at[frame].translation, (RADIUS + reach) * outward, atol=1e-11)


def test_three_hundred_kilograms_half_of_them_in_the_legs(heavy):
    assert pin.computeTotalMass(heavy.model) == pytest.approx(300.0)
    moving = dict.fromkeys(LEGS, 0.0)
    for name, inertia in zip(heavy.model.names[2:], heavy.model.inertias[2:], strict=True):
        moving[name.split("_")[0]] += inertia.mass
    assert moving == pytest.approx(dict.fromkeys(LEGS, 25.0))
    # The legs are evenly round a body that is alike on both sides.
    np.testing.assert_allclose(heavy.model.inertias[1].lever[:2], 0.0, atol=1e-9)


# --- equations 5 to 15


def random_states(robot: wb.Robot, count: int = 50):
    rng = np.random.default_rng(3)
    model = robot.model
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    for _ in range(count):
        q = pin.neutral(model)
        q[:3] = rng.uniform(-1, 1, 3)
        q[3:7] = pin.Quaternion(pin.exp3(rng.uniform(-1, 1, 3))).coeffs()
        q[7:] = rng.uniform(low, high)
        yield robot.state(q)


def test_feet_are_where_equation_12_puts_them(robot):
    for state in random_states(robot):
        for leg, phi in PHI.items():
            theta, hip, gamma = leg_angles(state, leg)
            beta = hip + gamma
            reach = SHIN * np.cos(beta) + THIGH * np.cos(hip) + COXA
            foot = [
                np.cos(phi + theta) * reach + RADIUS * np.cos(phi),
                np.sin(phi + theta) * reach + RADIUS * np.sin(phi),
                SHIN * np.sin(beta) + THIGH * np.sin(hip),
            ]
            found = state.pose("body").actInv(state.pose(f"{leg}_foot")).translation
            np.testing.assert_allclose(found, foot, atol=1e-11)


def test_the_shin_is_turned_as_in_equation_9(robot):
    # The paper's knee frame has z along -y of the leg's; its other axes are the shin's x and z here.
    for state in random_states(robot):
        for leg, phi in PHI.items():
            theta, hip, gamma = leg_angles(state, leg)
            (c, s), (cb, sb) = (np.cos(theta), np.sin(theta)), (np.cos(hip + gamma), np.sin(hip + gamma))
            rotation = np.array([[c * cb, -c * sb, s], [s * cb, -s * sb, -c], [sb, cb, 0.0]])
            base = pin.utils.rotate("z", phi)
            shin = (state.pose("body").inverse() * state.pose(f"{leg}_shin")).rotation
            np.testing.assert_allclose(shin, base @ rotation @ pin.utils.rotate("x", -np.pi / 2), atol=1e-11)


# --- ranges, and what the drives can do


def test_ranges_are_the_papers_knee_up(robot):
    def span(joint: str) -> list[float]:
        return [float(np.rad2deg(end)) for end in robot.joint_limits(joint)]

    # 30 degrees about an initial angle that legs 1, 3, 4, 6 may set from radial to parallel to the x axis.
    turns = {"leg1": [-30, 90], "leg3": [-90, 30], "leg4": [-30, 90], "leg6": [-90, 30]}
    for leg in LEGS:
        np.testing.assert_allclose(span(f"{leg}_abductor"), turns.get(leg, [-30, 30]), atol=1e-9)
        np.testing.assert_allclose(span(f"{leg}_hip"), [-90, 90], atol=1e-9)
        np.testing.assert_allclose(span(f"{leg}_knee"), [-150, 0], atol=1e-9)


def test_it_stands_as_high_as_in_the_experiment_knees_up(robot):
    state = robot.state("stand")
    assert state.q[2] == pytest.approx(0.6, abs=1e-9)
    for leg in LEGS:
        assert state.joint(f"{leg}_knee") < -0.5
        foot, knee = state.pose(f"{leg}_foot").translation, state.pose(f"{leg}_shin").translation
        assert knee[2] > 0.45
        assert np.hypot(*foot[:2]) == pytest.approx(1.1955, abs=1e-4)
        assert np.arctan2(foot[1], foot[0]) % (2 * np.pi) == pytest.approx(PHI[leg] % (2 * np.pi), abs=1e-9)


def test_in_pose_crab_every_leg_is_parallel_to_the_x_axis(robot):
    state = robot.state("crab")
    for leg in LEGS:
        x, y, _ = state.pose(f"{leg}_coxa").rotation[:, 0]
        assert [abs(x), y] == pytest.approx([1.0, 0.0], abs=1e-9)


def test_three_legs_hold_robot_and_load(robot):
    state, model = robot.state("stand"), robot.model
    data = model.createData()
    weight = pin.computeGeneralizedGravity(model, data, state.q)
    share = (300.0 * GRAVITY + LOAD) / 3
    use = []
    for joint in ("hip", "knee"):
        v = robot.joint_index(f"leg5_{joint}")[1]
        foot = robot.frame_id("leg5_foot")
        J = pin.computeFrameJacobian(model, data, state.q, foot, pin.LOCAL_WORLD_ALIGNED)
        use.append(abs(weight[v] - J[2, v] * share) / model.effortLimit[v])
    # The README's 854 and 189 N m.
    np.testing.assert_allclose(use, [854.3 / 1200.0, 189.2 / 800.0], rtol=2e-3)


# --- it plans


def test_it_sways_under_the_papers_load(robot, heavy):
    here = robot.state("stand").pose("body")
    load = wb.Body("load", mass=LOAD / GRAVITY, size=(0.4, 0.4, 0.3))
    on_deck = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.15]))

    def at(xyz, rpy):
        return pin.SE3(pin.exp3(np.radians(rpy)), here.translation + np.array(xyz))

    way = [wb.AS_IS, at((0.10, 0.06, -0.05), (5, 0, 8)), at((-0.10, 0.04, -0.10), (-5, 4, -8)), here]
    phase = wb.Phase(
        "sway",
        contacts=[wb.Contact(foot, friction=0.6) for foot in robot.feet.values()],
        carried=[wb.Carried(load, by="deck", pose=on_deck)],
        soft=[
            wb.PoseTask("body", wb.Waypoints((0.0, 1.0, 2.0, 3.0), way), weight=20.0),
            wb.PostureTask(weight=0.01),
        ],
        limits=[wb.JointLimits(speed=0.9), wb.SupportPolygon(margin=0.5)],
        duration=3.0,
    )
    plan = wb.plan(robot, phase, dt=0.02)
    report = plan.check()
    assert report.ok, report
    worst = plan.bundle.phases[0]["tasks"][0]
    assert worst["position"] < 2e-3
    assert worst["orientation"] < 2e-3
    assert np.ptp(plan.trajectory.q[:, 0]) > 0.19
    for q in plan.trajectory.q[::10]:
        assert heavy.hits(heavy.checked, q) == set()
