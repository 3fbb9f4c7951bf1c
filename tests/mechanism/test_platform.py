from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import pytest

from wbplan import Robot, SolveError, SpecError, catalog
from wbplan.mechanism import Follower, Platform, forward, limb_chain
from wbplan.mechanism.forward import distance_between, size_of
from wbplan.papers import mana

Standing = tuple[Platform, Mapping[str, float]]

SETS = (
    "1.hip1 1.hip2 1.knee 2.hip2 2.knee 4.knee",
    "1.hip1 1.hip2 1.knee 2.hip1 2.knee 4.hip2",
    "1.hip1 1.hip2 1.knee 2.hip2 2.knee 4.hip1",
    "4.hip1 4.hip2 4.knee 1.hip2 1.knee 3.knee",
)
OTHERS = (
    "1.hip1 1.hip2 1.knee 2.knee 3.knee 4.hip1",
    "1.hip1 1.knee 2.hip2 2.knee 4.hip1 4.knee",
    "1.hip2 1.knee 2.hip2 2.knee 3.hip1 4.knee",
)


def names(text: str) -> list[str]:
    return [f"leg{part.replace('.', '_')}" for part in text.split()]


def poses(count: int, seed: int = 0) -> list[pin.SE3]:
    random = np.random.default_rng(seed)
    return [
        mana.pose(np.concatenate([random.uniform(-10, 10, 3), random.uniform(-15, 15, 3)]))
        for _ in range(count)
    ]


@pytest.mark.parametrize("name", sorted(catalog.robots()))
def test_inverse_and_pose_of_go_round(robots: dict[str, Robot], name: str) -> None:
    robot = robots[name]
    state = robot.state("stand")
    platform = Platform.of_robot(robot, state)
    home = {j: state.joint(j) for j in platform.joints}
    body = pin.XYZQUATToSE3(state.q[:7])
    moved = pin.SE3(
        body.rotation @ pin.exp3(np.array([0.02, 0.01, -0.03])), body.translation + [0.005, -0.004, 0.003]
    )
    every = platform.inverse(moved)
    assert set(every) == set(platform.chains)
    joints = platform.nearest_joints(moved, home)
    np.testing.assert_allclose(platform.pose_of(joints).homogeneous, moved.homogeneous, atol=1e-9)


def test_the_rates_map_is_the_derivative_of_the_inverse(standing: Standing) -> None:
    platform, home = standing
    body = poses(1)[0]
    joints = platform.nearest_joints(body, home)
    g = platform.rates_map(joints)
    twist = np.array([0.3, -0.2, 0.1, 0.5, -0.4, 0.6])
    step = 1e-6
    ahead, behind = (
        np.array(
            list(platform.nearest_joints(body * pin.exp6(pin.Motion(s * step * twist)), joints).values())
        )
        for s in (1, -1)
    )
    np.testing.assert_allclose(g @ twist, (ahead - behind) / (2 * step), atol=1e-7)


@pytest.mark.parametrize("text", SETS)
def test_elimination_finds_what_many_starts_find(standing: Standing, text: str) -> None:
    platform, home = standing
    near = mana.pose([0.0] * 6)
    for body in poses(6):
        every = platform.nearest_joints(body, home)
        known = {n: every[n] for n in names(text)}
        exact = forward(platform, known, near)
        assert exact.method == "elimination"
        assert exact.complete
        searched = forward(platform, known, near, method="multi-start")
        assert len(exact.solutions) == len(searched.solutions)
        size = size_of(platform)
        for a, b in zip(exact.solutions, searched.solutions, strict=True):
            assert distance_between(a.pose, b.pose, size) < 1e-6
        assert sum(distance_between(s.pose, body, size) < 1e-8 for s in exact.admissible) == 1
        for s in exact.solutions:
            for name, value in known.items():
                assert abs(np.remainder(s.joints[name] - value + np.pi, 2 * np.pi) - np.pi) < 1e-6


@pytest.mark.parametrize("text", OTHERS)
def test_other_sets_are_solved_by_many_starts(standing: Standing, text: str) -> None:
    platform, home = standing
    body, size = poses(1, 5)[0], size_of(platform)
    every = platform.nearest_joints(body, home)
    known = {n: every[n] for n in names(text)}
    runs = [forward(platform, known, mana.pose([0.0] * 6), seed=seed) for seed in (0, 1)]
    assert len(runs[0].solutions) == len(runs[1].solutions)
    assert all(s.hits > 0 for s in runs[0].solutions)
    assert any(distance_between(s.pose, body, size) < 1e-8 for s in runs[0].admissible)
    distances = [s.distance for s in runs[0].solutions]
    assert distances == sorted(distances)


