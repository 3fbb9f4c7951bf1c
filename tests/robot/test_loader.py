"""From a name or a file to a robot."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbplan import catalog
from wbplan.errors import ModelError, SpecError
from wbplan.robot import load_robot


def test_unknown_name_lists_the_known_robots():
    with pytest.raises(SpecError, match=r"no robot 'legarm_hexapot'.*legarm_hexapod"):
        load_robot("legarm_hexapot")
    with pytest.raises(SpecError, match="known robots"):
        load_robot("")


@pytest.mark.parametrize("bad", [None, 3, b"legarm_hexapod"])
def test_neither_name_nor_path(bad):
    with pytest.raises(SpecError):
        load_robot(bad)


def test_a_path_that_does_not_exist_or_is_a_folder(make, write, tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.urdf' does not exist"):
        load_robot(tmp_path / "nowhere.urdf")
    with pytest.raises(ModelError, match=r"nowhere\.urdf' does not exist"):
        load_robot("nowhere.urdf")
    with pytest.raises(SpecError, match="not a path"):
        load_robot("a\0b.urdf")
    write(make.biped())
    with pytest.raises(ModelError, match=r"is a folder.*toy\.urdf"):
        load_robot(tmp_path)


def test_a_path_as_text_and_relative(make, write, monkeypatch):
    path = write(make.biped())
    assert load_robot(str(path)).urdf_path == path
    monkeypatch.chdir(path.parent)
    assert load_robot("toy.urdf").urdf_path == path.resolve()


def test_model_is_the_urdf_with_a_free_flyer(make, write, capfd):
    robot = load_robot(write(make.biped()))
    assert robot.name == robot.model.name == "toy"
    assert robot.urdf_text == make.biped()
    assert (robot.model.nq, robot.model.nv) == (7 + 4, 6 + 4)
    assert robot.joint_names == ("left_hip", "left_knee", "right_hip", "right_knee")
    assert robot.joint_index("right_hip") == (9, 8)
    assert robot.joint_limits("left_hip") == (-1.0, 2.0)
    assert robot.total_mass == pytest.approx(5.0)
    assert capfd.readouterr() == ("", "")


def test_without_srdf_limbs_follow_from_the_tips(make, write):
    path = write(make.biped())
    bare = load_robot(path)
    assert (bare.limbs, bare.feet, bare.hands, bare.poses, bare.roles) == ({}, {}, {}, {}, {})
    robot = load_robot(
        path, feet={"L": "left_foot", "base": "body"}, hands={"L": "right_thigh", "R": "right_foot"}
    )
    assert robot.feet == {"L": "left_foot", "base": "body"}
    assert robot.hands == {"L": "right_thigh", "R": "right_foot"}
    assert robot.limbs == {
        "L": ("left_hip", "left_knee", "right_hip"),
        "base": (),
        "R": ("right_hip", "right_knee"),
    }
    assert robot.srdf_path is None


def test_tips_that_do_not_exist(make, write):
    path = write(make.biped())
    with pytest.raises(SpecError, match=r"feet\['lf'\].*no frame 'left_fot'.*left_foot"):
        load_robot(path, feet={"lf": "left_fot"})
    with pytest.raises(SpecError, match=r"hands\['a'\].*'universe'"):
        load_robot(path, hands={"a": "universe"})
    with pytest.raises(SpecError, match="expected limb -> frame"):
        load_robot(path, feet=["left_foot"])


def test_srdf_beside_is_found_and_tips_given_replace_its_own(make, write):
    path = write(make.biped(), make.srdf)
    robot = load_robot(path)
    assert robot.srdf_path == path.with_suffix(".srdf")
    assert robot.feet == {"left": "left_foot", "right": "right_foot"}
    other = load_robot(path, feet={"right": "right_shank", "new": "left_thigh"})
    assert other.feet == {"right": "right_shank", "new": "left_thigh"}
    assert other.hands == robot.hands
    assert other.limbs == {**robot.limbs, "new": ("left_hip",)}
    with pytest.raises(SpecError, match=r"feet\['right'\].*no joint of that limb moves frame 'left_foot'"):
        load_robot(path, feet={"right": "left_foot"})


def test_srdf_given(make, write, tmp_path):
    path = write(make.biped())
    other = tmp_path / "other.srdf"
    other.write_text(make.srdf)
    assert load_robot(path, srdf=other).feet == {"left": "left_foot", "right": "right_foot"}
    with pytest.raises(ModelError, match=r"SRDF '.*gone\.srdf' does not exist"):
        load_robot(path, srdf=tmp_path / "gone.srdf")


def test_package_dirs_are_checked(make, write, tmp_path):
    path = write(make.biped())
    with pytest.raises(SpecError, match=r"'.*gone' is not a folder"):
        load_robot(path, package_dirs=[tmp_path / "gone"])
    with pytest.raises(SpecError, match="expected a list of folders"):
        load_robot(path, package_dirs=str(tmp_path))


def test_a_robot_cannot_be_changed(make, write):
    feet = {"left": "left_foot"}
    robot = load_robot(write(make.biped(), make.srdf), feet=feet)
    feet["left"] = "body"
    assert robot.feet["left"] == "left_foot"
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.name = "x"
    for mapping in (
        robot.feet,
        robot.hands,
        robot.limbs,
        robot.poses,
        robot.poses["stand"],
        robot.roles["left"]["leg"],
    ):
        with pytest.raises(TypeError):
            mapping["left"] = None


def test_unknown_names_on_a_robot(make, write):
    robot = load_robot(write(make.biped(), make.srdf))
    with pytest.raises(SpecError, match=r"no joint 'left_hp'.*left_hip"):
        robot.joint_index("left_hp")
    with pytest.raises(SpecError, match="no joint 'root_joint'"):
        robot.joint_index("root_joint")
    with pytest.raises(SpecError, match=r"no joint 'left_sole'"):
        robot.joint_index("left_sole")
    with pytest.raises(SpecError, match=r"no frame 'left_fut'.*left_foot"):
        robot.frame_id("left_fut")
    with pytest.raises(SpecError, match=r"no limb 'middle'; limbs: left, right"):
        robot.role_of("middle", robot.state().q)
    with pytest.raises(SpecError, match=r"mesh 'a\.stl' does not exist"):
        robot.mesh_path("a.stl")
    assert robot.model.frames[robot.frame_id("left_sole")].type == pin.FrameType.FIXED_JOINT


def test_summary_names_what_matters(make, write):
    text = load_robot(write(make.biped(), make.srdf)).summary()
    for word in (
        "toy: 5.000 kg",
        "left_hip",
        "foot left_foot",
        "hand left_shank",
        "roles leg, arm",
        "stand",
        "toy.srdf",
    ):
        assert word in text


def test_the_shipped_hexapod_loads_without_a_word(capfd):
    robot = load_robot("legarm_hexapod")
    assert capfd.readouterr() == ("", "")
    assert robot.warnings == ()
    assert robot.urdf_path == catalog.robots()["legarm_hexapod"]
    assert set(robot.limbs) == {"limb1", "limb2", "leg3", "leg4", "leg5", "leg6"}
    assert robot.feet == {limb: f"{limb}_foot" for limb in robot.limbs}
    assert robot.hands == {"limb1": "limb1_tip", "limb2": "limb2_tip"}
    assert {"stand", "manipulate", "folded"} <= set(robot.poses)
    stand = robot.state("stand")
    for foot in robot.feet.values():
        assert abs(stand.pose(foot).translation[2]) < 1e-9
    assert [robot.role_of(limb, stand.q) for limb in ("limb1", "limb2", "leg3")] == ["leg", "leg", None]
    reach = robot.state("manipulate")
    assert [robot.role_of(limb, reach.q) for limb in ("limb1", "limb2")] == ["arm", "arm"]
    assert robot.standing_feet(reach.q) == ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
    for pose in robot.pose_names:
        q = robot.state(pose).q[7:]
        assert np.all(q >= robot.model.lowerPositionLimit[7:])
        assert np.all(q <= robot.model.upperPositionLimit[7:])


def test_catalog_finds_whole_robots_and_public_tasks(tmp_path, monkeypatch):
    for name in ("good", "_private"):
        (tmp_path / "urdf" / name).mkdir(parents=True)
        (tmp_path / "urdf" / name / f"{name}.urdf").write_text("")
    (tmp_path / "urdf" / "empty").mkdir()
    (tmp_path / "urdf" / "shapes.py").write_text("")
    (tmp_path / "tasks").mkdir()
    for name in ("walk.py", "_helper.py", "notes.md"):
        (tmp_path / "tasks" / name).write_text("")
    monkeypatch.setattr(catalog, "data_root", lambda: tmp_path)
    assert catalog.robots() == {"good": tmp_path / "urdf" / "good" / "good.urdf"}
    assert catalog.tasks() == {"walk": tmp_path / "tasks" / "walk.py"}
    monkeypatch.setattr(catalog, "data_root", lambda: tmp_path / "nowhere")
    assert catalog.robots() == catalog.tasks() == {}


def test_catalog_prefers_the_data_of_an_installed_wheel(tmp_path, monkeypatch):
    package = tmp_path / "wbplan"
    package.mkdir()
    monkeypatch.setattr(catalog, "_PACKAGE", package)
    assert catalog.data_root() == tmp_path
    (package / "_data").mkdir()
    assert catalog.data_root() == package / "_data"


def test_the_shipped_paths_exist():
    assert all(path.is_file() for path in catalog.robots().values())
    assert isinstance(catalog.robots()["legarm_hexapod"], Path)


def test_a_state_survives_pickling(make, write):
    state = load_robot(write(make.biped(), make.srdf)).state()
    again = pickle.loads(pickle.dumps(state))
    assert np.array_equal(again.q, state.q)
    assert np.allclose(again.com, state.com)
