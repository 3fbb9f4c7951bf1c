"""The walk task: every gait, mode, path and robot is planned, and goes where it was told to."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan import catalog
from wbplan.cli.commands import main
from wbplan.cli.survey import setting
from wbplan.gaits import Manner, Walker, gaits_for, straight, walk
from wbplan.taskfile import load_task

TASK = load_task("walk")


def planned(robot: str, dt: float = 0.02, backend: str = "proxqp", **settings: Any) -> wb.Plan:
    loaded = wb.load_robot(robot)
    values = TASK.values([f"{key}={value}" for key, value in settings.items()])
    plan = wb.plan(loaded, TASK.script(loaded, values), dt=dt, backend=backend)
    report = plan.check()
    assert report.ok, [row for row in report.rows if not row.held]
    assert all(phase["clearance"] == 0.005 for phase in plan.bundle.phases)
    return plan


def moved(plan: wb.Plan) -> tuple[np.ndarray, float]:
    """Where the body went (2,) [m], and by how much it turned [rad]."""
    first, last = plan.trajectory.q[0], plan.trajectory.q[-1]
    turn = pin.Quaternion(last[3:7]).toRotationMatrix() @ pin.Quaternion(first[3:7]).toRotationMatrix().T
    return last[:2] - first[:2], float(pin.rpy.matrixToRpy(turn)[2])


def same(one: wb.Script, other: wb.Script) -> bool:
    """Whether two walks have the same steps."""
    pairs = zip(one.phases, other.phases, strict=True)
    return all(
        a.name == b.name
        and a.duration == pytest.approx(b.duration)
        and [c.frame for c in a.contacts] == [c.frame for c in b.contacts]
        for a, b in pairs
    )


def test_gaits_by_name_are_those_that_are_walked_and_measured() -> None:
    """The task's walk is the one of the gaits' table: its speed and distance are measured there."""
    for name in catalog.robots():
        robot = wb.load_robot(name)
        for gait in gaits_for(robot)[::5]:
            one = setting(robot, gait)
            course = straight(2.0 * one.gait.stride(one.stroke))
            walked = walk(
                one.walker, one.gait, course, one.stroke, stance=one.stance, manner=Manner(height=one.lift)
            )
            assert same(TASK.script(robot, TASK.values([f"gait={gait}"])), walked.script), (name, gait)


@pytest.mark.parametrize("gait", ["crawl-2", "crawl-5"])
def test_any_heading(gait: str) -> None:
    way, _ = moved(planned("mana", dt=0.01, gait=gait, distance=0.05, heading=30.0, stroke=0.04))
    assert way == pytest.approx([0.05 * np.cos(np.pi / 6), 0.025], abs=1e-3)


@pytest.mark.parametrize(
    ("mode", "along"), [("crab", (1, 0)), ("ant", (0, 1)), ("mixed1", (1, 0)), ("mixed2", (0, 1))]
)
@pytest.mark.parametrize("robot", ["heavy_hexapod", "hexpiderix"])
def test_modes(robot: str, mode: str, along: tuple[int, int]) -> None:
    if robot == "hexpiderix" and mode == "ant":  # its first joints turn by no more than 60 degrees
        with pytest.raises(wb.GaitError, match=r"leg\d_joint1 would have to be at"):
            planned(robot, mode=mode, distance=0.1, stroke=0.05)
        return
    size = 0.25 if robot == "heavy_hexapod" else 0.05
    way, _ = moved(planned(robot, mode=mode, distance=size, stroke=size / 2))
    assert way == pytest.approx(size * np.array(along), abs=1e-3)


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
@pytest.mark.parametrize("robot", sorted(catalog.robots()))
def test_robots(robot: str, backend: str) -> None:
    plan = planned(robot, dt=0.01, backend=backend, cycles=0.5)
    way, _ = moved(plan)
    assert way[0] > 0.01
    assert way[1] == pytest.approx(0.0, abs=1e-3)
    assert np.nanmin(plan.trajectory.margin) > 0.0


@pytest.mark.parametrize("how", [{"mode": "crab"}, {"heading": 90}])
def test_thighs_pass_the_body_sideways_too(how: dict[str, Any]) -> None:
    """HIphanT's turn close by the belts beside its hull: the distance costs no margin."""
    way, _ = moved(planned("hiphant", cycles=0.5, **how))
    assert np.hypot(*way) > 0.1


