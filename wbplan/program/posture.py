"""Soft posture tasks over the joints that a phase leaves free."""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled.phase import JointTarget
from wbplan.paths import MinJerk, ask, number

Array = NDArray[np.float64]


@final
class Posture:
    """One posture task; writes where its target is into a row of the stack's arrays.

    Attributes:
        label: of the task.
        stiffness: (nf - 6,) squared weights; pull: fraction of the error removed per tick.
        goal: (nf - 6,) target now; step: how far it moved in the last `advance`; views of what was given.
    """

    def __init__(
        self, target: JointTarget, free: NDArray[np.intp], dt: float, goal: Array, step: Array
    ) -> None:
        self.label = target.label
        column = {int(c) - 6: k for k, c in enumerate(free[6:])}
        self.stiffness: Array = target.weight[free[6:] - 6] ** 2
        self.pull = 1.0 - float(np.exp(-target.gain * dt))
        self.goal, self.step = goal, step
        for j, path in target.paths:
            goal[column[j]] = float(ask(path, 0.0))
        moving = [(column[j], path) for j, path in target.paths if not path.constant]
        # Ramps of least jerk are what scripts use most: all of them at once.
        ramps = [(k, path) for k, path in moving if isinstance(path, MinJerk)]
        self._others = [(k, path) for k, path in moving if not isinstance(path, MinJerk)]
        self._ramps = np.array([k for k, _ in ramps], dtype=np.intp)
        self._from = np.array([float(path.start) for _, path in ramps])
        self._way = np.array([float(path.goal) - float(path.start) for _, path in ramps])
        self._duration = np.array([path.duration for _, path in ramps])
        self.moving = bool(moving)

    def aim(self, t: float) -> None:
        """Put the target where it is at time `t` [s]."""
        if len(self._ramps):
            s = np.minimum(t / self._duration, 1.0)
            self.goal[self._ramps] = self._from + self._way * (s * s * s * (10.0 + s * (6.0 * s - 15.0)))
        for k, path in self._others:
            self.goal[k] = number(ask(path, t), f"{self.label} at {t:.4g} s", "a finite joint position")
        self.step[:] = 0.0

    def advance(self, t: float) -> None:
        """Move the target on to time `t` [s]."""
        if self.moving:
            before = self.goal.copy()
            self.aim(t)
            np.subtract(self.goal, before, out=self.step)

    def next_goal(self, joints: Array) -> Array:
        """(nf - 6,) where a step from `joints` should lead: short of the target by the error that stays."""
        goal: Array = self.goal - (1.0 - self.pull) * (self.goal - self.step - joints)
        return goal
