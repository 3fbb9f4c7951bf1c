"""One test a table of MANA's paper; values that it does not print are those of an independent calculation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wbplan.mechanism import forward
from wbplan.papers import mana, mana_motion, mana_simulated

from .conftest import Judge


def test_table_1_lengths_and_table_4_height(judge: Judge) -> None:
    rows = judge(mana.table_1())
    assert rows["worst angle of Table 6, as printed"].ours == pytest.approx(0.22, abs=0.01)
    assert rows["worst angle, right legs only translated"].ours == pytest.approx(1.28, abs=0.005)
    assert rows["height of the body"].ours == pytest.approx(150.0051, abs=1e-4)


def test_table_2_constraint_lines(judge: Judge) -> None:
    assert len(judge(mana.table_2())) == 7


def test_table_3_actuated_sets(judge: Judge) -> None:
    rows = judge(mana.table_3())
    assert rows["regular sets of 924 at home"].ours == 424
    assert rows["regular sets of 924, generic pose"].ours == 918


def test_table_3_expands_to_22_different_sets() -> None:
    listed = list(mana.expanded_table_3())
    assert len(set(listed)) == 22
    assert all(len(s) == 6 for s in listed)


def test_equations_25_to_31(judge: Judge) -> None:
    judge(mana.equations())


def test_table_6_inverse_displacement(judge: Judge) -> None:
    assert len(judge(mana_motion.table_6())) == 12


def test_table_7_pose_of_the_virtual_prototype(judge: Judge) -> None:
    rows = judge(mana_motion.table_7())
    for what, right in zip(("roll", "pitch", "yaw", "x", "y", "z"), mana.TABLE_5, strict=True):
        assert rows[what].ours == pytest.approx(right, abs=0.01)


def test_table_8_forward_displacement(judge: Judge) -> None:
    rows = judge(mana_motion.table_8())
    assert rows["the same from random starts"].ours == 4
    assert rows["solutions within all limits"].ours == 1
    seconds = rows["seconds for all poses"].ours
    assert isinstance(seconds, float)
    assert seconds < 0.1
    step = rows["one step along a path (median)"].ours
    assert isinstance(step, float)
    assert step < 500.0


def test_table_8_is_complete() -> None:
    platform, _ = mana.stance()
    found = forward(platform, mana_motion.table_8_known(), mana.pose([0.0] * 6))
    assert (found.method, found.complete, found.degree) == ("elimination", True, 8)
    best = found.solutions[0]
    assert best.admissible
    np.testing.assert_allclose(mana.numbers(best.pose), [15.0, 10.0, 15.0, 20.0, 20.0, 130.0], atol=0.006)
    # Solution 3 = 6 needs hip 1 of leg 4 at -146 degrees.
    third = found.solutions[1]
    assert math.degrees(third.joints["leg4_hip1"]) == pytest.approx(-146.0, abs=0.5)
    assert "leg4_hip1" in third.reason


def test_table_9_rotation_and_translation(judge: Judge) -> None:
    judge(mana_motion.table_9())
    exact = [mana_motion.farthest(np.eye(6)[k]) for k in range(3)]
    np.testing.assert_allclose(exact, [52.5948, 27.5619, 49.7098], atol=5e-5)
    moves = [mana_motion.farthest(s * np.eye(6)[k]) for k, s in ((3, 1), (4, 1), (5, 1), (5, -1))]
    np.testing.assert_allclose(moves, [123.223, 101.082, 52.0, 44.625], atol=1e-3)


def test_section_5_3_helix_and_combined_motion(judge: Judge) -> None:
    rows = judge(mana_motion.section_5_3())
    assert rows["largest hip1 on the helix"].ours == pytest.approx(18.93, abs=0.01)
    assert rows["share of (40,30,30) mm and (20,20,20) deg in reach"].ours == pytest.approx(0.6167, abs=1e-4)
    assert rows["share of (20,20,20) deg alone"].ours == pytest.approx(0.8263, abs=1e-4)


@pytest.mark.slow
def test_figures_8_to_10_planned_by_the_qp_agree_with_the_closed_form(judge: Judge) -> None:
    assert len(judge(mana_motion.figures_8_to_10())) == 4


def test_figures_8_to_10_simulated_with_feet_that_roll_and_feet_as_ball_joints(judge: Judge) -> None:
    assert len(judge(mana_simulated.figures_8_to_10_simulated())) == 4
    for task in ("body_helix", "body_sway"):
        done = mana_simulated.compare(task)
        place, turn = done.worst("ball")
        as_joints = done.worst("joint")
        assert place > 5 * as_joints[0], "a ball of 15 mm rolls: that has to be seen"
        assert turn > as_joints[1]
        assert np.ptp(done.prescribed, axis=0).max() > 20.0, "the body moves"
