from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbplan import Robot, SolveError, SpecError, catalog
from wbplan.mechanism import Platform, ThreeJointLeg, limb_chain

length = st.floats(0.02, 0.5)
angle = st.floats(-3.1, 3.1)
legs = st.builds(
    ThreeJointLeg,
    st.floats(0.0, 0.3),
    length,
    length,
    st.floats(-0.1, 0.1),
    st.sampled_from([-1.0, 1.0]),
)


@given(legs, angle, angle, angle)
def test_every_branch_lands_on_the_foot_and_one_is_where_it_came_from(
    leg: ThreeJointLeg, one: float, two: float, three: float
) -> None:
    foot = leg.foot([one, two, three])
    found = leg.solve(foot)
    assert found.within
    assert len({s.branch for s in found.within}) <= 4
    # The square root loses half the digits where the leg is straight or the foot on axis 1.
    for solution in found.within:
        np.testing.assert_allclose(leg.foot(solution.joints), foot, atol=2e-6)
    x, y, _ = leg.local(foot)
    straight = abs(math.sin(three)) < 1e-3 or math.hypot(x, y) ** 2 - leg.offset**2 < 1e-6
    if not straight:
        assert min(np.abs(s.joints - [one, two, three]).max() for s in found.within) < 1e-6


@given(legs, st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_a_reason_is_given_exactly_where_nothing_is_found(
    leg: ThreeJointLeg, x: float, y: float, z: float
) -> None:
    found = leg.solve([x, y, z])
    assert bool(found.reason) != bool(found.within)
    assert leg.reachable([x, y, z]) == bool(found.within)
    square = x * x + y * y - leg.offset**2
    inside = False
    if square >= 0.0:
        reaches = [math.hypot(s * math.sqrt(square) - leg.l1, z) for s in (1, -1)]
        inside = any(abs(leg.l2 - leg.l3) <= r <= leg.l2 + leg.l3 for r in reaches)
    if inside != bool(found.within):  # only by rounding, at the edge
        assert (
            min(abs(r - e) for r in reaches for e in (abs(leg.l2 - leg.l3), leg.l2 + leg.l3)) < 1e-6
            or abs(square) < 1e-9
        )


@pytest.mark.parametrize("name", sorted(catalog.robots()))
def test_the_legs_of_every_robot_are_recognised(robots: dict[str, Robot], name: str) -> None:
    robot = robots[name]
    platform = Platform.of_robot(robot, robot.state("stand"))
    assert set(platform.legs) == set(platform.chains)
    random = np.random.default_rng(1)
    for limb, leg in platform.legs.items():
        chain = platform.chains[limb]
        again = ThreeJointLeg.of(leg.chain())
        for _ in range(10):
            q = random.uniform(np.maximum(leg.lower, -3), np.minimum(leg.upper, 3))
            np.testing.assert_allclose(leg.foot(q), chain.pose(q).translation, atol=1e-12)
            np.testing.assert_allclose(again.foot(q), leg.foot(q), atol=1e-12)
            found = leg.solve(leg.foot(q))
            assert min(np.abs(s.joints - q).max() for s in found.within) < 1e-6


def test_a_range_of_more_than_a_turn_gives_every_turn_that_fits() -> None:
    leg = ThreeJointLeg(0.0, 0.3, 0.3, 0.08, lower=-np.full(3, 2.0 * np.pi), upper=np.full(3, 2.0 * np.pi))
    q = np.array([0.3, 0.4, 0.5])
    found = leg.solve(leg.foot(q))
    assert (
        sum(np.abs(np.remainder(s.joints - q + np.pi, 2 * np.pi) - np.pi).max() < 1e-9 for s in found.within)
        == 8
    )


def test_no_solution_says_why() -> None:
    limits = np.radians([30.0, 90.0, 90.0])
    leg = ThreeJointLeg(0.05, 0.1, 0.1, lower=-limits, upper=limits, joints=("a", "b", "c"))
    far = leg.solve([0.5, 0.0, 0.0])
    assert not far.within
    assert not far.beyond
    assert "0.4500 m from axis 2, beyond the reach of 0.0000 to 0.2000 m" in far.reason
    turned = leg.solve([0.0, 0.2, 0.0])
    assert turned.beyond
    assert "a would have to be at 1.5708 rad, its limits are -0.5236 and 0.5236" in turned.reason
    with pytest.raises(SolveError, match="a would have to be"):
        turned.nearest([0.0, 0.0, 0.0])
    near = ThreeJointLeg(0.05, 0.1, 0.1, offset=0.04).solve([0.01, 0.0, 0.1])
    assert "cannot be nearer than the offset 0.0400 m" in near.reason
    with pytest.raises(SpecError, match="three finite numbers"):
        leg.solve([0.0, np.nan, 0.0])


def test_a_chain_of_another_shape_is_refused(robots: dict[str, Robot]) -> None:
    with pytest.raises(SpecError, match="expected three revolute joints"):
        ThreeJointLeg.of(limb_chain(robots["legarm_hexapod"], "limb1", "limb1_tip"))
    chain = limb_chain(robots["hiphant"], "arm").hold(
        {"arm_joint1": 0.0, "arm_joint2": 0.0, "arm_joint3": 0.0}
    )
    with pytest.raises(SpecError, match="expected joints 2 and 3 parallel"):
        ThreeJointLeg.of(chain)


def test_the_nearest_solution_is_the_nearest() -> None:
    leg = ThreeJointLeg(0.05, 0.1, 0.12, placement=pin.SE3.Random())
    q = np.array([0.2, 0.5, -0.9])
    found = leg.solve(leg.foot(q))
    assert len(found.within) >= 2
    for solution in found.within:
        np.testing.assert_allclose(found.nearest(solution.joints + 0.01).joints, solution.joints)
