"""Obstacles are in the simulated world, and hold up what stands on them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import wbplan as wb
from wbplan.physics.motion import motion_of
from wbplan.physics.options import Options
from wbplan.physics.scene import scene_of

BLOCKS = 0.05  #: height [m]
ROBOT = wb.load_robot("mana")
#: MANA's feet frames are the centres of balls of this radius [m].
BALL = 0.0075


def standing(*obstacles: wb.Obstacle, height: float = 0.0) -> wb.Plan:
    """MANA standing still, its ball centres at a height."""
    q = np.array(ROBOT.state("stand").q)
    q[2] += height
    phase = wb.Phase(
        "stand",
        contacts=[wb.Contact(foot) for foot in ROBOT.feet.values()],
        hard=[wb.PoseTask("body", wb.AS_IS)],
        limits=[wb.JointLimits(), wb.Obstacles(obstacles)],
        duration=0.3,
    )
    return wb.plan(ROBOT, phase, start=ROBOT.state(q))


def blocks(height: float) -> list[wb.Obstacle]:
    """A block under each foot, of different shapes."""
    stand = ROBOT.state("stand")
    kinds = [wb.Box((0.1, 0.1, height)), wb.Cylinder(0.06, height)]
    kinds.append(
        wb.Mesh([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-height / 2, height / 2)])
    )
    kinds.append(wb.HeightField([-0.05, 0.0, 0.05], [-0.05, 0.05], np.full((3, 2), height / 2)))
    places = [stand.pose(foot).translation * [1, 1, 0] + [0, 0, height / 2] for foot in ROBOT.feet.values()]
    return [
        wb.Obstacle(f"block{i}", kind, place)
        for i, (kind, place) in enumerate(zip(kinds, places, strict=True))
    ]


def test_a_robot_stands_on_blocks_of_every_shape() -> None:
    ground = wb.Obstacle("ground", wb.Ground())
    plan = standing(ground, *blocks(BLOCKS), height=BLOCKS + BALL)
    motion = motion_of(plan.bundle, Options())
    scene = scene_of(plan.bundle, motion, Options(), ignored=ROBOT.ignored_collisions)
    names = [scene.model.geom(g).name for g in range(scene.model.ngeom)]
    assert [n for n in names if n.startswith("obstacle:")] == ["obstacle:ground"] + [
        f"obstacle:block{i}" for i in range(4)
    ]
    assert not [n for n in names if n.startswith("tread") or n == "floor"]
    result = plan.simulate()
    assert result.verdict.word == "stands", str(result.verdict)


def test_feet_touch_boxes_and_height_fields_and_no_floor_is_put_under_them() -> None:
    plan = standing(*blocks(BLOCKS), height=BLOCKS + BALL)
    bundle = plan.bundle
    motion = motion_of(bundle, Options())
    scene = scene_of(bundle, motion, Options(), ignored=ROBOT.ignored_collisions)
    data = scene.start(motion)
    bottoms = {name: scene.model.geom(name).id for name in ("obstacle:block0", "obstacle:block3")}
    touched = {int(g) for contact in data.contact for g in contact.geom}
    mujoco.mj_step(scene.model, data, 50)
    touched |= {int(g) for contact in data.contact for g in contact.geom}
    assert set(bottoms.values()) <= touched
    assert scene.floor == pytest.approx(BLOCKS + BALL)


def test_a_slope_is_a_plane_with_its_normal() -> None:
    slope = wb.Obstacle("slope", wb.Ground((0.1, 0.0, 1.0)), np.array([0.0, 0.0, -0.3]), friction=0.4)
    plan = standing(slope)
    scene = scene_of(
        plan.bundle, motion_of(plan.bundle, Options()), Options(), ignored=ROBOT.ignored_collisions
    )
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    geom = scene.model.geom("obstacle:slope")
    assert data.geom_xmat[geom.id].reshape(3, 3)[:, 2] == pytest.approx(
        np.array([0.1, 0, 1]) / np.hypot(0.1, 1)
    )
    assert geom.friction[0] == pytest.approx(0.4)
