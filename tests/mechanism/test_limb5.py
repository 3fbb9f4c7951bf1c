from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from wbplan import Robot, SpecError
from wbplan.mechanism import FiveJointLimb, LimbSolutions, limb_chain

LOWER, UPPER = np.radians([0, -60, -30, 0, 0]), np.radians([180, 60, 60, 180, 180])


def limb(**more: object) -> FiveJointLimb:
    return FiveJointLimb(0.065, 0.12, 0.2, 0.025, 0.105, **{"lower": LOWER, "upper": UPPER, **more})  # type: ignore[arg-type]


def shifted(target: pin.SE3, travel: float, shift: float) -> pin.SE3:
    """The target when the body has moved by `shift` across its direction of travel."""
    return pin.SE3(
        target.rotation, target.translation - shift * np.array([math.sin(travel), -math.cos(travel), 0.0])
    )


def require_exact(arm: FiveJointLimb, found: LimbSolutions, target: pin.SE3, travel: float) -> None:
    for s in (*found.within, *found.beyond):
        error = arm.pose(s.joints).homogeneous - shifted(target, travel, s.shift).homogeneous
        assert np.abs(error).max() < 1e-9
    for s in found.within:
        assert (s.joints >= arm.lower - 1e-8).all()
        assert (s.joints <= arm.upper + 1e-8).all()


def test_the_robots_limbs_are_of_this_shape(robots: dict[str, Robot]) -> None:
    for name in ("limb1", "limb2"):
        chain = limb_chain(robots["legarm_hexapod"], name, f"{name}_tip")
        arm = FiveJointLimb.of(chain)
        np.testing.assert_allclose(
            [arm.l1, arm.l2, arm.l31, arm.l4, arm.l5], [0.065, 0.12, 0.2, 0.025, 0.105]
        )
        for seed in range(20):
            q = np.random.default_rng(seed).uniform(arm.lower, arm.upper)
            np.testing.assert_allclose(
                (arm.placement * arm.pose(q)).homogeneous, chain.pose(q).homogeneous, atol=1e-12
            )
            np.testing.assert_allclose(arm.chain().pose(q).homogeneous, chain.pose(q).homogeneous, atol=1e-12)
    with pytest.raises(SpecError, match="expected axes z, y, y, y, z"):
        FiveJointLimb.of(limb_chain(robots["mana"], "leg1"))


def test_case_2_3_recovers_joints_and_shift() -> None:
    arm, random = limb(), np.random.default_rng(0)
    for _ in range(300):
        q, travel, shift = random.uniform(LOWER, UPPER), random.uniform(-3, 3), random.uniform(-0.06, 0.06)
        target = shifted(arm.pose(q), travel, -shift)
        found = arm.solve(target, travel)
        assert found.case == "2.3"
        require_exact(arm, found, target, travel)
        assert any(np.abs(s.joints - q).max() < 1e-7 and abs(s.shift - shift) < 1e-9 for s in found.within)


def test_case_2_2_where_the_shift_is_not_allowed() -> None:
    arm = limb()
    q, travel = np.array([1.2, 0.2, 0.3, 0.5, 0.8]), 1.0
    target = shifted(arm.pose(q), travel, -0.05)
    assert arm.solve(target, travel, most=0.06).case == "2.3"
    found = arm.solve(target, travel, most=0.04)
    assert found.case == "2.2"
    assert not found.within
    assert "shift by" in found.reason
    assert "0.0400 m" in found.reason


def along_the_limb(q: np.ndarray) -> float:
    """A travel for which the compensation is along the limb: perpendicular to joint 1's direction."""
    return float(q[0]) + math.pi / 2


def test_case_2_4_takes_no_shift_where_none_is_needed() -> None:
    arm = limb()
    q = np.array([1.2, 0.2, 0.3, 0.5, 0.8])
    target, travel = arm.pose(q), along_the_limb(q)
    found = arm.solve(target, travel)
    assert found.case == "2.4"
    require_exact(arm, found, target, travel)
    assert any(np.abs(s.joints - q).max() < 1e-7 for s in found.within)
    assert min(abs(s.shift) for s in found.within) == 0.0


def test_case_2_4_takes_the_least_shift_that_helps() -> None:
    arm = limb()
    q = np.array([1.2, 0.2, 0.3, 0.5, 0.8])
    travel = along_the_limb(q)
    target = shifted(arm.pose(q), travel, -0.3)
    if not arm.solve(target, travel).within:
        target = shifted(arm.pose(q), travel, 0.3)
    found = arm.solve(target, travel)
    assert found.case == "2.4"
    require_exact(arm, found, target, travel)
    shift = min(abs(s.shift) for s in found.within)
    assert 0.0 < shift <= 0.3 + 1e-9
    assert not arm.solve(target, travel, most=0.95 * shift).within


