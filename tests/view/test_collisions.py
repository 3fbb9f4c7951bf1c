"""Collision shapes and the nearest pair are in the animation, where they are asked for."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.checks import check
from wbplan.checks.clearance import nearest
from wbplan.view.playback import page
from wbplan.view.robot_meshes import robot_meshes


@pytest.fixture(scope="module")
def plan() -> wb.Plan:
    robot = wb.load_robot("mana")
    phase = wb.Phase(
        "stand",
        contacts=[wb.Contact(foot) for foot in robot.feet.values()],
        soft=[wb.PostureTask()],
        limits=[wb.JointLimits(), wb.SelfCollision()],
        duration=0.05,
    )
    return wb.plan(robot, phase)


def test_shapes_and_the_nearest_pair_are_drawn_when_asked_for(plan: wb.Plan) -> None:
    plain, asked = page(plan.bundle), page(plan.bundle, collisions=True)
    assert len(asked) > len(plain) + 10_000


def test_the_nearest_pair_is_that_of_the_checks(plan: wb.Plan) -> None:
    samples = np.arange(len(plan.trajectory))
    found = nearest(plan.bundle, samples)
    worst = check(plan.bundle)["clearance"]
    names, gap, one, other = min(found, key=lambda item: item[1])
    assert gap == pytest.approx(worst.worst, abs=1e-9)
    assert names == worst.where
    assert np.linalg.norm(other - one) == pytest.approx(gap, abs=1e-6)


def test_capsules_are_drawn_about_their_middles() -> None:
    shape = '<geometry><capsule radius="0.05" length="0.2"/></geometry>'
    body = f'<link name="rod"><collision>{shape}</collision></link>'
    (mesh,) = robot_meshes(f'<robot name="one">{body}</robot>')
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-0.05, -0.05, -0.15], atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.05, 0.05, 0.15], atol=1e-6)
