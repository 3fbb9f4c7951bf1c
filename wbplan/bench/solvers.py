"""The solvers that are timed, each set up from the same scene.

The peers get each tick's targets ready-made, as numbers, and do no more than their users would have them do.
wbplan evaluates its paths itself, for many ticks at once where it can: the mean has that in it, the median
only in part. It also measures what it has done, corrects drift, and refuses steps that break a promise.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import final

import numpy as np
import pinocchio as pin
import placo
from lxml import etree
from numpy.typing import NDArray

from wbplan.bench.pink_solver import fastest_pink
from wbplan.bench.scenes import POSTURE_WEIGHT, Scene
from wbplan.bench.solver import Solver
from wbplan.tick import Loop

Array = NDArray[np.float64]


@final
class Floor(Solver):
    """Pinocchio's Jacobians, frames and CoM Jacobian of the same model, and nothing else."""

    name = "kinematics-floor"
    note = "Jacobians, frames and CoM Jacobian alone"
    moves = False

    def __init__(self, scene: Scene) -> None:
        self._model = scene.compiled.model
        self._data = self._model.createData()
        self._q = scene.q

    def tick(self, k: int) -> None:
        """See `Solver.tick`."""
        pin.computeJointJacobians(self._model, self._data, self._q)
        pin.updateFramePlacements(self._model, self._data)
        pin.jacobianCenterOfMass(self._model, self._data, False)

    @property
    def q(self) -> Array:
        """See `Solver.q`."""
        return self._q


@final
class Placo(Solver):
    """PlaCo's own kinematics solver, without wbplan."""

    name = "placo"

    def __init__(self, scene: Scene) -> None:
        robot = placo.RobotWrapper("", int(placo.Flags.ignore_collisions), _urdf(scene))
        robot.state.q = scene.q
        robot.update_kinematics()
        solver = placo.KinematicsSolver(robot)
        solver.dt = scene.dt
        for foot in scene.feet:
            task = solver.add_position_task(foot, robot.get_T_world_frame(foot)[:3, 3])
            task.configure(f"{foot} stays", "hard", 1.0)
        if scene.loop is not None:
            root, frame = scene.loop
            pose = np.linalg.inv(robot.get_T_world_frame(root)) @ robot.get_T_world_frame(frame)
            solver.add_relative_frame_task(root, frame, pose).configure("loop", "hard", 1.0, 1.0)
        self._tasks = []
        for tracked in scene.tracked:
            targets = [pose.homogeneous for pose in tracked.poses]
            task = solver.add_frame_task(tracked.frame, targets[0])
            # PlaCo's weights are on squares.
            task.configure(tracked.frame, "soft", tracked.position_weight**2, tracked.rotation_weight**2)
            self._tasks.append((task, targets))
        posture = solver.add_joints_task()
        joints = zip(scene.robot.joint_names, scene.q[7:].tolist(), strict=True)
        posture.set_joints({name: value for name, value in joints if name not in scene.held})
        posture.configure("posture", "soft", POSTURE_WEIGHT**2)
        solver.add_regularization_task(1e-6)
        for name in scene.held:
            solver.mask_dof(name)
        limits = scene.compiled.model.velocityLimit[6:]
        for name, limit in zip(scene.robot.joint_names, limits, strict=True):
            robot.set_velocity_limit(name, float(scene.speed * limit))
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        polygon = scene.compiled.polygon
        if scene.margin is not None and polygon is not None:
            clockwise = [np.array(vertex) for vertex in polygon.vertices[::-1]]
            solver.add_com_polygon_constraint(clockwise, scene.margin).configure("polygon", "hard", 1.0)
        self._robot, self._solver = robot, solver

    def tick(self, k: int) -> None:
        """See `Solver.tick`."""
        for task, targets in self._tasks:
            task.T_world_frame = targets[k]
        self._robot.update_kinematics()
        self._solver.solve(True)

    @property
    def q(self) -> Array:
        """See `Solver.q`."""
        return np.array(self._robot.state.q)


@final
class Wbplan(Solver):
    """`wbplan.Loop.step`."""

    def __init__(self, scene: Scene, backend: str) -> None:
        self.name = f"wbplan-{backend}"
        self.loop = Loop(scene.robot, scene.phase, scene.q, scene.dt, backend=backend, placed=scene.placed)

    def tick(self, k: int) -> None:
        """See `Solver.tick`."""
        self.loop.step()

    @property
    def q(self) -> Array:
        """See `Solver.q`."""
        return self.loop.q


def pink_is_installed() -> bool:
    """Whether Pink, of the extra `bench`, is there."""
    return find_spec("pink") is not None


def make_solvers(scene: Scene) -> tuple[list[Solver], list[tuple[str, str]]]:
    """Every solver set up for a scene; and (name, why) of those that are not to be had."""
    ours = [Wbplan(scene, "proxqp"), Wbplan(scene, "placo")]
    peers: list[Solver] = [Floor(scene), Placo(scene)]
    if not pink_is_installed():
        return [*peers, *ours], [("pink", "not installed: pip install 'wbplan[bench]'")]
    found, why = fastest_pink(scene)
    if found is None:
        return [*peers, *ours], [("pink", why)]
    return [*peers, found, *ours], []


def _urdf(scene: Scene) -> str:
    """The robot's URDF without its looks, with the carried body as one more link."""
    root = etree.fromstring(scene.robot.urdf_text.encode())
    for looks in list(root.iter("visual", "collision")):
        looks.getparent().remove(looks)
    for held in scene.compiled.held:
        name, pose = held.body.name, held.T_holder_body
        inertial = etree.SubElement(etree.SubElement(root, "link", name=name), "inertial")
        etree.SubElement(inertial, "mass", value=repr(held.body.mass))
        etree.SubElement(inertial, "inertia", ixx="1e-3", iyy="1e-3", izz="1e-3", ixy="0", ixz="0", iyz="0")
        joint = etree.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
        etree.SubElement(joint, "parent", link=held.holder)
        etree.SubElement(joint, "child", link=name)
        xyz, rpy = pose.translation.tolist(), pin.rpy.matrixToRpy(pose.rotation).tolist()
        etree.SubElement(joint, "origin", xyz=" ".join(map(repr, xyz)), rpy=" ".join(map(repr, rpy)))
    return str(etree.tostring(root, encoding="unicode"))
