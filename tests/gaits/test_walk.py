"""Walks: planned, every promise kept, distance and speed those of the gait."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.gaits import Manner, Walk, Walker, gait_named, straight, walk

#: Robot -> radius and height of its stance, stroke, step time, lift.
ROBOTS = {
    "heavy_hexapod": (None, None, 0.3, 2.0, 0.1),
    "legarm_hexapod": (0.49, 0.30, 0.04, 0.5, 0.02),
}


def walked(robot: str, gait: str, cycles: float = 1.0, heading: float = 0.0) -> Walk:
    radius, height, stroke, step_time, lift = ROBOTS[robot]
    walker = Walker(wb.load_robot(robot))
    stance = walker.stance(radius=radius, height=height)
    made = gait_named(gait, walker.ring)
    track = straight(cycles * made.stride(stroke), heading)
    return walk(walker, made, track, stroke, stance=stance, manner=Manner(step_time, lift))


@pytest.mark.parametrize("robot", list(ROBOTS))
def test_distance_and_speed_are_the_gaits(robot: str) -> None:
    _, _, stroke, step_time, _ = ROBOTS[robot]
    done = walked(robot, "tripod", 2.0)
    assert done.gait is not None
    assert done.speed == pytest.approx(done.gait.speed(stroke, 2 * step_time), abs=1e-6)
    plan = wb.plan(done.robot, done.script)
    report = plan.check()
    assert report.ok, [row for row in report.rows if not row.held]
    moved = plan.trajectory.q[-1, :3] - plan.trajectory.q[0, :3]
    assert moved == pytest.approx([4.0 * stroke, 0.0, 0.0], abs=1e-3)
    middle = len(plan.trajectory.time) // 2
    beat = round(step_time / 0.01)
    gone = plan.trajectory.com[middle + beat // 2] - plan.trajectory.com[middle - beat // 2]
    assert np.linalg.norm(gone[:2]) == pytest.approx(done.speed * 0.01 * 2 * (beat // 2), abs=1e-3)
    assert np.nanmin(plan.trajectory.margin) >= done.margin
