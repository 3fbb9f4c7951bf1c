"""Phases of a schedule: feet through the air, the body over its support."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, PchipInterpolator

from wbplan.errors import GaitError, SpecError
from wbplan.gaits.balance import Stay, Sway, common_margins, largest_margin, sway
from wbplan.gaits.gait import Gait
from wbplan.gaits.ground import normal_at
from wbplan.gaits.reach import Fastest, follow
from wbplan.gaits.schedule import Ground, Schedule, Step, flat
from wbplan.gaits.stance import Stance, Walker
from wbplan.gaits.swing import CosineSwing, Excerpt, QuinticSwing
from wbplan.geometry import support_polygon
from wbplan.paths import number
from wbplan.problem.contacts import Contact
from wbplan.problem.limits import JointLimits, SupportPolygon
from wbplan.problem.script import Phase, Script
from wbplan.problem.tasks import ComTask, PoseTask, PositionTask, PostureTask, Task
from wbplan.robot import Robot
from wbplan.state import State

Array = NDArray[np.float64]
Fields = Callable[[Step], Mapping[str, Any]]
SwingMaker = Callable[[Array, Array, float, float], QuinticSwing | CosineSwing]

#: Share of the largest margin that is asked for where none is given.
USUAL = 0.5
#: Share of that margin that is planned but not promised: what keeps links apart may push the body aside.
ASIDE = 0.03
#: Moments of a swing at which its height over the ground is looked at.
LOOKS = 61


@final
@dataclass(frozen=True)
class Manner:
    """How a robot walks, whatever the gait.

    Args:
        step_time: of the longest swing [s]; as short as seven tenths of the joints' speed and gentle feet
            allow where not given.
        height: how high feet are lifted over the higher end of their way [m].
        clearance: least height of a foot over the ground in the middle half of its way [m].
        margin: stability margin kept all through [m]; almost half the largest if not given (a quarter where
            legs do not reach far enough for the body's sway then).
        friction: of the feet on the ground [-].
        speed: share of the joints' speed limits that may be used.
        follow: how much of the mean height of its footholds the body goes up and down with, 0 to 1.
        settle: time on all feet at both ends, in which the body may be shifted, in step times.
        swing: start, goal, height, duration -> path of a foot; `QuinticSwing` where not given.
        limits: of every phase, beside joints' limits and support polygon.
    """

    step_time: float | None = None
    height: float = 0.05
    clearance: float = 0.0
    margin: float | None = None
    friction: float = 0.7
    speed: float = 1.0
    follow: float = 1.0
    settle: float = 1.0
    swing: SwingMaker = QuinticSwing
    limits: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        if self.step_time is not None:
            number(self.step_time, "Manner.step_time", "a positive time [s]", above=0.0)
        number(self.settle, "Manner.settle", "a positive number of step times", above=0.0)
        for key in ("height", "clearance", "follow"):
            number(getattr(self, key), f"Manner.{key}", "a number of 0 or more", least=0.0)
        if self.margin is not None:
            number(self.margin, "Manner.margin", "a finite margin [m]")
        JointLimits(speed=self.speed)  # refuses what is no share

    @property
    def beat(self) -> float:
        """Time of a step [s], 1 where it is not given."""
        return 1.0 if self.step_time is None else self.step_time

    @property
    def rest(self) -> float:
        """Time on all feet at either end [s]."""
        return self.beat * self.settle


@final
@dataclass(frozen=True, eq=False)
class Walk:
    """A walk, ready to be planned.

    Attributes:
        robot: the robot.
        start: its state at the start.
        schedule: footholds and the body's nominal motion, which begins after the first phase.
        steps: all steps, that on all feet before and that after too.
        phases: one for every step.
        com: centre of mass.
        margin: promised in every phase [m].
        fastest: the joint nearest to its speed limit.
        gait: the gait, where there is one.
        stride: of the body in a cycle at full speed [m], of a gait.
    """

    robot: Robot
    start: State
    schedule: Schedule
    steps: tuple[Step, ...]
    phases: tuple[Phase, ...]
    com: Sway
    margin: float
    fastest: Fastest
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


@final
@dataclass(frozen=True, eq=False)
class _Motion:
    """The body over time, from the first phase on.

    Attributes:
        schedule: the nominal motion.
        lead: when it begins [s].
        offset: of the centre of mass from the body's origin (2,) [m], in the body.
        heights: of the body's origin over time.
    """

    schedule: Schedule
    lead: float
    offset: Array
    heights: PchipInterpolator

    def yaw(self, times: Array) -> Array:
        return np.asarray(self.schedule.course.places(times - self.lead)[:, 2])

    def turned(self, times: Array) -> Array:
        """The centre of mass's offset in the world (N, 2) [m]."""
        yaw = self.yaw(times)
        c, s = np.cos(yaw), np.sin(yaw)
        return np.column_stack(
            [c * self.offset[0] - s * self.offset[1], s * self.offset[0] + c * self.offset[1]]
        )

    def com(self, times: Array) -> Array:
        """Nominal centre of mass (N, 2) [m]."""
        return np.asarray(self.schedule.course.places(times - self.lead)[:, :2] + self.turned(times))

    def raised(self, times: Array) -> Array:
        """The body's height as points (N, 3) [m]; x and y are the centre of mass's business."""
        return np.column_stack([np.zeros((len(times), 2)), self.heights(times)])


def build(
    walker: Walker,
    made: Schedule,
    stance: Stance,
    manner: Manner,
    ground: Ground = flat,
    fields: Fields | None = None,
    known: Walk | None = None,
    usual: float = USUAL,
) -> Walk:
    """Phases of a schedule.

    Args:
        walker: the robot's legs.
        made: steps and the body's nominal motion.
        stance: at the start.
        manner: times, heights, margin.
        ground: its height [m] at x, y.
        fields: a step -> more fields of its phase; 'hard' are added to its own, 'soft' stand for those that
            keep the joints of other limbs.
        known: the same walk at another speed: only its times change.
        usual: share of the largest margin that is kept where the manner gives none.

    Raises:
        GaitError: see `walk`.
    """
    first = made.steps[0]
    feet = {**first.support, **{limb: ends[0] for limb, ends in first.swing.items()}}
    raised = manner.follow * float(np.mean([foot[2] for foot in feet.values()]))
    start = walker.stand(stance, {leg: float(foot[2]) for leg, foot in feet.items()}, raised)
    steps = _with_ends(made, feet, manner.rest)
    motion = _Motion(
        made, manner.rest, (start.com - start.q[:3])[:2], _heights(steps, stance.height, manner.follow)
    )
    com, margin = _balanced(steps, motion, manner, usual) if known is None else _retimed(known, motion)
    swings = [
        {limb: _swing(limb, ends, step, manner, ground) for limb, ends in step.swing.items()}
        for step in steps
    ]

    def body(times: Array) -> tuple[Array, Array]:
        places = com.at(times) - motion.turned(times)
        return np.column_stack([places, motion.heights(times)]), motion.yaw(times)

    if known is None:
        fastest = follow(walker, steps, swings, body)
    else:
        slower = made.course.duration / known.schedule.course.duration
        fastest = Fastest(known.fastest.share / slower, known.fastest.joint, known.fastest.step)
    if manner.step_time is not None and fastest.share > manner.speed:
        raise GaitError(
            f"step '{fastest.step}': joint '{fastest.joint}' would have to move at {fastest.share:.2f} times "
            f"its speed limit, {manner.speed:.2f} may be used; a step_time of "
            f"{manner.beat * fastest.share / manner.speed:.2f} s would hold"
        )

    def com_points(times: Array) -> Array:
        return np.column_stack([com.at(times), np.zeros(len(times))])

    phases = []
    for step, paths in zip(steps, swings, strict=True):
        places = Excerpt(motion.raised, step.begin, step.duration, motion.yaw)
        tasks: list[Task] = [
            ComTask(Excerpt(com_points, step.begin, step.duration), weight=(100.0, 100.0, 0.0), gain=50.0),
            PoseTask(walker.root, places, weight=((0.0, 0.0, 100.0), 50.0)),
        ]
        phases.append(
            _phase(walker, step, paths, tasks, margin, manner, ground, dict(fields(step)) if fields else {})
        )
    return Walk(walker.robot, start, made, steps, tuple(phases), com, margin, fastest)


def _phase(
    walker: Walker,
    step: Step,
    paths: Mapping[str, Any],
    body: Sequence[Task],
    margin: float,
    manner: Manner,
    ground: Ground,
    more: dict[str, Any],
) -> Phase:
    robot = walker.robot
    swings = [PositionTask(robot.feet[limb], path) for limb, path in paths.items()]
    legs = {joint for limb in walker.legs for joint in robot.limbs[limb]}
    others = tuple(joint for joint in robot.joint_names if joint not in legs)
    rest = [PostureTask(walker.state, joints=others, weight=1.0)] if others else []
    limits = (JointLimits(speed=manner.speed), SupportPolygon(margin=margin), *manner.limits)
    return Phase(
        step.name,
        contacts=tuple(
            Contact(robot.feet[limb], friction=manner.friction, normal=normal_at(ground, foot))
            for limb, foot in step.support.items()
        ),
        hard=(*swings, *more.pop("hard", ())),
        soft=(*more.pop("soft", rest), *body),
        limits=tuple(more.pop("limits", limits)),
        duration=step.duration,
        **more,
    )


def _swing(limb: str, ends: Array, step: Step, manner: Manner, ground: Ground) -> Any:
    """A foot's path, lifted until it clears the ground."""
    height = manner.height
    times = np.linspace(0.0, step.duration, LOOKS)
    middle = np.abs(times / step.duration - 0.5) < 0.25
    for _ in range(40):
        path = manner.swing(ends[0], ends[1], height, step.duration)
        points = path.points(times)
        above = points[:, 2] - np.array([ground(float(x), float(y)) for x, y in points[:, :2]])
        short = float((np.where(middle, manner.clearance, 0.0) - above).max())
        if short <= 1e-9:
            return path
        height += max(short, 0.01)
    raise GaitError(
        f"step '{step.name}': no lift of '{limb}' up to {height:.3f} m clears the ground between "
        f"({ends[0][0]:.3f}, {ends[0][1]:.3f}) and ({ends[1][0]:.3f}, {ends[1][1]:.3f}) m"
    )


def _with_ends(made: Schedule, feet: Mapping[str, Array], lead: float) -> tuple[Step, ...]:
    """All steps, later by the time on all feet that comes first, and one such at the end."""
    moved = [Step(s.name, s.begin + lead, s.duration, s.swing, s.support, s.raised) for s in made.steps]
    before = Step("start", 0.0, lead, {}, feet)
    after = Step("end", moved[-1].end, lead, {}, made.feet, moved[-1].raised)
    return (before, *moved, after)


def _heights(steps: Sequence[Step], height: float, follow_share: float) -> PchipInterpolator:
    """Height of the body over time: at each boundary its share of the mean height of the footholds."""
    values = []
    for step in steps:
        feet = [*step.support.values(), *(ends[0] for ends in step.swing.values())]
        values.append(height + follow_share * float(np.mean([foot[2] for foot in feet])))
    # At rest on all feet at both ends.
    return PchipInterpolator([*(s.begin for s in steps), steps[-1].end], [values[0], *values[1:], values[-1]])


def _retimed(known: Walk, motion: _Motion) -> tuple[Sway, float]:
    """The centre of mass of a walk with other times."""
    spline, slower = known.com.spline, motion.schedule.course.duration / known.schedule.course.duration
    if spline is not None:
        spline = BSpline(spline.t * slower, spline.c, spline.k)
    return Sway(motion.com, spline, known.com.least), known.margin


def _balanced(steps: Sequence[Step], motion: _Motion, manner: Manner, usual: float) -> tuple[Sway, float]:
    """The centre of mass's motion and the margin that it keeps."""
    stays = []
    for step in steps:
        try:
            polygon = support_polygon(np.array([foot[:2] for foot in step.support.values()]))
        except SpecError as error:
            raise GaitError(f"step '{step.name}': the body cannot be held: {error}") from None
        stays.append(Stay(step.begin, step.end, polygon))
    ends = motion.com(np.array([steps[0].begin, steps[-1].end]))
    largest = largest_margin(stays, ends[0], ends[1])
    margin = usual * largest if manner.margin is None else manner.margin
    held = largest > 0.0 and margin <= largest
    found = sway(stays, motion.com, margin, manner.beat / 2.0) if held else None
    if found is None:
        common = common_margins(stays)
        worst = int(np.argmin(common))
        asked = "any margin" if manner.margin is None else f"a margin of {manner.margin:.4f} m"
        where = f"step '{steps[worst].name}': the body cannot be held with {asked}"
        if held:  # a body that may stop at every step could
            where = f"{where} and a smooth motion"
        raise GaitError(
            f"{where}: the largest there is from this step to the next is {common[worst]:.4f} m, "
            f"{largest:.4f} m all through",
            step=max(worst - 1, 0),
            margin=float(min(largest, common[worst])),
        )
    return found, margin if manner.margin is not None else (1.0 - ASIDE) * margin
