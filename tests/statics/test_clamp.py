"""The clamp's squeeze: along the whole path, with a safety factor, within the servos; or no plan."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.bundle import Bundle

SIZE = (0.2, 0.12, 0.1)


def lift(robot: wb.Robot, *, mass: float = 0.5, com: Any = (0.0, 0.0, 0.0), **grip: Any) -> wb.Script:
    """Both arms out, a box between their palms, lifted a little."""
    out = robot.state("manipulate")
    left, right = (out.pose(f"limb{k}_tip").translation for k in (1, 2))
    across = (right - left) / np.linalg.norm(right - left)
    place = pin.SE3(np.eye(3), 0.5 * (left + right))
    assert abs(across[0]) > 0.99
    width = float(np.linalg.norm(right - left))
    box = wb.Body("box", mass=mass, size=(width, *SIZE[1:]), pose=place, com=com)
    fields = {"friction": 0.7, **grip}
    goal = place * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.02]))
    return wb.Script(
        wb.Phase(
            "lift",
            contacts=[wb.Contact(f"leg{k}_foot") for k in (3, 4, 5, 6)],
            carried=[wb.Carried(box, by="limb1_tip", grip=wb.Grip("limb2_tip", **fields))],
            hard=[wb.RelativePoseTask("limb2_tip", root="limb1_tip")],
            soft=[
                wb.PoseTask("box", wb.MinJerk(wb.AS_IS, goal, 0.6), weight=(100.0, 50.0)),
                wb.PostureTask(weight=0.1),
            ],
            duration=0.6,
        ),
        start="manipulate",
    )


@pytest.fixture(scope="module")
def lifted(legarm: wb.Robot) -> Bundle:
    return wb.plan(legarm, lift(legarm), dt=0.02).bundle


def test_the_squeeze_holds_with_its_safety(lifted: Bundle) -> None:
    item = lifted.phases[0]["carried"][0]
    assert item["squeeze"] == pytest.approx(2.0 * item["squeeze_needed"])
    # Half of the weight at each palm over the friction, and a little for the lift's acceleration.
    still = 0.5 * 0.5 * 9.81 / 0.7
    assert still * 0.999 < item["squeeze_zheng"] < 1.2 * still
    assert item["squeeze_needed"] >= 0.999 * still
    report = wb.check(lifted)
    assert report.ok, report.broken
    assert report["grip friction use"].worst == pytest.approx(0.5, abs=0.02)
    palm = lifted.trajectory.forces["limb2_tip"]
    assert np.abs(palm[:, 0]) == pytest.approx(item["squeeze"], rel=0.02)


def test_a_com_off_the_middle_needs_more(legarm: wb.Robot, lifted: Bundle) -> None:
    off = wb.plan(legarm, lift(legarm, com=(0.05, 0.0, 0.0)), dt=0.02).bundle.phases[0]["carried"][0]
    assert off["squeeze_needed"] > 1.2 * lifted.phases[0]["carried"][0]["squeeze_needed"]
    assert off["squeeze_needed"] > 1.2 * off["squeeze_zheng"]


def test_checks_find_a_clamp_that_slips(lifted: Bundle) -> None:
    motion = lifted.trajectory
    palm = motion.forces["limb2_tip"]
    loose = dataclasses.replace(motion, forces={**motion.forces, "limb2_tip": palm * [0.2, 1.0, 1.0]})
    report = wb.check(dataclasses.replace(lifted, trajectory=loose))
    assert not report["grip friction use"].held
    gone = {k: v for k, v in motion.forces.items() if k != "limb2_tip"}
    report = wb.check(dataclasses.replace(lifted, trajectory=dataclasses.replace(motion, forces=gone)))
    assert not report["grip friction use"].held


def test_a_clamp_that_servos_cannot_hold_is_no_plan(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SolveError, match=r"needs a squeeze of .* limb\d_joint\d gives .* N are missing"):
        wb.plan(legarm, lift(legarm, friction=0.1, safety=3.0), dt=0.05)


def test_a_clamp_that_does_not_close_is_no_plan(legarm: wb.Robot) -> None:
    script = lift(legarm)
    phase = script.phases[0]
    box = script.bodies[0]
    turned = dataclasses.replace(
        box, pose=box.pose * pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.7])), np.zeros(3))
    )
    carried = [wb.Carried(turned, by="limb1_tip", grip=wb.Grip("limb2_tip", friction=0.3))]
    with pytest.raises(wb.SolveError, match="do not close on 'box'"):
        wb.plan(
            legarm,
            wb.Script(dataclasses.replace(phase, carried=carried, soft=()), start="manipulate"),
            dt=0.05,
        )


def test_the_simulator_squeezes_as_planned(lifted: Bundle) -> None:
    from wbplan.physics.motion import motion_of
    from wbplan.physics.options import Options

    item = lifted.phases[0]["carried"][0]
    assert motion_of(lifted, Options()).squeeze["box"] == item["squeeze"]
    assert motion_of(lifted, Options(squeeze=9.0)).squeeze["box"] == 9.0
