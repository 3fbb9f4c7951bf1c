from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import pytest

from wbplan import Robot, SolveError, SpecError
from wbplan.mechanism import Platform, actuated_sets, mobility, rank, stance_mobility
from wbplan.papers import mana, zheng

Standing = tuple[Platform, Mapping[str, float]]


@pytest.mark.parametrize(
    ("name", "pose"),
    [("mana", "stand"), ("hexpiderix", "stand"), ("hiphant", "stand"), ("heavy_hexapod", "stand")],
)
def test_a_robot_on_its_feet_has_six_freedoms(robots: dict[str, Robot], name: str, pose: str) -> None:
    robot = robots[name]
    state = robot.state(pose)
    platform = Platform.of_robot(robot, state)
    found = stance_mobility(platform, {j: state.joint(j) for j in platform.joints})
    assert found.mobility == found.grubler == found.platform == 6
    assert (found.common, found.redundant, found.virtual) == (0, 0, 0)
    # The same from the rank of Pinocchio's constraint Jacobian.
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, state.q)
    pin.updateFramePlacements(robot.model, data)
    rows = [
        pin.getFrameJacobian(robot.model, data, robot.frame_id(robot.feet[n]), pin.LOCAL_WORLD_ALIGNED)[:3]
        for n in platform.chains
    ]
    legs = [robot.joint_index(j)[1] for j in platform.joints]
    free = 6 + len(legs) - np.linalg.matrix_rank(np.vstack(rows)[:, [*range(6), *legs]], tol=1e-9)
    assert free == found.mobility


def test_the_clamp_has_five_freedoms_as_drawn_and_four_elsewhere() -> None:
    loop = zheng.clamp()
    drawn = loop.mobility(zheng.DRAWN)
    assert (drawn.mobility, drawn.grubler, drawn.common, drawn.redundant, drawn.virtual) == (5, 5, 1, 1, 0)
    assert (drawn.links, drawn.joints, drawn.ranks, drawn.platform) == (10, 10, (5, 5), 5)
    near = loop.nearby(zheng.DRAWN, 0.15, 100, seed=3)
    assert len(near) == 100
    for q in near:
        assert np.abs(loop.gap(q)).max() < 1e-9
        found = loop.mobility(q)
        assert (found.mobility, found.grubler, found.common) == (4, 4, 0)
        assert found.mobility == loop.tangents(q).shape[1]


def test_what_departs_does_not_shrink_with_the_step() -> None:
    loop = zheng.clamp()
    large, small = ({n: d for n, d, _ in zheng.departures(loop, step)} for step in (0.05, 0.005))
    for name in ("without tilt", "without yaw"):
        assert small[name] < 0.2 * large[name]
    assert small["with both"] > 0.9 * large["with both"] > 0.09


def test_a_loop_that_cannot_close_says_so() -> None:
    loop = zheng.clamp()
    loop.grasp = pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    with pytest.raises(SolveError, match="cannot be closed"):
        loop.close(zheng.DRAWN)
    with pytest.raises(SpecError, match="two branches or more"):
        mobility([np.zeros((3, 6))])


def test_sets_of_a_hexapod_and_their_condition(standing: Standing, robots: dict[str, Robot]) -> None:
    platform, home = standing
    joints = platform.nearest_joints(mana.pose([3, -4, 5, 8, -6, 4]), home)
    found = actuated_sets(platform, joints)
    assert len(found) == 924
    conditions = [s.condition for s in found]
    assert conditions == sorted(conditions)
    assert all(s.regular == np.isfinite(s.condition) for s in found)
    bad = {s.distribution for s in found if not s.regular}
    assert bad == {d for d in bad if sorted(d) == [0, 0, 3, 3]}
    assert len(bad) == 6
    index = {n: k for k, n in enumerate(platform.joints)}
    g = platform.rates_map(joints) @ np.diag([0.13] * 3 + [1.0] * 3)
    for s in found[::100]:
        assert rank(g[[index[j] for j in s.joints]]) == s.rank
    with pytest.raises(SpecError, match="expected 6 to 12"):
        actuated_sets(platform, joints, 5)
    state = robots["hexpiderix"].state("stand")
    tripod = Platform.of_robot(robots["hexpiderix"], state, ["leg1", "leg3", "leg5"])
    assert len(actuated_sets(tripod, {j: state.joint(j) for j in tripod.joints})) == 84
