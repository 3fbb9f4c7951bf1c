"""What a limb's inverse kinematics returns: every solution, or why there is none."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SolveError

Array = NDArray[np.float64]

LIMIT_TOLERANCE = 1e-9
"""How far [rad or m] beyond a limit a joint may be by rounding."""


@dataclass(frozen=True, eq=False)
class LimbSolution:
    """One set of joint positions that puts a limb's tip where it was asked.

    Attributes:
        joints: (n,) [rad or m].
        branch: which of the closed form's solutions it is, in words.
        shift: how far [m] the body had to move along the compensation direction.
    """

    joints: Array
    branch: str
    shift: float = 0.0


@dataclass(frozen=True, eq=False)
class LimbSolutions:
    """All solutions of a limb for one target.

    Attributes:
        within: those inside the joint limits.
        beyond: real ones outside the limits.
        reason: why `within` is empty; "" where it is not.
        case: the paper's case number, where it has one.
    """

    within: tuple[LimbSolution, ...]
    beyond: tuple[LimbSolution, ...]
    reason: str
    case: str = ""

    def nearest(self, joints: ArrayLike) -> LimbSolution:
        """The solution within limits whose joints are closest (least sum of squares) to the given ones.

        Args:
            joints: (n,) [rad or m].

        Raises:
            SolveError: there is none; the message is the reason.
        """
        if not self.within:
            raise SolveError(self.reason)
        given = np.asarray(joints, dtype=np.float64)
        return min(self.within, key=lambda s: float(np.sum((s.joints - given) ** 2)))


def wrapped(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned <= -math.pi else turned


def sort_by_limits(
    found: Sequence[LimbSolution],
    lower: Array,
    upper: Array,
    names: Sequence[str],
    reason: str,
    case: str = "",
) -> LimbSolutions:
    """Solutions with each angle turned by whole turns into its limits, every way that fits.

    Args:
        found: real solutions, angles modulo a turn.
        lower: (n,) [rad].
        upper: (n,) [rad].
        names: joints, for the reason.
        reason: why there is none, where `found` is empty.
        case: see `LimbSolutions`.
    """
    within: list[LimbSolution] = []
    beyond: list[LimbSolution] = []
    excuses: list[tuple[float, str]] = []
    for solution in found:
        fitting = [_turns(*triple) for triple in zip(solution.joints, lower, upper, strict=True)]
        if all(fitting):
            within += [
                LimbSolution(np.array(joints), solution.branch, solution.shift)
                for joints in itertools.product(*fitting)
            ]
            continue
        near = np.array([_closest(*triple) for triple in zip(solution.joints, lower, upper, strict=True)])
        beyond.append(LimbSolution(near, solution.branch, solution.shift))
        excess = np.maximum(lower - near, near - upper)
        worst = int(np.argmax(excess))
        excuses.append(
            (
                float(excess[worst]),
                f"{names[worst]} would have to be at {near[worst]:.4f} rad, its limits are "
                f"{lower[worst]:.4f} and {upper[worst]:.4f} (branch {solution.branch})",
            )
        )
    why = "" if within else (min(excuses)[1] if excuses else reason)
    return LimbSolutions(tuple(within), tuple(beyond), why, case)


def distinct(found: Sequence[LimbSolution], tolerance: float = 1e-9) -> list[LimbSolution]:
    """Solutions without repetition: branches coincide where a leg is straight, for one."""
    kept: list[LimbSolution] = []
    for solution in found:
        if all(
            max(abs(wrapped(float(d))) for d in solution.joints - other.joints) > tolerance for other in kept
        ):
            kept.append(solution)
    return kept


def _turns(angle: float, lower: float, upper: float) -> list[float]:
    """All angles equal to this one, modulo a turn, in the limits; the wrapped one where there are none."""
    base = wrapped(float(angle))
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return [base] if lower - LIMIT_TOLERANCE <= base <= upper + LIMIT_TOLERANCE else []
    first = math.ceil((lower - LIMIT_TOLERANCE - base) / (2.0 * math.pi))
    last = math.floor((upper + LIMIT_TOLERANCE - base) / (2.0 * math.pi))
    return [min(max(base + 2.0 * math.pi * k, lower), upper) for k in range(first, last + 1)]


def _closest(angle: float, lower: float, upper: float) -> float:
    """The angle equal to this one, modulo a turn, that is nearest to the range."""
    fitting = _turns(angle, lower, upper)
    if fitting:
        return fitting[0]
    base = wrapped(float(angle))
    return min((base + 2.0 * math.pi * k for k in (-1, 0, 1)), key=lambda a: max(lower - a, a - upper))
