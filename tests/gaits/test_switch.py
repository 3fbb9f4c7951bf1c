"""A limb becomes an arm and a leg again while the robot walks."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan import gaits
from wbplan.geometry import support_polygon

STEP = 0.02
SPEED = STEP / 1.0


@pytest.fixture(scope="module")
def walker(legarm: wb.Robot) -> gaits.Walker:
    return gaits.Walker(legarm)


@pytest.fixture(scope="module")
def legarm() -> wb.Robot:
    return wb.load_robot("legarm_hexapod")


@pytest.fixture(scope="module")
def switch(walker: gaits.Walker) -> gaits.Switch:
    return gaits.Switch(walker, "limb1", 0.40, 0.34)


def direction(foot: np.ndarray) -> float:
    return float(np.degrees(np.arctan2(foot[1], foot[0])))


def test_zheng_fig_14_the_five_feet_stand_on_a_pentagon_beside_the_arm(switch: gaits.Switch) -> None:
    """From the arm's direction legs 2 to 6 stand at 36, 108, 180, 252 and 324 degrees, going round."""
    arm = direction(switch.hexagon.feet["limb1"])
    turned = {leg: (arm - direction(foot)) % 360.0 for leg, foot in switch.pentagon.feet.items()}
    expected = {"limb2": 36.0, "leg3": 108.0, "leg4": 180.0, "leg5": 252.0, "leg6": 324.0}
    assert turned == pytest.approx(expected)
    radii = [np.linalg.norm(foot) for foot in [*switch.pentagon.feet.values(), *switch.hexagon.feet.values()]]
    np.testing.assert_allclose(radii, 0.40, rtol=1e-12)


def test_zheng_fig_23_who_steps_when(switch: gaits.Switch) -> None:
    first, second = switch.to_pentapod()
    assert set(first.swing) == {"limb2", "leg4", "leg6"}
    assert not first.raised
    assert set(second.swing) == {"leg3", "leg5"}
    assert second.raised == ("limb1",)
    assert [set(step) for step in switch.pentapod().steps] == [{"limb2", "leg5"}, {"leg3", "leg6"}, {"leg4"}]
    third, fourth = switch.to_hexapod()
    assert set(third.swing) == {"limb1", "leg3", "leg5"}
    assert set(fourth.swing) == {"limb2", "leg4", "leg6"}


def test_zheng_fig_16_margins_of_every_support(switch: gaits.Switch) -> None:
    """Centre and best margins over CR: 0.866, 0.5 on the hexagon; 0.809, 0.309 and 0.427 on the pentagon."""
    six, five = switch.hexagon.feet, switch.pentagon.feet

    def margins(feet: list[np.ndarray]) -> tuple[float, float]:
        polygon = support_polygon(np.array(feet))
        return polygon.margin(np.zeros(2)) / 0.40, polygon.chebyshev()[1] / 0.40

    assert margins(list(six.values())) == pytest.approx((0.8660, 0.8660), abs=5e-4)
    assert margins([six[leg] for leg in ("limb1", "leg3", "leg5")]) == pytest.approx((0.5, 0.5), abs=5e-4)
    assert margins(list(five.values())) == pytest.approx((0.8090, 0.8090), abs=5e-4)
    for swing in (("leg3", "leg5"), ("limb2", "leg5"), ("leg3", "leg6")):
        left = [foot for leg, foot in five.items() if leg not in swing]
        assert margins(left) == pytest.approx((0.3090, 0.4271), abs=5e-4)
    left = [foot for leg, foot in five.items() if leg != "leg4"]
    assert margins(left)[0] == pytest.approx(0.3090, abs=5e-4)


