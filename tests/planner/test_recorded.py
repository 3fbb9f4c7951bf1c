"""What a plan of several phases records: times, motion, promises, objects, targets and errors."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

FOUR = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")


def on(feet: tuple[str, ...] = FOUR) -> list[wb.Contact]:
    return [wb.Contact(foot, friction=0.7) for foot in feet]


def up(pose: pin.SE3, *by: float) -> pin.SE3:
    return pin.SE3(pose.rotation, pose.translation + np.array(by))


def pose_of(row: np.ndarray) -> pin.SE3:
    return pin.XYZQUATToSE3(np.array(row))


def gap(a: pin.SE3, b: pin.SE3) -> float:
    return float(np.linalg.norm(pin.log6(a.actInv(b)).vector))


@pytest.fixture(scope="module")
def carried(legarm: wb.Robot) -> wb.Plan:
    """Stand on six and sway; lift a place off the ground with the arms; put it down; leave it there."""
    state = legarm.state("manipulate")
    tip = state.pose("limb1_tip")
    where = up(tip, 0.03, 0.0, 0.0)
    box = wb.Body("box", mass=0.5, size=(0.1, 0.1, 0.1), pose=where, com=(0.0, 0.01, 0.0))
    shelf = wb.Body("shelf", mass=3.0, pose=up(where, 0.0, 0.5, 0.0))
    keep = [wb.PostureTask(weight=0.1)]
    limits = [wb.JointLimits(), wb.SupportPolygon(0.02)]
    hold = {
        "contacts": on(),
        "carried": [wb.Carried(box, by="limb1_tip")],
        "hard": [wb.RelativePoseTask("limb2_tip", root="limb1_tip")],
        "limits": limits,
    }

    def to(pose: pin.SE3) -> list[wb.Task]:
        return [wb.PoseTask("box", wb.MinJerk(wb.AS_IS, pose, 0.4), weight=(50.0, 10.0)), *keep]

    sway = wb.PoseTask("body", wb.MinJerk(wb.AS_IS, up(state.pose("body"), 0.01, 0.0, 0.0), 0.3), weight=10.0)
    return wb.plan(
        legarm,
        wb.Script(
            wb.Phase("sway", contacts=on(), soft=[sway, *keep], duration=0.3),
            wb.Phase("lift", soft=to(up(where, 0.0, 0.0, 0.03)), duration=0.4, **hold),
            wb.Phase("place", soft=to(up(where, 0.0, 0.01, 0.0)), duration=0.405, **hold),
            wb.Phase(
                "leave",
                contacts=on(FOUR[:3]),
                soft=[wb.PoseTask("limb1_tip", up(tip, 0, 0, 0.02)), *keep],
                duration=0.2,
            ),
            bodies=[shelf],
        ),
        start=state,
        task="carry",
        parameters={"mass": 0.5},
    )


def test_all_promises_hold_over_several_phases(carried: wb.Plan) -> None:
    report = carried.check()
    assert report.ok, report


def test_phases_cover_the_time_without_gaps(carried: wb.Plan) -> None:
    phases, time = carried.bundle.phases, carried.trajectory.time
    assert [p["name"] for p in phases] == ["sway", "lift", "place", "leave"]
    edges = [phases[0]["start"], *(p["end"] for p in phases)]
    assert edges[0] == 0.0
    assert [p["start"] for p in phases] == edges[:-1]
    # A duration that is no multiple of dt is rounded up to the next.
    np.testing.assert_allclose(np.diff(edges), [0.3, 0.4, 0.41, 0.2], atol=1e-12)
    assert edges[-1] == pytest.approx(time[-1], abs=1e-12)
    np.testing.assert_allclose(np.diff(time), 0.01, atol=1e-12)
    expected = np.searchsorted(edges[1:-1], time + 1e-9, side="right")
    np.testing.assert_array_equal(carried.trajectory.phase, expected)


def test_q_is_continuous_and_v_leads_from_each_sample_to_the_next(carried: wb.Plan) -> None:
    robot, motion = carried.robot, carried.trajectory
    assert motion.q.shape == (len(motion), robot.model.nq)
    assert motion.v.shape == (len(motion), robot.model.nv)
    for k in range(len(motion) - 1):
        step = pin.difference(robot.model, motion.q[k], motion.q[k + 1])
        np.testing.assert_allclose(step / 0.01, motion.v[k], atol=1e-9)
    assert np.abs(np.diff(motion.q, axis=0)).max() < 0.05
    assert not motion.v[-1].any()
    assert motion.joint_names == robot.joint_names


def test_phases_record_what_they_were_asked(carried: wb.Plan) -> None:
    sway, lift, place, leave = carried.bundle.phases
    assert [c["frame"] for c in lift["contacts"]] == list(FOUR)
    assert [c["frame"] for c in leave["contacts"]] == list(FOUR[:3])
    assert lift["contacts"][0] == {"frame": "leg3_foot", "friction": 0.7, "normal": [0.0, 0.0, 1.0]}
    assert sway["margin"] == leave["margin"] == -1e9
    assert lift["margin"] == place["margin"] == 0.02
    assert sway["closures"] == leave["closures"] == []
    assert lift["closures"] == place["closures"] == [{"frame_a": "limb1_tip", "frame_b": "limb2_tip"}]
    assert sway["carried"] == leave["carried"] == []
    (item,) = lift["carried"]
    assert {key: item[key] for key in ("name", "frame", "mass")} == {
        "name": "box",
        "frame": "limb1_tip",
        "mass": 0.5,
    }
    assert item["com"] == [0.0, 0.01, 0.0]
    assert lift["roles"] == {"limb1": "arm", "limb2": "arm"}
    assert [(t["name"], t["hard"]) for t in lift["tasks"]] == [
        ("relative(limb2_tip in limb1_tip)", True),
        ("pose(box)", False),
        ("posture", False),
    ]
    box = lift["tasks"][1]
    assert 0.0 < box["position"] < 1e-3
    assert 0.0 < box["orientation"] < 0.02
    assert box["joints"] is None
    assert carried.bundle.plan["task"] == "carry"
    assert carried.bundle.plan["parameters"] == {"mass": 0.5}
    assert {b["name"]: b["mass"] for b in carried.bundle.plan["bodies"]} == {"box": 0.5, "shelf": 3.0}
    json.dumps(carried.bundle.phases)


def test_worst_errors_are_the_largest_of_the_samples(carried: wb.Plan) -> None:
    for phase in carried.bundle.phases:
        rows = (carried.trajectory.time >= phase["start"] - 1e-9) & (
            carried.trajectory.time < phase["end"] - 1e-9
        )
        for task in phase["tasks"]:
            for part in ("position", "orientation", "joints"):
                column = carried.trajectory.errors.get(f"{task['name']}.{part}")
                if task[part] is not None:
                    assert task[part] >= np.nanmax(column[rows]) - 1e-15
    assert (
        carried.report["worst"]["pose(box).position"]
        >= max(p["tasks"][1]["position"] for p in carried.bundle.phases[1:3]) - 1e-9
    )


def test_a_carried_body_follows_its_holder_and_stays_where_it_is_put(carried: wb.Plan) -> None:
    motion, phases = carried.trajectory, carried.bundle.phases
    path = [pose_of(row) for row in motion.bodies["box"]]
    first, grasp, lower, release = (round(p["start"] / 0.01) for p in phases)
    rows = motion.bodies["box"]
    np.testing.assert_array_equal(rows[first:grasp], np.tile(rows[first], (grasp - first, 1)))
    in_tip = pose_of(phases[1]["carried"][0]["pose"])
    for k in range(grasp, release + 1):
        tip = wb.State(carried.robot.model, motion.q[k]).pose("limb1_tip")
        assert gap(path[k], tip * in_tip) < 1e-9
    assert gap(path[lower], path[grasp]) > 0.02
    assert gap(path[grasp], path[first]) < 1e-9
    assert gap(in_tip, pose_of(phases[2]["carried"][0]["pose"])) < 1e-9
    np.testing.assert_array_equal(rows[release:], np.tile(rows[release], (len(rows) - release, 1)))
    tips = [wb.State(carried.robot.model, motion.q[k]).pose("limb1_tip") for k in (release, len(path) - 1)]
    assert gap(*tips) > 5e-3
    shelf = motion.bodies["shelf"]
    np.testing.assert_array_equal(shelf, np.tile(shelf[0], (len(path), 1)))


def test_the_weight_of_what_is_carried_counts(carried: wb.Plan) -> None:
    robot, motion = carried.robot, carried.trajectory
    for k, (com, phase) in enumerate(zip(motion.com, motion.phase, strict=True)):
        expected = wb.State(robot.model, motion.q[k]).com * robot.total_mass
        mass = robot.total_mass
        if phase in (1, 2):
            expected = expected + 0.5 * pose_of(motion.bodies["box"][k]).act(np.array([0.0, 0.01, 0.0]))
            mass += 0.5
        np.testing.assert_allclose(com, expected / mass, atol=1e-9)
    known = np.isfinite(motion.margin)
    np.testing.assert_array_equal(known, np.isin(motion.phase, (1, 2)))
    assert motion.margin[known].min() >= 0.02


def test_targets_are_recorded_where_they_are_asked(carried: wb.Plan) -> None:
    motion = carried.trajectory
    asked = np.isfinite(motion.targets["pose(box)"]).all(axis=1)
    np.testing.assert_array_equal(asked, np.isin(motion.phase, (1, 2)))
    rows = np.flatnonzero(asked)
    assert (
        np.linalg.norm(motion.targets["pose(box)"][rows, :3] - motion.bodies["box"][rows, :3], axis=1).max()
        < 1e-3
    )
    assert not any(name.startswith("contact") for name in motion.targets)


def test_worst_errors_count_the_end_of_a_phase(legarm: wb.Robot) -> None:
    """A task that lags most at its very end is not asked any more in the sample that comes after."""
    tip = legarm.state("manipulate").pose("limb1_tip").translation
    away = wb.Waypoints((0.0, 0.2, 0.4), (wb.AS_IS, tip, tip + np.array([0.0, 0.0, 1.0])))
    chase = wb.PositionTask("limb1_tip", away, name="chase")
    phases = [
        wb.Phase("a", contacts=on(), soft=[chase], duration=0.3),
        wb.Phase("b", contacts=on(), duration=0.1),
    ]
    plan = wb.plan(legarm, wb.Script(phases), start="manipulate")
    worst = plan.bundle.phases[0]["tasks"][0]["position"]
    assert plan.report["worst"]["chase.position"] == worst
    assert worst > np.nanmax(plan.trajectory.errors["chase.position"])
