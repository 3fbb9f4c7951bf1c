"""What a phase's objectives aim at, on a robot: the CoM's way to the best place, a tip's manipulability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes
from wbplan.paths import POINT, Path
from wbplan.problem.bodies import frame_number
from wbplan.problem.objectives import KINDS, BalanceTask, ManipulabilityTask
from wbplan.problem.script import Phase
from wbplan.state import State

Array = NDArray[np.float64]


@final
class Settle(Path):
    """From a point with a velocity to rest at another, in `duration` [s].

    p(t) = start + velocity t + (10 c - 6 h) s^3 + (8 h - 15 c) s^4 + (6 c - 3 h) s^5, where s = t / duration,
    c = goal - start and h = velocity duration: the quintic whose acceleration is zero at both ends.

    Args:
        start: (3,) [m].
        velocity: (3,) [m/s] at the start.
        goal: (3,) [m].
        duration: [s].
    """

    kind = POINT

    def __init__(self, start: ArrayLike, velocity: ArrayLike, goal: ArrayLike, duration: float) -> None:
        self.start, self.goal = np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64)
        self.duration = float(duration)
        self._hop = self.duration * np.asarray(velocity, dtype=np.float64)

    def at(self, t: float) -> Array:
        """See `Path.at`."""
        s = t / self.duration
        if s >= 1.0:
            return self.goal.copy()
        way, hop = self.goal - self.start, self._hop
        rest: Array = 10.0 * way - 6.0 * hop + s * (8.0 * hop - 15.0 * way + s * (6.0 * way - 3.0 * hop))
        found: Array = self.start + s * (hop + s * s * rest)
        return found


@final
@dataclass(frozen=True, eq=False)
class ComTarget:
    """A CoM task with its target bound."""

    label: str
    path: Path
    weight: Array
    gain: float
    hard: bool
    level: int = 0


def balance_target(
    task: BalanceTask, region: HalfPlanes, state: State, velocity: Array | None, level: int
) -> ComTarget:
    """The CoM on its way to the middle of the region's best places, at its own height.

    Args:
        task: the task.
        region: of the CoM's places that the contacts hold.
        state: at the phase's start.
        velocity: (nv,) then; None at rest.
        level: of the task.
    """
    goal, drift = np.array(state.com), np.zeros(3)
    if velocity is not None:
        drift[:2] = (pin.jacobianCenterOfMass(state.model, state.model.createData(), state.q) @ velocity)[:2]
    goal[:2] = region.middle()
    path = Settle(state.com, drift, goal, task.settle)
    return ComTarget(task.label, path, task.weight * np.array([1.0, 1.0, 0.0]), task.gain, False, level)


@final
@dataclass(frozen=True, eq=False)
class AscentTarget:
    """A manipulability task on a model.

    Attributes:
        label: of the task.
        frame: number of the tip's frame; feet: of the frames in contact.
        rows: of the tip's velocity.
        weight, gain [1/s], rate [1/s], legs: see `ManipulabilityTask`.
    """

    label: str
    frame: int
    feet: tuple[int, ...]
    rows: slice
    weight: float
    gain: float
    rate: float
    legs: float


def ascent_target(task: ManipulabilityTask, phase: Phase, model: Any) -> AscentTarget:
    """Look up a manipulability task's frames.

    Raises:
        SpecError: its frame does not exist or is in contact, or nothing is.
    """
    what = f"phase '{phase.name}', {task.label}"
    frame = frame_number(model, task.frame, what)
    names = [c.frame for c in phase.contacts]
    if not names:
        raise SpecError(f"{what}: the phase has no contacts; nothing holds the base that the tip is moved by")
    if task.frame in names:
        raise SpecError(f"{what}: '{task.frame}' is in contact and cannot move")
    feet = tuple(frame_number(model, name, what) for name in names)
    return AscentTarget(
        task.label, frame, feet, KINDS[task.kind], task.weight, task.gain, task.rate, task.legs
    )
