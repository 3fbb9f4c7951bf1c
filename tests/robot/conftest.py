"""Small robots in text, right or wrong in one place."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

INERTIA = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"'
LIMIT = '<limit lower="-1" upper="2" effort="5" velocity="3"/>'


def inertial(mass: str | float = 1, inertia: str = INERTIA) -> str:
    return f'<inertial><mass value="{mass}"/><inertia {inertia}/></inertial>'


def link(name: str, inside: str | None = None) -> str:
    return f'<link name="{name}">{inertial() if inside is None else inside}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    xyz: str = "0 0 0",
    axis: str = "0 1 0",
    limit: str = LIMIT,
    more: str = "",
) -> str:
    moves = "" if kind == "fixed" else f'<axis xyz="{axis}"/>{limit}'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{xyz}"/>{moves}{more}</joint>'


def robot(*parts: str, name: str = "toy") -> str:
    return f'<?xml version="1.0"?>\n<robot name="{name}">{"".join(parts)}</robot>'


def leg(name: str, length: float, y: float) -> str:
    """A leg: hip about y, a knee that slides along it, a foot at its end (straight down at zero)."""
    return "".join(
        [
            link(f"{name}_thigh"),
            link(f"{name}_shank"),
            link(f"{name}_foot", ""),
            joint(f"{name}_hip", "body", f"{name}_thigh", xyz=f"0 {y} 0"),
            joint(f"{name}_knee", f"{name}_thigh", f"{name}_shank", kind="prismatic", axis="0 0 -1"),
            joint(f"{name}_sole", f"{name}_shank", f"{name}_foot", kind="fixed", xyz=f"0 0 {-length}"),
        ]
    )


def biped() -> str:
    """Two legs of different length, and an arm-like tool on the body."""
    return robot(link("body"), leg("left", 0.5, 0.2), leg("right", 0.4, -0.2))


BIPED_SRDF = """<robot name="toy">
  <group name="left"><joint name="left_hip"/><joint name="left_knee"/></group>
  <group name="right"><chain base_link="body" tip_link="right_foot"/></group>
  <group name="all"><group name="left"/><group name="right"/></group>
  <group name="feet"><link name="left_foot"/><link name="right_foot"/></group>
  <group name="hands"><link name="left_shank"/></group>
  <end_effector name="l" parent_link="left_foot" group="feet" parent_group="left"/>
  <end_effector name="r" parent_link="right_foot" group="feet" parent_group="right"/>
  <end_effector name="lh" parent_link="left_shank" group="hands" parent_group="left"/>
  <group_state name="stand" group="all"><joint name="left_knee" value="0.1"/></group_state>
  <group_state name="reach" group="all"><joint name="left_knee" value="0.3"/></group_state>
  <group_state name="leg" group="left"><joint name="left_knee" value="0.1"/></group_state>
  <group_state name="arm" group="left"><joint name="left_knee" value="0.3"/></group_state>
  <disable_collisions link1="body" link2="left_thigh" reason="Adjacent"/>
</robot>"""


@pytest.fixture(scope="session")
def make() -> SimpleNamespace:
    """The builders above."""
    return SimpleNamespace(
        inertial=inertial,
        link=link,
        joint=joint,
        robot=robot,
        biped=biped,
        leg=leg,
        srdf=BIPED_SRDF,
        limit=LIMIT,
    )


@pytest.fixture
def write(tmp_path: Path) -> Any:
    """Writes texts as `toy.urdf` and (if given) `toy.srdf` into one folder and returns the URDF's path."""

    def _write(urdf: str, srdf: str | None = None) -> Path:
        path = tmp_path / "toy.urdf"
        path.write_text(urdf, encoding="utf-8")
        if srdf is not None:
            path.with_suffix(".srdf").write_text(srdf, encoding="utf-8")
        return path

    return _write
