"""Where feet stand against the body, and the walking modes of radial robots."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.collision import has_shapes, sole
from wbplan.errors import SpecError, listing
from wbplan.mechanism import Platform, ThreeJointLeg
from wbplan.paths import name_of, number
from wbplan.robot import Robot
from wbplan.state import State

Array = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Mode:
    """A walking mode of a hexapod with two legs on its x axis (Zhuang, section 4).

    Attributes:
        name: of the mode.
        lean: initial angle of the abductors [rad], between the four outer legs and the x axis: 0 has them
            parallel to it; None leaves the legs as in the pose.
        heading: of travel against the body's x axis [rad].
    """

    name: str
    lean: float | None
    heading: float


CRAB = Mode("crab", 0.0, 0.0)
ANT = Mode("ant", 0.0, 0.5 * math.pi)
MIXED_I = Mode("mixed1", math.pi / 3.0, 0.0)
MIXED_II = Mode("mixed2", math.pi / 3.0, 0.5 * math.pi)
#: Modes by name; 'free' leaves the legs as in the robot's pose and goes along x.
MODES: Mapping[str, Mode] = MappingProxyType(
    {m.name: m for m in (Mode("free", None, 0.0), CRAB, ANT, MIXED_I, MIXED_II)}
)


def mode_named(name: str) -> Mode:
    """A walking mode by name.

    Raises:
        SpecError: there is none.
    """
    if name not in MODES:
        raise SpecError(f"no walking mode '{name}'; there are: {listing(list(MODES))}")
    return MODES[name]


@final
@dataclass(frozen=True, eq=False)
class Stance:
    """Feet against the body's origin, projected to the ground, and the body's height.

    Attributes:
        feet: limb -> (2,) [m] in the level body's axes.
        height: of the body's origin above the feet [m].
    """

    feet: Mapping[str, Array]
    height: float

    def __post_init__(self) -> None:
        feet = {}
        for limb, foot in self.feet.items():
            place = np.array(foot, dtype=np.float64)[:2]
            if place.shape != (2,) or not np.isfinite(place).all():
                raise SpecError(f"Stance.feet['{limb}']: expected two finite numbers [m], got {foot}")
            place.setflags(write=False)
            feet[limb] = place
        object.__setattr__(self, "feet", MappingProxyType(feet))
        number(self.height, "Stance.height", "a finite height [m]")

    @property
    def radius(self) -> float:
        """Mean distance of the feet from the body [m]; CR of a regular one."""
        return float(np.mean([np.linalg.norm(foot) for foot in self.feet.values()]))

    def with_feet(self, feet: Mapping[str, Any], without: Sequence[str] = ()) -> Stance:
        """The stance with some feet elsewhere, or not there."""
        kept = {limb: foot for limb, foot in {**self.feet, **feet}.items() if limb not in without}
        return Stance(kept, self.height)


#: How high raised limbs are held, as a share of the body's height.
LIFTED = 0.3


@final
@dataclass(frozen=True, eq=False)
class Walker:
    """A robot's legs as walking sees them.

    Args:
        robot: the robot.
        pose: named pose that it walks from.
        raised: limbs that stand in the pose, but are held in the air instead: arms, or spare ones.

    Attributes:
        state: the robot in the pose, raised limbs' feet off the ground.

    Raises:
        SpecError: fewer than three feet stand, or a raised limb is none of those that stand in the pose.
    """

    robot: Robot
    pose: str = "stand"
    raised: tuple[str, ...] = ()
    state: State = field(init=False)

    def __post_init__(self) -> None:
        put = partial(object.__setattr__, self)
        put("raised", tuple(name_of(limb, "Walker.raised") for limb in self.raised))
        put("state", self._lifted(self.robot.state(self.pose)))
        if len(self.legs) < 3:
            raise SpecError(
                f"robot '{self.robot.name}' has {len(self.legs)} feet in pose '{self.pose}'; "
                "walking needs three or more"
            )

    @property
    def legs(self) -> tuple[str, ...]:
        """Limbs that stand, in the robot's order: in the pose, but for raised ones."""
        standing = self.robot.standing_feet(self.state.q)
        limbs = self.robot.feet.items()
        return tuple(limb for limb, foot in limbs if foot in standing and limb not in self.raised)

    def _lifted(self, stands: State) -> State:
        """The pose with the raised limbs turned up by their second joint."""
        if not self.raised:
            return stands
        standing = self.robot.standing_feet(stands.q)
        legs = [limb for limb, foot in self.robot.feet.items() if foot in standing]
        forms = Platform.of_robot(self.robot, stands, legs).legs
        q = np.array(stands.q)
        for limb in self.raised:
            if limb not in forms:
                known = listing(list(forms))
                raise SpecError(f"Walker.raised: '{limb}' is no leg of three joints that stands: {known}")
            form, index = forms[limb], [self.robot.joint_index(joint)[0] for joint in forms[limb].joints]
            turns = np.concatenate([np.linspace(q[index[1]], end[1], 60) for end in (form.lower, form.upper)])
            heights = np.array([form.foot([q[index[0]], turn, q[index[2]]])[2] for turn in turns])
            rises = heights - form.foot(q[index])[2]
            # The least turn that is enough, else the one that lifts most.
            far = rises >= min(LIFTED * q[2], rises.max())
            q[index[1]] = turns[far][np.abs(turns[far] - q[index[1]]).argmin()]
        return State(self.robot.model, q)

    @property
    def ring(self) -> tuple[str, ...]:
        """The same counter-clockwise round the body, the first one at or after the +y axis.

        Where one limb is raised, the first one is next to it.

        Of a hexapod with two legs on the x axis the first three are those behind the y axis, as in
        Zhuang's Table 2.
        """
        return tuple(
            sorted(self.legs, key=lambda leg: (self._direction(leg) - self._first) % (2.0 * math.pi))
        )

    @property
    def _first(self) -> float:
        """Direction from which legs are counted [rad]."""
        return self._direction(self.raised[0]) if len(self.raised) == 1 else 0.5 * math.pi

    def _direction(self, limb: str) -> float:
        """Where a limb's foot is in the pose, seen from the body [rad]."""
        x, y = self.foot(limb)
        return math.atan2(y, x)

    @property
    def root(self) -> str:
        """Frame of the root link."""
        frames = self.robot.model.frames
        return str(next(f.name for f in frames if f.parentJoint == 1 and f.name != "root_joint"))

    @cached_property
    def closed(self) -> Mapping[str, ThreeJointLeg]:
        """Closed forms of the legs, in the pose's roles."""
        return Platform.of_robot(self.robot, self.state, self.legs).legs

    @cached_property
    def solid(self) -> bool:
        """Whether the robot has collision shapes, so that distances can be kept."""
        return has_shapes(self.robot)

    @cached_property
    def sole(self) -> float:
        """How far below the feet's frames the ground is [m]; see `collision.sole`."""
        if not self.solid:
            return 0.0
        return max(sole(self.robot, self.robot.feet[leg]) for leg in self.legs)

    def foot(self, leg: str) -> Array:
        """A foot in the pose, against the body's origin (2,) [m]."""
        there = self.state.pose(self.robot.feet[leg]).translation - self.state.q[:3]
        return np.asarray(there[:2])

    def hip(self, leg: str) -> Array:
        """Where a leg begins, in the body (2,) [m]."""
        return np.asarray(self._leg(leg).placement.translation[:2])

    def _leg(self, leg: str) -> ThreeJointLeg:
        if leg not in self.closed:
            raise SpecError(
                f"robot '{self.robot.name}': leg '{leg}' has no closed form; expected three joints, the last "
                "two parallel and square to the first"
            )
        return self.closed[leg]

    def stance(
        self,
        lean: float | None = None,
        radius: float | None = None,
        height: float | None = None,
        angles: Mapping[str, float] | None = None,
        even: float = 0.0,
    ) -> Stance:
        """Where the feet stand: as in the pose, or on a circle, or with the outer legs turned.

        Args:
            lean: angle between the outer legs and the x axis [rad], see `Mode`; the feet stay as far from
                their hips as in the pose.
            radius: CR, of the circle that all feet stand on [m], each in its direction.
            height: of the body's origin [m]; the pose's where not given.
            angles: leg -> direction from the body [rad], for feet on the circle.
            even: share, 0 to 1, by which the feet on the circle close the gap that a raised limb leaves; at 1
                they stand evenly about it.

        Raises:
            SpecError: both `lean` and a circle are given, there is not one gap, or a leg cannot reach its
                place.
        """
        if lean is not None and (radius is not None or angles or even):
            raise SpecError("stance: give lean, or a circle (radius, angles, even), not both")
        if even:
            angles = {**self._closing(even), **dict(angles or {})}
        feet = {leg: self.foot(leg) for leg in self.legs}
        if lean is not None:
            feet = {leg: self._leaning(leg, foot, lean) for leg, foot in feet.items()}
        if radius is not None or angles:
            circle = (
                radius if radius is not None else float(np.mean([np.linalg.norm(f) for f in feet.values()]))
            )
            turned = {leg: math.atan2(f[1], f[0]) for leg, f in feet.items()} | dict(angles or {})
            feet = {leg: circle * np.array([math.cos(a), math.sin(a)]) for leg, a in turned.items()}
        ground = self.state.pose(self.robot.feet[self.legs[0]]).translation[2]
        stance = Stance(feet, float(self.state.q[2] - ground) if height is None else height)
        for leg, foot in stance.feet.items():
            self.require(leg, np.array([*foot, -stance.height]), "its stance")
        return stance

    def _closing(self, share: float) -> dict[str, float]:
        """Directions of the feet that close the gap of a raised limb by a share [rad]."""
        share = number(share, "stance: even", "a share of 0 to 1", least=0.0)
        if len(self.raised) != 1 or share > 1.0:
            raise SpecError(f"stance: even={share:g} needs one raised limb and a share of 0 to 1")
        full, found = 2.0 * math.pi, {}
        for k, leg in enumerate(self.ring):
            own = (self._direction(leg) - self._first) % full
            found[leg] = self._first + own + share * (full * (k + 0.5) / len(self.legs) - own)
        return found

    def _leaning(self, leg: str, foot: Array, lean: float) -> Array:
        hip = self.hip(leg)
        side = math.copysign(1.0, hip[1]) if abs(hip[1]) > 0.05 * float(np.linalg.norm(hip)) else 0.0
        ahead = math.copysign(1.0, hip[0])
        reach = float(np.linalg.norm(foot - hip))
        return np.asarray(hip + reach * np.array([ahead * math.cos(side * lean), math.sin(side * lean)]))

    def require(self, leg: str, foot: Array, what: str) -> None:
        """Refuse a place (3,) [m] in the body that a leg's foot cannot reach.

        Raises:
            SpecError: says why.
        """
        found = self._leg(leg).solve(foot)
        if not found.within:
            raise SpecError(f"leg '{leg}' cannot reach {what}: {found.reason}")

    def stand(self, stance: Stance, ground: Mapping[str, float] | None = None, raised: float = 0.0) -> State:
        """The robot level over the origin with its feet at a stance.

        Args:
            stance: where the feet stand.
            ground: leg -> height of the ground under its foot [m]; 0 where not given.
            raised: how much higher the body is than the stance has it [m].

        Raises:
            SpecError: a leg cannot reach its place.
        """
        q = np.array(self.state.q)
        q[:3] = 0.0, 0.0, stance.height + raised
        q[3:7] = 0.0, 0.0, 0.0, 1.0
        for leg, foot in stance.feet.items():
            there = np.array([*foot, (ground or {}).get(leg, 0.0) - q[2]])
            self.require(leg, there, "its stance")
            index = [self.robot.joint_index(joint)[0] for joint in self._leg(leg).joints]
            q[index] = self._leg(leg).solve(there).nearest(q[index]).joints
        return State(self.robot.model, q)
