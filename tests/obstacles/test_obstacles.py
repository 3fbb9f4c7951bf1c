"""Shapes, what they refuse, their terrain against MuJoCo's rays, and their way through plan.json."""

from __future__ import annotations

import json
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wbplan as wb
from wbplan.obstacles import from_record, to_record

CORNERS = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0.3, 0.3, 0], [0.1, 0.2, 0.25], [0.25, 0.1, 0.2]])
FIELD = wb.HeightField(
    np.linspace(-0.5, 0.5, 6), np.linspace(-0.4, 0.4, 5), np.random.default_rng(3).uniform(0.05, 0.3, (6, 5))
)
SHAPES: dict[str, Any] = {
    "box": wb.Box((0.4, 0.3, 0.2)),
    "sphere": wb.Sphere(0.2),
    "cylinder": wb.Cylinder(0.15, 0.5),
    "mesh": wb.Mesh(CORNERS),
    "height_field": FIELD,
    "ground": wb.Ground((0.1, -0.2, 1.0)),
}


def placed(kind: str) -> wb.Obstacle:
    turn = pin.exp3(np.array([0.0, 0.0, 0.7] if kind == "height_field" else [0.4, -0.3, 0.7]))
    return wb.Obstacle(kind, SHAPES[kind], pin.SE3(turn, np.array([0.1, -0.05, 0.3])))


def in_mujoco(item: wb.Obstacle) -> Any:
    """The same obstacle in MuJoCo."""
    spec, shape = mujoco.MjSpec(), item.shape
    pose = pin.SE3ToXYZQUAT(item.pose)
    place: dict[str, Any] = {"pos": pose[:3], "quat": pose[[6, 3, 4, 5]]}
    T = mujoco.mjtGeom
    if isinstance(shape, wb.Box):
        spec.worldbody.add_geom(type=T.mjGEOM_BOX, size=np.array(shape.size) / 2, **place)
    elif isinstance(shape, wb.Sphere):
        spec.worldbody.add_geom(type=T.mjGEOM_SPHERE, size=[shape.radius, 0, 0], **place)
    elif isinstance(shape, wb.Cylinder):
        spec.worldbody.add_geom(type=T.mjGEOM_CYLINDER, size=[shape.radius, shape.length / 2, 0], **place)
    elif isinstance(shape, wb.Mesh):
        corners, faces = shape.hull
        spec.add_mesh(name="m", uservert=corners.ravel(), userface=faces.ravel())
        spec.worldbody.add_geom(type=T.mjGEOM_MESH, meshname="m", **place)
    elif isinstance(shape, wb.HeightField):
        low, high = shape.heights.min(), shape.heights.max()
        reach = [np.ptp(shape.x) / 2, np.ptp(shape.y) / 2]
        spec.add_hfield(
            name="h", nrow=len(shape.y), ncol=len(shape.x), size=[*reach, high - low, 1.0],
            userdata=((shape.heights.T - low) / (high - low)).ravel(),
        )  # fmt: skip
        place["pos"] = pose[:3] + [0, 0, low]
        spec.worldbody.add_geom(type=T.mjGEOM_HFIELD, hfieldname="h", **place)
    return spec.compile()


@pytest.mark.parametrize("kind", [kind for kind in SHAPES if kind != "ground"])
def test_heights_are_where_rays_from_above_hit(kind: str) -> None:
    item = placed(kind)
    terrain = wb.Terrain([item])
    model = in_mujoco(item)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hits = 0
    for x, y in np.random.default_rng(1).uniform(-0.5, 0.6, (200, 2)):
        geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
        down = np.array([0.0, 0.0, -1.0])
        far = mujoco.mj_ray(model, data, np.array([x, y, 5.0]), down, None, 1, -1, geom, normal)
        if far < 0:
            assert terrain.height(x, y) == -np.inf
            continue
        hits += 1
        assert terrain.height(x, y) == pytest.approx(5.0 - far, abs=1e-5)
        assert terrain.normal(x, y) == pytest.approx(normal, abs=1e-4)
    assert hits > 10


