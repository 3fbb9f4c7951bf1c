"""Inequalities that a phase keeps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, final

from wbplan.errors import SpecError
from wbplan.obstacles import Obstacle, Terrain
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
            effort limit and the inertia that the joint has to move (see `wbplan.compiled.acceleration`).
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
class Forces:
    """Contact forces exist that carry the motion, within friction and what the servos can give.

    At every sample, with the plan's own accelerations (means over a tenth of a second): forces in the
    friction cones meet Newton's and Euler's equations, use at most `friction` of the friction and leave the
    joints at most `torque` of the URDF's effort. They are looked for once the motion is planned; if there are
    none, there is no plan. Without this limit a plan promises shares of 1 where they hold, and warns where
    not.

    Args:
        friction: share of the contacts' friction that may be used, in (0, 1].
        torque: share of the joints' effort that may be used, in (0, 1].
    """

    friction: float = 1.0
    torque: float = 1.0

    def __post_init__(self) -> None:
        for name in ("friction", "torque"):
            share = number(getattr(self, name), f"Forces.{name}", "a share in (0, 1]", above=0.0)
            if share > 1.0:
                raise SpecError(f"Forces.{name}: expected a share in (0, 1], got {share}")
            object.__setattr__(self, name, share)


@final
@dataclass(frozen=True)
class SupportPolygon:
    """The CoM of robot and carried bodies stays `margin` [m] inside the hull of the phase's contacts.

    N (c + J dq) <= d - margin, with N the unit normals of the edges, in the horizontal plane.
    Where the contacts do not lie in one plane that is their ground, or the phase pushes on something, the
    static-equilibrium region (see `wbplan.statics`) stands for the hull.
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


def _reaches(limit: SelfCollision | Obstacles) -> None:
    """Checks and keeps `distance` and `influence`."""
    at = type(limit).__name__
    distance = number(limit.distance, f"{at}.distance", "metres of 0 or more", least=0.0)
    influence = number(limit.influence, f"{at}.influence", "metres")
    if not influence > distance:
        raise SpecError(f"{at}.influence: expected more than the distance {distance} m, got {influence}")
    object.__setattr__(limit, "distance", distance)
    object.__setattr__(limit, "influence", influence)


@final
@dataclass(frozen=True)
class SelfCollision:
    """Links, and the bodies that they carry, stay `distance` [m] from each other.

    n^T (J_b - J_a) dq >= -gain (d - distance) for each pair nearer than `influence`, with d its distance, n
    the unit normal from a to b and J the Jacobians of the nearest points. Pairs that the SRDF leaves out,
    neighbours in the chain, and a body with what holds it are not looked at. Nearer than `distance` at
    first, a pair moves outward and never inward.

    Args:
        distance: [m].
        influence: [m], pairs further apart than this have no row.
        except_for: pairs of links that are made to lie closer, as a folded arm in its cradle: they may touch,
            but not go into each other.

    Raises:
        SpecError: a field is not what it has to be.
    """

    distance: float = 0.005
    influence: float = 0.05
    except_for: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        _reaches(self)
        what = "SelfCollision.except_for"
        excepted = [
            _exception(item, what) for item in _listed(self.except_for, f"{what}: expected a list of pairs")
        ]
        for item in excepted:
            if isinstance(item, str):
                raise SpecError(f"{what}: expected pairs of links, got {item!r}")
        object.__setattr__(self, "except_for", tuple(excepted))


@final
@dataclass(frozen=True, eq=False)
class Obstacles:
    """Links, and the bodies that they carry, stay `distance` [m] from what stands in the world.

    Rows as those of `SelfCollision`. What stands in the world is `shapes`, and every body of the script that
    is not carried. Feet, and what `except_for` names, may touch; they may not go in.

    Args:
        shapes: the obstacles; the ground is one of them. They are also the phase's terrain.
        distance: [m].
        influence: [m], pairs further apart than this have no row.
        except_for: frames (of links, or bodies) that may touch any obstacle, or pairs (frame, obstacle).

    Raises:
        SpecError: a field is not what it has to be, or two obstacles have one name.
    """

    shapes: tuple[Obstacle, ...] = ()
    distance: float = 0.005
    influence: float = 0.05
    except_for: tuple[str | tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        _reaches(self)
        shapes = _listed(self.shapes, "Obstacles.shapes: expected a list of Obstacle")
        for item in shapes:
            if not isinstance(item, Obstacle):
                raise SpecError(f"Obstacles.shapes: expected Obstacle, got {item!r}")
        names = [item.name for item in shapes]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise SpecError(f"Obstacles.shapes: named more than once: {', '.join(twice)}")
        excepted = _listed(self.except_for, "Obstacles.except_for: expected a list of frames")
        object.__setattr__(self, "shapes", shapes)
        object.__setattr__(
            self, "except_for", tuple(_exception(item, "Obstacles.except_for") for item in excepted)
        )

    @cached_property
    def terrain(self) -> Terrain:
        """The obstacles seen from above."""
        return Terrain(self.shapes)


def _listed(given: object, what: str) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise SpecError(f"{what}, got {given!r}")
    return tuple(given)


def _exception(item: object, what: str) -> str | tuple[str, str]:
    if isinstance(item, list | tuple):
        if len(item) != 2:
            raise SpecError(f"{what}: expected a name or two, got {item!r}")
        return name_of(item[0], what), name_of(item[1], what)
    return name_of(item, what)