def test_how_far_the_feet_can_be_from_their_hips(walker: gaits.Walker) -> None:
    """The knee's 60 degrees leave a band of 60 to 110 mm; taller is wider, and it moves inward.

    So a foothold at the paper's circle (assumed CR 0.52 m) is in reach, but with hardly any stride: steps of
    a pentapod gait take up to three body strides in one stance.
    """
    leg = walker.closed["leg3"]
    hip = leg.placement.translation

    def band(height: float) -> tuple[float, float]:
        radii = np.arange(0.05, 0.45, 0.001)
        good = [r for r in radii if leg.reachable(hip + np.array([r, 0.0, -height]))]
        return float(min(good)), float(max(good))

    low, tall = band(0.244), band(0.34)
    assert low == pytest.approx((0.311, 0.370), abs=0.002)
    assert tall == pytest.approx((0.130, 0.257), abs=0.002)
    gaits.Switch(walker, "limb1", 0.5195, 0.2443)
    with pytest.raises(wb.SpecError, match="cannot reach its stance"):
        gaits.Switch(walker, "limb1", 0.5195, 0.30)


def test_an_arm_that_is_no_leg_is_refused(walker: gaits.Walker) -> None:
    with pytest.raises(wb.SpecError, match=r"Switch\.arm: expected one of six legs, got 'limb7'"):
        gaits.Switch(walker, "limb7", 0.40, 0.34)


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"limb": "leg3"}, r"Unfolding\.limb: 'leg3' has no roles"),
        ({"clear": {"leg3_joint1": 0.0}}, r"leg3_joint1 is no joint of limb1"),
        ({"order": (("limb1_joint4", "limb1_joint2"),)}, r"where limb1_joint2 goes"),
        ({"step_time": 0.0}, r"Unfolding\.step_time"),
        ({"via": {"limb1_joint4": 1.7}}, r"Unfolding\.via: expected a value for each joint that two groups"),
        ({"order": (("limb1_joint4",),) * 2}, r"Unfolding\.via"),
    ],
)
def test_bad_unfoldings(walker: gaits.Walker, fields: dict[str, object], match: str) -> None:
    given = {
        "limb": "limb1",
        "pose": {"limb1_joint1": 2.5, "limb1_joint4": 0.1},
        "order": (("limb1_joint4", "limb1_shank2"),),
        "clear": {"limb1_joint2": 0.0},
        "step_time": 1.0,
        **fields,
    }
    with pytest.raises(wb.SpecError, match=match):
        gaits.Unfolding(walker, **given).out(np.zeros(3))


def test_a_group_takes_the_steps_that_its_slowest_joint_needs(walker: gaits.Walker) -> None:
    """The sliding shank does 70 mm at 0.1 m/s: two steps of 1 s, one of 1.6 s."""
    for seconds, count in ((1.0, 2), (1.6, 1)):
        folding = gaits.Unfolding(
            walker,
            "limb1",
            {"limb1_joint1": 2.5, "limb1_joint4": 0.1},
            (("limb1_joint4", "limb1_shank2"),),
            {"limb1_joint2": 0.0},
            seconds,
        )
        assert len(folding.out(np.zeros(3))) == 2 + count
        assert len(folding.back()) == count


def test_a_joint_may_wait_half_way(walker: gaits.Walker) -> None:
    """It is at its value of `via` between two groups that name it, on the way out and on the way back."""
    folding = gaits.Unfolding(
        walker,
        "limb1",
        {"limb1_joint1": 2.5, "limb1_joint4": 0.1},
        (("limb1_joint4", "limb1_shank2"), ("limb1_joint4",)),
        {"limb1_joint2": 0.0},
        1.6,
        via={"limb1_joint4": 1.7},
    )
    first, last = folding.out(np.zeros(3))[2:]
    assert first["driven"] == {"limb1_joint4": 1.7, "limb1_shank2": 0.0}
    assert last["roles"] == {"limb1": "arm"}
    back = folding.back()
    assert back[0]["driven"] == {"limb1_joint4": 1.7, "limb1_shank2": 0.0}
    assert back[1]["roles"] == {"limb1": "leg"}
