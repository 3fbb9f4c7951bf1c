"""One test a group of Zheng's equations, and Figure 16."""

from __future__ import annotations

import pytest

from wbplan.papers import zheng, zheng_case, zheng_switch

from .conftest import Judge


def test_equation_20_forward_kinematics(judge: Judge) -> None:
    rows = judge(zheng.equation_20())
    right = {"x": 139.022437, "y": 401.663258, "z": -127.667274}
    for axis, value in right.items():
        assert rows[f"{axis} at (60, -10, 30, 40, 50) deg"].ours == pytest.approx(value, abs=1e-6)


def test_equations_2_to_7_mobility_of_the_clamp(judge: Judge) -> None:
    rows = judge(zheng.mobility_rows())
    apart = {
        name: rows[f"departure of a rate {name}, per step"].ours
        for name in ("without tilt", "without yaw", "with both")
    }
    assert apart["without tilt"] < 2e-3  # type: ignore[operator]
    assert apart["without yaw"] < 2e-3  # type: ignore[operator]
    assert apart["with both"] > 0.05  # type: ignore[operator]


def test_equations_23_to_29_inverse_kinematics(judge: Judge) -> None:
    judge(zheng.inverse_rows())


def test_equations_22_and_31_planar_part(judge: Judge) -> None:
    rows = judge(zheng_case.equation_31())
    assert rows["share of its disc out of reach for a given thetax"].ours == pytest.approx(19.0, abs=1.0)


def test_equations_26_and_27_case_1(judge: Judge) -> None:
    rows = judge(zheng_case.equations_26_27())
    assert rows["theta5 solved, arguments (y, x) only"].ours == 100


def test_figure_16_stability_radii(judge: Judge) -> None:
    rows = judge(zheng.figure_16())
    assert rows["distance from the centre to the best point"].ours == pytest.approx(0.381966, abs=1e-6)
    assert rows["four of five legs, best point"].ours == pytest.approx(0.5590, abs=1e-4)


def test_figures_14_15_19_the_change_of_gait(judge: Judge) -> None:
    judge(zheng_switch.switching())