@settings(max_examples=60, deadline=None)
@given(
    normal=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)),
    at=st.tuples(*[st.floats(-2, 2)] * 3),
    xy=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_ground_is_a_plane(
    normal: tuple[float, float], at: tuple[float, ...], xy: tuple[float, float]
) -> None:
    slope = np.array([*normal, 1.0]) / np.linalg.norm([*normal, 1.0])
    terrain = wb.Terrain([wb.Obstacle("slope", wb.Ground((*normal, 1.0)), np.array(at))])
    foot = np.array([*xy, terrain.height(*xy)])
    assert abs(slope @ (foot - np.array(at))) < 1e-9
    assert terrain.normal(*xy) == pytest.approx(slope)


def test_the_highest_surface_counts_and_nothing_is_nothing() -> None:
    ground = wb.Obstacle("ground", wb.Ground())
    step = wb.Obstacle("step", wb.Box((0.2, 0.2, 0.1)), (1.0, 0.0, 0.05))
    terrain = wb.Terrain([ground, step])
    assert terrain.height(1.05, 0.05) == pytest.approx(0.1)
    assert terrain.height(1.2, 0.0) == 0.0
    assert [item and item.name for item in (terrain.under(1.0, 0.0), terrain.under(0.0, 0.0))] == [
        "step",
        "ground",
    ]
    over = terrain.height(np.array([[1.0, 0.0]]), 0.0)
    assert over.shape == (1, 2)
    assert over.tolist() == [[pytest.approx(0.1), 0.0]]
    assert wb.Terrain([step]).height(0.0, 0.0) == -np.inf
    assert wb.Terrain([step]).under(0.0, 0.0) is None
    assert wb.Terrain([]).normal(0.0, 0.0).tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("kind", SHAPES)
def test_through_json_and_back(kind: str) -> None:
    item = placed(kind)
    back = from_record(json.loads(json.dumps(to_record(item))))
    assert back.same_as(item)
    assert back.pose.isApprox(item.pose, 1e-12)
    xy = np.random.default_rng(0).uniform(-0.4, 0.4, (2, 50))
    assert wb.Terrain([back]).height(*xy) == pytest.approx(wb.Terrain([item]).height(*xy), abs=1e-12)


