"""The mobile manipulation task does what the experiment shows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.gaits import SHIFT
from wbplan.papers.zheng_switch import centre_margins, margin_figure
from wbplan.taskfile import load_task

RADIUS = 0.40


@pytest.fixture(scope="module")
def plan() -> wb.Plan:
    task = load_task("mobile_manipulation")
    robot = wb.load_robot(task.robot)
    return wb.plan(robot, task.script(robot, task.values([])))


def support(plan: wb.Plan, k: int) -> set[str]:
    return {contact["frame"].removesuffix("_foot") for contact in plan.bundle.plan["phases"][k]["contacts"]}


def phases(plan: wb.Plan, letter: str) -> list[int]:
    names = [entry["name"] for entry in plan.bundle.plan["phases"]]
    return [k for k, name in enumerate(names) if name[3:].startswith(f" {letter} ")]


def test_zheng_fig_23_who_carries_in_every_step(plan: wb.Plan) -> None:
    (b,), (d,) = phases(plan, "b"), phases(plan, "d")
    assert support(plan, b) == {"limb1", "leg3", "leg5"}
    assert support(plan, d) == {"limb2", "leg4", "leg6"}
    carrying = [support(plan, k) for k in phases(plan, "f")]
    cycle = [{"leg3", "leg4", "leg6"}, {"limb2", "leg4", "leg5"}, {"limb2", "leg3", "leg5", "leg6"}]
    assert carrying == [cycle[k % 3] for k in range(len(carrying))]
    back = [support(plan, k) for k in phases(plan, "back")]
    assert back == [{"limb2", "leg4", "leg6"}, {"limb1", "leg3", "leg5"}]


def test_the_body_never_stops_between_the_two_gaits(plan: wb.Plan) -> None:
    y, phase = plan.trajectory.q[:, 1], plan.trajectory.phase
    for k in [*phases(plan, "b"), *phases(plan, "d"), *phases(plan, "f"), *phases(plan, "back")]:
        way = y[phase == k]
        assert way[-1] - way[0] > 0.008, plan.bundle.plan["phases"][k]["name"]


def test_zheng_fig_16_margins_over_the_switch(plan: wb.Plan) -> None:
    """Margins that the walk has stand below the paper's at the centre, 0.5 and 0.309 CR, by what it walks."""
    margin, phase = plan.trajectory.margin / RADIUS, plan.trajectory.phase
    assert margin.min() * RADIUS >= 0.06
    tripod = phases(plan, "a")[1:-1]
    assert np.isin(phase, tripod).any()
    assert 0.42 < margin[np.isin(phase, tripod)].min() < 0.5
    three = [k for k in phases(plan, "f") if len(support(plan, k)) == 3]
    assert margin[np.isin(phase, three)].min() > 0.309 - SHIFT - 0.05
    assert margin[np.isin(phase, three)].max() < 0.427


def test_zheng_fig_16_margins_of_the_bodys_middle_beside_the_papers_lines(plan: wb.Plan) -> None:
    """On three feet of the hexagon 0.5 CR at best, on three of the pentagon 0.309 CR half-way."""
    middle = centre_margins(plan) / RADIUS
    phase = plan.trajectory.phase
    standing, tripod = phase == 0, np.isin(phase, phases(plan, "a")[1:-1])
    three = np.isin(phase, [k for k in phases(plan, "f") if len(support(plan, k)) == 3])
    assert middle[standing].max() == pytest.approx(np.sqrt(0.75), abs=1e-3)
    assert middle[tripod].max() == pytest.approx(0.5, abs=1e-3)
    assert np.median(middle[three]) == pytest.approx(0.309, abs=0.02)
    (axes,) = margin_figure(plan, RADIUS).axes
    drawn = {round(float(np.atleast_1d(line.get_ydata())[0]), 3) for line in axes.lines}
    assert {0.866, 0.5, 0.809, 0.427, 0.309} <= drawn
    assert [line.get_label() for line in axes.lines][5:] == [
        "body's middle, planned",
        "centre of mass, planned",
        "promised",
    ]


def test_the_hand_is_where_it_is_asked_while_the_robot_walks(plan: wb.Plan) -> None:
    """Its path is hard in every step with the object; the body goes sideways for it, within 0.118 CR."""
    errors, phase = plan.trajectory.errors, plan.trajectory.phase
    carrying = [k for k, entry in enumerate(plan.bundle.plan["phases"]) if entry["carried"]]
    assert len(carrying) == 9
    now = np.isin(phase, carrying)
    assert errors["pose(limb1_tip).position"][now].max() < 5e-5
    assert errors["pose(limb1_tip).orientation"][now].max() < 5e-5
    aside = np.abs(plan.trajectory.q[now, 0])
    assert 0.002 < aside.max() < SHIFT * RADIUS


def test_the_object_is_carried_turned_and_put_down_upright(plan: wb.Plan) -> None:
    poses = plan.trajectory.bodies["object"]
    first, last = (pin.XYZQUATToSE3(poses[k]) for k in (0, -1))
    assert last.translation[1] - first.translation[1] > 0.15
    assert last.translation[2] == pytest.approx(first.translation[2], abs=1e-3)
    np.testing.assert_allclose(last.rotation[:, 2], [0.0, 0.0, 1.0], atol=2e-3)
    tilt = [np.degrees(np.arccos(pin.XYZQUATToSE3(pose).rotation[2, 2])) for pose in poses[::10]]
    assert max(tilt) > 15.0
