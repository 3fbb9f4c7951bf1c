"""A plan that cannot keep its word from the first sample on is not begun."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

FOUR = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")


def stand(name: str = "stand", **fields: Any) -> wb.Phase:
    return wb.Phase(name, **{"contacts": [wb.Contact(foot) for foot in FOUR], "duration": 0.1, **fields})


def moved(robot: wb.Robot, pose: str, **joints: float) -> np.ndarray:
    q = np.array(robot.state(pose).q)
    for joint, value in joints.items():
        q[robot.joint_index(joint)[0]] = value
    return q


# --------------------------------------------------------------------------------------------- the margin


def test_a_margin_that_the_start_does_not_hold_is_refused_with_the_number(legarm: wb.Robot) -> None:
    margin = wb.Loop(legarm, stand(limits=[wb.SupportPolygon(0.0)]), legarm.state("manipulate")).margin
    promised = margin + 0.01
    phase = stand("reach", limits=[wb.JointLimits(), wb.SupportPolygon(promised)])
    with pytest.raises(wb.SpecError) as caught:
        wb.plan(legarm, phase, start="manipulate")
    message = str(caught.value)
    assert message.startswith(
        f"phase 'reach' promises a stability margin of {promised:.4f} m but starts with {margin:.4f} m"
    )
    com = legarm.state("manipulate").com
    assert f"CoM x={com[0]:.4f}, y={com[1]:.4f} m over 4 contacts" in message


def test_a_margin_of_a_later_phase_is_refused_when_it_begins(legarm: wb.Robot) -> None:
    """The weight of a box that is taken up counts: it may be what breaks the promise."""
    heavy = wb.Body("box", mass=8.0)
    alone = wb.Loop(legarm, stand(limits=[wb.SupportPolygon(0.0)]), legarm.state("manipulate")).margin
    limits = [wb.JointLimits(), wb.SupportPolygon(alone - 0.005)]
    phases = [
        stand("empty", limits=limits),
        stand("laden", limits=limits, carried=[wb.Carried(heavy, by="limb1_tip")]),
    ]
    wb.plan(legarm, phases[0], start="manipulate")
    with pytest.raises(
        wb.SpecError, match=r"phase 'laden' promises a stability margin of .* but starts with -?0"
    ):
        wb.plan(legarm, wb.Script(phases), start="manipulate")


def test_a_margin_that_the_start_just_holds_is_accepted(legarm: wb.Robot) -> None:
    margin = wb.Loop(legarm, stand(limits=[wb.SupportPolygon(0.0)]), legarm.state("manipulate")).margin
    plan = wb.plan(legarm, stand(limits=[wb.JointLimits(), wb.SupportPolygon(margin)]), start="manipulate")
    assert plan.check().ok


# ---------------------------------------------------------------------------------------------- the start


def test_a_start_outside_joint_limits_names_the_joints(legarm: wb.Robot) -> None:
    low, high = legarm.joint_limits("leg3_joint2")
    q = moved(
        legarm, "stand", leg3_joint2=high + 0.1, leg5_joint3=legarm.joint_limits("leg5_joint3")[0] - 0.2
    )
    with pytest.raises(wb.SpecError) as caught:
        wb.plan(legarm, stand(), start=q)
    message = str(caught.value)
    assert message.startswith("start: joints outside their limits: ")
    assert f"leg3_joint2 is {high + 0.1:.4f}, limits {low:.4f} to {high:.4f}" in message
    assert "leg5_joint3 is" in message
    assert "leg4" not in message


@pytest.mark.parametrize(
    ("start", "says"),
    [
        ("sit", r"no pose 'sit'; poses: .*stand"),
        (np.zeros(3), r"q of robot 'legarm_hexapod': shape \(3,\), expected"),
    ],
    ids=["unknown pose", "too short"],
)
def test_a_start_that_is_none_is_refused(legarm: wb.Robot, start: Any, says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        wb.plan(legarm, stand(), start=start)


@pytest.mark.parametrize(
    ("index", "value", "says"),
    [
        (9, np.nan, r"q\[9\] of robot 'legarm_hexapod' is nan"),
        (9, np.inf, r"q\[9\] of robot 'legarm_hexapod' is inf"),
        (slice(3, 7), 0.0, "quaternion has to have norm 1"),
    ],
)
def test_a_start_with_a_wrong_number_is_refused(
    legarm: wb.Robot, index: Any, value: float, says: str
) -> None:
    q = np.array(legarm.state("stand").q)
    q[index] = value
    with pytest.raises(wb.SpecError, match=says):
        wb.plan(legarm, stand(), start=q)


def test_a_state_of_another_robot_is_refused(legarm: wb.Robot) -> None:
    model = pin.buildSampleModelHumanoid()
    assert model.nq == legarm.model.nq  # so that only the names tell them apart
    with pytest.raises(wb.SpecError, match=r"start: a state of '.*', expected one of 'legarm_hexapod'"):
        wb.plan(legarm, stand(), start=wb.State(model, pin.neutral(model)))


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf, "0.01", None], ids=str)
def test_dt_is_finite_and_positive(legarm: wb.Robot, dt: Any) -> None:
    with pytest.raises(wb.SpecError, match="dt: expected a finite positive time in seconds"):
        wb.plan(legarm, stand(), dt=dt)


@pytest.mark.parametrize(
    "script", [None, "stand", 5, [stand(), "x"]], ids=["none", "text", "number", "mixed"]
)
def test_a_script_is_made_of_phases(legarm: wb.Robot, script: Any) -> None:
    with pytest.raises(wb.SpecError, match="Script: expected"):
        wb.plan(legarm, script)


def test_a_backend_that_does_not_exist_is_refused_with_those_that_do(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SpecError, match=r"proxqp.*placo"):
        wb.plan(legarm, stand(), backend="osqp")


# --------------------------------------------------------------------------------- loops, and what clashes


def test_a_loop_that_starts_open_is_refused_with_its_gap(legarm: wb.Robot) -> None:
    state = legarm.state("manipulate")
    closed = state.pose("limb1_tip").actInv(state.pose("limb2_tip"))
    away = pin.SE3(closed.rotation, closed.translation + np.array([0.0, 0.0, 2e-4]))
    hard = [wb.RelativePoseTask("limb2_tip", root="limb1_tip", target=away, name="clamp")]
    with pytest.raises(wb.SpecError, match=r"phase 'stand': the loop 'clamp' starts open by 0\.0002 m"):
        wb.plan(legarm, stand(hard=hard), start=state)
    hard = [wb.RelativePoseTask("limb2_tip", root="limb1_tip", target=closed)]
    assert wb.plan(legarm, stand(hard=hard), start=state).check().ok


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_a_clash_says_when_in_the_plan_and_in_which_phase(legarm: wb.Robot, backend: str) -> None:
    tip = legarm.state("manipulate").pose("limb1_tip").translation
    hard = [
        wb.PositionTask("limb1_tip", tip + np.array([0.0, 0.0, 0.002]), name="up"),
        wb.PositionTask("limb1_tip", tip - np.array([0.0, 0.0, 0.002]), name="down"),
    ]
    with pytest.raises(wb.SolveError, match=r"at 0\.10 s of the plan, 0\.00 s into phase 'torn'") as caught:
        wb.plan(legarm, wb.Script(stand(), stand("torn", hard=hard)), start="manipulate", backend=backend)
    assert {clash.name for clash in caught.value.clashes} == {"up", "down"}


def test_an_unreachable_soft_target_is_no_error(legarm: wb.Robot) -> None:
    far = legarm.state("stand").pose("limb1_tip").translation + np.array([0.0, 5.0, 0.0])
    plan = wb.plan(
        legarm,
        stand(soft=[wb.PositionTask("limb1_tip", far, weight=5.0), wb.PostureTask()], duration=0.5),
    )
    assert plan.check().ok
    assert plan.report["worst"]["position(limb1_tip).position"] > 4.0


def test_a_script_may_say_where_it_starts(legarm: wb.Robot) -> None:
    folded = wb.Phase("stand", contacts=[wb.Contact(foot) for foot in legarm.feet.values()], duration=0.02)
    script = wb.Script(folded, start="folded")
    np.testing.assert_array_equal(wb.plan(legarm, script).trajectory.q[0], legarm.state("folded").q)
    told = wb.plan(legarm, script, start="stand")
    np.testing.assert_array_equal(told.trajectory.q[0], legarm.state("stand").q)
    with pytest.raises(wb.SpecError, match=r"Script\.start: expected a State or the name of a pose"):
        wb.Script(folded, start=3.0)  # type: ignore[arg-type]
