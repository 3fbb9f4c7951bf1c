"""Task files: what is wrong with one is told with its file, its line and what was expected."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb
from wbplan.taskfile import Parameter, find_task, glance, load_task

Refused = Callable[..., str]
HEAD = '"""A task."""\nimport wbplan as wb\nROBOT = "legarm_hexapod"\n'

# A path of the task's own, that raises while it is planned.
RAISES = """
class Raises(wb.Path):
    def at(self, t):
        return 1 / 0 if {when} else robot_place
def script(robot):
    global robot_place
    robot_place = robot.state("stand").pose("body").translation
    feet = [wb.Contact(foot, friction=0.7) for foot in robot.feet.values()]
    return wb.Script(wb.Phase("a", contacts=feet, soft=[wb.PositionTask("body", Raises())], duration=0.1))
"""


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("def script(robot:\n", ["task.py, line 1", "not valid Python"]),
        (HEAD + "x = 1 / 0\n", ["task.py, line 4", "ZeroDivisionError"]),
        (HEAD + "import no_such_module\n", ["task.py, line 4", "no_such_module"]),
        (HEAD + "raise SystemExit(0)\n", ["task.py, line 4", "SystemExit"]),
        ("def script(robot): ...\n", ["task.py", 'ROBOT = "name of a robot"']),
        ("ROBOT = 3\ndef script(robot): ...\n", ["task.py", "ROBOT", "3"]),
        (HEAD + "ROBOTS = 'mana'\ndef script(robot): ...\n", ["task.py: ROBOTS", "any", "'mana'"]),
        (HEAD + "ROBOTS = ('mana', 3)\ndef script(robot): ...\n", ["task.py: ROBOTS", "3"]),
        (HEAD, ["task.py", "def script(robot"]),
        (HEAD + "script = 5\n", ["task.py", "def script(robot"]),
        (HEAD + "def script(): ...\n", ["task.py", "robot as its first argument"]),
        (HEAD + "def script(robot, *, x=1.0): ...\n", ["'x'", "no annotation", "float"]),
        (HEAD + "def script(robot, *, x: float): ...\n", ["'x'", "no default"]),
        (HEAD + "def script(robot, *, x: float = 'far'): ...\n", ["'x'", "'far'", "float"]),
        (HEAD + "def script(robot, *, x: tuple[float, float] = (1.0,)): ...\n", ["'x'", "2 values"]),
        (HEAD + "def script(robot, *, x: dict = {}): ...\n", ["'x'", "dict", "tuple"]),
        (HEAD + "def script(robot, *, x: Nope = 1): ...\n", ["Nope"]),
        (HEAD + "def script(robot, **rest): ...\n", ["'rest'", "keyword parameters"]),
        (HEAD + "def script(robot):\n    return 5\n", ["returned a int", "wbplan.Script"]),
        (HEAD + "def script(robot): ...\n", ["returned nothing", "wbplan.Script"]),
        (HEAD + "def script(robot):\n    return {}['key']\n", ["task.py, line 5", "KeyError"]),
        (HEAD + "def script(robot):\n    return wb.Script()\n", ["task.py, line 5", "one or more phases"]),
        (
            HEAD + "def script(robot):\n    feet = [wb.Contact('no_foot', friction=0.7)]\n"
            "    return wb.Script(wb.Phase('a', contacts=feet))\n",
            ["no_foot"],
        ),
        (
            HEAD + "def script(robot):\n"
            "    return wb.Script(wb.Phase('a', hard=[wb.ComTask((float('nan'), 0.0, 0.3))]))\n",
            ["task.py, line 5", "nan"],
        ),
        (
            HEAD + RAISES.format(when="t > 0.0"),
            ["Raises at 0.01 s raised ZeroDivisionError"],
        ),
        (HEAD + RAISES.format(when="True"), ["Raises at 0 s raised ZeroDivisionError"]),
        (
            HEAD.replace("legarm_hexapod", "no_robot") + "def script(robot): ...\n",
            ["no_robot", "legarm_hexapod"],
        ),
    ],
    ids=lambda value: "" if isinstance(value, list) else None,
)
def test_a_broken_task_file(source: str, expected: list[str], refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "task.py").write_text(source, encoding="utf-8")
    said = refused("run", "task.py")
    for part in expected:
        assert part in said
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_text(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "task.py").write_bytes(b"\xff\xfe\x00")
    assert "task.py" in refused("run", "task.py")


@pytest.mark.parametrize("name", ["no_task", "no_task.py", "folder/no_task"])
def test_a_task_that_does_not_exist(name: str, refused: Refused) -> None:
    said = refused("run", name)
    assert name in said
    assert name != "no_task" or "clamp" in said


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("away=0.1", ["'away'", "did you mean 'sway'", "axis, duration, feet, name, sway"]),
        ("sway", ["KEY=VALUE", "'sway'"]),
        ("=1", ["KEY=VALUE"]),
        ("sway=far", ["'sway'", "float", "'far'"]),
        ("sway=nan", ["'sway'", "not finite"]),
        ("sway=inf", ["'sway'", "not finite"]),
        ("feet=2.5", ["'feet'", "int", "'2.5'"]),
        ("axis=1,2", ["'axis'", "3 values", "2 given"]),
        ("axis=1,2,x", ["'axis'", "3 values"]),
    ],
)
def test_a_wrong_setting(setting: str, expected: list[str], refused: Refused) -> None:
    said = refused("run", "sway.py", "--set", setting)
    for part in expected:
        assert part in said


@pytest.mark.parametrize(
    ("annotation", "text", "value"),
    [
        (float, "0.5", 0.5),
        (float, "-1e-3", -1e-3),
        (int, "7", 7),
        (bool, "true", True),
        (bool, "No", False),
        (str, "a = b", "a = b"),
        (tuple[float, ...], "0,0.5, 0.06", (0.0, 0.5, 0.06)),
        (tuple[float, float], "(1, 2)", (1.0, 2.0)),
        (tuple[int, str], "1, a", (1, "a")),
        (float | None, "none", None),
        (float | None, "2", 2.0),
    ],
)
def test_a_setting_becomes_what_its_annotation_says(annotation: object, text: str, value: object) -> None:
    got = Parameter("p", annotation, value).convert(text)
    assert got == value
    assert type(got) is type(value)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_floats_survive_the_command_line(values: list[float]) -> None:
    assert Parameter("p", tuple[float, ...], ()).convert(",".join(map(repr, values))) == tuple(values)


@given(st.sampled_from([float, int, bool, tuple[float, float], float | None]), st.text())
def test_any_text_is_converted_or_refused(annotation: object, text: str) -> None:
    with contextlib.suppress(wb.SpecError):
        Parameter("p", annotation, None).convert(text)


def test_what_a_task_file_says(tmp_path: Path) -> None:
    path = tmp_path / "reach.py"
    path.write_text(
        HEAD.replace('"""A task."""\n', '"""Reach out.\n\nMore.\n"""\nfrom __future__ import annotations\n')
        + "def script(robot, *, far: float = 1, up: tuple[float, ...] = (0.0, 1.0)) -> wb.Script: ...\n",
        encoding="utf-8",
    )
    task = load_task(path)
    assert (task.name, task.robot, task.summary) == ("reach", "legarm_hexapod", "Reach out")
    assert [str(p) for p in task.parameters] == ["far=1 (float)", "up=0.0,1.0 (floats separated by commas)"]
    assert task.values(["far=2", "far=3"]) == {"far": 3.0, "up": (0.0, 1.0)}
    assert glance(path) == ("legarm_hexapod", "Reach out")
    assert find_task(path) == path
