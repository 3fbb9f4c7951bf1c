"""From a gait, a track and the ground to phases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from wbplan.contacts import Contact
from wbplan.errors import GaitError, SpecError, listing
from wbplan.gaits.balance import Stay, Sway, largest_margins, sway
from wbplan.gaits.gait import Gait
from wbplan.gaits.schedule import Ground, Schedule, Step, beats_of, count_for, flat, schedule
from wbplan.gaits.stance import Stance, Walker
from wbplan.gaits.swing import CosineSwing, Excerpt, QuinticSwing
from wbplan.gaits.tracks import Track
from wbplan.geometry import support_polygon
from wbplan.limits import JointLimits, SupportPolygon
from wbplan.paths import number
from wbplan.robot import Robot
from wbplan.script import Phase, Script
from wbplan.state import State
from wbplan.tasks import ComTask, PoseTask, PositionTask, PostureTask, Task

Array = NDArray[np.float64]
Fields = Callable[[Step], Mapping[str, Any]]
SwingMaker = Callable[[Array, Array, float, float], QuinticSwing | CosineSwing]

#: Share of the largest margin that is asked for where none is given.
USUAL = 0.6


@final
@dataclass(frozen=True)
class Manner:
    """How a robot walks, whatever the gait.

    Args:
        step_time: of a step [s].
        height: how high feet are lifted over the higher end of their way [m].
        clearance: least height of a foot over the ground in the middle half of its way [m].
        margin: stability margin kept all through [m]; 0.6 of the largest where not given.
        friction: of the feet on the ground [-].
        speed: share of the joints' speed limits that may be used.
        follow: how much of the mean height of its footholds the body goes up and down with, 0 to 1.
        settle: time on all feet at both ends, in which the body may be shifted [s].
        swing: start, goal, height, duration -> path of a foot; `QuinticSwing` where not given.
    """

    step_time: float = 0.6
    height: float = 0.05
    clearance: float = 0.0
    margin: float | None = None
    friction: float = 0.7
    speed: float = 1.0
    follow: float = 1.0
    settle: float = 0.5
    swing: SwingMaker = QuinticSwing

    def __post_init__(self) -> None:
        for key in ("step_time", "settle"):
            number(getattr(self, key), f"Manner.{key}", "a positive time [s]", above=0.0)
        for key in ("height", "clearance", "follow"):
            number(getattr(self, key), f"Manner.{key}", "a number of 0 or more", least=0.0)
        if self.margin is not None:
            number(self.margin, "Manner.margin", "a finite margin [m]")


@final
@dataclass(frozen=True, eq=False)
class Walk:
    """A walk, ready to be planned.

    Attributes:
        robot: the robot.
        start: its state at the start.
        schedule: footholds and the body's nominal motion.
        phases: one for every step, and one on all feet before and after.
        com: centre of mass.
        margin: promised in every phase [m].
        gait: the gait, where there is one.
        stride: of the body in a cycle at full speed [m], of a gait.
    """

    robot: Robot
    start: State
    schedule: Schedule
    phases: tuple[Phase, ...]
    com: Sway
    margin: float
    gait: Gait | None = None
    stride: float | None = None

    @property
    def script(self) -> Script:
        """All phases, from the start."""
        return Script(self.phases, start=self.start)

    @property
    def speed(self) -> float:
        """Of the body between speeding up and slowing down [m/s]."""
        return self.schedule.course.speed


def walk(
    robot: Robot | Walker,
    gait: Gait,
    track: Track,
    stroke: float,
    *,
    stance: Stance | None = None,
    manner: Manner | None = None,
    ground: Ground = flat,
    place: Callable[[str, Array], Array] | None = None,
    fields: Fields | None = None,
) -> Walk:
    """A robot on a track in a gait.

    The body speeds up while every foot takes its first step and slows down from the last but one on; between,
    its speed is the gait's for the stroke. Where the track is not a whole number of steps long, strokes are a
    little shorter.

    Args:
        robot: the robot, or its legs in another pose than 'stand'.
        gait: of its limbs.
        track: where to.
        stroke: how far a foot goes in the body's frame while it stands [m], at most.
        stance: of the feet; as in the pose where not given.
        manner: times, heights, margin.
        ground: its height [m] at x, y.
        place: see `schedule`.
        fields: more fields of a step's phase (soft and hard tasks are added to its own).

    Raises:
        SpecError: the gait is of other limbs than the robot's.
        GaitError: no motion keeps the margin, or a leg does not reach; says in which step, how much margin
            there is, and what stride or stance would hold.
    """
    walker = robot if isinstance(robot, Walker) else Walker(robot)
    manner, stance = manner or Manner(), stance or walker.stance()
    strange = set(gait.legs) ^ set(stance.feet)
    if strange:
        raise SpecError(
            f"gait '{gait.name}': of legs {listing(gait.legs)}, the stance has {listing(list(stance.feet))}"
        )
    stroke = number(stroke, "walk: stroke", "a positive length [m]", above=0.0)

    def planned(share: float) -> Walk:
        stride = gait.stride(share * stroke)
        beats = beats_of(gait, count_for(gait, track.length, stride))
        speed = stride / (gait.step_count * manner.step_time)
        made = schedule(beats, stance, track, manner.step_time, ground, place, speed)
        return build(walker, made, stance, manner, ground, fields)

    try:
        done = planned(1.0)
    except GaitError as error:
        raise _with_a_way_out(error, planned, gait.stride(stroke)) from None
    return replace(done, gait=gait, stride=done.speed * gait.step_count * manner.step_time)


def _with_a_way_out(error: GaitError, planned: Callable[[float], Walk], stride: float) -> GaitError:
    """The same error with the longest stride that would hold."""
    low, high = 0.0, 1.0
    for share in (0.02, 0.5):
        if _holds(planned, share):
            low = share
        else:
            high = share
            break
    while high - low > 0.02 and low > 0.0:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _holds(planned, middle) else (low, middle)
    way = (
        f"a stride of {low * stride:.3f} m (of {stride:.3f} m) would hold"
        if low > 0.0
        else "no shorter stride would hold: widen the stance, ask for less margin, or pause between steps"
    )
    return GaitError(f"{error}; {way}", step=error.step, margin=error.margin, stride=low * stride or None)


def _holds(planned: Callable[[float], Walk], share: float) -> bool:
    try:
        planned(share)
    except GaitError:
        return False
    return True


def build(
    walker: Walker,
    made: Schedule,
    stance: Stance,
    manner: Manner,
    ground: Ground = flat,
    fields: Fields | None = None,
) -> Walk:
    """Phases of a schedule: feet through the air, the body over its support.

    Args:
        walker: the robot's legs.
        made: steps and the body's nominal motion.
        stance: at the start.
        manner: times, heights, margin.
        ground: its height [m] at x, y.
        fields: more fields of a step's phase.

    Raises:
        GaitError: see `walk`.
    """
    robot = walker.robot
    first = made.steps[0]
    feet = {**first.support, **{limb: ends[0] for limb, ends in first.swing.items()}}
    start = walker.stand(
        stance, {leg: float(foot[2]) for leg, foot in feet.items()}, _mean_height(feet) * manner.follow
    )
    steps = _with_ends(made, feet, manner)
    offset = (start.com - start.q[:3])[:2]
    lead = manner.settle
    course = made.course

    def nominal(times: Array) -> Array:
        x, y, yaw = course.places(times - lead).T
        c, s = np.cos(yaw), np.sin(yaw)
        return np.column_stack([x + c * offset[0] - s * offset[1], y + s * offset[0] + c * offset[1]])

    com, margin = _balanced(walker, steps, nominal, manner)
    _reach(walker, steps, com, course, offset, lead, stance, manner)
    heights = _heights(steps, stance.height, manner.follow)

    def com_points(times: Array) -> Array:
        return np.column_stack([com.at(times), np.zeros(len(times))])

    def body_points(times: Array) -> Array:
        return np.column_stack([np.zeros((len(times), 2)), heights(times)])

    def yaw(times: Array) -> Array:
        return np.asarray(course.places(times - lead)[:, 2])

    phases = []
    for step in steps:
        body = [
            ComTask(Excerpt(com_points, step.begin, step.duration), weight=(100.0, 100.0, 0.0)),
            PoseTask(
                walker.root,
                Excerpt(body_points, step.begin, step.duration, yaw),
                weight=((0.0, 0.0, 100.0), 50.0),
            ),
        ]
        phases.append(
            _phase(walker, step, body, margin, manner, ground, dict(fields(step)) if fields else {})
        )
    return Walk(robot, start, made, tuple(phases), com, margin)


def _phase(
    walker: Walker,
    step: Step,
    body: Sequence[Task],
    margin: float,
    manner: Manner,
    ground: Ground,
    more: dict[str, Any],
) -> Phase:
    robot = walker.robot
    swings = [
        PositionTask(robot.feet[limb], _swing(limb, ends, step, manner, ground))
        for limb, ends in step.swing.items()
    ]
    legs = {joint for limb in walker.legs for joint in robot.limbs[limb]}
    others = tuple(joint for joint in robot.joint_names if joint not in legs)
    rest = [PostureTask(walker.state, joints=others, weight=1.0)] if others else []
    return Phase(
        step.name,
        contacts=tuple(Contact(robot.feet[limb], friction=manner.friction) for limb in step.support),
        hard=(*swings, *more.pop("hard", ())),
        soft=(*more.pop("soft", rest), *body),
        limits=more.pop("limits", [JointLimits(speed=manner.speed), SupportPolygon(margin=margin)]),
        duration=step.duration,
        **more,
    )


def _swing(limb: str, ends: Array, step: Step, manner: Manner, ground: Ground) -> Any:
    """A foot's path, lifted until it clears the ground."""
    height = manner.height
    times = np.linspace(0.0, step.duration, 61)
    for _ in range(40):
        path = manner.swing(ends[0], ends[1], height, step.duration)
        points = path.points(times)
        above = points[:, 2] - np.array([ground(float(x), float(y)) for x, y in points[:, :2]])
        asked = np.where(
            (times > 0.25 * step.duration) & (times < 0.75 * step.duration), manner.clearance, 0.0
        )
        short = float((asked - above).max())
        if short <= 1e-9:
            return path
        height += max(short, 0.01)
    raise GaitError(
        f"step '{step.name}': no lift of '{limb}' up to {height:.3f} m clears the ground between "
        f"({ends[0][0]:.3f}, {ends[0][1]:.3f}) and ({ends[1][0]:.3f}, {ends[1][1]:.3f}) m"
    )


