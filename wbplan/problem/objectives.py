"""Soft tasks that have no target of their own: what the robot should be good at, as it stands.

They go into a phase's `soft` list beside the tasks of `tasks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbplan.errors import SpecError
from wbplan.paths import name_of, number
from wbplan.problem.tasks import GAIN, Task

#: Rows of a tip's velocity (linear, then angular; world axes) that each kind of manipulability is of.
KINDS = {"translation": slice(0, 3), "rotation": slice(3, 6), "whole": slice(0, 6)}


class Objective(Task):
    """A soft task with a `weight` and no target."""

    weight: float

    def _check(self) -> None:
        super()._check()
        weight = number(self.weight, f"{self.label}.weight", "a finite number of 0 or more", least=0.0)
        object.__setattr__(self, "weight", weight)


@final
@dataclass(frozen=True, eq=False)
class BalanceTask(Objective):
    """Draws the CoM toward the point of largest margin of the phase's support region.

    A CoM task in x and y (the height is free) whose target is the middle of the region's places whose margin
    is the largest, or 1 % less. The target goes there from where the CoM is when the phase begins, with the
    CoM's velocity then, and comes to rest after `settle` seconds: it never jumps, nor does its velocity.

    The phase needs a support limit or three contacts that are not on one line.

    Args:
        weight: [1/m].
        settle: how long the target is on its way [s].
        gain: [1/s], as of `ComTask`.
        name: for reports.
    """

    weight: float = 1.0
    settle: float = 2.0
    gain: float = GAIN
    name: str | None = None

    def __post_init__(self) -> None:
        self._check()
        settle = number(self.settle, f"{self.label}.settle", "a finite positive time in seconds", above=0.0)
        object.__setattr__(self, "settle", settle)

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "balance"


@final
@dataclass(frozen=True, eq=False)
class ManipulabilityTask(Objective):
    """Raises the manipulability of a tip through the stance legs.

    w = sqrt(det(J J^T)), where J (m x c) takes a motion that keeps the contacts to the tip's velocity in m
    and rad, m = 3 or 6. Motions count by the base's velocity [m/s, rad/s] and the rates of all free joints
    that are not in a stance leg; stance legs follow, at `legs` times the cost of other joints. At 0,
    with legs that can follow any motion of the base, J is [[1, -[r]x, J_v], [0, 1, J_w]] over base and arm.

    The task costs -weight^2 log w, so a rise of w by a share is worth the same at any size of w. Its step is
    that of steepest ascent in the norm which w is made with, damped by a bound of the curvature of log w:
    it settles where w is largest, and takes at most the share 1 - exp(-gain dt) of the way per tick.

    Args:
        frame: the tip; of the robot, or the name of a carried body. Not a frame in contact.
        kind: 'translation', 'rotation' or 'whole': rows of the tip's velocity that w is made of.
        weight: pure number, see above.
        gain: [1/s].
        rate: log w rises by at most this per second [1/s] where nothing else pulls.
        legs: what 1 rad/s of a stance leg's joint counts beside 1 rad/s of another joint. With more than 0
            a leg near its end of reach lowers w.
        name: for reports.

    Source: HIphanT, equations 32 to 45; Yoshikawa's measure.
    """

    frame: str
    kind: str = "whole"
    weight: float = 1.0
    gain: float = GAIN
    rate: float = 0.2
    legs: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        name_of(self.frame, "ManipulabilityTask.frame")
        self._check()
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise SpecError(f"{self.label}.kind: expected {', '.join(KINDS)}, got {self.kind!r}")
        rate = number(self.rate, f"{self.label}.rate", "a finite positive rate [1/s]", above=0.0)
        legs = number(self.legs, f"{self.label}.legs", "a finite number of 0 or more", least=0.0)
        object.__setattr__(self, "rate", rate)
        object.__setattr__(self, "legs", legs)

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or f"manipulability({self.frame})"
