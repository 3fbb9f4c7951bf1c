"""Any sound chain loads as it is written; one number spoiled in it is found."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wbplan.errors import ModelError
from wbplan.robot import load_robot, problems

SIZES = st.tuples(*[st.floats(0.01, 2.0)] * 3)
UNIT = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda v: np.linalg.norm(v) > 0.1)


@dataclass(frozen=True)
class Part:
    """A box (mass, edges, turned by a quaternion) and the joint it hangs on."""

    mass: float
    size: tuple[float, float, float]
    turn: tuple[float, float, float, float]
    kind: str
    axis: tuple[float, float, float]
    lower: float
    width: float
    velocity: float
    effort: float


PARTS = st.lists(
    st.builds(
        Part,
        mass=st.floats(1e-3, 1e3),
        size=SIZES,
        turn=UNIT,
        kind=st.sampled_from(["revolute", "prismatic"]),
        axis=st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3),
        lower=st.floats(-7, 7),
        width=st.floats(0, 7),
        velocity=st.floats(1e-3, 1e3),
        effort=st.floats(1e-3, 1e4),
    ),
    min_size=2,
    max_size=4,
)


def inertia_of(part):
    """A solid box's inertia, about its centre, turned."""
    a, b, c = np.square(part.size)
    w, x, y, z = np.array(part.turn) / np.linalg.norm(part.turn)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return rotation @ np.diag([b + c, a + c, a + b]) @ rotation.T * part.mass / 12


def written(parts, spoil=(None, None)):
    """The chain as a URDF; `spoil` is (index of the part, what to spoil in it)."""
    out = []
    for index, part in enumerate(parts):
        what = spoil[1] if index == spoil[0] else None
        inertia = inertia_of(part)
        if what == "negative inertia":
            inertia = -inertia
        if what == "triangle":
            inertia = np.diag([1.0, 1.0, 2.01]) * part.mass
        ixx, ixy, ixz, _, iyy, iyz, _, _, izz = (float(value) for value in inertia.ravel())
        mass = {"negative mass": -part.mass, "no mass": 0.0, "nan mass": "nan"}.get(what, part.mass)
        out.append(
            f'<link name="l{index}"><inertial><mass value="{mass}"/><inertia ixx="{ixx!r}" ixy="{ixy!r}" '
            f'ixz="{ixz!r}" iyy="{iyy!r}" iyz="{iyz!r}" izz="{izz!r}"/></inertial></link>'
        )
        if index == 0:
            continue
        lower, upper = part.lower, part.lower + part.width
        if what == "inverted":
            lower, upper = upper + 0.1, lower
        axis = (0, 0, 0) if what == "axis" else part.axis
        velocity = -part.velocity if what == "velocity" else part.velocity
        effort = "inf" if what == "effort" else part.effort
        parent = f"l{index}" if what == "own parent" else f"l{index - 1}"
        out.append(
            f'<joint name="j{index}" type="{part.kind}"><parent link="{parent}"/><child link="l{index}"/>'
            f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            f'<limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="{effort}"/></joint>'
        )
    return f'<robot name="chain">{"".join(out)}</robot>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("chains")


@given(parts=PARTS)
@settings(max_examples=60, deadline=None)
def test_any_sound_chain_loads_as_written(folder, parts):
    path = folder / "chain.urdf"
    path.write_text(written(parts))
    robot = load_robot(path, feet={"leg": f"l{len(parts) - 1}"})
    assert robot.joint_names == robot.limbs["leg"] == tuple(f"j{i}" for i in range(1, len(parts)))
    assert robot.total_mass == pytest.approx(sum(part.mass for part in parts), rel=1e-9)
    for index, part in enumerate(parts[1:], start=1):
        assert robot.joint_limits(f"j{index}") == pytest.approx((part.lower, part.lower + part.width))
        assert robot.model.inertias[index + 1].mass == pytest.approx(part.mass)
    state = robot.state()
    assert state.pose(robot.feet["leg"]).translation[2] == pytest.approx(0, abs=1e-9)


@given(
    parts=PARTS,
    where=st.integers(0, 3),
    what=st.sampled_from(
        [
            ("negative mass", "l"),
            ("no mass", "l"),
            ("nan mass", "l"),
            ("negative inertia", "l"),
            ("triangle", "l"),
            ("inverted", "j"),
            ("axis", "j"),
            ("velocity", "j"),
            ("effort", "j"),
            ("own parent", "robot"),
        ]
    ),
)
@settings(max_examples=150, deadline=None)
def test_one_number_spoiled_is_found_with_its_element(parts, where, what):
    fault, kind = what
    index = where % len(parts)
    if kind != "l":
        index = max(index, 1)
    found = problems(written(parts, (index, fault)))
    element = {"l": f"link 'l{index}'", "j": f"joint 'j{index}'", "robot": "robot: "}[kind]
    assert found
    assert all(problem.startswith(element) for problem in found)


@pytest.mark.parametrize("kind", ["urdf", "srdf"])
@given(data=st.data())
@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_a_spoiled_file_loads_or_is_refused_but_nothing_else(make, folder, capfd, kind, data):
    texts = {"urdf": make.biped(), "srdf": make.srdf}
    root = ElementTree.fromstring(texts[kind])
    for _ in range(data.draw(st.integers(1, 3))):
        element = data.draw(st.sampled_from(list(root.iter())))
        how = data.draw(st.sampled_from(["set", "delete", "remove", "repeat", "rename"]))
        if how in ("set", "delete") and element.attrib:
            key = data.draw(st.sampled_from(sorted(element.attrib)))
            if how == "delete":
                del element.attrib[key]
            else:
                words = [
                    "",
                    " ",
                    "nan",
                    "-1",
                    "0",
                    "1e400",
                    "1 2",
                    "x",
                    "body",
                    "left",
                    "feet",
                    "left_foot",
                    "left_hip",
                ]
                element.set(key, data.draw(st.sampled_from(words)))
        elif how in ("remove", "repeat") and len(element):
            child = data.draw(st.sampled_from(list(element)))
            if how == "remove":
                element.remove(child)
            else:
                element.append(child)
        elif how == "rename":
            element.tag = data.draw(st.sampled_from(["link", "joint", "group", "limit", "mesh", "other"]))
    texts[kind] = ElementTree.tostring(root, encoding="unicode")
    for suffix, text in texts.items():
        (folder / f"spoiled.{suffix}").write_text(text)
    refused: tuple[str, ...] = ()
    try:
        robot = load_robot(folder / "spoiled.urdf")
    except ModelError as error:
        refused = error.problems or ("",)
    else:
        for pose in robot.pose_names:
            assert np.isfinite(robot.state(pose).q).all()
    # The checks come before Pinocchio's parser and see all that it would stumble over.
    assert all(line and "Pinocchio" not in line for line in refused)
    assert capfd.readouterr() == ("", "")
