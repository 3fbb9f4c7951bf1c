"""Inequalities that a phase keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

from wbplan.errors import SpecError
from wbplan.paths import name_of, number

#: One bound for every joint, or a joint's name -> its bound.
Bounds = float | Mapping[str, float]


@final
@dataclass(frozen=True)
class JointLimits:
    """Joint positions, speeds and accelerations within limits, as one box on the tick's step.

    A tick's velocity v, after v_before, keeps

        |v| <= speed x URDF's speed limit,    |v - v_before| <= acceleration dt,

    and never so fast towards a position limit that braking, in steps of dt and with half of the acceleration,
    could not stop before it. So the three never contradict each other. A start outside the position limits
    comes back inside.

    Args:
        speed: fraction of the URDF's speed limits that may be used, in (0, 1].
        acceleration: [rad/s^2, m/s^2], for all joints or by joint; where none is given, from the URDF's
            effort limit and the inertia that the joint has to move (see `wbplan.acceleration`).
        jerk: [rad/s^3, m/s^3], for all joints or by joint; no bound where none is given. Position and speed
            limits are then approached exponentially, which is slower than it would have to be.

    Source: A. Del Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of
    robot manipulators", 2018.
    """

    speed: float = 1.0
    acceleration: Bounds | None = None
    jerk: Bounds | None = None

    def __post_init__(self) -> None:
        speed = number(self.speed, "JointLimits.speed", "a fraction in (0, 1]", above=0.0)
        if speed > 1.0:
            raise SpecError(f"JointLimits.speed: expected a fraction in (0, 1], got {speed}")
        object.__setattr__(self, "speed", speed)
        for name in ("acceleration", "jerk"):
            object.__setattr__(self, name, _bounds(getattr(self, name), f"JointLimits.{name}"))


def _bounds(given: Any, what: str) -> Bounds | None:
    """A bound or bounds by joint, checked; the mapping becomes read-only."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        return number(given, what, "a finite positive bound, or joints and their bounds", above=0.0)
    return MappingProxyType(
        {
            name_of(joint, f"{what}: key"): number(
                bound, f"{what}['{joint}']", "a finite positive bound", above=0.0
            )
            for joint, bound in given.items()
        }
    )


@final
@dataclass(frozen=True)
class SupportPolygon:
    """The CoM of robot and carried bodies stays `margin` [m] inside the hull of the phase's contacts.

    N (c + J dq) <= d - margin, with N the unit normals of the edges, in the horizontal plane.
    A CoM that starts outside moves inward at `recovery_speed`, and never outward, until it is inside.

    Args:
        margin: [m]; negative lets the CoM leave the polygon by that much.
        recovery_speed: [m/s].
    """

    margin: float = 0.02
    recovery_speed: float = 0.05

    def __post_init__(self) -> None:
        margin = number(self.margin, "SupportPolygon.margin", "a finite number of metres")
        speed = number(
            self.recovery_speed, "SupportPolygon.recovery_speed", "a finite positive speed [m/s]", above=0.0
        )
        object.__setattr__(self, "margin", margin)
        object.__setattr__(self, "recovery_speed", speed)
