"""HIphanT's two experiments, planned by either backend, do what they are asked and stand."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.taskfile import load_task

W = "manipulability(arm_tip).manipulability"


def planned(name: str, backend: str = "proxqp", **values: object) -> wb.Plan:
    task, robot = load_task(name), wb.load_robot("hiphant")
    return wb.plan(robot, task.script(robot, {**task.values([]), **values}), backend=backend, task=name)


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_the_tip_stays_while_w_rises(backend: str) -> None:
    plan = planned("static_endpoint", backend)
    w, errors = plan.trajectory.measures[W], plan.trajectory.errors
    assert w[-1] > 1.045 * w[0]
    assert (np.diff(w) > -1e-9).all()
    assert np.sqrt(np.mean(errors["pose(arm_tip).position"] ** 2)) < 1e-5
    assert np.abs(plan.trajectory.v[-2]).max() < 0.02, "it comes to rest"
    simulated = plan.simulate()
    assert simulated.verdict.stands, simulated.verdict


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_the_tip_goes_sideways_and_the_robot_stands(backend: str) -> None:
    plan = planned("linear_motion", backend)
    errors = plan.trajectory.errors
    assert errors["pose(arm_tip).position"].max() < 1e-5
    assert errors["pose(arm_tip).orientation"].max() < 1e-5
    simulated = plan.simulate()
    assert simulated.verdict.stands, simulated.verdict


@pytest.mark.parametrize("left_out", [{"balance": 0.0}, {"manipulability": 0.0}])
def test_an_objective_may_be_left_out(left_out: dict[str, float]) -> None:
    plan = planned("linear_motion", **left_out)
    assert (W in plan.trajectory.measures) == ("balance" in left_out)
    assert ("balance.position" in plan.trajectory.errors) == ("manipulability" in left_out)
    assert plan.check().ok
    assert plan.simulate().stands
