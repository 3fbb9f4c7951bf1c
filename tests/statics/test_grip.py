"""Soft fingers: the closed form against the cones themselves, and against Zheng's condition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb
from wbplan.statics import Squeeze, force_closure, smallest_squeeze
from wbplan.statics.grip import box_normal

LEFT, RIGHT = np.array([[-0.1, 0.0, 0.0]]), np.array([[0.1, 0.0, 0.0]])


def hold(weight: np.ndarray, at: np.ndarray, friction: float = 0.5, patch: float = 0.01) -> Squeeze:
    """What holds a force through a point (the object's CoM), opposed."""
    moment = np.cross(at - LEFT[0], weight)[None]
    return smallest_squeeze(LEFT, RIGHT, weight[None], moment, friction, patch)


def test_midway_it_is_zhengs_condition() -> None:
    for weight in (np.array([0.0, 0.0, 8.0]), np.array([3.0, 1.0, 8.0]), np.array([-3.0, 2.0, 5.0])):
        found = hold(weight, np.zeros(3))
        across = np.linalg.norm(weight[1:])
        assert found.zheng[0] == pytest.approx(0.5 * across / 0.5 + 0.5 * abs(weight[0]))
        assert found.need[0] == pytest.approx(found.zheng[0], rel=1e-9)
        # The weaker finger presses with half of the load across over the friction: equation 1.
        weak = found.need[0] - abs(found.axial[0])
        assert 0.5 * weak == pytest.approx(0.5 * across)


def test_off_the_middle_one_finger_bears_more() -> None:
    """A CoM off by e of the width w: shares of one half plus and minus e / w; Zheng's is too small."""
    found = hold(np.array([0.0, 0.0, 8.0]), np.array([0.03, 0.0, 0.0]))
    assert found.need[0] == pytest.approx((0.5 + 0.03 / 0.2) * 8.0 / 0.5)
    assert found.zheng[0] == pytest.approx(8.0)
    assert found.need[0] > 1.2 * found.zheng[0]


def test_off_the_line_torsion_counts() -> None:
    """A CoM off the line by d twists: half of m g d at each finger, on its soft patch. Not in equation 1."""
    found = hold(np.array([0.0, 0.0, 8.0]), np.array([0.0, 0.02, 0.0]))
    assert found.torsion[0] == pytest.approx(0.5 * 0.02 * 8.0, rel=1e-4)
    assert found.need[0] == pytest.approx(np.hypot(4.0, 0.08 / 0.01) / 0.5, rel=1e-6)
    assert found.zheng[0] == pytest.approx(8.0)


vectors = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array)


@given(vectors, vectors, st.floats(0.3, 1.5))
def test_it_is_the_smallest_that_holds(force: np.ndarray, moment: np.ndarray, friction: float) -> None:
    """Both fingers' forces and torsions free, equilibrium as equations, the cones as they are."""
    patch, moment = 0.05, 0.02 * moment
    found = smallest_squeeze(LEFT, RIGHT, force[None], moment[None], friction, patch)
    s = float(found.need[0])
    f2 = found.second(s)[0]
    f1, t2 = force - f2, float(found.torsion[0])
    t1 = float(moment[0]) - t2  # the line is along x
    assert np.cross(RIGHT[0] - LEFT[0], f2)[1:] == pytest.approx(moment[1:], abs=1e-9)
    for f, t, inward in ((f1, t1, 1.0), (f2, t2, -1.0)):
        assert np.hypot(np.hypot(f[1], f[2]), t / patch) <= friction * inward * f[0] + 1e-6

    # With a little less there is no way to share the torsion.
    for less, held in ((s * (1.0 + 1e-6) + 1e-9, True), (0.998 * s, False)):
        f2 = found.second(less)[0]
        f1 = force - f2
        shares = np.append(np.linspace(-0.2, 0.2, 4001), t2)
        one = np.hypot(np.hypot(f1[1], f1[2]), (moment[0] - shares) / patch) - friction * f1[0]
        two = np.hypot(np.hypot(f2[1], f2[2]), shares / patch) + friction * f2[0]
        assert bool((np.maximum(one, two) <= 1e-7).any()) is (held or s < 1e-6)


def test_force_closure_is_the_line_in_both_cones() -> None:
    left, right, inward = LEFT[0], RIGHT[0], np.array([1.0, 0.0, 0.0])
    assert force_closure(left, inward, right, -inward, 0.3)
    assert not force_closure(left, inward, right, inward, 0.3)
    assert not force_closure(left, inward, left, -inward, 0.3)
    for angle, closed in ((0.28, True), (0.30, False)):  # atan(0.3) = 0.2915
        turned = np.array([np.cos(angle), np.sin(angle), 0.0])
        assert force_closure(left, turned, right, -inward, 0.3) is closed


def test_faces_of_a_box() -> None:
    size = (0.25, 0.15, 0.12)
    assert box_normal(np.array([-0.125, 0.02, 0.01]), size).tolist() == [1.0, 0.0, 0.0]
    assert box_normal(np.array([0.0, 0.08, 0.0]), size).tolist() == [0.0, -1.0, 0.0]
    assert box_normal(np.array([0.01, 0.0, -0.06]), size).tolist() == [0.0, 0.0, 1.0]


def test_what_a_grip_may_not_be() -> None:
    for fields in ({"friction": 0.0}, {"patch": -0.01}, {"safety": 0.9}, {"by": ""}):
        with pytest.raises(wb.SpecError):
            wb.Grip(**{"by": "limb2_tip", **fields})
    box = wb.Body("box", mass=1.0)
    with pytest.raises(wb.SpecError, match=r"wb\.Grip"):
        wb.Carried(box, by="a", grip="b")  # type: ignore[arg-type]
    with pytest.raises(wb.SpecError, match="nothing holds together"):
        wb.Phase("lift", carried=[wb.Carried(box, by="a", grip=wb.Grip("b"))])
