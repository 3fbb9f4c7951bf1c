"""Tasks as specifications: what they refuse, what they copy, and that they stay as they were made."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb

POSE, POINT, TURN = pin.SE3.Identity(), np.zeros(3), np.eye(3)

#: Kind -> how it is made, and the label in its messages.
TASKS: dict[str, tuple[Callable[..., wb.Task], str]] = {
    "pose": (lambda **k: wb.PoseTask("tip", **k), "pose(tip)"),
    "relative": (lambda **k: wb.RelativePoseTask("tip", root="palm", **k), "relative(tip in palm)"),
    "position": (lambda **k: wb.PositionTask("tip", **k), "position(tip)"),
    "orientation": (lambda **k: wb.OrientationTask("tip", **k), "orientation(tip)"),
    "com": (lambda **k: wb.ComTask(**k), "com"),
    "posture": (lambda **k: wb.PostureTask(**k), "posture"),
    "damping": (lambda **k: wb.DampingTask(**k), "damping"),
}
THREE = ("position", "orientation", "com")
SIX = ("pose", "relative")
FRAME = (*SIX, "position", "orientation")

BAD_WEIGHTS = {
    "negative": -1.0,
    "nan": np.nan,
    "infinite": np.inf,
    "text": "heavy",
    "number as text": "1.0",
    "none": None,
    "two by two": [[1.0, 1.0], [1.0, 1.0]],
    "empty": [],
    "ragged": [[1.0], [1.0, 2.0], 3.0],
    "four": [1.0, 1.0, 1.0, 1.0],
}


@pytest.mark.parametrize("kind", TASKS)
@pytest.mark.parametrize("weight", BAD_WEIGHTS.values(), ids=BAD_WEIGHTS)
def test_a_weight_is_finite_and_not_negative(kind: str, weight: Any) -> None:
    make, label = TASKS[kind]
    with pytest.raises(wb.SpecError) as caught:
        make(weight=weight)
    assert str(caught.value).startswith(f"{label}.weight")
    assert "expected" in str(caught.value)


@pytest.mark.parametrize("kind", THREE)
@pytest.mark.parametrize(
    "weight", [(1.0, np.nan, 1.0), (1.0, -2.0, 1.0), (1.0, 1.0), (1.0,), np.ones(6)], ids=str
)
def test_a_vector_of_weights_has_three_good_numbers(kind: str, weight: Any) -> None:
    make, label = TASKS[kind]
    with pytest.raises(wb.SpecError) as caught:
        make(weight=weight)
    assert str(caught.value).startswith(f"{label}.weight: expected")


@pytest.mark.parametrize("kind", SIX)
@pytest.mark.parametrize(
    "weight",
    [(1.0, np.nan), (-1.0, 1.0), (1.0, (1.0, 1.0)), ((1.0, 1.0, np.inf), 0.0), np.ones(5), (1.0,), "ab"],
    ids=str,
)
def test_a_pose_weight_has_two_good_halves(kind: str, weight: Any) -> None:
    make, label = TASKS[kind]
    with pytest.raises(wb.SpecError) as caught:
        make(weight=weight)
    assert str(caught.value).startswith(f"{label}.weight")


positive = st.floats(0.0, 100.0)
triples = st.lists(positive, min_size=3, max_size=3)


@given(st.one_of(positive, triples, triples.map(np.array)), st.one_of(positive, triples))
def test_weights_are_read_as_they_are_written(position: Any, rotation: Any) -> None:
    task = wb.PoseTask("tip", weight=(position, rotation))
    np.testing.assert_array_equal(task.position_weight, np.broadcast_to(position, 3))
    np.testing.assert_array_equal(task.rotation_weight, np.broadcast_to(rotation, 3))
    assert not wb.PositionTask("tip", weight=position).rotation_weight.any()
    np.testing.assert_array_equal(
        wb.PositionTask("tip", weight=position).position_weight, task.position_weight
    )
    assert not wb.OrientationTask("tip", weight=rotation).position_weight.any()
    np.testing.assert_array_equal(
        wb.OrientationTask("tip", weight=rotation).rotation_weight, task.rotation_weight
    )
    np.testing.assert_array_equal(wb.ComTask(weight=position).position_weight, task.position_weight)


def test_one_number_or_six_weigh_a_whole_pose() -> None:
    task = wb.RelativePoseTask("tip", root="palm", weight=3.0)
    np.testing.assert_array_equal([task.position_weight, task.rotation_weight], np.full((2, 3), 3.0))
    task = wb.RelativePoseTask("tip", root="palm", weight=[1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal([task.position_weight, task.rotation_weight], [[1, 2, 3], [4, 5, 6]])
    task = wb.PoseTask("tip", weight=np.array([7.0, 8.0]))
    np.testing.assert_array_equal([task.position_weight, task.rotation_weight], [[7] * 3, [8] * 3])


@pytest.mark.parametrize("kind", [kind for kind in TASKS if kind != "damping"])
@pytest.mark.parametrize("gain", [0.0, -1.0, np.nan, np.inf, "20", None, [20.0]], ids=str)
def test_a_gain_is_a_finite_positive_rate(kind: str, gain: Any) -> None:
    make, label = TASKS[kind]
    with pytest.raises(wb.SpecError) as caught:
        make(gain=gain)
    assert str(caught.value).startswith(f"{label}.gain: expected a finite positive rate [1/s], got")


@pytest.mark.parametrize("kind", TASKS)
@pytest.mark.parametrize("name", ["", 7, ["a"]], ids=str)
def test_a_name_is_text(kind: str, name: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"Task\.name: expected a name"):
        TASKS[kind][0](name=name)


@pytest.mark.parametrize("kind", TASKS)
def test_a_label_is_the_name_or_made_of_kind_and_frame(kind: str) -> None:
    make, label = TASKS[kind]
    assert make().label == label
    assert make(name="mine").label == "mine"


@pytest.mark.parametrize("frame", ["", None, 3], ids=str)
def test_a_frame_is_named(frame: Any) -> None:
    for kind in (wb.PoseTask, wb.PositionTask, wb.OrientationTask):
        with pytest.raises(wb.SpecError, match=rf"{kind.__name__}\.frame: expected a name"):
            kind(frame)
    with pytest.raises(wb.SpecError, match=r"RelativePoseTask\.frame: expected a name"):
        wb.RelativePoseTask(frame, root="palm")
    with pytest.raises(wb.SpecError, match=r"RelativePoseTask\.root: expected a name"):
        wb.RelativePoseTask("tip", root=frame)


def test_a_frame_is_not_relative_to_itself() -> None:
    with pytest.raises(wb.SpecError, match="frame and root are the same, 'tip'"):
        wb.RelativePoseTask("tip", root="tip")


TARGETS = {
    "pose": POSE,
    "point": POINT,
    "rotation": TURN,
    "number": 0.3,
    "plane": np.zeros(2),
    "matrix": np.zeros((4, 4)),
}
TAKES = {
    "pose": {"pose"},
    "relative": {"pose"},
    "position": {"pose", "point"},
    "orientation": {"pose", "rotation"},
    "com": {"point"},
}


@pytest.mark.parametrize("kind", TAKES)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("by", ["itself", "min jerk", "from as-is", "waypoints", "live"])
def test_a_target_is_of_a_kind_that_the_task_takes(kind: str, target: str, by: str) -> None:
    value = TARGETS[target]
    given = {
        "itself": lambda: value,
        "min jerk": lambda: wb.MinJerk(value, value, 1.0),
        "from as-is": lambda: wb.MinJerk(wb.AS_IS, value, 1.0),
        "waypoints": lambda: wb.Waypoints((0.0, 1.0), (wb.AS_IS, value)),
        "live": lambda: wb.Live(value),
    }[by]()
    make, label = TASKS[kind]
    if target in TAKES[kind]:
        assert isinstance(make(target=given).path, wb.Path)
        return
    with pytest.raises(wb.SpecError) as caught:
        make(target=given)
    assert str(caught.value).startswith(f"{label}.target: expected ")
    assert ", got " in str(caught.value)


@pytest.mark.parametrize("kind", TAKES)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_target_is_finite(kind: str, bad: float) -> None:
    make, label = TASKS[kind]
    pose = pin.SE3.Identity()
    pose.translation = np.array([0.0, bad, 0.0])
    for target in (pose, np.array([0.0, bad, 0.0]), "there", None):
        with pytest.raises(wb.SpecError) as caught:
            make(target=target)
        assert str(caught.value).startswith(f"{label}.target: ")


def test_an_orientation_is_a_rotation_matrix() -> None:
    for matrix in (np.zeros((3, 3)), 1.001 * np.eye(3), np.diag([1.0, -1.0, 1.0])):
        with pytest.raises(wb.SpecError, match=r"orientation\(tip\)\.target: not a rotation matrix"):
            wb.OrientationTask("tip", matrix)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"target": {"knee": np.nan}}, r"posture\.target\['knee'\]: NaN"),
        ({"target": {"knee": [0.1, 0.2]}}, r"posture\.target\['knee'\]: expected a number"),
        ({"target": {"knee": POSE}}, r"posture\.target\['knee'\]: expected a number, got pin\.SE3"),
        (
            {"target": {"knee": wb.MinJerk(wb.AS_IS, POINT, 1.0)}},
            r"posture\.target\['knee'\]: expected a num",
        ),
        ({"target": {"knee": "bent"}}, r"posture\.target\['knee'\]"),
        ({"target": {7: 0.1}}, r"posture\.target: joint: expected a name, got 7"),
        ({"target": {}}, r"posture\.target: expected one joint or more"),
        ({"target": [0.1, 0.2]}, r"posture\.target: expected joint values by name, a State or AS_IS"),
        ({"weight": {"knee": -1.0}}, r"posture\.weight\['knee'\]: expected a finite number of 0 or more"),
        ({"weight": {"knee": np.nan}}, r"posture\.weight\['knee'\]"),
        ({"weight": {}}, r"posture\.weight: expected one joint or more"),
        ({"joints": "knee"}, r"posture\.joints: expected a list"),
        ({"joints": ()}, r"posture\.joints: expected a list of one joint or more"),
        ({"joints": 5}, r"posture\.joints: expected a list"),
        ({"joints": ["knee", 5]}, r"posture\.joints: expected a name, got 5"),
        ({"target": {"knee": 0.1}, "joints": ["hip"]}, r"posture\.target: knee not among its joints: hip"),
    ],
)
def test_a_posture_is_joint_values_by_name(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        wb.PostureTask(**fields)


@pytest.mark.parametrize("kind", TASKS)
def test_a_task_cannot_be_assigned_to(kind: str) -> None:
    task = TASKS[kind][0]()
    for field in ("weight", "name", "gain", "target"):
        if hasattr(task, field):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(task, field, getattr(task, field))
    with pytest.raises(dataclasses.FrozenInstanceError):
        del task.name


@pytest.mark.parametrize("kind", [*SIX, *THREE])
def test_a_task_keeps_copies_of_arrays(kind: str) -> None:
    weight = np.arange(1.0, 7.0 if kind in SIX else 4.0)
    target: Any = {"position": np.zeros(3), "com": np.zeros(3), "orientation": np.eye(3)}.get(kind)
    target = pin.SE3.Identity() if target is None else target
    task: Any = TASKS[kind][0](target=target, weight=weight)
    kept = np.array(task.path.at(0.0) if kind not in SIX else task.path.at(0.0).homogeneous)
    weight[:] = np.nan
    if kind in SIX:
        target.translation = np.ones(3)
        halves = [task.position_weight, task.rotation_weight]
        np.testing.assert_array_equal(np.concatenate(halves), np.arange(1.0, 7.0))
        np.testing.assert_array_equal(task.path.at(0.0).homogeneous, kept)
    else:
        target[:] = np.nan
        mine = task.rotation_weight if kind == "orientation" else task.position_weight
        np.testing.assert_array_equal(mine, [1.0, 2.0, 3.0])
        np.testing.assert_array_equal(task.path.at(0.0), kept)


def test_a_pair_of_lists_as_weight_is_copied() -> None:
    position, rotation = [1.0, 2.0, 3.0], np.array([4.0, 5.0, 6.0])
    task = wb.PoseTask("tip", weight=[position, rotation])
    position[0] = rotation[0] = np.nan
    np.testing.assert_array_equal(task.position_weight, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(task.rotation_weight, [4.0, 5.0, 6.0])
    with pytest.raises(ValueError, match="read-only"):
        task.position_weight[0] = 5.0


def test_a_posture_keeps_copies_of_its_mappings() -> None:
    target, weight, joints = {"knee": 0.5}, {"knee": 2.0}, ["knee"]
    task = wb.PostureTask(target, weight=weight, joints=joints)
    target["knee"] = target["hip"] = np.nan
    weight["knee"] = np.nan
    joints.append("hip")
    assert task.weight == {"knee": 2.0}
    assert task.joints == ("knee",)
    assert list(task.target) == ["knee"]
    assert float(task.target["knee"].at(0.0)) == 0.5
    with pytest.raises(TypeError):
        task.target["knee"] = 1.0
    with pytest.raises(TypeError):
        task.weight["knee"] = 1.0
