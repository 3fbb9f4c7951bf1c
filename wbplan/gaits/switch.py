"""Changing a limb between leg and arm while the robot walks (Zheng, section 4.1, figures 14 and 15).

Six feet stand on a regular hexagon, five on a regular pentagon of the same circle, with a side of it
towards the arm. One tripod steps to its places of the new polygon, then the other one does while the arm's
foot leaves the ground, or comes back to it. The body keeps going.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError, listing
from wbplan.gaits.building import Manner, Walk, build
from wbplan.gaits.gait import Gait
from wbplan.gaits.library import pentapod
from wbplan.gaits.manipulation import beside_way
from wbplan.gaits.schedule import Beat, Ground, Schedule, Step, flat
from wbplan.gaits.stance import Stance, Walker
from wbplan.paths import AS_IS, MinJerk, name_of, number
from wbplan.problem.script import Phase
from wbplan.problem.tasks import ComTask, PoseTask, PositionTask, PostureTask, Task

Array = NDArray[np.float64]
Fields = Mapping[str, Any]

#: Peak over mean speed of a motion of least jerk.
PEAK = 1.875


@final
@dataclass(frozen=True, eq=False)
class Switch:
    """The two stances of a hexapod one limb of which may be an arm, and the steps from one to the other.

    Args:
        walker: its six legs.
        arm: the limb that changes.
        radius: CR, of the circle through the feet [m].
        height: of the body [m].

    Attributes:
        hexagon: six feet, each in its own direction.
        pentagon: the five others, at 36, 108, 180, 252 and 324 degrees from the arm's direction.

    Raises:
        SpecError: there are not six legs, the limb is none of them, or a leg does not reach its place.
    """

    walker: Walker
    arm: str
    radius: float
    height: float
    hexagon: Stance = field(init=False)
    pentagon: Stance = field(init=False)

    def __post_init__(self) -> None:
        legs = self.walker.ring
        if len(legs) != 6 or self.arm not in legs:
            raise SpecError(f"Switch.arm: expected one of six legs, got {self.arm!r} of {listing(legs)}")
        six = self.walker.stance(radius=self.radius, height=self.height)
        first = math.atan2(six.feet[self.arm][1], six.feet[self.arm][0])
        angles = {leg: first - math.radians(36.0 + 72.0 * k) for k, leg in enumerate(self.others)}
        five = self.walker.stance(radius=self.radius, height=self.height, angles=angles)
        object.__setattr__(self, "hexagon", six)
        object.__setattr__(self, "pentagon", five.with_feet({}, without=(self.arm,)))

    @property
    def others(self) -> tuple[str, ...]:
        """The five other legs, clockwise from the arm."""
        ring = self.walker.ring[::-1]
        at = ring.index(self.arm)
        return (*ring[at + 1 :], *ring[:at])

    @property
    def mates(self) -> tuple[str, ...]:
        """The two other legs of the arm's tripod."""
        return self.others[1::2]

    @property
    def rest(self) -> tuple[str, ...]:
        """The other tripod."""
        return self.others[0::2]

    @property
    def hexapod(self) -> Gait:
        """The 3+3 gait, the arm's tripod first."""
        return Gait("3+3", ((self.arm, *self.mates), self.rest), self.walker.ring)

    def pentapod(self, name: str = "mixture") -> Gait:
        """A gait of the five legs: '4+1', '3+2' or 'mixture'."""
        return pentapod(self.others)[name]

    def to_pentapod(self) -> tuple[Beat, Beat]:
        """Figure 14: the other tripod steps to the pentagon, then the arm's mates do and the arm rises."""
        return (
            Beat(self.rest, stance=self.pentagon, name="to pentagon"),
            Beat(self.mates, raised=(self.arm,), stance=self.pentagon, name="to pentagon, arm rises"),
        )

    def to_hexapod(self) -> tuple[Beat, Beat]:
        """Figure 15: arm and mates step to the hexagon, then the other tripod does."""
        return (
            Beat((self.arm, *self.mates), stance=self.hexagon, name="to hexagon, arm lands"),
            Beat(self.rest, stance=self.hexagon, name="to hexagon"),
        )


