"""The picture of a plan's forces: it shows what is recorded, and it can always be drawn."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

import wbplan as wb
from wbplan.bundle import Bundle
from wbplan.plots import forces as forceplots


@pytest.fixture(scope="module")
def pressed() -> Bundle:
    robot = wb.load_robot("legarm_hexapod")
    phase = wb.Phase(
        "press",
        contacts=[wb.Contact(foot) for foot in robot.feet.values()],
        hard=[wb.PositionTask("limb1_tip")],
        pushes=[wb.Push("limb1_tip", (5.0, 0.0, 0.0))],
        limits=[wb.JointLimits(), wb.SupportPolygon(0.02)],
        duration=0.4,
    )
    return wb.plan(robot, phase, dt=0.02).bundle


def test_it_shows_what_is_recorded(pressed: Bundle) -> None:
    motion = pressed.trajectory
    normal, use, torque, margin, push = forceplots.figure(pressed).axes
    foot = pressed.phases[0]["contacts"][0]["frame"]
    (line,) = [line for line in normal.lines if line.get_label() == foot]
    np.testing.assert_allclose(line.get_ydata(), motion.forces[foot][:, 2])
    worst = pressed.phases[0]["forces"]
    assert max(float(np.max(line.get_ydata())) for line in use.lines) == pytest.approx(worst["friction_use"])
    assert max(float(np.max(line.get_ydata())) for line in torque.lines) == pytest.approx(worst["torque_use"])
    np.testing.assert_allclose(margin.lines[0].get_ydata(), motion.margin)
    np.testing.assert_allclose(push.lines[0].get_ydata(), motion.push)


def test_a_plan_without_forces_can_be_drawn(good: Bundle, pressed: Bundle, tmp_path: Path) -> None:
    bare = dataclasses.replace(pressed.trajectory, forces={}, torque=None, push=None)
    for bundle in (good, dataclasses.replace(pressed, trajectory=bare)):
        picture = imread(forceplots.save(bundle, tmp_path / "forces.png"))
        assert picture.shape[0] > 500
    with pytest.raises(wb.BundleError, match="cannot be written"):
        forceplots.save(good, tmp_path / "nowhere" / "forces.png")