def test_a_mesh_from_a_file_is_its_hull(tmp_path: Any) -> None:
    hull = wb.Mesh(CORNERS * 1000.0)
    lines = [f"v {x} {y} {z}" for x, y, z in hull.vertices]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in hull.faces]
    (tmp_path / "stone.obj").write_text("\n".join(lines))
    mesh = wb.Mesh(file=tmp_path / "stone.obj", scale=0.001)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(CORNERS, axis=0), abs=1e-6)
    assert len(mesh.hull[0]) == len(CORNERS)
    corners, faces = mesh.hull
    a, b, c = (corners[faces[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - corners.mean(axis=0))
    assert (outward > 0).all()


BAD: dict[str, tuple[Any, str]] = {
    "a flat box": (lambda: wb.Box((0.1, 0.0, 0.1)), "Box.size"),
    "two lengths": (lambda: wb.Box((0.1, 0.1)), "Box.size"),  # type: ignore[arg-type]
    "no radius": (lambda: wb.Sphere(float("nan")), "Sphere.radius"),
    "a negative length": (lambda: wb.Cylinder(0.1, -1.0), "Cylinder.length"),
    "no volume": (lambda: wb.Mesh(np.zeros((5, 3))), "no volume"),
    "neither": (lambda: wb.Mesh(), "either vertices or a file"),
    "no such file": (lambda: wb.Mesh(file="nowhere.stl"), "nowhere.stl"),
    "a corner too many": (lambda: wb.Mesh(CORNERS, [[0, 1, 9]]), "corners from 0 to 5"),
    "uneven steps": (lambda: wb.HeightField([0, 1, 3], [0, 1], np.zeros((3, 2))), "HeightField.x"),
    "heights of another shape": (lambda: wb.HeightField([0, 1], [0, 1], np.zeros((3, 2))), "(2, 2)"),
    "no normal": (lambda: wb.Ground((0.0, 0.0, 0.0)), "Ground.normal"),
    "no shape": (lambda: wb.Obstacle("x", "box"), "Obstacle 'x'.shape"),  # type: ignore[arg-type]
    "a pose of two": (lambda: wb.Obstacle("x", wb.Sphere(1.0), (1.0, 2.0)), "Obstacle 'x'.pose"),
    "a tipped field": (
        lambda: wb.Obstacle("x", FIELD, pin.SE3(pin.exp3(np.array([0.1, 0, 0])), np.zeros(3))),
        "only be turned about z",
    ),
    "two of a name": (
        lambda: wb.Obstacles([wb.Obstacle("x", wb.Sphere(1.0)), wb.Obstacle("x", wb.Sphere(1.0))]),  # type: ignore[arg-type]
        "more than once: x",
    ),
    "influence inside distance": (lambda: wb.SelfCollision(0.05, 0.05), "SelfCollision.influence"),
    "a negative distance": (lambda: wb.Obstacles((), -0.1), "Obstacles.distance"),
    "an exception of three": (
        lambda: wb.Obstacles(except_for=[("a", "b", "c")]),  # type: ignore[arg-type, list-item]
        "except_for",
    ),
    "one exception, not a list": (lambda: wb.Obstacles(except_for="tip"), "list of frames"),  # type: ignore[arg-type]
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named(case: str) -> None:
    make, says = BAD[case]
    with pytest.raises(wb.SpecError) as caught:
        make()
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda r: r.pop("size"), "missing size"),
        (lambda r: r.update(kind="cone"), "kind: expected one of"),
        (lambda r: r.update(pose=[0.0] * 7), "length 1"),
        (lambda r: r.update(pose="here"), "length 1"),
        (lambda r: r.update(size=[1.0, None, 1.0]), "Box.size"),
        (lambda r: r.update(friction=0.0), "friction"),
    ],
)
def test_a_spoilt_record_is_named(spoil: Any, says: str) -> None:
    record = to_record(placed("box"))
    spoil(record)
    with pytest.raises(wb.SpecError, match=says):
        from_record(record)
    with pytest.raises(wb.SpecError, match="expected an object"):
        from_record([record])


def test_one_name_one_obstacle_in_a_script() -> None:
    def phase(name: str, radius: float) -> wb.Phase:
        ball = wb.Obstacle("ball", wb.Sphere(radius))
        return wb.Phase(name, limits=(wb.JointLimits(), wb.Obstacles((ball,))))

    assert [item.name for item in wb.Script(phase("a", 0.1), phase("b", 0.1)).obstacles] == ["ball"]
    with pytest.raises(wb.SpecError, match="two different obstacles are named 'ball'"):
        wb.Script(phase("a", 0.1), phase("b", 0.2))


@pytest.mark.parametrize("kind", SHAPES)
def test_how_far_a_point_is_above_what_is_under_it(kind: str) -> None:
    item = placed(kind)
    terrain = wb.Obstacles([item]).terrain
    solid = kind in ("ground", "height_field")
    x, y, _ = item.pose.act(CORNERS.mean(axis=0) if kind == "mesh" else np.zeros(3))
    top = terrain.height(x, y)
    points = np.array([[x, y, top + h] for h in (0.2, 0.0, -0.01, -5.0)])
    expected = [0.2, 0.0, -0.01, -5.0 if solid else np.inf]
    assert terrain.above(points) == pytest.approx(np.array(expected), abs=1e-9)
    if kind != "ground":
        assert terrain.above(np.array([[9.0, 9.0, 0.0]])) == [np.inf]


def test_what_is_overhead_is_no_ground() -> None:
    table = wb.Obstacle("table", wb.Box((1.0, 1.0, 0.05)), (0.0, 0.0, 0.7))
    terrain = wb.Obstacles([wb.Obstacle("floor", wb.Ground()), table]).terrain
    points = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.7], [0.0, 0.0, 0.8], [0.0, 0.0, -0.1]])
    assert terrain.above(points) == pytest.approx([0.3, -0.025, 0.075, -0.1])
