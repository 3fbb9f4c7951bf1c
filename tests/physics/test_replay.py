"""What stands, what falls, what is dropped, and that the figures say so."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wbplan as wb
from wbplan import catalog
from wbplan.errors import PhysicsError
from wbplan.physics import PICTURE, REPORT, Disturbance, Options, Push, simulate
from wbplan.taskfile import load_task

WEIGHT = 6.507 * 9.81


def test_a_plan_with_margin_stands(leaning) -> None:
    done = leaning[0.03].simulate()
    assert done.stands, done.verdict
    assert float(np.nanmin(leaning[0.03].trajectory.margin[-50:])) == pytest.approx(0.03, abs=8e-3)
    m = done.measures
    assert m.normal[-1].sum() == pytest.approx(WEIGHT, rel=0.02)
    assert m.normal[-1, :2].max() == 0.0  # limbs 1 and 2 are in the air
    assert m.load.max() <= 1.0 + 1e-9
    assert m.slip.max() < 0.01


def test_a_plan_with_negative_margin_falls(leaning) -> None:
    """Every promise of this plan holds: it promised too little."""
    assert leaning[-0.01].check().ok
    done = leaning[-0.01].simulate(Options(rest=2.0))
    assert done.verdict.word == "falls", done.verdict
    assert done.verdict.phase in ("lift", "hold")
    assert "off the ground" in done.verdict.cause


@pytest.mark.slow
def test_a_clamp_with_too_little_friction_drops_the_box(clamp) -> None:
    done = clamp.simulate(Options(grip=0.15, squeeze=9.0))
    assert done.verdict.word == "drops", done.verdict
    assert "'box'" in done.verdict.cause
    assert done.verdict.phase in ("e lift", "e move")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_every_task_stands(name: str) -> None:
    task = load_task(name)
    robot = wb.load_robot(task.robot)
    done = wb.plan(robot, task.script(robot), task=name).simulate()
    assert done.stands, done.verdict
    assert done.measures.collision.max() == 0.0, done.record.links
    for drift in done.measures.drift.values():
        assert np.nanmax(drift) < 0.02


def test_a_strong_push_fells_what_stands(leaning) -> None:
    push = Disturbance(pushes=(Push(2.0, (0.0, 150.0, 0.0), 0.2),))
    done = leaning[0.03].simulate(disturbance=push)
    assert not done.stands
    assert done.verdict.time is not None
    assert done.verdict.time > 2.0


def test_a_slope_without_friction_lets_feet_slip(leaning) -> None:
    slope = Disturbance(friction=0.02, tilt=(0.0, 0.1))
    assert leaning[0.03].simulate(disturbance=replace(slope, friction=1.0)).stands
    done = leaning[0.03].simulate(disturbance=slope)
    assert done.verdict.word in ("slips", "falls")
    assert done.measures.slip.max() > 0.02


def test_the_same_replay_twice_is_the_same(leaning) -> None:
    one, two = leaning[0.03].simulate(), leaning[0.03].simulate()
    np.testing.assert_array_equal(one.record.base, two.record.base)


def test_feet_as_ball_joints_follow_more_closely_than_balls(leaning) -> None:
    """A ball rolls as its leg turns, a ball joint does not."""
    ball = leaning[0.03].simulate(Options(feet="ball"))
    joint = leaning[0.03].simulate(Options(feet="joint"))
    assert ball.stands
    assert joint.stands
    planned = leaning[0.03].trajectory
    feet = np.linalg.norm(ball.record.feet[-1, 2:] - joint.motion.places[-1, 2:], axis=1)
    pinned = np.linalg.norm(joint.record.feet[-1, 2:] - joint.motion.places[-1, 2:], axis=1)
    assert pinned.max() < 1e-3 < feet.max()
    assert planned.time[-1] == pytest.approx(3.3)


def test_saved_beside_the_plan(leaning, tmp_path: Path) -> None:
    folder = leaning[0.03].save(tmp_path / "lean")
    done = simulate(wb.Bundle.read(folder))
    done.save(folder)
    told = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    assert told["verdict"]["word"] == "stands"
    assert told["collision_pairs"] == "SRDF of legarm_hexapod"
    assert 0.0 < told["measured"]["torque"]["worst"] <= 1.0 + 1e-9
    assert math.isfinite(told["real_time_factor"])
    assert (folder / PICTURE).read_bytes().startswith(b"\x89PNG")
    assert [p.name for p in folder.iterdir() if p.name.startswith(".")] == []
    leaning[0.03].save(folder)  # a new plan: the old one's simulation says nothing of it
    assert not (folder / REPORT).exists()


def test_no_contacts_is_refused(leaning) -> None:
    bundle = leaning[0.03].bundle
    bare = [{**phase, "contacts": []} for phase in bundle.phases]
    with pytest.raises(PhysicsError, match="contact"):
        simulate(replace(bundle, plan={**bundle.plan, "phases": bare}))
