"""A manipulability task as tasks that PlaCo has.

PlaCo's own manipulability task leaves the base out, so it does not see the stance legs. A quadratic in the
whole step is a task on each of its columns that would step to its minimum: on the base's place and turn, and
on the joints.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
import pinocchio as pin

from wbplan.program.ascent import Ascent
from wbplan.program.stack import Stack


@final
class PlacoAscent:
    """One manipulability task of a phase.

    Args:
        ascent: the task.
        stack: the phase's; its kinematics say where the robot is.
        solver: PlaCo's, which gets the tasks.
    """

    def __init__(self, ascent: Ascent, stack: Stack, solver: Any) -> None:
        self._ascent, self._stack = ascent, stack
        phase, q = stack.phase, stack.kinematics.q
        root = next(f.name for f in phase.model.frames if f.parentJoint == 1 and f.placement.isIdentity())
        self._place = solver.add_position_task(root, q[:3])
        self._turn = solver.add_orientation_task(root, np.eye(3))
        self._joints: list[tuple[Any, list[str], Any]] = []
        for value in sorted({float(s) for s in ascent.stiffness[6:] if s > 0.0}):
            task = solver.add_joints_task()
            columns = 6 + np.flatnonzero(ascent.stiffness[6:] == value)
            names = [phase.robot.joint_names[phase.free[k] - 6] for k in columns]
            for k, name in zip(columns, names, strict=True):
                task.set_joint(name, float(q[1 + phase.free[k]]))
            self._joints.append((task, names, columns))
        self._weigh()

    def _weigh(self) -> None:
        """Put the weights as they are now; the base's six columns count alike."""
        label, stiffness = self._ascent.label, self._ascent.stiffness
        self._place.configure(f"{label} base position", "soft", float(stiffness[0]))
        self._turn.configure(f"{label} base rotation", "soft", float(stiffness[0]))
        for k, (task, _, columns) in enumerate(self._joints):
            task.configure(f"{label} joints {k}", "soft", float(stiffness[columns[0]]))

    def aim(self) -> None:
        """Put the tasks where the quadratic is least; the stack's Jacobian is up to date."""
        q, free = self._stack.kinematics.q, self._stack.phase.free
        self._ascent.update()
        if self._ascent.varies:
            self._weigh()
        step, here = self._ascent.wanted, pin.XYZQUATToSE3(q[:7])
        self._place.target_world = here.translation + here.rotation @ step[:3]
        self._turn.R_world_frame = here.rotation @ pin.exp3(step[3:6])
        for task, names, columns in self._joints:
            for name, goal in zip(names, (q[1 + free[columns]] + step[columns]).tolist(), strict=True):
                task.set_joint(name, goal)
