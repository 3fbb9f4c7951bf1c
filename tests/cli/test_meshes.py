"""Bundles of robots with meshes: the commands find these where they are told to look."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
SHAPE = "<{kind}><geometry>{shape}</geometry></{kind}>"
STONE = ["v 0 0 0", "v 0.06 0 0", "v 0 0.06 0", "v 0 0 0.06", "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
TURN = '''"""A joint turns. Source: none."""
import wbplan as wb
ROBOT = {robot!r}
def script(robot: wb.Robot) -> wb.Script:
    """It turns."""
    limits = [wb.JointLimits(), wb.SelfCollision(0.005)]
    tasks = {{"hard": [wb.PoseTask("base", wb.AS_IS)], "soft": [wb.PostureTask({{"joint_hand": 0.2}})]}}
    return wb.Script(wb.Phase("turn", limits=limits, duration=0.2, **tasks))
'''


def link(name: str, shape: str = "") -> str:
    collision = SHAPE.format(kind="collision", shape=shape) if shape else ""
    return f'<link name="{name}">{MASS}{collision}</link>'


def joint(parent: str, child: str) -> str:
    limit = '<limit lower="-1" upper="1" effort="9" velocity="2"/>'
    return (
        f'<joint name="joint_{child}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>{limit}</joint>'
    )


@pytest.fixture
def task(tmp_path: Path) -> Path:
    """A task file of a robot with a mesh, which lies in a folder of its own."""
    home = tmp_path / "robot"
    home.mkdir()
    (home / "stone.obj").write_text("\n".join(STONE))
    parts = [
        link("base", '<mesh filename="stone.obj"/>'), link("arm"), link("hand", '<sphere radius="0.05"/>'),
        joint("base", "arm"), joint("arm", "hand"),
    ]  # fmt: skip
    (home / "pair.urdf").write_text(f'<robot name="pair">{"".join(parts)}</robot>')
    path = tmp_path / "turn.py"
    path.write_text(TURN.format(robot=str(home / "pair.urdf")))
    return path


def test_distances_of_meshes_are_checked(wbplan: Callable[..., Any], task: Path) -> None:
    """`run` knows the robot's folder; `check` is told it, and does not pass what it cannot see."""
    out = str(task.parent / "out")
    ran = wbplan("run", str(task), "--out", out)
    assert ran.code == 0, ran.err
    assert "clearance" in ran.out
    assert wbplan("check", out, "--meshes", str(task.parent / "robot")).code == 0
    blind = wbplan("check", out)
    assert blind.code == 1
    assert "stone.obj" in blind.out
