"""The simulated robot is the planned one: the same masses, places and inertias."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.errors import PhysicsError
from wbplan.physics import Disturbance, Options, Servo
from wbplan.physics.engine import full_mass_matrix
from wbplan.physics.motion import motion_of
from wbplan.physics.run import disturbed
from wbplan.physics.scene import scene_of, to_mujoco
from wbplan.physics.spec import robot_spec

ROBOT = wb.load_robot("legarm_hexapod")


@pytest.fixture(scope="module")
def world() -> tuple[object, object]:
    model = robot_spec(ROBOT.urdf_text, Servo()).compile()
    model.dof_armature[:] = 0.0
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_pinocchio(world, seed: int) -> None:
    model, data = world
    random = np.random.default_rng(seed)
    pin.seed(seed)
    ours = ROBOT.model
    q = pin.randomConfiguration(ours, ours.lowerPositionLimit.clip(-3), ours.upperPositionLimit.clip(-3, 3))
    q[:3] = random.uniform(-1, 1, 3)
    data.qpos[:7] = to_mujoco(q[:7])
    places = [model.jnt_qposadr[model.joint(name).id] for name in ROBOT.joint_names]
    data.qpos[places] = q[7:]
    mujoco.mj_forward(model, data)
    theirs = ours.createData()
    com = pin.centerOfMass(ours, theirs, q)
    np.testing.assert_allclose(data.subtree_com[1], com, atol=1e-9)
    pin.updateFramePlacements(ours, theirs)
    for foot in ROBOT.feet.values():
        at = theirs.oMf[ours.getFrameId(foot)]
        np.testing.assert_allclose(data.xpos[model.body(foot).id], at.translation, atol=1e-9)
        np.testing.assert_allclose(data.xmat[model.body(foot).id].reshape(3, 3), at.rotation, atol=1e-9)
    # MuJoCo's base speed is along the world's axes, Pinocchio's along the base's own.
    turn = np.eye(ours.nv)
    turn[:3, :3] = pin.Quaternion(q[3:7]).toRotationMatrix()
    order = [*range(6), *(model.jnt_dofadr[model.joint(name).id] for name in ROBOT.joint_names)]
    M = full_mass_matrix(model, data)[np.ix_(order, order)]
    ref = pin.crba(ours, theirs, q)
    ref = np.triu(ref) + np.triu(ref, 1).T
    np.testing.assert_allclose(turn.T @ M @ turn, ref, atol=1e-9)


def test_servos_have_the_urdf_limits(world) -> None:
    model, _ = world
    for name, effort in zip(ROBOT.joint_names, ROBOT.model.effortLimit[6:], strict=True):
        act = model.actuator(name).id
        np.testing.assert_allclose(model.actuator_forcerange[act], [-effort, effort])
        assert model.actuator_forcelimited[act]


def test_collision_pairs_of_the_srdf_are_left_out(clamp) -> None:
    options = Options(lead=False)
    motion = motion_of(clamp.bundle, options)
    scene = scene_of(clamp.bundle, motion, options, ignored=ROBOT.ignored_collisions)
    model = scene.model
    left_out = {
        frozenset(model.body(int(s) >> 16 if k else int(s) & 0xFFFF).name for k in (0, 1))
        for s in model.exclude_signature
    }
    assert left_out == {pair for pair in ROBOT.ignored_collisions if pair <= {b.name for b in _bodies(model)}}
    assert frozenset({"limb1_shank1", "limb1_arm2"}) not in left_out


def _bodies(model):
    return [model.body(i) for i in range(model.nbody)]


def test_what_is_clamped_is_free(clamp) -> None:
    options = Options(lead=False)
    scene = scene_of(clamp.bundle, motion_of(clamp.bundle, options), options)
    assert scene.model.neq == 0
    body, _ = scene.objects["box"]
    assert scene.model.body_mass[body] == pytest.approx(0.8)
    assert scene.model.body_dofnum[body] == 6
    welded = Options(lead=False, weld=True)
    assert scene_of(clamp.bundle, motion_of(clamp.bundle, welded), welded).model.neq == 1


def test_a_disturbance_changes_what_it_says(clamp) -> None:
    options = Options(lead=False)
    scene = scene_of(clamp.bundle, motion_of(clamp.bundle, options), options)
    off = Disturbance(
        mass=1.1, com=(0.01, 0.0, 0.0), object_mass=0.5, object_com=(0.0, 0.02, 0.0), friction=0.5, gain=0.8,
        tilt=(0.0, 0.1),
    )  # fmt: skip
    model, was = disturbed(scene, off), scene.model
    body, _ = scene.objects["box"]
    assert model.body_mass[body] == pytest.approx(0.5 * was.body_mass[body])
    links = [i for i in range(1, was.nbody) if i != body]
    np.testing.assert_allclose(model.body_mass[links], 1.1 * was.body_mass[links])
    np.testing.assert_allclose(model.body_ipos[scene.root] - was.body_ipos[scene.root], [0.01, 0.0, 0.0])
    np.testing.assert_allclose(model.body_ipos[body] - was.body_ipos[body], [0.0, 0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(model.geom_friction[:, 0], 0.5 * was.geom_friction[:, 0])
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], 0.8 * was.actuator_gainprm[:, 0])
    np.testing.assert_allclose(np.linalg.norm(model.opt.gravity), 9.81)
    assert model.opt.gravity[0] == pytest.approx(9.81 * np.sin(0.1))
    assert was.opt.gravity[0] == 0.0


@pytest.mark.parametrize(
    ("field", "value"),
    [("dt", 0.0), ("dt", float("nan")), ("dt", 0.1), ("grip", -1.0), ("safety", 0.0), ("feet", "wheels")],
)
def test_options_refuse(field: str, value: object) -> None:
    with pytest.raises(PhysicsError, match=field):
        Options(**{field: value})


def test_a_joint_without_effort_is_refused() -> None:
    text = ROBOT.urdf_text.replace('effort="5.099458"', 'effort="0"', 1)
    with pytest.raises(PhysicsError, match=r"limb1_joint1.*effort"):
        robot_spec(text, Servo())
