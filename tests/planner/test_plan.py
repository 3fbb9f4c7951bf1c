"""A script becomes a plan: what is recorded, what is kept, and that nothing else is touched."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

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


# ----------------------------------------------------------------------------------- the page-one example


def test_the_first_example_plans_checks_and_saves(tmp_path: Path) -> None:
    """As a newcomer types it, but for where the box goes."""
    robot = wb.load_robot("legarm_hexapod")
    state = robot.state("manipulate")
    start = state.pose("limb1_tip")
    goal = up(start, 0.0, -0.02, 0.05)

    box = wb.Body("box", mass=0.8, size=(0.25, 0.15, 0.12))
    phase = wb.Phase(
        "lift",
        contacts=[wb.Contact(f, friction=0.7) for f in ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")],
        carried=[wb.Carried(box, by="limb1_tip")],
        hard=[wb.RelativePoseTask("limb2_tip", root="limb1_tip", target=wb.AS_IS)],
        soft=[
            wb.PoseTask("box", wb.MinJerk(start, goal, duration=3.0), weight=(20.0, 5.0)),
            wb.PostureTask(weight=0.1),
        ],
        limits=[wb.JointLimits(), wb.SupportPolygon(margin=0.02)],
        duration=3.0,
    )
    plan = wb.plan(robot, wb.Script(phase), start=state, dt=0.01, backend="proxqp")
    assert plan.report["ticks"] == 300
    assert plan.report["seconds_motion"] == pytest.approx(3.0)
    assert plan.report["seconds_planning"] > 0.0
    assert 0.0 < plan.report["median_us"] <= plan.report["p99_us"]
    assert plan.report["warnings"] == []
    checked = plan.check()
    assert checked.ok, checked
    box_path = plan.trajectory.bodies["box"]
    assert gap(pose_of(box_path[0]), start) < 1e-9
    assert gap(pose_of(box_path[-1]), goal) < 2e-3
    folder = plan.save(tmp_path / "lift")
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "plan.json",
        "robot.urdf",
        "trajectory.npz",
        "trajectory.csv",
        "scene.html",
        "plots.png",
        "forces.png",
    }
    assert wb.check(wb.Bundle.read(folder)).ok


# ----------------------------------------------------------------------------- a body in a script's details


def test_a_body_that_stands_nowhere_is_put_at_its_holder(legarm: wb.Robot) -> None:
    phase = wb.Phase(
        "hold", contacts=on(), carried=[wb.Carried(wb.Body("box", mass=0.1), by="limb1_tip")], duration=0.02
    )
    plan = wb.plan(legarm, phase, start="manipulate", dt=0.01)
    assert (
        gap(pose_of(plan.trajectory.bodies["box"][0]), legarm.state("manipulate").pose("limb1_tip")) < 1e-12
    )


def test_a_grip_that_is_given_is_the_grip(legarm: wb.Robot) -> None:
    grip = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.01, 0.02, 0.03]))
    item = wb.Carried(wb.Body("box", mass=0.1), by="limb1_tip", pose=grip)
    plan = wb.plan(legarm, wb.Phase("hold", contacts=on(), carried=[item], duration=0.02), start="manipulate")
    tip = legarm.state("manipulate").pose("limb1_tip")
    assert gap(pose_of(plan.trajectory.bodies["box"][0]), tip * grip) < 1e-9
    assert plan.check().ok


def test_a_body_does_not_jump_into_its_holder(legarm: wb.Robot) -> None:
    tip = legarm.state("manipulate").pose("limb1_tip")
    grip = pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.0]))
    for place, says in (
        (tip * up(grip, 0.0, 0.002, 0.0), r"0\.002 m and \S+ rad from where the body is"),
        (
            tip * grip * pin.SE3(pin.exp3(np.array([0.0, 0.003, 0.0])), np.zeros(3)),
            r"\S+ m and 0\.003 rad from where",
        ),
    ):
        item = wb.Carried(wb.Body("box", mass=0.1, pose=place), by="limb1_tip", pose=grip)
        with pytest.raises(wb.SpecError, match=rf"phase 'hold'\.carried: body 'box'\.pose: {says}"):
            wb.plan(legarm, wb.Phase("hold", contacts=on(), carried=[item]), start="manipulate")
    there = wb.Carried(wb.Body("box", mass=0.1, pose=tip * grip), by="limb1_tip", pose=grip)
    phases = [wb.Phase(name, contacts=on(), carried=[there], duration=0.05) for name in ("one", "two")]
    assert wb.plan(legarm, wb.Script(phases), start="manipulate").check().ok


def test_a_body_passed_on_keeps_its_place(legarm: wb.Robot) -> None:
    """From one hand to the other: the second takes it as it is."""
    box = wb.Body("box", mass=0.1, pose=legarm.state("manipulate").pose("limb1_tip"))
    move = wb.PoseTask("box", wb.MinJerk(wb.AS_IS, up(box.pose, 0.0, 0.0, 0.02), 0.2), weight=20.0)
    plan = wb.plan(
        legarm,
        wb.Script(
            wb.Phase(
                "one", contacts=on(), carried=[wb.Carried(box, by="limb1_tip")], soft=[move], duration=0.2
            ),
            wb.Phase("two", contacts=on(), carried=[wb.Carried(box, by="limb2_tip")], duration=0.1),
        ),
        start="manipulate",
    )
    assert plan.check().ok
    path = plan.trajectory.bodies["box"]
    assert np.abs(np.diff(path[:, :3], axis=0)).max() < 5e-3
    assert [p["carried"][0]["frame"] for p in plan.bundle.phases] == ["limb1_tip", "limb2_tip"]


def test_a_loop_closed_by_way_of_the_box_is_a_closure_of_its_holder(legarm: wb.Robot) -> None:
    box = wb.Body("box", mass=0.2)
    phase = wb.Phase(
        "hold",
        contacts=on(),
        carried=[wb.Carried(box, by="limb1_tip")],
        hard=[wb.RelativePoseTask("limb2_tip", root="box")],
        soft=[
            wb.PoseTask(
                "box", wb.MinJerk(wb.AS_IS, up(legarm.state("manipulate").pose("limb1_tip"), 0, 0, 0.01), 0.2)
            )
        ],
        duration=0.2,
    )
    plan = wb.plan(legarm, phase, start="manipulate")
    assert plan.bundle.phases[0]["closures"] == [{"frame_a": "limb1_tip", "frame_b": "limb2_tip"}]
    assert plan.check().ok


def test_a_role_once_taken_is_kept(legarm: wb.Robot) -> None:
    change = wb.Phase("change", contacts=on(), roles={"limb1": "arm"}, soft=[wb.PostureTask()], duration=1.4)
    after = wb.Phase("after", contacts=on(), soft=[wb.PostureTask()], duration=0.1)
    plan = wb.plan(legarm, wb.Script(change, after), dt=0.02)
    assert plan.check().ok
    assert [p["roles"] for p in plan.bundle.phases] == [{"limb1": "arm", "limb2": "leg"}] * 2
    q = plan.trajectory.q
    for joint, value in legarm.roles["limb1"]["arm"].items():
        index = legarm.joint_index(joint)[0]
        np.testing.assert_allclose(q[70:, index], value, atol=1e-9)
    shank = q[:, legarm.joint_index("limb1_shank2")[0]]
    assert shank[0] == pytest.approx(0.07)
    assert (np.diff(shank) <= 1e-12).all()
    on_it = wb.Phase("on it", contacts=on(("limb1_foot", *FOUR)), duration=0.1)
    with pytest.raises(wb.SpecError, match="phase 'on it': contact 'limb1_foot' needs limb1 in role 'leg'"):
        wb.plan(legarm, wb.Script(change, after, on_it), dt=0.02)


# -------------------------------------------------------------------------------------- dt and progress


@pytest.mark.parametrize(("dt", "ticks"), [(0.007, 43), (0.03, 10), (0.3, 1), (0.5, 1), (0.29, 2)])
def test_a_tick_that_does_not_divide_the_duration_is_rounded_up(
    legarm: wb.Robot, dt: float, ticks: int
) -> None:
    goal = up(legarm.state("stand").pose("body"), 0.0, 0.002, 0.0)
    task = wb.PoseTask("body", wb.MinJerk(wb.AS_IS, goal, 0.3), weight=20.0)
    phases = [wb.Phase(name, contacts=on(), soft=[task], duration=0.3) for name in ("one", "two")]
    plan = wb.plan(legarm, wb.Script(phases), dt=dt)
    assert plan.report["ticks"] == 2 * ticks
    assert [p["end"] for p in plan.bundle.phases] == pytest.approx([ticks * dt, 2 * ticks * dt])
    np.testing.assert_allclose(plan.trajectory.time, np.arange(2 * ticks + 1) * dt)
    assert plan.check().ok


@pytest.mark.parametrize("dt", [0.01, 0.27, 0.5, 2.0])
def test_progress_grows_and_ends_at_one(legarm: wb.Robot, dt: float) -> None:
    phases = [wb.Phase(name, contacts=on(), duration=0.5) for name in ("one", "two", "three")]
    seen: list[tuple[float, str]] = []
    wb.plan(legarm, wb.Script(phases), dt=dt, progress=lambda share, name: seen.append((share, name)))
    shares = [share for share, _ in seen]
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert all(a < b for a, b in pairwise(shares))
    assert list(dict.fromkeys(name for _, name in seen)) == ["one", "two", "three", "done"]


def test_an_observer_sees_every_sample(legarm: wb.Robot) -> None:
    phases = [
        wb.Phase(name, contacts=on(), soft=[wb.PostureTask()], duration=0.05) for name in ("one", "two")
    ]
    seen: list[tuple[float, str, np.ndarray]] = []
    plan = wb.plan(
        legarm,
        wb.Script(phases),
        observe=lambda loop, t: seen.append((t, loop.compiled.phase.name, loop.q.copy())),
    )
    np.testing.assert_allclose([t for t, _, _ in seen], plan.trajectory.time, atol=1e-12)
    np.testing.assert_array_equal([q for _, _, q in seen], plan.trajectory.q)
    assert [name for _, name, _ in seen] == ["one"] * 5 + ["two"] * 6


# --------------------------------------------------------------------------------------- nothing half-done


def test_an_interrupt_while_planning_comes_through(legarm: wb.Robot, tmp_path: Path) -> None:
    def stop(share: float, name: str) -> None:
        if share > 0.2:
            raise KeyboardInterrupt

    phase = wb.Phase("stand", contacts=on(), duration=1.0)
    with pytest.raises(KeyboardInterrupt):
        wb.plan(legarm, phase, progress=stop).save(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def short(legarm: wb.Robot) -> wb.Plan:
    return wb.plan(legarm, wb.Phase("stand", contacts=on(), duration=0.05))


def test_an_interrupt_while_saving_leaves_nothing_behind(
    short: wb.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    kept = tmp_path / "kept"
    short.bundle.write(kept)
    before = {path.name: path.read_bytes() for path in kept.iterdir()}
    monkeypatch.setattr("wbplan.plots.save", stop)
    for folder in (tmp_path / "new" / "out", kept):
        with pytest.raises(KeyboardInterrupt):
            short.save(folder)
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]


def test_a_folder_that_is_a_file_is_refused(short: wb.Plan, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(wb.BundleError, match="out: is a file"):
        short.save(tmp_path / "out")
    assert (tmp_path / "out").read_text() == "mine"


def snapshot(robot: wb.Robot) -> list[Any]:
    model = robot.model
    return [
        model.nq,
        model.nframes,
        list(model.names),
        [frame.name for frame in model.frames],
        [inertia.toDynamicParameters().tolist() for inertia in model.inertias],
        [np.array(place.homogeneous).tolist() for place in model.jointPlacements],
        [np.array(frame.placement.homogeneous).tolist() for frame in model.frames],
        *(
            np.array(a).tolist()
            for a in (model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit)
        ),
        dict(robot.feet),
        {limb: {role: dict(held) for role, held in its.items()} for limb, its in robot.roles.items()},
    ]


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_planning_changes_nothing_that_the_caller_holds(legarm: wb.Robot, backend: str) -> None:
    state = legarm.state("manipulate")
    box = wb.Body("box", mass=0.8, pose=state.pose("limb1_tip"))
    place = up(box.pose, 0.0, 0.0, 0.02)
    path = wb.MinJerk(wb.AS_IS, place, 0.2)
    placed = np.array(box.pose.homogeneous)
    phase = wb.Phase(
        "lift",
        contacts=on(),
        carried=[wb.Carried(box, by="limb1_tip")],
        soft=[wb.PoseTask("box", path, weight=20.0), wb.PostureTask(state)],
        limits=[wb.JointLimits(0.5), wb.SupportPolygon()],
        driven={"limb2_joint4": wb.MinJerk(wb.AS_IS, 0.3, 0.2)},
        duration=0.2,
    )
    script, parameters = wb.Script(phase), {"mass": 0.8}
    before, q = snapshot(legarm), np.array(state.q)
    first = wb.plan(legarm, script, start=state, backend=backend, parameters=parameters)
    assert snapshot(legarm) == before
    np.testing.assert_array_equal(state.q, q)
    np.testing.assert_array_equal(box.pose.homogeneous, placed)
    assert path.start is wb.AS_IS
    assert parameters == {"mass": 0.8}
    again = wb.plan(legarm, script, start=state, backend=backend, parameters=parameters)
    np.testing.assert_array_equal(first.trajectory.q, again.trajectory.q)
    parameters["mass"] = 0.0
    assert first.bundle.plan["parameters"] == {"mass": 0.8}
