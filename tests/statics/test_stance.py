"""A phase takes the hull where it is right, and the region where it is not; both are promised and checked."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import wbplan as wb
from wbplan.bundle import Bundle
from wbplan.compiled.phase import compile_phase
from wbplan.statics import push_load

SLOPE = 0.25  # [rad], inward: the six feet stand in a bowl


def contacts(robot: wb.Robot, tilt: float = SLOPE) -> list[wb.Contact]:
    state = robot.state("stand")
    feet = []
    for foot in robot.feet.values():
        out = state.pose(foot).translation[:2]
        out = out / np.linalg.norm(out)
        feet.append(wb.Contact(foot, friction=0.7, normal=(*(-np.sin(tilt) * out), np.cos(tilt))))
    return feet


def sway(robot: wb.Robot, **fields: Any) -> wb.Phase:
    goal = robot.state("stand").com + np.array([0.04, 0.02, -0.01])
    return wb.Phase(
        "sway",
        soft=[wb.ComTask(wb.MinJerk(wb.AS_IS, goal, 0.4))],
        duration=0.4,
        **{"limits": [wb.JointLimits(), wb.SupportPolygon(0.05)], "contacts": contacts(robot), **fields},
    )


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_a_stance_in_a_bowl_promises_its_region(legarm: wb.Robot, backend: str) -> None:
    plan = wb.plan(legarm, sway(legarm), dt=0.02, backend=backend)
    corners = np.array(plan.bundle.phases[0]["region"])
    assert corners.shape[1] == 2
    report = plan.check()
    assert report.ok, report.broken
    assert report["region corners that do not hold"].worst == 0.0
    assert report["margin agrees with q"].worst < 1e-9


def test_a_region_made_larger_is_found_out(legarm: wb.Robot) -> None:
    bundle = wb.plan(legarm, sway(legarm), dt=0.02).bundle
    phase = dict(bundle.phases[0])
    corners = np.array(phase["region"])
    phase["region"] = (corners + 0.02 * (corners - corners.mean(axis=0))).tolist()
    bad = dataclasses.replace(bundle, plan={**bundle.plan, "phases": [phase]})
    assert not wb.check(bad)["region corners that do not hold"].held


def test_level_contacts_keep_their_hull(legarm: wb.Robot) -> None:
    phase = sway(legarm, contacts=contacts(legarm, 0.0))
    compiled = compile_phase(legarm, phase, legarm.state("stand").q)
    assert not compiled.region
    assert compiled.polygon is not None
    assert len(compiled.polygon.vertices) == 6
    assert "region" not in wb.plan(legarm, phase, dt=0.05).bundle.phases[0]


def test_a_push_is_part_of_the_stance(legarm: wb.Robot) -> None:
    state = legarm.state("stand")
    push = wb.Push("limb1_tip", (8.0, 0.0, 0.0))
    held = wb.PositionTask("limb1_tip")
    phase = sway(legarm, contacts=contacts(legarm, 0.0), pushes=[push], hard=[held])
    load = push_load(phase, legarm.model, state)
    weight = 9.81 * float(sum(inertia.mass for inertia in legarm.model.inertias))
    assert load[:3] * weight == pytest.approx([-8.0, 0.0, 0.0])
    place = state.pose("limb1_tip").translation
    assert load[3:] * weight == pytest.approx(np.cross(place, [-8.0, 0.0, 0.0]))
    hull = compile_phase(legarm, dataclasses.replace(phase, pushes=()), state.q).polygon
    both = compile_phase(legarm, phase, state.q)
    assert both.region
    assert hull is not None
    assert both.polygon is not None
    assert hull.margins(both.polygon.vertices).min() > -1e-3  # the hull, and what the push leaves of it
    assert both.polygon.margin(state.com[:2]) < hull.margin(state.com[:2])
    plan = wb.plan(legarm, phase, dt=0.05)
    assert plan.bundle.phases[0]["pushes"] == [{"frame": "limb1_tip", "force": [8.0, 0.0, 0.0]}]
    assert plan.check().ok
    names = wb.Loop(legarm, phase, state).stack.edge_names()
    assert len(names) == len(both.polygon.vertices)
    assert names[0].startswith("support region, side towards")


def test_what_a_push_may_not_be(legarm: wb.Robot) -> None:
    start = legarm.state("stand").q
    loose = sway(legarm, pushes=[wb.Push("limb1_tip", (1.0, 0.0, 0.0))])
    with pytest.raises(wb.SpecError, match="'limb1_tip' may move while it pushes"):
        compile_phase(legarm, loose, start)
    nowhere = sway(legarm, pushes=[wb.Push("nose", (1.0, 0.0, 0.0))])
    with pytest.raises(wb.SpecError, match="nose"):
        compile_phase(legarm, nowhere, start)
    with pytest.raises(wb.SpecError, match=r"Push 'limb1_tip'\.force"):
        wb.Push("limb1_tip", (1.0, float("nan"), 0.0))
    with pytest.raises(wb.SpecError, match="named more than once: limb1_tip"):
        sway(legarm, pushes=[wb.Push("limb1_tip", (1.0, 0.0, 0.0))] * 2)
    hard = sway(
        legarm,
        contacts=contacts(legarm, 0.0),
        hard=[wb.PositionTask("limb1_tip")],
        pushes=[wb.Push("limb1_tip", (500.0, 0.0, 0.0))],
    )
    with pytest.raises(wb.SpecError, match="span no support polygon"):
        compile_phase(legarm, hard, start)


def test_a_slope_too_steep_is_refused_at_planning(legarm: wb.Robot) -> None:
    tilted = [dataclasses.replace(c, normal=(0.8, 0.0, 0.6)) for c in contacts(legarm)]
    with pytest.raises(wb.SpecError, match="span no support polygon"):
        wb.plan(legarm, sway(legarm, contacts=tilted), dt=0.05)


def test_bundles_with_a_broken_push_are_refused(legarm: wb.Robot) -> None:
    bundle = wb.plan(legarm, sway(legarm), dt=0.1).bundle
    for push in (
        {"frame": "limb1_tip"},
        {"frame": "x", "force": [0, 0, 0]},
        {"frame": "limb1_tip", "force": [1]},
    ):
        phase = {**bundle.phases[0], "pushes": [push]}
        with pytest.raises(wb.BundleError, match=r"pushes\[0\]"):
            Bundle({**bundle.plan, "phases": [phase]}, bundle.trajectory, bundle.urdf).validate()