def test_case_2_1_where_the_shift_cannot_help() -> None:
    arm = limb()
    q = np.array([1.2, 0.2, 0.3, 0.5, 0.8])
    travel = along_the_limb(q)
    aside = np.array([-math.sin(q[0]), math.cos(q[0]), 0.0])
    target = pin.SE3(arm.pose(q).rotation, arm.pose(q).translation + 0.02 * aside)
    found = arm.solve(target, travel)
    assert found.case == "2.1"
    assert "off the limb's plane" in found.reason


UP: tuple[float, Callable[[np.ndarray], float]] = (1.0, lambda q: -q[1] - q[2])
DOWN: tuple[float, Callable[[np.ndarray], float]] = (-1.0, lambda q: math.pi - q[1] - q[2])


@pytest.mark.parametrize(("r33", "fourth"), [UP, DOWN], ids=["r33=1", "r33=-1"])
def test_case_1_4_needs_no_shift(r33: float, fourth: Callable[[np.ndarray], float]) -> None:
    arm, random = limb(), np.random.default_rng(4)
    tried = 0
    for _ in range(200):
        q = random.uniform(LOWER, UPPER)
        q[3] = fourth(q)
        if not LOWER[3] <= q[3] <= UPPER[3]:
            continue
        tried += 1
        target = arm.pose(q)
        assert target.rotation[2, 2] == pytest.approx(r33)
        found = arm.solve(target, float(q[0]))
        assert found.case == "1.4"
        require_exact(arm, found, target, float(q[0]))
        assert any(np.abs(s.joints - q).max() < 1e-6 and s.shift == 0.0 for s in found.within)
    assert tried > 20


def test_cases_1_3_1_2_and_1_1() -> None:
    arm = limb()
    q = np.array([1.5, 0.2, -0.3, 0.1, 0.8])
    target, travel = arm.pose(q), 1.5
    pushed = shifted(target, travel, -0.4)
    found = arm.solve(pushed, travel)
    assert found.case == "1.3"
    require_exact(arm, found, pushed, travel)
    least = min(abs(s.shift) for s in found.within)
    assert 0.0 < least < 0.4
    # The printed root is the far one: both put the wrist on the edge of the reach, on two sides.
    wrist = pushed.translation - arm.l5 * pushed.rotation[:, 0]
    n = np.array([math.sin(travel), -math.cos(travel)])
    deep = -float(wrist[2])
    edge = arm.l1 + arm.l4 + math.sqrt(arm.reach[1] ** 2 - deep**2)
    b, c = -2.0 * float(wrist[:2] @ n), float(wrist[:2] @ wrist[:2]) - edge**2
    roots = sorted(((-b + s * math.sqrt(b * b - 4 * c)) / 2 for s in (1, -1)), key=abs)
    assert least == pytest.approx(abs(roots[0]), abs=2e-3)  # or just beyond it, for a joint limit
    assert least >= abs(roots[0]) - 1e-9
    assert b < 0.0
    assert (-b + math.sqrt(b * b - 4 * c)) / 2 == roots[1]
    short = arm.solve(pushed, travel, most=0.5 * least)
    assert short.case == "1.2"
    assert "at most" in short.reason
    away = pin.SE3(target.rotation, target.translation + np.array([math.cos(travel), math.sin(travel), 0.0]))
    assert arm.solve(away, travel).case == "1.1"
    sunk = pin.SE3(target.rotation, target.translation - np.array([0.0, 0.0, 1.0]))
    assert arm.solve(sunk, travel).case == "1.1"
    assert "below joint 2" in arm.solve(sunk, travel).reason


def test_out_of_reach_and_out_of_limits_say_why() -> None:
    arm = limb()
    q = np.array([1.2, 0.2, 0.3, 0.5, 0.8])
    far = pin.SE3(arm.pose(q).rotation, arm.pose(q).translation + np.array([0.0, 0.0, 0.6]))
    assert "the reach is 0.0800 to 0.3200 m" in arm.solve(far, 1.2).reason
    tight = limb(upper=UPPER - np.array([0, 0, 0, 0, 2.5]))
    found = tight.solve(arm.pose(q), 1.2)
    assert found.beyond
    assert "joint5 would have to be at 0.8000 rad" in found.reason
    with pytest.raises(SpecError, match="finite target"):
        arm.solve(arm.pose(q), math.nan)
