from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import umsgpack
from hypothesis import given, settings
from hypothesis import strategies as st

from wbplan.errors import ModelError, ViewError
from wbplan.problem.bodies import Body
from wbplan.view import Scene
from wbplan.view.robot_meshes import robot_meshes

SQUARE = [[0.15, 0.1], [-0.15, 0.1], [-0.15, -0.1], [0.15, -0.1]]
UNTURNED = [0.0, 0.0, 0.0, 1.0]


class Listener:
    """A window that remembers what it was told."""

    def __init__(self):
        self.heard: list[dict] = []

    def send(self, command):
        self.heard.append(umsgpack.unpackb(umsgpack.packb(command.lower())))

    def since(self, start: int) -> list[tuple[str, str]]:
        return [(m["type"], m["path"]) for m in self.heard[start:]]

    def poses(self) -> dict[str, np.ndarray]:
        moved = [m for m in self.heard if m["type"] == "set_transform"]
        return {m["path"]: np.array(m["matrix"]).reshape(4, 4).T for m in moved}

    def shown(self) -> dict[str, bool]:
        told = [m for m in self.heard if m["type"] == "set_property" and m["property"] == "visible"]
        return {m["path"]: m["value"] for m in told}

    def drawn(self) -> set[str]:
        return {m["path"] for m in self.heard if m["type"] == "set_object"}


@pytest.fixture
def window() -> Listener:
    return Listener()


def test_every_link_stands_where_pinocchio_says(window, stool, stool_model, q_stand):
    rng = np.random.default_rng(3)
    q = pin.integrate(stool_model, q_stand, rng.normal(scale=0.5, size=stool_model.nv))
    Scene(window, stool).update(q)
    data = stool_model.createData()
    pin.framesForwardKinematics(stool_model, data, q)
    for link in ("base", "leg_a", "leg_d"):
        expected = data.oMf[stool_model.getFrameId(link)].homogeneous
        np.testing.assert_allclose(window.poses()[f"/wbplan/robot/{link}"], expected, atol=1e-12)


def test_sends_only_what_moved(window, stool, stool_model, q_stand):
    scene = Scene(window, stool, bodies={"box": (0.1, 0.1, 0.1)}, trails=["foot_a"])
    told = {
        "contacts": [("foot_a", [0.15, 0.1, 0.0])],
        "polygon": SQUARE,
        "inset": np.multiply(SQUARE, 0.8),
        "com": [0.0, 0.0, 0.2],
        "margin": 0.08,
        "bodies": {"box": [0.5, 0.0, 0.05, *UNTURNED]},
        "targets": {"hand": [0.5, 0.0, 0.1, *UNTURNED]},
        "label": "standing",
    }
    scene.update(q_stand, **told)
    before = len(window.heard)
    scene.update(q_stand, **told)
    assert window.since(before) == []
    q_stand[stool_model.joints[stool_model.getJointId("hip_b")].idx_q] = 0.1
    scene.update(q_stand, **told)
    assert window.since(before) == [("set_transform", "/wbplan/robot/leg_b")]


def test_a_foot_is_marked_as_touching_then_as_lifted_and_followed(window, stool, q_stand):
    scene = Scene(window, stool)
    scene.update(q_stand, contacts=[("foot_a", [0.15, 0.1, 0.0])])
    assert window.shown()["/wbplan/contacts/foot_a/off"] is False
    q_stand[2] += 0.3
    scene.update(q_stand)
    assert window.shown()["/wbplan/contacts/foot_a/on"] is False
    assert window.shown()["/wbplan/contacts/foot_a/off"] is True
    np.testing.assert_allclose(window.poses()["/wbplan/contacts/foot_a"][:3, 3], [0.15, 0.1, 0.3], atol=0.003)


@pytest.mark.parametrize(
    ("margin", "required", "seen"),
    [
        (0.05, 0.02, "clear"),
        (0.022, 0.02, "near"),
        (0.02, 0.02, "near"),
        (0.01, 0.02, "broken"),
        (-0.1, 0.0, "broken"),
    ],
)
def test_the_com_is_coloured_by_its_margin(window, stool, q_stand, margin, required, seen):
    Scene(window, stool).update(q_stand, com=[0.0, 0.0, 0.2], margin=margin, required=required)
    shown = window.shown()
    for place in ("com", "com_ground"):
        grades = [g for g in ("clear", "near", "broken") if shown.get(f"/wbplan/{place}/{g}", True)]
        assert grades == [seen]