@final
@dataclass(frozen=True, eq=False)
class Unfolding:
    """How a limb becomes an arm in the air, and a leg again: fields of the phases, one a step.

    It rises; its first joints turn it to where it has room; the groups of the other joints move one after
    the other (a group takes as many steps as its joints' speeds ask for); then it is in role 'arm'. It folds
    in the reverse order.

    Args:
        walker: the robot's legs.
        limb: the limb; its roles are 'leg' and 'arm'.
        pose: joint -> value [rad, m] once it is an arm; joints that the role holds may be left out.
        order: groups of joints that move while it is neither, in the order of unfolding.
        clear: joint -> value of the limb as a leg in the air, from which it unfolds.
        step_time: of a step [s].
        rise: how high the foot is lifted straight [m] before the limb turns.
        speed: share of the joints' speed limits that may be used.
        via: joint -> value at which it waits between two groups that both name it.

    Raises:
        SpecError: the limb has no such roles, a joint is none of its own, or `via` is not of those joints
            that two groups name.
    """

    walker: Walker
    limb: str
    pose: Mapping[str, float]
    order: tuple[tuple[str, ...], ...]
    clear: Mapping[str, float]
    step_time: float
    rise: float = 0.04
    speed: float = 0.9
    via: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        robot = self.walker.robot
        if not {"leg", "arm"} <= set(robot.roles.get(self.limb, {})):
            raise SpecError(f"Unfolding.limb: {self.limb!r} has no roles 'leg' and 'arm'")
        own = robot.limbs[self.limb]
        grouped = [name for group in self.order for name in group]
        named = (*self.pose, *self.clear, *grouped)
        strange = [name for name in named if name_of(name, "Unfolding: joint") not in own]
        if strange:
            raise SpecError(f"Unfolding: {listing(strange)} is no joint of {self.limb}: {listing(own)}")
        for key in ("step_time", "rise", "speed"):
            number(getattr(self, key), f"Unfolding.{key}", "a positive number", above=0.0)
        if {name for name in grouped if grouped.count(name) == 2} != set(self.via) or max(
            map(grouped.count, grouped), default=0
        ) > 2:
            raise SpecError(
                f"Unfolding.via: expected a value for each joint that two groups name, got {dict(self.via)}"
            )
        for key in ("pose", "clear", "via"):
            object.__setattr__(self, key, MappingProxyType(dict(getattr(self, key))))

    def out(self, foothold: Array) -> tuple[Fields, ...]:
        """From the step in which the foot leaves the ground to the one after which the limb is an arm.

        Args:
            foothold: that it leaves (3,) [m], world.
        """
        foot = self.walker.robot.feet[self.limb]
        above = np.asarray(foothold) + np.array([0.0, 0.0, self.rise])
        up = PositionTask(foot, MinJerk(AS_IS, above, self.step_time), weight=(0.0, 0.0, 1.0))
        found: list[Fields] = [
            {"hard": (up,), "soft": (self.posture(self.clear),)},
            {"soft": (self.posture(self._shoulder),)},
        ]
        places = self._places
        for k, (before, goal) in enumerate(pairwise(places)):
            last = k == len(self.order) - 1
            for driven in self._driven(before, goal, k):
                found.append({"soft": (self.posture(self._shoulder),), "driven": driven})
            if last:  # the role brings its own joints to their values, and sets the others free
                found[-1] = {"soft": (self.posture(self.pose),), "roles": {self.limb: "arm"}}
        return tuple(found)

    def back(self) -> tuple[Fields, ...]:
        """From the first step in which the limb folds to the last one before its foot lands."""
        found: list[Fields] = []
        for k, (goal, before) in reversed(list(enumerate(pairwise(self._places)))):
            shoulder = self._shoulder if k == len(self.order) - 1 else self.clear
            for driven in self._driven(before, goal, k):
                found.append({"soft": (self.posture(shoulder),), "driven": driven})
            if k == 0:
                found[-1] = {"soft": (self.posture(self.clear),), "roles": {self.limb: "leg"}}
        return tuple(found)

    def lowered(self, foothold: Array, body: Any, above: float = 0.012) -> Fields:
        """The step before the foot lands: it goes to a little above its foothold.

        Args:
            foothold: (3,) [m], world.
            body: pose of the body at the step's end.
            above: [m].

        Raises:
            SpecError: the foot cannot be there.
        """
        goal = np.asarray(foothold) + np.array([0.0, 0.0, above])
        there = body.actInv(goal)
        self.walker.require(self.limb, there, f"{above:g} m above its foothold")
        leg = self.walker.closed[self.limb]
        joints = leg.solve(there).nearest([self.clear.get(name, 0.0) for name in leg.joints]).joints
        over = PositionTask(
            self.walker.robot.feet[self.limb], MinJerk(AS_IS, goal, self.step_time), weight=50.0
        )
        return {"soft": (over, self.posture(dict(zip(leg.joints, joints, strict=True)), 0.1))}

    def posture(self, values: Mapping[str, float], weight: float = 1.0) -> PostureTask:
        """The limb's joints to values, from rest to rest in a step."""
        moves = {name: MinJerk(AS_IS, value, self.step_time) for name, value in values.items()}
        return PostureTask(moves, weight=weight, gain=10.0, name=self.limb)

    @property
    def _shoulder(self) -> dict[str, float]:
        """The pose's values of joints that are in no group."""
        grouped = {name for group in self.order for name in group}
        return {name: value for name, value in self.pose.items() if name not in grouped}

    @property
    def _places(self) -> list[dict[str, float]]:
        """Where the groups' joints are as a leg, and after each group as it unfolds."""
        found, as_arm = [self._as_leg], self._as_arm
        for k, group in enumerate(self.order):
            later = {name for other in self.order[k + 1 :] for name in other}
            found.append(found[-1] | {n: self.via[n] if n in later else as_arm[n] for n in group})
        return found

    @property
    def _as_arm(self) -> dict[str, float]:
        return self._grouped({**self.pose, **self.walker.robot.roles[self.limb]["arm"]}, "arm")

    @property
    def _as_leg(self) -> dict[str, float]:
        return self._grouped(dict(self.walker.robot.roles[self.limb]["leg"]), "leg")

    def _grouped(self, values: Mapping[str, float], role: str) -> dict[str, float]:
        names = [name for group in self.order for name in group]
        missing = [name for name in names if name not in values]
        if missing:
            raise SpecError(f"Unfolding: neither pose nor role '{role}' says where {listing(missing)} goes")
        return {name: values[name] for name in names}

    def _driven(self, start: Mapping[str, float], goal: Mapping[str, float], k: int) -> list[dict[str, Any]]:
        """Paths of all grouped joints in each step of group k's motion; those of other groups stay."""
        model = self.walker.robot.model
        need = max(
            PEAK
            * abs(goal[name] - start[name])
            / (self.speed * float(model.velocityLimit[self.walker.robot.joint_index(name)[1]]))
            for name in self.order[k]
        )
        count = max(1, math.ceil(need / self.step_time - 1e-9))
        return [
            {name: start[name] + (step + 1) / count * (goal[name] - start[name]) for name in goal}
            for step in range(count)
        ]


