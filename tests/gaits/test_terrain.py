"""Walks on uneven ground: a height field, two levels, and what the check of feet and ground sees."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.gaits import Manner, Walker, gait_for, over, straight, walk
from wbplan.gaits.ground import normal_at
from wbplan.taskfile import load_task

TASK = load_task("walk")


def feet_over(plan: wb.Plan) -> dict[str, np.ndarray]:
    """Places (N, 3) [m] of every foot."""
    model, robot = plan.robot.model, plan.robot
    data, found = model.createData(), {foot: [] for foot in robot.feet.values()}
    for q in plan.trajectory.q:
        pin.framesForwardKinematics(model, data, q)
        for foot, places in found.items():
            places.append(data.oMf[robot.frame_id(foot)].translation.copy())
    return {foot: np.array(places) for foot, places in found.items()}


@pytest.mark.parametrize("robot", ["heavy_hexapod", "hexpiderix"])
def test_a_walk_over_hills_and_hollows(robot: str) -> None:
    loaded = wb.load_robot(robot)
    values = TASK.values(["terrain=rolling", "cycles=0.7"])
    plan = wb.plan(loaded, TASK.script(loaded, values), dt=0.02)
    report = plan.check()
    assert report.ok, [row for row in report.rows if not row.held]
    (hills,) = plan.bundle.obstacles
    terrain = wb.Obstacles([hills]).terrain
    stood = {}
    for foot, places in feet_over(plan).items():
        above = places[:, 2] - terrain.height(places[:, 0], places[:, 1])
        assert above.min() > -1e-4, foot
        still = np.linalg.norm(np.diff(places, axis=0), axis=1) < 1e-6
        assert np.abs(above[1:][still]).max() < 1e-4, foot
        stood[foot] = np.ptp(places[1:][still][:, 2])
    assert max(stood.values()) > 2e-3  # they do stand higher and lower
    for phase in plan.bundle.phases:
        for contact in phase["contacts"]:
            start = int(np.searchsorted(plan.trajectory.time, phase["start"] - 1e-9))
            x, y, _ = feet_over_at(plan, contact["frame"], start)
            # A foothold may lie on an edge between two triangles.
            assert contact["normal"] == pytest.approx(terrain.normal(x, y), abs=0.03)
            assert contact["normal"][2] < 1.0
    assert plan.simulate().stands


def feet_over_at(plan: wb.Plan, foot: str, k: int) -> np.ndarray:
    """Place (3,) [m] of a foot at a sample."""
    state = wb.State(plan.robot.model, plan.trajectory.q[k])
    return np.array(state.pose(foot).translation)


def test_slopes_are_found_from_heights_alone() -> None:
    hills = wb.HeightField(
        np.linspace(-1, 1, 21), np.linspace(-1, 1, 21), np.add.outer(np.arange(21) * 0.02, np.zeros(21))
    )
    ground = over(wb.Obstacles([wb.Obstacle("hills", hills)]).terrain)
    exact = normal_at(ground, np.array([0.13, 0.21, 0.0]))
    assert exact == pytest.approx(np.array([-0.2, 0.0, 1.0]) / np.hypot(1.0, 0.2))
    assert normal_at(lambda x, y: ground(x, y), np.array([0.13, 0.21, 0.0])) == pytest.approx(exact)
    assert normal_at(lambda x, y: 0.3, np.zeros(3)) == (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def two_levels() -> wb.Plan:
    """Legs 2, 4 and 6 tread on blocks of 0.1 m, the others on the floor."""
    walker = Walker(wb.load_robot("heavy_hexapod"))
    stance = walker.stance()
    high = {leg: stance.feet[leg] + [0.05, 0.0] for leg in ("leg2", "leg4", "leg6")}
    blocks = [wb.Obstacle(leg, wb.Box((0.5, 0.5, 0.1)), (*place, 0.05)) for leg, place in high.items()]
    world = wb.Obstacles([wb.Obstacle("floor", wb.Ground()), *blocks])
    made = gait_for(walker, "tripod", stance, 0.0, 0.1)
    manner = Manner(step_time=3.0, height=0.06, clearance=0.02, limits=(world,))
    done = walk(walker, made, straight(0.1), 0.1, stance=stance, manner=manner, ground=over(world.terrain))
    return wb.plan(walker.robot, done.script, dt=0.02)


def test_tripods_on_two_levels_are_each_level(two_levels: wb.Plan) -> None:
    """No foot of one is a foot of the other: that their heights differ breaks no promise."""
    phases = two_levels.bundle.phases
    lone = [phase for phase in phases if len(phase["contacts"]) == 3]
    heights = []
    for phase in lone:
        assert "region" not in phase
        start = int(np.searchsorted(two_levels.trajectory.time, phase["start"] - 1e-9))
        feet = [feet_over_at(two_levels, contact["frame"], start)[2] for contact in phase["contacts"]]
        assert np.ptp(feet) < 1e-5
        heights.append(round(float(np.mean(feet)), 3))
    assert all(one != other for one, other in pairwise(heights))
    assert set(heights) == {0.0, 0.1}
    report = two_levels.check()
    assert report.ok, [row for row in report.rows if not row.held]
    assert report["contacts level"].worst < 1e-5
    assert two_levels.simulate().stands
