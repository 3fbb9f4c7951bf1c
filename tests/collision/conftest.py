"""A small robot with an arm whose shapes are given: base, upper arm without a shape, forearm with one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import wbplan as wb

CORNERS = np.array(
    [[-0.06, -0.05, -0.1], [0.07, -0.04, -0.1], [0.0, 0.08, -0.09], [0.05, 0.0, 0.11], [-0.05, 0.02, 0.1]]
)

SHAPES = {
    "sphere": '<sphere radius="0.06"/>',
    "box": '<box size="0.1 0.14 0.2"/>',
    "cylinder": '<cylinder radius="0.05" length="0.2"/>',
    "capsule": '<capsule radius="0.05" length="0.12"/>',
    "mesh": '<mesh filename="stone.obj"/>',
}


def urdf(base: str, hand: str) -> str:
    """Base - joint1 (z) - joint2 (y) - joint3 (x) - hand, 0.15 m apart; shapes of base and hand."""
    moments = 'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><mass value="1"/><inertia {moments}/></inertial>'
    limit = '<limit lower="-3" upper="3" effort="50" velocity="4"/>'
    parts = [
        '<robot name="arm">',
        f'<link name="base">{inertial}<collision><geometry>{base}</geometry></collision></link>',
    ]
    before = "base"
    for i, axis in enumerate(("0 0 1", "0 1 0", "1 0 0"), 1):
        link = "hand" if i == 3 else f"link{i}"
        shape = (
            f'<collision><origin xyz="0.12 0 0"/><geometry>{hand}</geometry></collision>' if i == 3 else ""
        )
        parts += [
            f'<link name="{link}">{inertial}{shape}</link>',
            f'<joint name="joint{i}" type="revolute"><parent link="{before}"/><child link="{link}"/>'
            f'<origin xyz="{0.0 if i == 1 else 0.15} 0 0"/><axis xyz="{axis}"/>{limit}</joint>',
        ]
        before = link
    return "\n".join([*parts, "</robot>"])


@pytest.fixture(scope="session")
def make_robot(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], wb.Robot]:
    """The robot with a shape, by its name, for base and for hand."""
    folder: Path = tmp_path_factory.mktemp("robots")
    hull = wb.Mesh(CORNERS)
    lines = [f"v {x} {y} {z}" for x, y, z in hull.vertices]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in hull.hull_faces]
    (folder / "stone.obj").write_text("\n".join(lines))

    def make(base: str, hand: str) -> wb.Robot:
        path = folder / f"{abs(hash((base, hand)))}.urdf"
        path.write_text(urdf(SHAPES.get(base, base), SHAPES.get(hand, hand)))
        return wb.load_robot(path)

    return make