def test_what_is_not_given_is_hidden_but_bodies_stay(window, stool, q_stand):
    scene = Scene(window, stool, bodies=[Body("box", mass=1.0)])
    box, hand = [0.5, 0.0, 0.05, *UNTURNED], [0.5, 0.0, 0.1, *UNTURNED]
    scene.update(q_stand, polygon=SQUARE, com=[0, 0, 0.2], bodies={"box": box}, targets={"hand": hand})
    scene.update(q_stand)
    shown = window.shown()
    assert shown["/wbplan/bodies/box"] is True
    for path in ("support/live", "com", "com_ground", "targets/hand"):
        assert shown[f"/wbplan/{path}"] is False


def test_a_target_that_is_not_a_number_is_hidden(window, stool, q_stand):
    scene = Scene(window, stool)
    scene.update(q_stand, targets={"hand": [0.5, 0.0, 0.1, *UNTURNED]})
    scene.update(q_stand, targets={"hand": [np.nan] * 7})
    assert window.shown()["/wbplan/targets/hand"] is False


def test_the_camera_is_aimed_once_from_the_side_of_the_bodies(window, stool, q_stand):
    scene = Scene(window, stool, bodies={"box": (0.1, 0.1, 0.1)})
    for y in (-0.6, 0.6):
        scene.update(q_stand, bodies={"box": [0.0, y, 0.05, *UNTURNED]})
    eyes = [m["value"] for m in window.heard if m.get("property") == "eye"]
    assert len(eyes) == 1
    assert eyes[0][1] < -0.3
    assert eyes[0][2] > 0.1


def test_a_trail_follows_its_frame(window, stool, q_stand):
    scene = Scene(window, stool, trails=["foot_a"])
    for x in np.linspace(0.0, 0.1, 11):
        q_stand[0] = x
        scene.update(q_stand)
    lines = [m for m in window.heard if m["type"] == "set_object" and m["path"] == "/wbplan/trails/foot_a"]
    position = lines[-1]["object"]["geometries"][0]["data"]["attributes"]["position"]["array"]
    points = np.frombuffer(position.data, dtype=np.float32).reshape(-1, 3)
    np.testing.assert_allclose(points[[0, -1], 0], [0.15, 0.25], atol=1e-6)


def test_only_solid_things_throw_shadows(window, stool, q_stand):
    scene = Scene(window, stool, bodies={"box": (0.1, 0.1, 0.1)})
    scene.update(q_stand, contacts=[("foot_a", [0.15, 0.1, 0.0])], polygon=SQUARE, com=[0, 0, 0.2])
    shadowless = {m["path"] for m in window.heard if m.get("property") == "castShadow" and not m["value"]}
    solid = {path for path in window.drawn() if f"{path}/<object>" not in shadowless}
    assert solid
    assert all(path.startswith(("/wbplan/robot/", "/wbplan/bodies/box/sides")) for path in solid)


def _asks_for_an_unknown_frame(scene, q):
    scene.update(q, contacts=[("foot_z", [0, 0, 0])])


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda scene, q: scene.update(q[:-1]), "q has to be 11 finite numbers, found shape"),
        (lambda scene, q: scene.update(q * np.nan), "not finite"),
        (_asks_for_an_unknown_frame, "no frame 'foot_z'"),
        (lambda scene, q: scene.update(q, bodies={"box": [1, 2, 3]}), "x y z qx qy qz qw"),
        (lambda scene, q: scene.update(q, bodies={"box": [0.0] * 7}), "x y z qx qy qz qw"),
    ],
)
def test_bad_input_is_named(window, stool, q_stand, ask, message):
    with pytest.raises(ViewError, match=message):
        ask(Scene(window, stool, bodies={"box": (1, 1, 1)}), q_stand)


@pytest.mark.parametrize("size", [(1, 1), (1, 1, 0), (1, np.nan, 1)])
def test_a_body_needs_a_size(window, stool, size):
    with pytest.raises(ViewError, match="body 'box': size"):
        Scene(window, stool, bodies={"box": size})


def test_a_trail_needs_a_frame(window, stool):
    with pytest.raises(ViewError, match="no frame 'nose'"):
        Scene(window, stool, trails=["nose"])


@pytest.mark.parametrize("text", ["", "<robot", "<robot name='x'></robot>", "not xml"])
def test_a_broken_urdf_is_one_error(window, text):
    with pytest.raises(ModelError, match="URDF cannot be read"):
        Scene(window, text)


# Meshes.


def shaped(visual: str = "", collision: str = "", extra: str = "") -> str:
    return f'<robot name="r">{extra}<link name="base">{visual}{collision}</link></robot>'


MESH = '<visual><geometry><mesh filename="{}"{}/></geometry></visual>'


def volume(mesh) -> float:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


