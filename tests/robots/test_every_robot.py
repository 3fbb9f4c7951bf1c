"""What holds of every robot that ships: its files, names, inertias, poses and collision pairs."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin

import wbplan as wb


def test_committed_files_are_what_the_generator_writes(machine, run_script):
    files = run_script(f"{machine.name}/generate.py").generate()
    assert set(files) == {machine.urdf.name, machine.urdf.with_suffix(".srdf").name}
    for name, text in files.items():
        assert (machine.folder / name).read_text(encoding="utf-8") == text, f"{name}: run generate.py again"


def test_it_loads_by_its_name_without_a_problem_or_a_warning(machine):
    robot = wb.load_robot(machine.name)
    assert robot.name == machine.name
    assert robot.warnings == ()
    assert (machine.folder / "README.md").is_file()


# --- names


def test_every_frame_has_a_name_of_its_own(machine):
    names = Counter(frame.name for frame in machine.model.frames)
    assert [name for name, count in names.items() if count > 1] == []


def test_materials_are_defined_once_and_all_of_them_are_used(machine):
    defined = [m.attrib["name"] for m in machine.links.findall("material")]
    used = {m.attrib["name"] for m in machine.links.findall("link/visual/material")}
    assert len(defined) == len(set(defined))
    assert set(defined) == used


def test_every_joint_belongs_to_one_limb_and_every_limb_ends_somewhere(machine):
    robot = wb.load_robot(machine.name)
    joints = [joint for limb in robot.limbs.values() for joint in limb]
    assert sorted(joints) == sorted(machine.model.names[2:])
    assert set(robot.limbs) == set(robot.feet) | set(robot.hands)


# --- bodies


def test_every_link_with_mass_can_be_seen_and_hit(machine):
    for link in machine.links.iter("link"):
        shown = (link.find("visual") is not None, link.find("collision") is not None)
        massive = link.find("inertial") is not None
        assert shown == (massive, massive), link.attrib["name"]


def test_inertias_are_those_of_real_bodies(machine):
    for name, inertia in zip(machine.model.names[1:], machine.model.inertias[1:], strict=True):
        i1, i2, i3 = np.linalg.eigvalsh(inertia.inertia)
        assert inertia.mass > 0, name
        assert i1 > 0, name
        assert i1 + i2 > i3 * (1 + 1e-6), name
        # No link is much longer than half a metre, and none is a point.
        assert 0.002 < np.sqrt(i3 / inertia.mass) < 0.3, name


# --- poses


def test_poses_name_every_joint_and_keep_the_limits(machine):
    low, high = machine.model.lowerPositionLimit[7:], machine.model.upperPositionLimit[7:]
    for name, pose in machine.states("all").items():
        assert sorted(pose) == sorted(machine.model.names[2:]), name
        q = machine.q(name)[7:]
        assert np.all((q >= low) & (q <= high)), name


def test_in_every_pose_the_standing_feet_are_on_the_ground(machine):
    robot = wb.load_robot(machine.name)
    assert "stand" in robot.poses
    for name in robot.poses:
        state = robot.state(name)
        heights = [state.pose(foot).translation[2] for foot in robot.standing_feet(state.q)]
        assert len(heights) >= 3
        np.testing.assert_allclose(heights, 0.0, atol=1e-9, err_msg=name)


# --- collisions


def test_disabled_pairs_are_links_and_listed_once(machine):
    links = {link.attrib["name"] for link in machine.links.iter("link")}
    pairs = machine.disabled()
    assert all(len(pair) == 2 and pair <= links for pair in pairs)
    assert [pair for pair, count in Counter(pairs).items() if count > 1] == []


def test_poses_touch_nothing(machine):
    for name in machine.states("all"):
        assert machine.hits(machine.checked, machine.q(name)) == set(), name


def test_pairs_called_never_stay_apart(machine):
    never = machine.solids_with(set(machine.disabled("Never")), keep=True)
    data, found = machine.model.createData(), never.createData()
    low, high = machine.model.lowerPositionLimit[7:], machine.model.upperPositionLimit[7:]
    rng = np.random.default_rng(0)
    q = machine.q({})
    for _ in range(400):
        share = rng.random(len(low))
        at_end = rng.random(len(low)) < 0.4  # limbs meet in the far corners of their ranges
        q[7:] = low + np.where(at_end, np.round(share), share) * (high - low)
        pin.updateGeometryPlacements(machine.model, data, never, found, q)
        pin.computeDistances(never, found)
        closest = int(np.argmin([result.min_distance for result in found.distanceResults]))
        pair = never.collisionPairs[closest]
        names = [machine.link_of(never.geometryObjects[k]) for k in (pair.first, pair.second)]
        assert found.distanceResults[closest].min_distance > 0.02, names