def _mean_height(feet: Mapping[str, Array]) -> float:
    return float(np.mean([foot[2] for foot in feet.values()]))


def _with_ends(made: Schedule, feet: Mapping[str, Array], manner: Manner) -> tuple[Step, ...]:
    """All steps, later by the time on all feet that comes first, and one such at the end."""
    lead = manner.settle
    moved = [Step(s.name, s.begin + lead, s.duration, s.swing, s.support, s.raised) for s in made.steps]
    before = Step("start", 0.0, lead, {}, feet)
    after = Step("end", moved[-1].end, lead, {}, made.feet, moved[-1].raised)
    return (before, *moved, after)


def _heights(steps: Sequence[Step], height: float, follow: float) -> PchipInterpolator:
    """Height of the body over time: at each boundary its share of the mean height of the footholds."""
    times, values = [], []
    for step in steps:
        feet = [*step.support.values(), *(ends[0] for ends in step.swing.values())]
        times.append(step.begin)
        values.append(height + follow * float(np.mean([foot[2] for foot in feet])))
    times.append(steps[-1].end)
    values.append(height + follow * float(np.mean([foot[2] for foot in steps[-1].support.values()])))
    values[0] = values[1]
    values[-2] = values[-1]
    return PchipInterpolator(times, values)


def _balanced(
    walker: Walker, steps: Sequence[Step], nominal: Callable[[Array], Array], manner: Manner
) -> tuple[Sway, float]:
    """The centre of mass's motion and the margin that it keeps."""
    stays = []
    for step in steps:
        try:
            polygon = support_polygon(np.array([foot[:2] for foot in step.support.values()]))
        except SpecError as error:
            raise GaitError(f"step '{step.name}': the body cannot be held: {error}") from None
        stays.append(Stay(step.begin, step.end, polygon))
    ends = nominal(np.array([steps[0].begin, steps[-1].end]))
    largest, common = largest_margins(stays, ends[0], ends[1])
    margin = USUAL * largest if manner.margin is None else manner.margin
    worst = int(np.argmin(common))
    found = (
        sway(stays, nominal, margin, manner.step_time / 2.0) if largest > 0.0 and margin <= largest else None
    )
    if found is None:
        asked = "some margin" if manner.margin is None else f"a margin of {manner.margin:.4f} m"
        raise GaitError(
            f"step '{steps[worst].name}': the body cannot be held with {asked}: the largest there is from "
            f"this step to the next is {common[worst]:.4f} m, {largest:.4f} m all through",
            step=max(worst - 1, 0),
            margin=float(min(largest, common[worst])),
        )
    return found, margin


