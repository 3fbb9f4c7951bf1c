from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbplan import Robot, SpecError, catalog
from wbplan.mechanism import chain_to, limb_chain, positions, swap


def tips(robot: Robot) -> list[tuple[str, str]]:
    return [*robot.feet.items(), *robot.hands.items()]


def random_q(robot: Robot, seed: int) -> np.ndarray:
    model = robot.model
    low = np.r_[-np.ones(7), np.maximum(model.lowerPositionLimit[7:], -4.0)]
    high = np.r_[np.ones(7), np.minimum(model.upperPositionLimit[7:], 4.0)]
    pin.seed(seed)
    return np.asarray(pin.randomConfiguration(model, low, high))


@pytest.mark.parametrize("name", sorted(catalog.robots()))
def test_every_limbs_pose_is_pinocchios(robots: dict[str, Robot], name: str) -> None:
    robot = robots[name]
    for seed in range(20):
        state = robot.state(random_q(robot, seed))
        body = pin.XYZQUATToSE3(state.q[:7])
        for limb, tip in tips(robot):
            chain = limb_chain(robot, limb, tip)
            ours = chain.pose(positions(robot, chain.joints, state.q))
            right = body.actInv(state.pose(tip))
            assert np.abs(ours.homogeneous - right.homogeneous).max() < 1e-12


@pytest.mark.parametrize("name", sorted(catalog.robots()))
def test_screws_are_the_columns_of_pinocchios_jacobian(robots: dict[str, Robot], name: str) -> None:
    robot = robots[name]
    q = random_q(robot, 3)
    q[:7] = pin.neutral(robot.model)[:7]
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    pin.updateFramePlacements(robot.model, data)
    for _, tip in tips(robot):
        chain = chain_to(robot, tip)
        columns = [robot.joint_index(j)[1] for j in chain.joints]
        at = positions(robot, chain.joints, q)
        np.testing.assert_allclose(swap(chain.screws_at(at)).T, data.J[:, columns], atol=1e-12)
        point = pin.getFrameJacobian(robot.model, data, robot.frame_id(tip), pin.LOCAL_WORLD_ALIGNED)[:3]
        np.testing.assert_allclose(chain.point_jacobian(at), point[:, columns], atol=1e-12)


def test_a_held_joint_leaves_the_rest_as_it_was(robots: dict[str, Robot]) -> None:
    chain = limb_chain(robots["legarm_hexapod"], "limb1", "limb1_foot")
    q = np.array([0.4, -0.3, 0.8, 0.05])
    for k, name in enumerate(chain.joints):
        held = chain.hold({name: q[k]})
        assert len(held.joints) == 3
        rest = np.delete(q, k)
        np.testing.assert_allclose(held.pose(rest).homogeneous, chain.pose(q).homogeneous, atol=1e-12)
        np.testing.assert_allclose(held.screws_at(rest), np.delete(chain.screws_at(q), k, axis=0), atol=1e-12)


def test_bad_input_is_named(robots: dict[str, Robot]) -> None:
    robot = robots["mana"]
    with pytest.raises(SpecError, match="no limb 'leg9'"):
        limb_chain(robot, "leg9")
    with pytest.raises(SpecError, match="no frame 'nowhere'"):
        chain_to(robot, "nowhere")
    chain = limb_chain(robot, "leg1")
    with pytest.raises(SpecError, match=r"expected 3 finite joint positions .*leg1_hip1"):
        chain.pose([0.0, np.nan, 0.0])
    with pytest.raises(SpecError, match="no joint 'elbow'"):
        chain.hold({"elbow": 0.0})
