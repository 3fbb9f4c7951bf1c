"""Joints whose motion is given: whether it starts as they move, and keeps their acceleration limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SpecError
from wbplan.paths import ask

Array = NDArray[np.float64]

#: Rounding, against an acceleration limit [rad/s^2, m/s^2].
SLACK = 1e-6


def check_given(compiled: CompiledPhase, velocity: Array, dt: float) -> None:
    """Refuse a given motion that no tick can follow within its joint's acceleration limit.

    Args:
        compiled: the phase.
        velocity: (nv,) when it begins [m/s, rad/s].
        dt: length of a tick [s].

    Raises:
        SpecError: a joint would have to change its speed too fast, at the start or on the way.
    """
    if compiled.phase.joint_limits is None:
        return
    for driven in compiled.driven:
        before, bound = float(velocity[6 + driven.joint]), float(compiled.acceleration[driven.joint])
        ticks = 1 if driven.path.constant else max(1, int(np.ceil(compiled.phase.duration / dt - 1e-9)))
        places = np.array([float(ask(driven.path, k * dt)) for k in range(ticks + 1)])
        change = np.abs(np.diff([before, *(np.diff(places) / dt)])) / dt
        worst = int(change.argmax())
        if change[worst] > bound + SLACK:
            name = compiled.robot.joint_names[driven.joint]
            moves = f", which moves at {before:.3g} when the phase begins," if worst == 0 else ""
            raise SpecError(
                f"phase '{compiled.phase.name}': joint '{name}'{moves} would have to change its speed by "
                f"{change[worst]:.3g} per second at {worst * dt:.3g} s, its limit is {bound:.3g}; let its "
                "motion take longer, begin and end at rest, or be at rest before it"
            )
