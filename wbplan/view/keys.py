"""Which samples of a motion an animation needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Pictures a second.
RATE = 30.0
#: Positions [m] and quaternions are rounded to this in the animation, far below a pixel.
FINE = 1e-5


def pick(time: Array, phase: NDArray[np.int64]) -> NDArray[np.int64]:
    """Samples that are shown: about `RATE` a second, both sides of every change of phase, first and last."""
    picture = np.floor((time - time[0]) * RATE + 1e-6)
    change = np.diff(phase, prepend=phase[:1]) != 0
    wanted = (np.diff(picture, prepend=-1.0) > 0) | change | np.append(change[1:], True)
    return np.flatnonzero(wanted)


def changes(values: Array) -> NDArray[np.int64]:
    """Keys (N, k) that are needed: all but those between two equal ones."""
    still = (values[1:] == values[:-1]).all(axis=1)
    needed = np.ones(len(values), dtype=bool)
    needed[1:-1] = ~(still[:-1] & still[1:])
    return np.flatnonzero(needed)


def apart(places: Array, step: float) -> NDArray[np.int64]:
    """Indices of places (N, 3) at least a step [m] from the one before, and the last."""
    kept = [0]
    for i in range(1, len(places)):
        if np.linalg.norm(places[i] - places[kept[-1]]) >= step:
            kept.append(i)
    if kept[-1] != len(places) - 1:
        kept.append(len(places) - 1)
    return np.array(kept)


def quaternions(rotations: Array) -> Array:
    """(N, 3, 3) -> (N, 4), x y z w."""
    return np.array([pin.Quaternion(R).coeffs() for R in rotations])


def holding(phases: Iterable[Mapping[str, Any]]) -> Iterable[str]:
    """The frames that hold something or close a loop."""
    for phase in phases:
        for closure in phase.get("closures", ()):
            yield from (closure["frame_a"], closure["frame_b"])
        for carried in phase.get("carried", ()):
            yield carried["frame"]