def test_the_ground_is_a_balls_radius_below_its_middle() -> None:
    """Of a foot whose frame is the middle of its ball; feet that land sink no further in than ticks go."""
    soles = {name: Walker(wb.load_robot(name)).sole for name in catalog.robots()}
    assert soles == {**dict.fromkeys(soles, 0.0), "mana": 0.0075}
    plan = planned("mana", dt=0.01, cycles=0.5)
    (ground,) = plan.bundle.obstacles
    assert ground.pose.translation == pytest.approx([0.0, 0.0, -0.0075])
    assert plan.check()["depth of touch"].worst > -1e-5


def test_distances_are_left_out_where_nobody_asks(tmp_path: Path) -> None:
    robot = wb.load_robot("mana")
    script = TASK.script(robot, TASK.values(["clearance=0"]))
    assert {phase.clearance for phase in script.phases} == {None}
    bare = re.sub(r"<collision>.*?</collision>", "", robot.urdf_text, flags=re.DOTALL)
    (tmp_path / "bare.urdf").write_text(bare)
    shapeless = wb.load_robot(tmp_path / "bare.urdf", srdf=robot.srdf_path)
    assert {phase.clearance for phase in TASK.script(shapeless, TASK.values([])).phases} == {None}


@pytest.mark.parametrize("robot", ["hexpiderix", "hiphant"])
def test_curved_paths(robot: str) -> None:
    size = 0.05 if robot == "hexpiderix" else 0.3
    way, turn = moved(planned(robot, path="arc", distance=size, turn=15))
    assert turn == pytest.approx(np.radians(15.0), abs=1e-3)
    chord = size * np.sinc(np.radians(7.5) / np.pi)
    assert way == pytest.approx(chord * np.array([np.cos(np.pi / 24), np.sin(np.pi / 24)]), abs=2e-3)
    way, turn = moved(planned(robot, path="spot", turn=-15))
    assert turn == pytest.approx(np.radians(-15.0), abs=1e-3)
    assert way == pytest.approx([0.0, 0.0], abs=1e-3)


def test_walks_stand_in_physics() -> None:
    for robot in ("hexpiderix", "mana"):
        assert planned(robot, dt=0.01, cycles=0.5).simulate().stands, robot


def test_a_robot_is_chosen_on_the_command_line(
    tmp_path: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = str(tmp_path / "out")
    assert main(["run", "walk", "--robot", "hexpiderix", "--out", out, "--set", "cycles=0.5"]) == 0
    assert "walk on hexpiderix" in capsys.readouterr().out
    assert main(["run", "clamp", "--robot", "hexpiderix", "--out", out]) == 2
    assert (
        "'clamp' is not written for robot 'hexpiderix'; it is for: legarm_hexapod" in capsys.readouterr().err
    )
    assert main(["run", "walk", "--out", out, "--set", "gait=trot"]) == 2
    assert "6 legs have no gait 'trot'" in capsys.readouterr().err
    hexpiderix = ["run", "walk", "--robot", "hexpiderix", "--out", out]
    assert main([*hexpiderix, "--set", "margin=0.1"]) == 1
    assert "no walk exists: step '" in capsys.readouterr().err


def test_gaits_side_by_side_on_the_command_line(capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    picture = tmp_path / "cycle.png"
    assert main(["gaits", "hexpiderix", "tripod", "--figure", str(picture)]) == 0
    print(told := capsys.readouterr().out)
    assert "tripod" in told
    assert "hold" in told
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["gaits", "hexpiderix", "trot"]) == 2
