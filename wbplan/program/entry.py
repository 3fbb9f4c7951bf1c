"""How a robot comes into a phase: whether its joints can stop before their limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SolveError, SpecError
from wbplan.program.joint_box import BRAKING, JointBox, brake

Array = NDArray[np.float64]

#: How far [rad, m] a joint may be beyond its limit by rounding.
ROUNDING = 1e-9


def check_stops(phase: CompiledPhase, box: JointBox, q: Array) -> None:
    """Refuse a start from which a joint leaves its limits, however hard it brakes.

    Args:
        phase: the phase.
        box: knows the steps before the phase.
        q: (nq,) where it starts.

    Raises:
        SpecError: a joint is too fast for the acceleration or jerk that the phase lets it brake with.
    """
    if phase.phase.joint_limits is None:
        return
    box.fill(q, np.zeros(0), np.zeros(0))
    if box.lost >= 0:
        raise SpecError(
            f"phase '{phase.phase.name}': joint '{_name(phase, box.lost)}' is too fast when the phase "
            "begins: with the phase's jerk it cannot stop before its limit"
        )
    gaps = _gaps(phase, box, q)
    least = np.abs(box.previous) - box.most  # what it still goes in the first tick
    for i in np.flatnonzero(least > 0.0):
        room = brake(gaps[i], 2.0 * BRAKING * box.most[i]) if gaps[i] > 0.0 else 0.0
        if least[i] > room + ROUNDING:
            raise SpecError(
                f"phase '{phase.phase.name}': joint '{_name(phase, i)}' moves at "
                f"{abs(box.previous[i]) / box.dt:.3g} when the phase begins, {gaps[i]:.3g} from its limit: "
                f"with an acceleration of {box.most[i] / box.dt**2:.3g} it cannot stop before it"
            )


def check_inside(phase: CompiledPhase, box: JointBox, q: Array, new: Array) -> None:
    """Refuse a step that takes a joint (further) out of its limits, which only a bound on jerk can force.

    Raises:
        SolveError: the joint would have to slow down faster.
    """
    here, there = _gaps(phase, box, q), _gaps(phase, box, new)
    out = np.flatnonzero(there < np.minimum(here, 0.0) - ROUNDING)
    if out.size:
        raise SolveError(
            f"phase '{phase.phase.name}': joint '{_name(phase, out[0])}' came too fast to stop before its "
            "limit within its jerk"
        )


def _name(phase: CompiledPhase, joint: int) -> str:
    """Of a free joint."""
    name: str = phase.robot.joint_names[phase.free[6 + joint] - 6]
    return name


def _gaps(phase: CompiledPhase, box: JointBox, q: Array) -> Array:
    """(n,) what is left of each free joint's way to the limit that its last step led to."""
    columns, model = box.q_index, phase.model
    above, below = (
        model.upperPositionLimit[columns] - q[columns],
        q[columns] - model.lowerPositionLimit[columns],
    )
    gaps: Array = np.where(box.previous > 0.0, above, below)
    return gaps