def _reach(
    walker: Walker,
    steps: Sequence[Step],
    com: Sway,
    course: Any,
    offset: Array,
    lead: float,
    stance: Stance,
    manner: Manner,
) -> None:
    """Refuse a walk in which a leg cannot reach its foothold, with the body where it is planned to be."""
    heights = _heights(steps, stance.height, manner.follow)
    for k, step in enumerate(steps):
        times = np.array([step.begin, step.begin + 0.5 * step.duration, step.end])
        for j, (t, c, place, z) in enumerate(
            zip(times, com.at(times), course.places(times - lead), heights(times), strict=True)
        ):
            turn = np.asarray(pin.utils.rotate("z", float(place[2])))
            body = pin.SE3(turn, np.array([*(c - turn[:2, :2] @ offset), float(z)]))
            feet = dict(step.support)
            if j != 1:
                feet |= {limb: ends[j // 2] for limb, ends in step.swing.items()}
            for limb, foot in feet.items():
                found = walker.closed[limb].solve(body.actInv(foot)) if limb in walker.closed else None
                if found is not None and not found.within:
                    raise GaitError(
                        f"step '{step.name}', at {t:.2f} s: '{limb}' cannot reach its foothold: "
                        f"{found.reason}",
                        step=max(k - 1, 0),
                    )
