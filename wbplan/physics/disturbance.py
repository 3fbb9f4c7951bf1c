"""What is other than planned: one draw of every uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final


@final
@dataclass(frozen=True)
class Push:
    """A force on the base for a while.

    Attributes:
        time: when it starts [s].
        force: (3,) [N], world.
        seconds: how long.
    """

    time: float
    force: tuple[float, float, float]
    seconds: float = 0.1


@final
@dataclass(frozen=True)
class Disturbance:
    """How one simulated world differs from the planned one; as it stands, not at all.

    Attributes:
        mass: factor on the mass and inertia of all links.
        com: shift of the base's centre of mass [m], base frame.
        object_mass: factor on the objects' masses.
        object_com: shift of the objects' centres of mass [m], object frame.
        friction: factor on all friction.
        gain: factor on the servos' stiffness.
        latency: the servos get their targets this much later [s].
        tilt: slope of the whole ground about x and y [rad].
        pushes: forces on the base.
    """

    mass: float = 1.0
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    object_mass: float = 1.0
    object_com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 1.0
    gain: float = 1.0
    latency: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    pushes: tuple[Push, ...] = field(default_factory=tuple)
