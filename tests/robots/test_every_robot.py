"""What holds for every robot of the repository: its files, names, bodies, poses and collision pairs."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin
import pytest

from wbplan import catalog

# --- files and names


def test_committed_files_are_what_the_generator_writes(machine, run_script):
    files = run_script(f"{machine.name}/generate.py").generate()
    assert set(files) == {machine.urdf.name, machine.urdf.with_suffix(".srdf").name}
    for name, text in files.items():
        assert (machine.folder / name).read_text(encoding="utf-8") == text, f"{name}: run generate.py again"


def test_it_ships_and_loads_without_a_warning(machine):
    assert catalog.robots()[machine.name] == machine.urdf
    assert machine.robot.name == machine.name
    assert machine.robot.warnings == ()
    assert (machine.folder / "README.md").is_file()


def test_every_frame_has_a_name_of_its_own(machine):
    names = Counter(frame.name for frame in machine.model.frames)
    assert [name for name, count in names.items() if count > 1] == []


def test_materials_are_defined_once_and_all_of_them_are_used(machine):
    defined = [m.attrib["name"] for m in machine.links.findall("material")]
    used = {m.attrib["name"] for m in machine.links.findall("link/visual/material")}
    assert len(defined) == len(set(defined))
    assert set(defined) == used


def test_every_link_with_mass_can_be_seen_and_hit(machine):
    for link in machine.links.iter("link"):
        shown = (link.find("visual") is not None, link.find("collision") is not None)
        massive = link.find("inertial") is not None
        assert shown == (massive, massive), link.attrib["name"]


def test_tips_belong_to_their_limbs(machine):
    keys = ("name", "parent_link", "group", "parent_group")
    tips = [tuple(e.attrib[k] for k in keys) for e in machine.meaning.iter("end_effector")]
    feet = [(frame, frame, "feet", limb) for limb, frame in machine.robot.feet.items()]
    assert tips == feet + [(frame, frame, "hands", limb) for limb, frame in machine.robot.hands.items()]


def test_every_joint_belongs_to_one_limb_and_every_limb_has_a_tip(machine):
    joints = [joint for limb in machine.robot.limbs.values() for joint in limb]
    assert sorted(joints) == sorted(machine.model.names[2:])
    assert set(machine.robot.limbs) == {*machine.robot.feet, *machine.robot.hands}


# --- bodies


def test_inertias_are_those_of_real_bodies(machine):
    corners = {joint: [np.zeros(3)] for joint in range(machine.model.njoints)}
    for shape in machine.solids.geometryObjects:
        shape.geometry.computeLocalAABB()
        low, high = shape.geometry.aabb_local.min_, shape.geometry.aabb_local.max_
        for k in range(8):
            corner = np.where([k & 1, k & 2, k & 4], high, low)
            corners[shape.parentJoint].append(shape.placement.act(corner))
    for joint, inertia in enumerate(machine.model.inertias[1:], start=1):
        name = machine.model.names[joint]
        i1, i2, i3 = np.linalg.eigvalsh(inertia.inertia)
        assert inertia.mass > 0, name
        assert i1 > 0, name
        assert i1 + i2 > i3 * (1 + 1e-6), name
        reach = max(np.linalg.norm(corner - inertia.lever) for corner in corners[joint])
        assert 0.1 * reach < np.sqrt(i3 / inertia.mass) < reach, name


def test_joints_have_speeds_and_efforts(machine):
    assert np.all((machine.model.velocityLimit[6:] > 0) & (machine.model.velocityLimit[6:] < 50))
    assert np.all((machine.model.effortLimit[6:] > 0) & (machine.model.effortLimit[6:] < 1e4))


# --- poses


def test_poses_name_every_joint_and_keep_the_limits(machine):
    for pose, values in machine.states("all").items():
        assert sorted(values) == sorted(machine.model.names[2:]), pose
        q = machine.q(pose)[7:]
        assert np.all(q >= machine.model.lowerPositionLimit[7:]), pose
        assert np.all(q <= machine.model.upperPositionLimit[7:]), pose


def test_all_feet_stand_on_the_ground(machine):
    state = machine.robot.state("stand")
    heights = [state.pose(foot).translation[2] for foot in machine.robot.feet.values()]
    np.testing.assert_allclose(heights, 0.0, atol=1e-9)


def test_in_other_poses_the_feet_of_legs_do(machine):
    for pose in machine.robot.poses:
        state = machine.robot.state(pose)
        heights = [state.pose(foot).translation[2] for foot in machine.robot.standing_feet(state.q)]
        np.testing.assert_allclose(heights, 0.0, atol=1e-9, err_msg=pose)


def test_poses_touch_nothing(machine):
    for pose in machine.states("all"):
        assert machine.hits(machine.checked, machine.q(pose)) == set(), pose


# --- collision pairs


def test_disabled_pairs_are_links_and_listed_once(machine):
    links = {link.attrib["name"] for link in machine.links.iter("link")}
    pairs = machine.disabled()
    assert all(len(pair) == 2 and pair <= links for pair in pairs)
    assert [pair for pair, count in Counter(pairs).items() if count > 1] == []


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
        assert all(result.min_distance > 0.02 for result in found.distanceResults)


# --- plans


def test_its_body_sways_on_all_feet(machine, sway):
    plan = sway(machine.robot, "stand", (0.006, 0.004, 0.006), (0.02, 0.01, 0.04))
    report = plan.check()
    assert report.ok, report
    asked = plan.bundle.phases[0]["tasks"][0]
    assert asked["position"] < 1e-3
    assert asked["orientation"] < 2e-3
    start, farthest = plan.trajectory.q[0], plan.trajectory.q[len(plan.trajectory.q) // 2]
    np.testing.assert_allclose(farthest[:3] - start[:3], (0.006, 0.004, 0.006), atol=1e-3)
    assert np.linalg.norm(farthest[3:6]) == pytest.approx(
        np.sin(np.linalg.norm((0.02, 0.01, 0.04)) / 2), rel=0.05
    )
