"""Every error that a user can cause, under one root.

A message names what was at fault, what was found, what was expected, and what to do about it; the
attributes carry the same as data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


class WbplanError(Exception):
    """Root of all errors raised by wbplan."""


class ModelError(WbplanError):
    """A robot's description (URDF, SRDF, meshes) is unusable.

    Attributes:
        problems: every problem found, each naming its element.
    """

    def __init__(self, message: str, problems: Sequence[str] = ()) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join([message, *(f"  - {p}" for p in self.problems)]))


class SpecError(WbplanError):
    """A task, phase, script or argument is not what it has to be."""


@dataclass(frozen=True)
class Relaxation:
    """How far one hard row group has to give way for the others to hold.

    Attributes:
        name: the task, contact or limit.
        amount: least relaxation over the next tick, in `unit`.
        unit: "m" or "rad".
    """

    name: str
    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.name} by {self.amount:.3g} {self.unit}"


class SolveError(WbplanError):
    """No step exists that keeps every hard promise; nothing was integrated.

    Attributes:
        clashes: the hard rows that contradict each other (or the limits), and by how much.
        limits: names of the limits that stand against them.
        partial: from `wbplan.plan`, the `Plan` up to the last state that keeps every promise, its report's
            `incomplete` saying why it ends there; None where there is none.
    """

    def __init__(
        self,
        message: str,
        clashes: Sequence[Relaxation] = (),
        limits: Sequence[str] = (),
        partial: Any = None,
    ) -> None:
        self.clashes = tuple(clashes)
        self.limits = tuple(limits)
        self.partial = partial
        super().__init__(message)


class GaitError(WbplanError):
    """A gait, stance, path and terrain that no motion of the body goes with.

    Attributes:
        step: number of the step at fault, from 0; `None` where it is not one step.
        margin: the largest stability margin [m] there is in that step, where it was computed.
        stride: the longest stride [m] that would hold, where there is one.
    """

    def __init__(
        self,
        message: str,
        *,
        step: int | None = None,
        margin: float | None = None,
        stride: float | None = None,
    ) -> None:
        self.step, self.margin, self.stride = step, margin, stride
        super().__init__(message)


class CheckFailed(WbplanError):
    """A plan breaks a promise.

    Attributes:
        broken: names of the broken promises.
    """

    def __init__(self, message: str, broken: Sequence[str] = ()) -> None:
        self.broken = tuple(broken)
        super().__init__(message)


class BundleError(WbplanError):
    """A plan bundle cannot be read or written."""


class ViewError(WbplanError):
    """The viewer cannot start or be reached."""


class PhysicsError(WbplanError):
    """A plan cannot be simulated."""


class PlanFalls(WbplanError):
    """A plan was simulated and did not stand."""


def listing(names: Sequence[str], most: int = 12) -> str:
    """Names for a message: all where they are few, else the first ones and how many more there are."""
    shown = ", ".join(sorted(names)[:most]) or "none"
    more = len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown
