"""`plan.why`, and the sentences that a bundle keeps for the view."""

from __future__ import annotations

import json

import numpy as np
import pytest

import wbplan as wb

FEET = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")


@pytest.fixture(scope="module")
def reaching(legarm: wb.Robot) -> wb.Plan:
    """A tip is sent where it cannot get, then back."""
    start = legarm.state("manipulate")
    here = start.pose("limb1_tip").translation
    out = here + np.array([0.0, 0.3, 0.2])

    def phase(name: str, goal: np.ndarray) -> wb.Phase:
        tip = wb.PositionTask("limb1_tip", wb.MinJerk(wb.AS_IS, goal, 1.5), weight=20.0)
        body = wb.PoseTask("body", start.pose("body"), weight=0.5)
        return wb.Phase(
            name,
            contacts=[wb.Contact(foot) for foot in FEET],
            soft=[[tip], [body, wb.PostureTask(weight=0.1)]],
            limits=[wb.JointLimits(), wb.SupportPolygon(0.02)],
            duration=2.5,
        )

    return wb.plan(legarm, wb.Script(phase("out", out), phase("back", here)), start=start, dt=0.01)


def test_a_plan_says_why_at_a_time(reaching: wb.Plan) -> None:
    why = reaching.why(2.4, "limb1_tip")
    recorded = reaching.trajectory.errors["position(limb1_tip).position"]
    assert why.error == pytest.approx(recorded[241], rel=1e-3)
    assert why.error > 0.05
    assert why.reasons
    assert "limb1_tip is " in str(why)
    assert str(reaching.why(2.4, "limb1_tip")) == str(why), "asking changes nothing"
    assert reaching.why(5.0, "limb1_tip").error < 1e-3


@pytest.mark.parametrize("t", [-0.1, 5.2, np.nan])
def test_a_time_outside_the_plan_is_refused(reaching: wb.Plan, t: float) -> None:
    with pytest.raises(wb.SpecError, match=r"Plan\.why: t"):
        reaching.why(t, "limb1_tip")


def test_an_unknown_task_is_answered_with_those_of_the_phase(reaching: wb.Plan) -> None:
    with pytest.raises(wb.SpecError, match=r"'box' does not exist; there are: .*position\(limb1_tip\)"):
        reaching.why(1.0, "box")


def test_the_bundle_keeps_short_sentences_where_a_limit_holds_a_task_back(reaching: wb.Plan) -> None:
    notes = reaching.bundle.plan["why"]
    assert notes
    assert len(json.dumps(notes)) < 5000
    for note in notes:
        assert note["text"].startswith(("limb1_tip is ", "body is "))
        assert note["until"] - note["time"] == pytest.approx(0.5, abs=0.011)
    while_out = [note for note in notes if 1.0 <= note["time"] <= 2.5]
    assert {note["task"] for note in while_out} == {"position(limb1_tip)"}, "the higher level comes first"
    assert all("limit" in note["text"] or "holds it" in note["text"] for note in while_out), while_out
    assert not any(note["time"] > 4.5 for note in notes), "at the end it is back"


def test_levels_are_in_the_plan(reaching: wb.Plan) -> None:
    levels = {task["name"]: task["level"] for task in reaching.bundle.plan["phases"][0]["tasks"]}
    assert levels == {"position(limb1_tip)": 0, "pose(body)": 1, "posture": 1}
