"""Pink, asked the same as far as it goes.

- Hard contacts and the loop are equality constraints. Pink's frame constraints have six rows, whatever their
  costs, and a foot held in six rows nails down the robot; so a point foot of three rows is written here, as a
  user of Pink would have to.
- It has no CoM polygon: that limit is left out, which is to its advantage.
- It has no locked joints: it gets a reduced model without them, which is to its advantage too.
"""

from __future__ import annotations

import time
from importlib import import_module
from typing import Any, final

import numpy as np
import pinocchio as pin
import qpsolvers
from numpy.typing import NDArray

from wbplan.bench.scenes import POSTURE_GAIN, POSTURE_WEIGHT, Scene
from wbplan.bench.solver import Solver

Array = NDArray[np.float64]

#: QP solvers that Pink is tried with.
CANDIDATES = ("daqp", "proxqp")


@final
class _PointFoot:
    """A frame's origin that stays: J dq = -e with e = p - p_target, along the world's axes."""

    gain = 1.0

    def __init__(self, frame: int, target: Array) -> None:
        self._frame, self._target = frame, target

    def compute_error(self, configuration: Any) -> Array:
        error: Array = configuration.data.oMf[self._frame].translation - self._target
        return error

    def compute_jacobian(self, configuration: Any) -> Array:
        jacobian: Array = pin.getFrameJacobian(
            configuration.model, configuration.data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )[:3]
        return jacobian


@final
class Pink(Solver):
    """`pink.solve_ik` with one of its QP solvers."""

    name = "pink"

    def __init__(self, scene: Scene, solver: str) -> None:
        # Not an import statement: Pink is no dependency, an extra brings it.
        pink, tasks = import_module("pink"), import_module("pink.tasks")
        self._solve, self._solver, self._dt = pink.solve_ik, solver, scene.dt
        full = scene.compiled.model
        locked = [full.getJointId(name) for name in scene.held]
        model = pin.buildReducedModel(full, locked, scene.q)
        model.velocityLimit = scene.speed * model.velocityLimit
        self._places = np.array(
            [*range(7), *(full.joints[full.getJointId(n)].idx_q for n in model.names[2:])]
        )
        self._q = np.array(scene.q)
        configuration = pink.Configuration(model, model.createData(), self._q[self._places])
        self._configuration = configuration
        self._constraints: list[Any] = []
        for foot in scene.feet:
            frame = model.getFrameId(foot, pin.BODY)
            self._constraints.append(_PointFoot(frame, configuration.data.oMf[frame].translation.copy()))
        if scene.loop is not None:
            root, frame = scene.loop
            loop = tasks.RelativeFrameTask(frame, root, position_cost=1.0, orientation_cost=1.0)
            loop.set_target_from_configuration(configuration)
            self._constraints.append(loop)
        self._tracked = []
        for tracked in scene.tracked:
            task = tasks.FrameTask(
                tracked.frame,
                position_cost=tracked.position_weight,
                orientation_cost=tracked.rotation_weight,
            )
            self._tracked.append((task, tracked.poses))
        posture = tasks.PostureTask(cost=POSTURE_WEIGHT, gain=1.0 - float(np.exp(-POSTURE_GAIN * scene.dt)))
        posture.set_target(scene.q[self._places])
        self._tasks = [*(task for task, _ in self._tracked), posture]
        lacks = [] if scene.margin is None else ["no CoM polygon"]
        self.note = "; ".join([f"with {solver}", *lacks, "point feet written for it"])

    def tick(self, k: int) -> None:
        """See `Solver.tick`."""
        for task, poses in self._tracked:
            task.set_target(poses[k])
        velocity = self._solve(
            self._configuration, self._tasks, self._dt, solver=self._solver, constraints=self._constraints
        )
        self._configuration.integrate_inplace(velocity, self._dt)

    @property
    def q(self) -> Array:
        """See `Solver.q`."""
        self._q[self._places] = self._configuration.q
        return self._q


def fastest_pink(scene: Scene) -> tuple[Pink | None, str]:
    """Pink at the start, with the fastest solver that gets to the end of the path; or why there is none."""
    refused = import_module("pink.exceptions").PinkError
    medians: dict[str, float] = {}
    why = "no QP solver for it is installed"
    for name in CANDIDATES:
        if name not in qpsolvers.available_solvers:
            continue
        trial, taken = Pink(scene, name), []
        try:
            for k in range(1, scene.ticks + 1):
                started = time.perf_counter_ns()
                trial.tick(k)
                taken.append(time.perf_counter_ns() - started)
        except refused as error:
            why = f"with {name}, stops at tick {len(taken)}: {' '.join(str(error).split())[:120]}"
        else:
            medians[name] = float(np.median(taken))
    if not medians:
        return None, why
    return Pink(scene, min(medians, key=lambda name: medians[name])), ""
