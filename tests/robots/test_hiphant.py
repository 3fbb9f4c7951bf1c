"""HIphanT: given sizes and masses, legs and arm in closed form, ranges, the reach along y of its paper."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

LEGS = ("rf", "lf", "rr", "lr")
FRONT = {"rf": 1, "lf": 1, "rr": -1, "lr": -1}
LEFT = {"rf": -1, "lf": 1, "rr": -1, "lr": 1}
ARM = tuple(f"arm_joint{k}" for k in range(1, 7))
GRAVITY = 9.80665


@pytest.fixture(scope="module")
def hiphant(machines):
    return machines["hiphant"]


@pytest.fixture(scope="module")
def robot(hiphant) -> wb.Robot:
    return hiphant.robot


def turn(axis: str, angle: float) -> np.ndarray:
    return np.asarray(pin.utils.rotate(axis, float(angle)))


def random_joints(robot: wb.Robot, count: int = 50):
    rng = np.random.default_rng(4)
    model = robot.model
    for _ in range(count):
        q = pin.neutral(model)
        q[7:] = rng.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
        yield robot.state(q)


# --- given numbers


def test_names(robot):
    legs = {leg: tuple(f"{leg}_joint{k}" for k in (1, 2, 3)) for leg in LEGS}
    assert dict(robot.limbs) == legs | {"arm": ARM}
    assert dict(robot.feet) == {leg: f"{leg}_foot" for leg in LEGS}
    assert dict(robot.hands) == {"arm": "arm_tip"}
    assert {"stand", "ready"} <= set(robot.poses)


def test_45_kg_of_which_10_are_the_arm(hiphant):
    masses = {
        link.attrib["name"]: float(inertial.find("mass").attrib["value"])
        for link in hiphant.links.iter("link")
        if (inertial := link.find("inertial")) is not None
    }
    arm = sum(mass for link, mass in masses.items() if link.startswith("arm_"))
    assert arm == pytest.approx(10.0)
    assert sum(masses.values()) - arm == pytest.approx(35.0)
    assert pin.computeTotalMass(hiphant.model) == pytest.approx(45.0)


def test_twelve_modules_of_2_3_kg_are_in_the_platform(hiphant, run_script):
    # Each is a part of that mass in the link that carries it: four in the torso, two in every leg.
    legs = run_script("hiphant/generate.py")
    links = [legs.body(), *(make(leg) for leg in LEGS for make in (legs.hip, legs.thigh, legs.shank))]
    counts = {link.name: sum(part.mass == 2.3 for part in link.parts) for link in links}
    assert sum(counts.values()) == 12
    assert counts["body"] == 4
    assert all(counts[f"{leg}_hip"] == counts[f"{leg}_thigh"] == 1 for leg in LEGS)


def test_the_torso_is_one_metre_by_half_a_metre(hiphant):
    size = np.zeros(3)
    for shape in hiphant.solids.geometryObjects:
        if hiphant.link_of(shape) == "body":
            shape.geometry.computeLocalAABB()
            half = (shape.geometry.aabb_local.max_ - shape.geometry.aabb_local.min_) / 2
            size = np.maximum(size, abs(shape.placement.translation) + abs(shape.placement.rotation) @ half)
    np.testing.assert_allclose(2 * size[:2], [1.0, 0.5], atol=1e-9)


# --- legs


def test_feet_are_where_the_legs_three_turns_put_them(robot):
    for state in random_joints(robot):
        for leg in LEGS:
            a, b, c = (state.joint(f"{leg}_joint{k}") for k in (1, 2, 3))
            hip = np.array([0.4 * FRONT[leg], 0.2 * LEFT[leg], 0.0])
            down = np.array([0.0, 0.0, -0.3])
            leg_plane = np.array([0.0, 0.08 * LEFT[leg], 0.0]) + turn("y", b) @ (down + turn("y", c) @ down)
            found = state.pose(f"{leg}_foot").translation
            np.testing.assert_allclose(found, hip + turn("x", a) @ leg_plane, atol=1e-11)


def test_it_stands_over_its_feet(robot, hiphant):
    state = robot.state("stand")
    assert state.q[2] == pytest.approx(0.45, abs=1e-9)
    for leg in LEGS:
        foot = state.pose(f"{leg}_foot").translation
        np.testing.assert_allclose(foot, [0.4 * FRONT[leg], 0.28 * LEFT[leg], 0.0], atol=1e-9)
    # The balloons rest on the ground, neither in it nor above it.
    placed = hiphant.solids.createData()
    pin.updateGeometryPlacements(hiphant.model, hiphant.model.createData(), hiphant.solids, placed, state.q)
    bottoms = [
        place.translation[2] - shape.geometry.radius
        for shape, place in zip(hiphant.solids.geometryObjects, placed.oMg, strict=True)
        if type(shape.geometry).__name__ == "Sphere"
    ]
    np.testing.assert_allclose(bottoms, np.zeros(4), atol=1e-9)


def test_knees_turn_more_than_once_round_past_thigh_and_hip(robot, hiphant):
    own = {frozenset((f"{leg}_shank", f"{leg}_{link}")) for leg in LEGS for link in ("thigh", "hip")}
    near = hiphant.solids_with(own, keep=True)
    low, high = robot.joint_limits("lf_joint3")
    assert high - low > 2 * np.pi
    for angle in np.linspace(low, high, 73):
        q = hiphant.q({f"{leg}_joint3": float(angle) for leg in LEGS})
        assert hiphant.hits(near, q) == set(), f"at {angle:.2f}"


def test_legs_have_the_modules_stall_torque_and_stand_on_it(robot):
    state, model = robot.state("stand"), robot.model
    data = model.createData()
    weight = pin.computeGeneralizedGravity(model, data, state.q)
    J = pin.computeFrameJacobian(model, data, state.q, robot.frame_id("rf_foot"), pin.LOCAL_WORLD_ALIGNED)
    for k, expected in ((1, 18.5), (2, 5.0), (3, 43.6)):  # on two legs, the README's numbers
        v = robot.joint_index(f"rf_joint{k}")[1]
        assert model.effortLimit[v] == 80.0
        assert abs(weight[v] - J[2, v] * 45.0 * GRAVITY / 2) == pytest.approx(expected, abs=0.1)


# --- arm


def test_the_tip_is_where_the_arms_six_turns_put_it(robot):
    upper, fore, hand = (np.array([length, 0.0, 0.0]) for length in (0.38, 0.34, 0.18))
    for state in random_joints(robot):
        q1, q2, q3, q4, q5, q6 = (state.joint(joint) for joint in ARM)
        a = turn("z", q1) @ turn("y", q2)
        b = a @ turn("y", q3)
        c = b @ turn("x", q4) @ turn("y", q5) @ turn("x", q6)
        tip = state.pose("arm_tip")
        shoulder = np.array([0.35, 0.0, 0.08 + 0.14])
        np.testing.assert_allclose(tip.rotation, c, atol=1e-11)
        np.testing.assert_allclose(tip.translation, shoulder + a @ upper + b @ fore + c @ hand, atol=1e-11)


def test_the_stretched_arm_holds_itself_and_three_kilograms(robot):
    q = np.array(robot.state("stand").q)
    for joint in ARM:
        q[robot.joint_index(joint)[0]] = 0.0
    model, data = robot.model, robot.model.createData()
    weight = pin.computeGeneralizedGravity(model, data, q)
    J = pin.computeFrameJacobian(model, data, q, robot.frame_id("arm_tip"), pin.LOCAL_WORLD_ALIGNED)
    for joint in ARM:
        v = robot.joint_index(joint)[1]
        assert abs(weight[v] + J[2, v] * 3.0 * GRAVITY) < model.effortLimit[v], joint


def test_manipulability_is_of_the_papers_size(robot):
    # Columns: base translation, base rotation about its origin, six arm joints; the paper starts from 6.54.
    state = robot.state("ready")
    J = pin.computeFrameJacobian(
        robot.model, robot.model.createData(), state.q, robot.frame_id("arm_tip"), pin.LOCAL_WORLD_ALIGNED
    )
    whole = np.eye(6, 12)
    whole[:3, 3:6] = -pin.skew(state.pose("arm_tip").translation - state.q[:3])
    whole[:, 6:] = J[:, [robot.joint_index(joint)[1] for joint in ARM]]
    assert np.sqrt(np.linalg.det(whole @ whole.T)) == pytest.approx(6.75, abs=0.01)


# --- it plans


def phase(robot: wb.Robot, margin: float, seconds: float, **tasks) -> wb.Phase:
    return wb.Phase(
        "move",
        contacts=[wb.Contact(foot, friction=0.6) for foot in robot.feet.values()],
        limits=[wb.JointLimits(speed=0.8), wb.SupportPolygon(margin=margin)],
        duration=seconds,
        **tasks,
    )


def test_it_sways_on_four_feet(robot, hiphant):
    here = robot.state("stand").pose("body")

    def at(xyz, rpy):
        return pin.SE3(pin.exp3(np.radians(rpy)), here.translation + np.array(xyz))

    way = [wb.AS_IS, at((0.05, 0.04, -0.04), (6, 0, 8)), at((-0.05, -0.04, 0.03), (-6, 5, -8)), here]
    sway = wb.PoseTask("body", wb.Waypoints((0.0, 0.8, 1.6, 2.4), way), weight=20.0)
    plan = wb.plan(robot, phase(robot, 0.15, 2.4, soft=[sway, wb.PostureTask(weight=0.01)]), dt=0.02)
    report = plan.check()
    assert report.ok, report
    worst = plan.bundle.phases[0]["tasks"][0]
    assert worst["position"] < 2e-3
    assert worst["orientation"] < 3e-3
    for q in plan.trajectory.q[::10]:
        assert hiphant.hits(hiphant.checked, q) == set()


def test_the_tip_moves_40_cm_to_the_left_and_nothing_else_of_it_moves(robot, hiphant):
    start = robot.state("ready").pose("arm_tip")
    goal = pin.SE3(start.rotation, start.translation + np.array([0.0, 0.4, 0.0]))
    plan = wb.plan(
        robot,
        phase(
            robot,
            0.2,
            3.2,
            hard=[wb.PoseTask("arm_tip", wb.MinJerk(wb.AS_IS, goal, 3.0))],
            soft=[wb.PoseTask("body"), wb.PostureTask(weight=0.1)],
        ),
        start="ready",
        dt=0.02,
    )
    report = plan.check()
    assert report.ok, report
    tips = [wb.State(robot.model, q).pose("arm_tip") for q in plan.trajectory.q]
    off = np.array([tip.translation - start.translation for tip in tips])
    assert off[-1, 1] == pytest.approx(0.4, abs=1e-5)
    assert abs(off[:, [0, 2]]).max() < 1e-4
    assert max(np.linalg.norm(pin.log3(start.rotation.T @ tip.rotation)) for tip in tips) < 1e-3
    assert plan.trajectory.margin.min() > 0.2 - 1e-6
    for q in plan.trajectory.q[::10]:
        assert hiphant.hits(hiphant.checked, q) == set()
