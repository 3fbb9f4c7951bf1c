"""The commands: what they print, what they write, and their exit codes."""

from __future__ import annotations

import json
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbplan as wb
from wbplan.bundle import Bundle
from wbplan.cli import commands

Refused = Callable[..., str]
Call = Callable[..., Any]

FILES = [
    "forces.png",
    "plan.json",
    "plots.png",
    "robot.urdf",
    "scene.html",
    "trajectory.csv",
    "trajectory.npz",
]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small plan, saved; tests that change it work on a copy."""
    robot = wb.load_robot("legarm_hexapod")
    phase = wb.Phase(
        "stand",
        contacts=[wb.Contact(foot, friction=0.7) for foot in robot.feet.values()],
        soft=[wb.PostureTask(weight=1.0)],
        limits=[wb.JointLimits(), wb.SupportPolygon(margin=0.02)],
        duration=0.1,
    )
    folder = tmp_path_factory.mktemp("bundle") / "stand"
    wb.plan(robot, phase).save(folder)
    return folder


def test_list_names_tasks_and_robots(wbplan: Call) -> None:
    ran = wbplan("list")
    assert ran.code == 0
    lines = ran.out.splitlines()
    assert [line for line in lines if line.split()[:2] == ["clamp", "legarm_hexapod"]]
    assert [line for line in lines if line.split()[:1] == ["legarm_hexapod"]]


def test_list_of_a_task_names_its_parameters(wbplan: Call) -> None:
    ran = wbplan("list", "clamp")
    assert ran.code == 0
    assert "mass=0.8 (float)" in ran.out


def test_help_and_version(wbplan: Call) -> None:
    for args in ([], ["--help"], ["run", "--help"]):
        ran = wbplan(*args)
        assert ran.code == 0
        assert "Usage" in ran.out
    assert wbplan("--version").out == f"wbplan {wb.__version__}\n"


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_run_plans_checks_and_writes(backend: str, wbplan: Call, tmp_path: Path) -> None:
    ran = wbplan(
        "run", "sway.py", "--backend", backend, "--dt", "0.02", "--set", "sway=0.02", "--set", "name=lean"
    )
    assert (ran.code, ran.err) == (0, "")
    folder = tmp_path / "out" / "sway"
    assert sorted(p.name for p in folder.iterdir()) == FILES
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    assert (plan["task"], plan["backend"], plan["dt"]) == ("sway", backend, 0.02)
    assert plan["parameters"]["sway"] == 0.02
    assert [phase["name"] for phase in plan["phases"]] == ["lean"]
    for part in ("lean", "planned in", "of motion", "wbplan view", str(Path("out") / "sway")):
        assert part in ran.out
    assert wbplan("check", "out/sway").code == 0


def test_run_replaces_a_bundle(wbplan: Call, tmp_path: Path) -> None:
    assert wbplan("run", "sway.py", "--out", "here").code == 0
    assert wbplan("run", "sway.py", "--out", "here", "--dt", "0.05").code == 0
    assert json.loads((tmp_path / "here" / "plan.json").read_text(encoding="utf-8"))["dt"] == 0.05
    assert sorted(p.name for p in tmp_path.iterdir()) == ["here", "sway.py"]


def test_check_of_what_holds(wbplan: Call, bundle: Path) -> None:
    ran = wbplan("check", str(bundle))
    assert (ran.code, ran.err) == (0, "")
    assert "holds" in ran.out


def test_check_finds_one_changed_joint_value(wbplan: Call, bundle: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bundle, tmp_path / "tampered")
    arrays = dict(np.load(folder / "trajectory.npz"))
    arrays["q"][3, 9] += 0.01
    np.savez_compressed(folder / "trajectory.npz", **arrays)
    ran = wbplan("check", str(folder))
    assert ran.code == 1
    assert "BROKEN" in ran.out
    assert ran.err.startswith("wbplan: ")
    assert "Traceback" not in ran.err


def test_robot_summary(wbplan: Call) -> None:
    ran = wbplan("robot", "legarm_hexapod")
    assert ran.code == 0
    for part in (
        "limb1",
        "limb1_tip",
        "leg3_foot",
        "kg",
        "stand",
        "manipulate",
        "limb1_shank2",
        "problems: none",
    ):
        assert part in ran.out


def test_every_problem_of_a_robot_is_listed(wbplan: Call, tmp_path: Path) -> None:
    link = (
        '<link name="{}"><inertial><mass value="{}"/>'
        '<inertia ixx="1" iyy="1" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="knee" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="1" upper="-1" effort="1" velocity="1"/></joint>'
    )
    (tmp_path / "bad.urdf").write_text(
        f'<robot name="bad">{link.format("a", 1, 1)}{link.format("b", -2, 5)}{joint}</robot>',
        encoding="utf-8",
    )
    ran = wbplan("robot", "bad.urdf")
    assert ran.code == 2
    assert "Traceback" not in ran.err
    told = [line for line in ran.err.splitlines() if line.startswith("  - ")]
    assert [line for line in told if "'b'" in line and "mass" in line]
    assert [line for line in told if "'b'" in line and "inertia" in line]
    assert [line for line in told if "'knee'" in line]


@pytest.mark.parametrize("text", ["", "not xml", "<robot/>"])
def test_an_empty_or_broken_urdf(text: str, wbplan: Call, tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text(text, encoding="utf-8")
    ran = wbplan("robot", "bad.urdf")
    assert ran.code == 2
    assert "bad.urdf" in ran.err
    assert "Traceback" not in ran.err


def test_contradicting_hard_tasks_are_named(wbplan: Call, tmp_path: Path) -> None:
    (tmp_path / "torn.py").write_text(
        '"""Torn."""\n'
        "import wbplan as wb\n"
        'ROBOT = "legarm_hexapod"\n'
        "def script(robot):\n"
        '    here = robot.state("stand").pose("body").translation\n'
        "    ask = lambda name, dz: wb.PositionTask('body', here + [0, 0, dz], name=name)\n"
        "    return wb.Script(wb.Phase('torn', hard=[ask('up', 0.05), ask('down', -0.05)]))\n",
        encoding="utf-8",
    )
    ran = wbplan("run", "torn.py")
    assert ran.code == 1
    for part in ("no plan exists", "up", "down", "torn"):
        assert part in ran.err
    assert "Traceback" not in ran.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        (["fly"], ["fly"]),
        (["run"], ["task"]),
        (["run", "sway.py", "--backend", "magic"], ["magic", "proxqp", "placo"]),
        (["run", "sway.py", "--dt", "soon"], ["--dt"]),
        (["run", "sway.py", "--dt", "0"], ["dt", "0"]),
        (["run", "sway.py", "--dt", "nan"], ["dt", "nan"]),
        (["run", "sway.py", "--dt", "-0.01"], ["dt", "-0.01"]),
        (["run", "sway.py", "--colour", "red"], ["--colour"]),
        (["run", "sway.py", "--set", "duration=-1"], ["duration", "-1"]),
        (["run", "sway.py", "--set", "feet=2"], ["sway", "polygon"]),
        (["run", "sway.py", "--set", "feet=3"], ["margin"]),
        (["robot", "no_robot"], ["no_robot", "legarm_hexapod"]),
        (["robot", "no_robot.urdf"], ["no_robot.urdf"]),
        (["check", "nowhere"], ["nowhere"]),
        (["check", "sway.py"], ["sway.py"]),
        (["check", "."], ["plan.json"]),
        (["view", "nowhere"], ["nowhere"]),
        (["view", ".", "--port", "70000"], ["--port"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_bad_input_is_told_in_one_line(
    args: list[str], expected: list[str], refused: Refused, tmp_path: Path
) -> None:
    said = refused(*args)
    for part in expected:
        assert part in said
    assert [p.name for p in tmp_path.iterdir()] == ["sway.py"]


@pytest.mark.parametrize("file", ["plan.json", "robot.urdf", "trajectory.npz"])
def test_a_damaged_bundle(file: str, refused: Refused, bundle: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bundle, tmp_path / "damaged")
    whole = (folder / file).read_bytes()
    for content in (b"", whole[: len(whole) // 2], None):
        if content is None:
            (folder / file).unlink()
        else:
            (folder / file).write_bytes(content)
        assert file in refused("check", "damaged")


def test_a_folder_that_cannot_be_written(refused: Refused, tmp_path: Path) -> None:
    assert "sway.py" in refused("run", "sway.py", "--out", "sway.py")
    assert "sway.py" in refused("run", "sway.py", "--out", "sway.py/deeper/still")


def test_a_folder_with_other_things_is_left_alone(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years", encoding="utf-8")
    assert "mine" in refused("run", "sway.py", "--out", "mine")
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_a_taken_port(refused: Refused, bundle: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert port in refused("view", str(bundle), "--port", port)


STRETCHED = '''"""Stretched: the body rises until the legs are at their end."""
import wbplan as wb
ROBOT = "mana"
def script(robot):
    stand = robot.state("stand")
    contacts = [wb.Contact(foot) for foot in robot.feet.values()]
    rise = wb.ComTask(wb.MinJerk(stand.com, stand.com + [0.0, 0.0, 2.0], 4.0))
    return wb.Script(wb.Phase("rise", contacts=contacts, hard=[rise], duration=4.0))
'''


def test_a_plan_that_fails_on_its_way_is_kept_where_asked_for(wbplan: Call, tmp_path: Path) -> None:
    (tmp_path / "stretched.py").write_text(STRETCHED, encoding="utf-8")
    ran = wbplan("run", "stretched.py", "--partial", "until")
    assert ran.code == 1
    assert "no plan exists: at " in ran.err
    assert "the plan until then is in until" in ran.err
    assert not (tmp_path / "out").exists()
    checked = wbplan("check", "until")
    assert checked.code == 0, checked
    assert "incomplete: it ends where no step was found: at " in checked.out


def test_a_bundle_replaced_while_it_is_simulated_gets_no_verdict(
    wbplan: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert wbplan("run", "sway.py", "--out", "a").code == 0
    real = commands.replay

    def replay(bundle: Bundle, **asked: object) -> object:
        done = real(bundle, **asked)
        assert commands.main(["run", "sway.py", "--out", "a", "--set", "sway=0.005"]) == 0
        return done

    monkeypatch.setattr(commands, "replay", replay)
    ran = wbplan("simulate", "a")
    assert ran.code == 2
    assert "was replaced while it was simulated" in ran.err
    assert not (tmp_path / "a" / "physics.json").exists()