def test_all_twelve_joints_leave_one_pose(standing: Standing) -> None:
    platform, home = standing
    body = poses(1, 7)[0]
    every = platform.nearest_joints(body, home)
    found = forward(platform, every, body)
    assert [distance_between(s.pose, body, size_of(platform)) < 1e-8 for s in found.solutions] == [True]


def test_a_hexapod_with_held_limbs_on_six_of_its_joints(robots: dict[str, Robot]) -> None:
    robot = robots["legarm_hexapod"]
    state = robot.state("stand")
    platform = Platform.of_robot(robot, state)
    assert len(platform.joints) == 18
    chosen = ["limb1_joint1", "limb1_joint2", "limb1_joint3", "leg3_joint2", "leg3_joint3", "leg5_joint3"]
    found = forward(platform, {j: state.joint(j) for j in chosen}, pin.XYZQUATToSE3(state.q[:7]))
    assert found.method == "elimination"
    assert found.solutions[0].distance < 1e-8
    assert found.solutions[0].admissible


def test_any_set_finds_the_pose_that_its_angles_came_from(standing: Standing) -> None:
    platform, home = standing
    body = poses(1, 9)[0]
    every = platform.nearest_joints(body, home)
    for text in (SETS[0], OTHERS[1]):
        known = {n: every[n] for n in names(text)}
        found = forward(platform, known, mana.pose([0.0] * 6))
        assert min(distance_between(s.pose, body, 0.1) for s in found.solutions) < 1e-6


def test_following_a_path_stays_on_the_branch(standing: Standing) -> None:
    platform, home = standing
    chosen = names(SETS[0])
    start = platform.nearest_joints(mana.pose([0.0] * 6), home)
    follower, joints = Follower(platform, start, chosen), start
    for k in range(1, 201):
        s = np.sin(2 * np.pi * k / 200)
        body = mana.pose([10 * s, -8 * s, 12 * s, 15 * s, 10 * np.sin(4 * np.pi * k / 200), -10 * s])
        joints = platform.nearest_joints(body, joints)
        pose = follower.step([joints[n] for n in chosen])
        assert distance_between(pose, body, 0.1) < 1e-9
    assert max(abs(v - joints[n]) for n, v in follower.joints.items()) < 1e-8


def test_a_follower_that_cannot_go_on_stays_where_it_was(standing: Standing) -> None:
    platform, home = standing
    chosen = names(SETS[0])
    start = platform.nearest_joints(mana.pose([0.0] * 6), home)
    follower = Follower(platform, start, chosen)
    before = follower.pose
    values = [start[n] for n in chosen]
    values[2], values[4] = 0.0, 2.2
    with pytest.raises(SolveError, match="loops stay open"):
        follower.step(values)
    assert follower.pose == before


def test_bad_input_is_named(standing: Standing, robots: dict[str, Robot]) -> None:
    platform, home = standing
    near = mana.pose([0.0] * 6)
    with pytest.raises(SpecError, match="no joint 'leg1_ankle'"):
        forward(platform, {"leg1_ankle": 0.0}, near)
    with pytest.raises(SpecError, match="leave the body free to move"):
        forward(platform, {"leg1_knee": 0.5, "leg2_knee": 0.5}, near)
    both = {n: home[n] for n in platform.joints if n.startswith(("leg1", "leg2"))}
    with pytest.raises(SpecError, match="6 known joints leave the body free to move"):
        forward(platform, both, near)
    with pytest.raises(SpecError, match="elimination needs one leg known whole"):
        forward(platform, {n: home[n] for n in names(OTHERS[0])}, near, method="elimination")
    with pytest.raises(SpecError, match="expected 'elimination' or 'multi-start'"):
        forward(platform, home, near, method="guess")
    with pytest.raises(SpecError, match="no position given for joint 'leg1_hip2'"):
        platform.pose_of({"leg1_hip1": 0.0})
    with pytest.raises(SpecError, match="no foot"):
        Platform.of_robot(robots["hiphant"], robots["hiphant"].state("stand"), ["arm"])
    with pytest.raises(SpecError, match="have to be the same"):
        Platform(platform.chains, {})
    sliding = limb_chain(robots["legarm_hexapod"], "limb1", "limb1_foot")
    loose = Platform({"limb1": sliding}, {"limb1": np.zeros(3)})
    with pytest.raises(SpecError, match=r"leg 'limb1' with joints .* no closed form"):
        loose.inverse(pin.SE3.Identity())
    with pytest.raises(SolveError, match=r"m from axis 2, beyond the reach"):
        platform.nearest_joints(mana.pose([0, 0, 0, 0, 0, 100]), home)
