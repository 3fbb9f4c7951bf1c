"""Hex-Piderix: its numeric example, its leg, and equations 20 to 27."""

from __future__ import annotations

import numpy as np
import pytest

from wbplan.mechanism import body_acceleration, body_twist
from wbplan.papers import constraint, hexpiderix

from .conftest import Judge


def test_section_5_numeric_example(judge: Judge) -> None:
    rows = judge(hexpiderix.example())
    assert rows["Q from the centroid"].ours == pytest.approx(15.35, abs=0.01)


def test_equations_11_to_14_leg_kinematics(judge: Judge) -> None:
    rows = judge(hexpiderix.inverse())
    right = {"leg1": (-47.7935, -38.4473), "leg3": (-47.7605, -38.6381), "leg5": (-47.7605, -38.6382)}
    for leg, (femur, tibia) in right.items():
        assert rows[f"{leg} femur"].ours == pytest.approx(femur, abs=2e-4)
        assert rows[f"{leg} tibia"].ours == pytest.approx(tibia, abs=2e-4)


def test_equations_20_to_27_velocity_and_acceleration(judge: Judge) -> None:
    rows = judge(hexpiderix.rates())
    assert rows["rank of the printed six-screw limb"].ours == 5
    assert rows["rank with torsion added, seven screws"].ours == 6
    assert rows["rank of M, cups giving along the wall's normal"].ours == 3


def test_equation_27_is_the_derivative_of_equation_24() -> None:
    """The body moved on by its own twist, the cups by theirs: V changes at the rate A, to second order."""
    q, speed, rise = hexpiderix.moved(11)
    stance, names, _ = hexpiderix.legs(q=q)
    split, bent = list(speed.reshape(3, 3)), list(rise.reshape(3, 3))
    given = dict(zip(names, speed, strict=True)), dict(zip(names, rise, strict=True))
    slides = {f"{leg}_foot": hexpiderix.direction(leg, "tibia", q) for leg in hexpiderix.STANCE}
    twist = body_twist(stance, split)
    ours = body_acceleration(stance, split, bent)
    right = constraint.solve(hexpiderix.robot(), q, list(slides), *given, slides)
    np.testing.assert_allclose(ours, right.acceleration, atol=1e-9 * np.abs(ours).max())
    step, after = 1e-5, []
    for sign in (-1.0, 1.0):
        moved, rates = hexpiderix.drifted(q, twist, speed, rise, sign * step)
        after.append(body_twist(moved, rates))
    np.testing.assert_allclose((after[1] - after[0]) / (2 * step), ours, atol=2e-6 * np.abs(ours).max())
