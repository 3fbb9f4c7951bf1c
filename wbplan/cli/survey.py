"""Gaits side by side: what each is on paper, and what comes out when a robot walks it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.gaits import (
    CLOSING,
    Gait,
    Manner,
    Mode,
    Stance,
    Walk,
    Walker,
    comfortable,
    gait_for,
    gaits_for,
    step_margins,
    straight,
    walk,
    walker_for,
)
from wbplan.planner import Plan, plan
from wbplan.robot import Robot

if TYPE_CHECKING:
    from rich.table import Table

Array = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Walked:
    """One gait, walked and measured on the trajectory.

    Attributes:
        robot, mode, gait: their names.
        duty: duty factor.
        steps: in a cycle.
        speed: of the gait, v = s n / (T u) with the longest stance's stroke [m/s].
        measured: mean speed of the centre of mass half-way [m/s], its sway taken out; over a cycle where it
            goes two, else over a step.
        distance: asked [m].
        gone: by the body [m].
        centre: least margin of the body's middle over the steps, standing [m].
        promised: margin in every phase [m].
        margin: least margin [m].
        slip: largest way of a foot that stands [m].
        clearance: least height of a foot over the ground in the middle half of its way [m].
        seconds: planning time [s].
        motion: time that the walk takes [s].
        held: whether all promises hold.
    """

    robot: str
    mode: str
    gait: str
    duty: float
    steps: int
    speed: float
    measured: float
    distance: float
    gone: float
    centre: float
    promised: float
    margin: float
    slip: float
    clearance: float
    seconds: float
    motion: float
    held: bool


@final
@dataclass(frozen=True, eq=False)
class Setting:
    """How a robot would walk in a gait, its stance and stroke those that are easy.

    Attributes:
        walker: its legs; of six, five for a gait of five.
        gait: the gait.
        stance: of the feet.
        stroke: of a standing foot [m].
        lift: of a swinging one [m].
        mode: which way legs point and it goes.
    """

    walker: Walker
    gait: Gait
    stance: Stance
    stroke: float
    lift: float
    mode: Mode


def setting(robot: Robot, name: str, mode: Mode | None = None) -> Setting:
    """How a robot would walk in a gait.

    Args:
        robot: the robot.
        name: of the gait.
        mode: which way its legs point and it goes.

    Raises:
        SpecError: the robot has no such gait, or not in that mode.
    """
    mode, walker = mode or Mode("free", None, 0.0), walker_for(robot, name)
    stance = walker.stance(lean=mode.lean, even=CLOSING if walker.raised else 0.0)
    lift = 0.1 * stance.height
    stance, stroke = comfortable(walker, stance, lift, heading=mode.heading)
    gait = gait_for(walker, name, stance, mode.heading, stroke)
    return Setting(walker, gait, stance, stroke, lift, mode)


def survey(
    robot: Robot,
    names: Iterable[str] | None = None,
    *,
    mode: Mode | None = None,
    cycles: float = 2.0,
    dt: float = 0.01,
) -> Iterator[Walked]:
    """A robot walks a few cycles of every gait on level ground.

    Args:
        robot: the robot.
        names: of the gaits; all that it has where not given.
        mode: which way its legs point and it goes.
        cycles: how far, in strides.
        dt: length of a tick [s].

    Raises:
        GaitError: a gait cannot be walked.
    """
    for name in names or gaits_for(robot, mode):
        yield walk_once(setting(robot, name, mode), cycles, dt)


def walk_once(given: Setting, cycles: float = 2.0, dt: float = 0.01) -> Walked:
    """A few cycles of one gait on level ground, planned and measured.

    Args:
        given: robot, gait, stance and stroke.
        cycles: how far, in strides.
        dt: length of a tick [s].
    """
    began = perf_counter()
    gait, stance, stroke = given.gait, given.stance, given.stroke
    track = straight(cycles * gait.stride(stroke), given.mode.heading)
    walked = walk(given.walker, gait, track, stroke, stance=stance, manner=Manner(height=given.lift))
    planned = plan(given.walker.robot, walked.script, dt=dt, task=f"survey {gait.name}")
    seconds = perf_counter() - began
    return measured(given, walked, planned, track.length, seconds)


def measured(given: Setting, walked: Walk, planned: Plan, distance: float, seconds: float) -> Walked:
    """The figures of a walk, from its trajectory."""
    gait, stroke = given.gait, given.stroke
    course, first = walked.schedule.course, walked.steps[1].begin
    whole = distance >= 2.0 * gait.stride(stroke) - 1e-9  # then it goes a cycle and more at full speed
    beat = next(s.duration for s in walked.steps if s.swing)
    trajectory, report = planned.trajectory, planned.check()
    moved = trajectory.q[-1, :2] - trajectory.q[0, :2]
    return Walked(
        planned.robot.name,
        given.mode.name,
        gait.name,
        gait.duty_factor,
        gait.step_count,
        gait.speed(stroke, gait.cycle * beat, longest=True),
        _speed_at(
            trajectory.time,
            _without_sway(walked, planned),
            first + 0.5 * course.duration,
            beat * (gait.cycle if whole else 1.0),
        ),
        distance,
        float(np.linalg.norm(moved)),
        min(step.centre for step in step_margins(gait, given.stance.feet)),
        walked.margin,
        float(np.nanmin(trajectory.margin)),
        next((row.worst for row in report.rows if row.promise == "foot slip"), 0.0),
        clearance(walked, planned),
        seconds,
        float(trajectory.time[-1]),
        report.ok,
    )


def _without_sway(walked: Walk, planned: Plan) -> Array:
    """The centre of mass (N, 2) [m] less what it is meant to sway by."""
    trajectory, spline = planned.trajectory, walked.com.spline
    places: Array = trajectory.com[:, :2]
    return places if spline is None else places - np.asarray(spline(trajectory.time))


def _speed_at(time: Array, com: Array, moment: float, window: float) -> float:
    """Mean speed [m/s] in the plane over a window about a moment."""
    early, late = (int(np.argmin(np.abs(time - t))) for t in (moment - window / 2, moment + window / 2))
    if early == late:
        raise SpecError("survey: a step is shorter than a tick")
    return float(np.linalg.norm(com[late] - com[early]) / (time[late] - time[early]))


def clearance(walked: Walk, planned: Plan, ground: float = 0.0) -> float:
    """Least height [m] of any foot over level ground in the middle half of its swings."""
    model = planned.robot.model
    data, trajectory, least = model.createData(), planned.trajectory, np.inf
    for step in walked.steps:
        early, late = step.begin + 0.25 * step.duration, step.begin + 0.75 * step.duration
        for k in np.flatnonzero((trajectory.time >= early) & (trajectory.time <= late)) if step.swing else ():
            pin.framesForwardKinematics(model, data, trajectory.q[k])
            for limb in step.swing:
                frame = planned.robot.frame_id(planned.robot.feet[limb])
                least = min(least, float(data.oMf[frame].translation[2]) - ground)
    return float(least)


def table(rows: Iterable[Walked], title: str) -> Table:
    """The figures of gaits as a table to print.

    Columns: robot and mode, where there are several; duty factor; steps in a cycle; the gait's speed and the
    one found; way asked and gone; margin of the body's middle at worst, margin promised and the least there
    is; slip of standing feet; clearance of swinging ones; time of the motion over the time of planning it;
    whether all promises hold.

    Args:
        rows: one for each gait.
        title: of the table.
    """
    from rich.table import Table

    rows = list(rows)
    shown = Table(title=f"{title}; mm, mm/s, slip in um", title_justify="left")
    where = ("robot", "mode") if len({(row.robot, row.mode) for row in rows}) > 1 else ()
    for name in (
        *where, "gait", "duty", "steps", "speed", "found", "way", "gone", "centre", "asked", "margin", "slip",
        "clear", "rate", "promises",
    ):  # fmt: skip
        shown.add_column(name, justify="left" if name in ("robot", "mode", "gait", "promises") else "right")
    for row in rows:
        millimetres = (row.speed, row.measured, row.distance, row.gone, row.centre, row.promised, row.margin)
        shown.add_row(
            *(str(getattr(row, name)) for name in where),
            row.gait,
            f"{row.duty:.3f}",
            str(row.steps),
            *(f"{1e3 * value:.1f}" for value in millimetres),
            f"{1e6 * row.slip:.1f}",
            f"{1e3 * row.clearance:.1f}",
            f"{row.motion / row.seconds:.1f}",
            "hold" if row.held else "broken",
        )
    return shown