@pytest.fixture
def wedge(tmp_path):
    """A mesh that is not its own mirror image, with outward faces."""
    mesh = trimesh.creation.box(extents=(0.2, 0.1, 0.1))
    mesh.vertices[mesh.vertices[:, 1] > 0] *= (0.5, 3.0, 1.0)
    (tmp_path / "robot" / "meshes").mkdir(parents=True)
    mesh.export(tmp_path / "robot" / "meshes" / "wedge.stl")
    return tmp_path, mesh


def test_shapes_and_colours_of_a_urdf(stool):
    meshes = {mesh.link: mesh for mesh in robot_meshes(stool)}
    assert sorted(meshes) == ["base", "leg_a", "leg_b", "leg_c", "leg_d"]
    np.testing.assert_allclose(
        meshes["leg_a"].colours, np.tile([0.2, 0.4, 0.8], (len(meshes["leg_a"].vertices), 1))
    )
    np.testing.assert_allclose(meshes["leg_a"].vertices[:, 2].min(), -0.2, atol=1e-9)
    assert (meshes["base"].colours[0] == [0.9, 0.3, 0.1]).all()
    assert meshes["base"].vertices[:, 2].max() == pytest.approx(0.08, abs=1e-3)


def test_a_colour_defined_at_its_first_use_counts_later_too():
    paint = '<material name="p"><color rgba="0 1 0 0.5"/></material>'
    box = '<visual><geometry><box size="1 1 1"/></geometry>{}</visual>'
    text = shaped(box.format(paint) + box.format('<material name="p"/>'))
    (mesh,) = robot_meshes(text)
    assert mesh.opacity == 0.5
    assert (mesh.colours == [0.0, 1.0, 0.0]).all()


def test_collision_shapes_are_drawn_only_where_nothing_else_is():
    collision = '<collision><geometry><box size="2 2 2"/></geometry></collision>'
    visual = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    assert volume(robot_meshes(shaped("", collision))[0]) == pytest.approx(8.0)
    (mesh,) = robot_meshes(shaped(visual, collision))
    assert volume(mesh) == pytest.approx(1.0)


def test_a_robot_without_shapes_is_nothing_and_no_error(window):
    world = (
        '<link name="world"/><joint name="j" type="fixed"><parent link="world"/><child link="base"/></joint>'
    )
    text = shaped(extra=world)
    assert robot_meshes(text) == []
    Scene(window, text).update([0, 0, 0, 0, 0, 0, 1])


@pytest.mark.parametrize("name", ["package://robot/meshes/wedge.stl", "robot/meshes/wedge.stl"])
def test_meshes_are_found_in_the_package_folders(wedge, name):
    folder, mesh = wedge
    (drawn,) = robot_meshes(shaped(MESH.format(name, "")), package_dirs=[folder])
    assert volume(drawn) == pytest.approx(mesh.volume, rel=1e-5)


@settings(max_examples=20, deadline=None)
@given(signs=st.tuples(*[st.sampled_from([-1, 1])] * 3), size=st.floats(0.1, 10.0))
def test_a_scaled_or_mirrored_mesh_keeps_its_outside_out(tmp_path_factory, signs, size):
    folder = tmp_path_factory.mktemp("mesh")
    mesh = trimesh.creation.box(
        extents=(0.2, 0.1, 0.1), transform=trimesh.transformations.translation_matrix([1, 2, 3])
    )
    mesh.export(folder / "m.stl")
    scale = np.multiply(signs, size)
    text = shaped(MESH.format("m.stl", f' scale="{scale[0]} {scale[1]} {scale[2]}"'))
    (drawn,) = robot_meshes(text, urdf_dir=folder)
    np.testing.assert_allclose(drawn.vertices.mean(axis=0), scale * [1, 2, 3], rtol=1e-5)
    assert volume(drawn) == pytest.approx(mesh.volume * size**3, rel=1e-4)


def test_a_missing_mesh_is_named_with_the_remedy(window):
    with pytest.raises(ViewError, match=r"link 'base'.*gone\.stl.*not found.*package_dirs"):
        robot_meshes(shaped(MESH.format("package://robot/gone.stl", "")))


def test_a_mesh_that_is_none_is_named(tmp_path):
    (tmp_path / "bad.stl").write_text("this is no mesh")
    with pytest.raises(ViewError, match=r"link 'base': mesh .*bad\.stl cannot be read"):
        robot_meshes(shaped(MESH.format("bad.stl", "")), urdf_dir=tmp_path)


def test_sharp_edges_are_parted_and_round_ones_are_not():
    text = shaped('<visual><geometry><box size="1 1 1"/></geometry></visual>')
    assert len(robot_meshes(text)[0].vertices) == 24
    text = shaped('<visual><geometry><sphere radius="1"/></geometry></visual>')
    assert len(robot_meshes(text)[0].vertices) == len(trimesh.creation.icosphere(subdivisions=3).vertices)