def perform(
    switch: Switch, made: Schedule, manner: Manner, acts: Mapping[int, Fields], ground: Ground = flat
) -> Walk:
    """Phases of a schedule in which a limb is an arm for a while.

    Beside what `build` does: a foot that comes out of the air lands from where it is; while a limb is raised
    the body keeps to its own nominal way, since the centre of mass moves with the limb; and a step's fields
    may hold 'body', tasks that stand for these.

    Args:
        switch: the stances; the walk starts on the hexagon.
        made: the schedule.
        manner: times, heights, margin.
        acts: number of a step, from 0 -> more fields of its phase.
        ground: its height [m] at x, y.

    Raises:
        SpecError: there is no such step.
        GaitError: see `build`.
    """
    strange = [k for k in acts if not 0 <= k < len(made.steps)]
    if strange:
        raise SpecError(f"perform: no step {strange[0]}; there are {len(made.steps)}, from 0")
    numbers = {step.name: k for k, step in enumerate(made.steps)}

    def fields(step: Step) -> Fields:
        given = acts.get(numbers.get(step.name, -1), {})
        return {key: value for key, value in given.items() if key != "body"}

    walk = build(switch.walker, made, switch.hexagon, manner, ground, fields)
    phases = list(walk.phases)
    for i, phase in enumerate(phases):
        k = numbers.get(phase.name)
        if k is None:
            continue
        lands = set(made.steps[k - 1].raised if k else ()) & set(made.steps[k].swing)
        for limb in lands:
            phase = _landing(phase, switch.walker.robot.feet[limb])
        given, step = acts.get(k, {}), made.steps[k]
        if "body" in given or step.raised or lands:
            body = given.get("body") or beside_way(
                switch.walker, made.course, step.begin, switch.height, across=30.0
            )
            own = tuple(given.get("soft", ()))
            soft = [item for item in phase.soft if item in own or not _moves_body(item, switch.walker.root)]
            phase = replace(phase, soft=(*soft, *body))
        phases[i] = phase
    return replace(walk, phases=tuple(phases))


def _landing(phase: Phase, foot: str) -> Phase:
    """The phase with a foot that comes from where it is."""

    def landing(task: Task) -> Task:
        if not (isinstance(task, PositionTask) and task.frame == foot):
            return task
        goal = task.path.at(phase.duration)
        return replace(task, target=MinJerk(AS_IS, goal, phase.duration))

    return replace(phase, hard=tuple(landing(task) for task in phase.hard))


def _moves_body(task: Any, root: str) -> bool:
    return isinstance(task, ComTask) or (isinstance(task, PoseTask) and task.frame == root)
