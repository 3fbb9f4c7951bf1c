"""HIphanT's frames, screws and Jacobian; Zhuang's leg."""

from __future__ import annotations

import pytest

from wbplan.papers import hiphant, zhuang

from .conftest import Judge


def test_hiphant_equations_1_to_7_foot_plane(judge: Judge) -> None:
    judge(hiphant.frames())


def test_hiphant_equations_12_to_31_leg_screws(judge: Judge) -> None:
    rows = judge(hiphant.screws())
    assert rows["acceleration against the constraint Jacobian"].ours == pytest.approx(0.0, abs=1e-9)


def test_hiphant_equations_34_and_38_jacobian(judge: Judge) -> None:
    judge(hiphant.jacobian())


def test_zhuang_equations_3_to_15_forward_kinematics(judge: Judge) -> None:
    judge(zhuang.forward())


def test_zhuang_equation_19_inverse_kinematics(judge: Judge) -> None:
    rows = judge(zhuang.equation_19())
    assert rows["knee-up solution found too"].ours == pytest.approx(100.0)
