from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbplan import Robot, SpecError
from wbplan.mechanism import (
    Platform,
    StanceLeg,
    body_acceleration,
    body_pose,
    body_twist,
    cup_leg,
    foot_plane,
    joint_rates,
    klein,
    origin_acceleration,
    point_leg,
    positions,
    projected_twist,
    rank,
    swap,
)
from wbplan.papers import constraint

TRIPODS = {
    "mana": ["leg1", "leg2", "leg3", "leg4"],
    "legarm_hexapod": ["limb1", "leg3", "leg5"],
    "hexpiderix": ["leg1", "leg3", "leg5"],
    "heavy_hexapod": ["leg1", "leg3", "leg5"],
    "hiphant": ["rf", "lf", "rr"],
}


def stance(robot: Robot, seed: int) -> tuple[np.ndarray, Platform, list[StanceLeg]]:
    random = np.random.default_rng(seed)
    q = np.array(robot.state("stand").q)
    moving = [
        robot.joint_index(j)[0] for j in Platform.of_robot(robot, robot.state(q), TRIPODS[robot.name]).joints
    ]
    q[moving] += random.uniform(-0.1, 0.1, len(moving))
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(random.uniform(-1, 1, 3)), random.uniform(-0.5, 0.5, 3)))
    platform = Platform.of_robot(robot, robot.state(q), TRIPODS[robot.name])
    body = pin.XYZQUATToSE3(q[:7])
    return q, platform, [point_leg(c, positions(robot, c.joints, q), body) for c in platform.chains.values()]


@pytest.mark.parametrize("name", sorted(TRIPODS))
def test_velocity_and_acceleration_are_the_constraint_jacobians(robots: dict[str, Robot], name: str) -> None:
    robot = robots[name]
    for seed in range(3):
        q, platform, legs = stance(robot, seed)
        random = np.random.default_rng(seed + 50)
        twist, wanted = random.uniform(-1, 1, 6), random.uniform(-1, 1, 6)
        speed = [leg.projection() @ swap(twist) for leg in legs]
        rise = [
            leg.projection() @ swap(wanted - leg.lie_terms(leg.passive_rates(twist, s), s))
            for leg, s in zip(legs, speed, strict=True)
        ]
        np.testing.assert_allclose(joint_rates(legs, twist), np.concatenate(speed), atol=1e-12)
        np.testing.assert_allclose(body_twist(legs, speed), twist, atol=1e-9)
        np.testing.assert_allclose(projected_twist(legs, np.concatenate(speed)), twist, atol=1e-9)
        np.testing.assert_allclose(body_acceleration(legs, speed, rise), wanted, atol=1e-9)
        feet = [robot.feet[n] for n in platform.chains]
        named = (dict(zip(platform.joints, np.concatenate(x), strict=True)) for x in (speed, rise))
        right = constraint.solve(robot, q, feet, *named)
        np.testing.assert_allclose(right.twist, twist, atol=1e-9)
        np.testing.assert_allclose(right.acceleration, wanted, atol=1e-9)


def test_the_reduced_acceleration_is_that_of_the_origin_less_the_transport_term() -> None:
    twist, reduced = np.array([0.0, 0.0, 2.0, 3.0, 0.0, 0.0]), np.zeros(6)
    # Turning about a fixed line: the body's point at the origin moves on a circle, a = omega x v.
    np.testing.assert_allclose(origin_acceleration(twist, reduced), [0, 0, 0, 0, 6.0, 0])


def test_wrenches_see_no_passive_joint(robots: dict[str, Robot]) -> None:
    robot = robots["hexpiderix"]
    q, platform, legs = stance(robot, 1)
    body = pin.XYZQUATToSE3(q[:7])
    for name, chain in platform.chains.items():
        angles = positions(robot, chain.joints, q)
        knee = robot.state(q).pose(f"{name}_tibia").translation
        cup = cup_leg(chain, angles, body, platform.feet[name] - knee)
        assert max(abs(klein(w, p)) for w in cup.wrenches for p in cup.passive) < 1e-12
        bare = cup_leg(chain, angles, body, platform.feet[name] - knee, torsion=False)
        assert rank(np.vstack([bare.passive, bare.active])) == 5
        with pytest.raises(SpecError, match="not square to the knee"):
            cup_leg(chain, angles, body, cup.active[-1, :3])
        with pytest.raises(SpecError, match="six independent screws, found 6 of rank 5"):
            bare.projection()
    assert max(abs(klein(w, p)) for leg in legs for w in leg.wrenches for p in leg.passive) < 1e-12
    with pytest.raises(SpecError, match="have rank 5; six are needed"):
        body_twist(legs[:2], [np.zeros(3)] * 2)


def test_three_feet_give_the_bodys_pose() -> None:
    random = np.random.default_rng(2)
    for _ in range(20):
        pose = pin.SE3.Random()
        feet = random.normal(size=(3, 3))
        world = np.array([pose.act(f) for f in feet])
        np.testing.assert_allclose(body_pose(world, feet).homogeneous, pose.homogeneous, atol=1e-12)
    frame = foot_plane([1, 1, 0], [3, 1, 0], [1, 4, 0])
    np.testing.assert_allclose(frame.homogeneous, pin.SE3(np.eye(3), np.array([1.0, 1.0, 0.0])).homogeneous)
    with pytest.raises(SpecError, match="on one line"):
        foot_plane([0, 0, 0], [1, 0, 0], [2, 0, 0])
    with pytest.raises(SpecError, match="three feet"):
        body_pose(np.zeros((4, 3)), np.zeros((4, 3)))
