"""The balance task draws the CoM to the point of largest margin, without a jump."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wbplan as wb
from wbplan.compiled.aims import Settle
from wbplan.compiled.phase import compile_phase
from wbplan.geometry import support_polygon

FEET = ["rf_foot", "lf_foot", "rr_foot", "lr_foot"]


@pytest.fixture(scope="module")
def hiphant() -> wb.Robot:
    return wb.load_robot("hiphant")


def stand(feet: list[str], task: wb.BalanceTask, **more: object) -> wb.Phase:
    hard = [wb.OrientationTask("body")]
    contacts = [wb.Contact(f) for f in feet]
    return wb.Phase("stand", contacts=contacts, hard=hard, soft=[task, wb.PostureTask()], **more)


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
@pytest.mark.parametrize("feet", [FEET, FEET[:3]])
def test_the_com_comes_to_the_point_of_largest_margin(
    hiphant: wb.Robot, feet: list[str], backend: str
) -> None:
    """Also where the phase promises no margin: its contacts are enough."""
    phase = stand(feet, wb.BalanceTask(20.0, settle=1.0), duration=2.0)
    plan = wb.plan(hiphant, phase, start="ready", backend=backend)
    start = hiphant.state("ready")
    polygon = support_polygon(np.array([start.pose(f).translation[:2] for f in feet]))
    centre, radius = polygon.middle(), polygon.chebyshev()[1]
    np.testing.assert_allclose(plan.trajectory.com[-1, :2], centre, atol=2e-3)
    assert polygon.margin(plan.trajectory.com[-1, :2]) > 0.99 * radius - 2e-3
    assert np.linalg.norm(plan.trajectory.com[0, :2] - centre) > 0.03


def test_the_weight_is_a_com_tasks(hiphant: wb.Robot) -> None:
    """In 1/m, on x and y: the same motion as a ComTask along the same path."""
    task = wb.BalanceTask(3.0, settle=1.0, gain=7.0)
    balance = wb.Loop(hiphant, stand(FEET, task), hiphant.state("ready"), dt=0.01)
    start = hiphant.state("ready")
    polygon = support_polygon(np.array([start.pose(f).translation[:2] for f in FEET]))
    goal = np.r_[polygon.middle(), start.com[2]]
    same = wb.ComTask(wb.MinJerk(start.com, goal, 1.0), weight=(3.0, 3.0, 0.0), gain=7.0, name="balance")
    phase = wb.Phase("stand", contacts=[wb.Contact(f) for f in FEET], hard=[wb.OrientationTask("body")],
                     soft=[same, wb.PostureTask()])  # fmt: skip
    by_hand = wb.Loop(hiphant, phase, start, dt=0.01)
    for _ in range(60):
        a, b = balance.step(), by_hand.step()
        np.testing.assert_allclose(a.q, b.q, atol=1e-9)
        assert a.errors["balance.position"] == pytest.approx(b.errors["balance.position"], abs=1e-9)


def test_the_target_leaves_with_the_velocity_that_the_phase_begins_with(hiphant: wb.Robot) -> None:
    start, model = hiphant.state("ready"), hiphant.model
    velocity = np.random.default_rng(0).normal(scale=0.1, size=model.nv)
    compiled = compile_phase(hiphant, stand(FEET, wb.BalanceTask()), start.q, velocity=velocity)
    (target,) = compiled.com_targets
    step = 1e-6
    moved = wb.State(model, pin.integrate(model, start.q, step * velocity))
    expected = (moved.com - start.com) / step * (1.0, 1.0, 0.0)
    np.testing.assert_allclose((target.path.at(step) - target.path.at(0.0)) / step, expected, atol=1e-5)
    np.testing.assert_allclose(target.path.at(0.0), start.com, atol=1e-12)


finite = st.floats(-2.0, 2.0)
points = st.tuples(finite, finite, finite)


@settings(max_examples=50, deadline=None)
@given(points, points, points, st.floats(0.05, 10.0))
def test_the_target_leaves_with_the_coms_velocity_and_comes_to_rest(
    start: tuple[float, ...], velocity: tuple[float, ...], goal: tuple[float, ...], duration: float
) -> None:
    path, h = Settle(start, velocity, goal, duration), 1e-4 * duration
    scale = 1.0 + duration
    np.testing.assert_allclose(path.at(0.0), start, atol=1e-12)
    np.testing.assert_allclose(path.at(duration), goal, atol=1e-9)
    np.testing.assert_allclose(path.at(5.0 * duration), goal)
    np.testing.assert_allclose((path.at(h) - path.at(0.0)) / h, velocity, atol=1e-5 * scale / duration)
    # At the end velocity and acceleration are zero: what is left of the way falls with the cube of the time.
    assert np.abs(path.at(duration - h) - goal).max() < 1e-9 * scale
    speeds = np.diff([path.at(t) for t in np.linspace(0.0, 1.2 * duration, 400)], axis=0)
    assert np.abs(np.diff(speeds, axis=0)).max() < 1e-3 * scale, "no jump in velocity"


@pytest.mark.parametrize(
    ("feet", "message"), [(FEET[:2], "rf_foot, lf_foot.*no support polygon"), ([], "no support polygon")]
)
def test_a_stance_without_a_region_is_refused(hiphant: wb.Robot, feet: list[str], message: str) -> None:
    with pytest.raises(wb.SpecError, match=message):
        wb.Loop(hiphant, stand(feet, wb.BalanceTask()), hiphant.state("ready"))


@pytest.mark.parametrize("fields", [{"weight": -1.0}, {"settle": 0.0}, {"gain": float("inf")}, {"name": ""}])
def test_a_wrong_field_is_named(fields: dict[str, object]) -> None:
    with pytest.raises(wb.SpecError, match=next(iter(fields))):
        wb.BalanceTask(**fields)


def test_it_is_soft_only() -> None:
    with pytest.raises(wb.SpecError, match="balance has no target"):
        wb.Phase("any", hard=[wb.BalanceTask()])
