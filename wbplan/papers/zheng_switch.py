"""Zheng's figures 14 to 16 and 23 on the robot: footholds, support and margins of the change of gait."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wbplan.gaits import SHIFT, Beat, Switch, Walker
from wbplan.geometry import support_polygon
from wbplan.papers.rows import Row
from wbplan.planner import Plan, plan
from wbplan.robot import load_robot
from wbplan.state import State
from wbplan.taskfile import load_task

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

row = partial(Row, "Zheng")
#: CR and height [m] with the most room for strokes: taller, and feet nearer, than in the pose 'stand'.
RADIUS, HEIGHT = 0.40, 0.34


#: Lines of figure 16: margin [CR], what it is, on how many feet.
FIGURE_16 = (
    (math.sqrt(3.0) / 2.0, "Ch2: six feet", 6),
    (0.5, "Ch1: three of six", 6),
    (0.809, "Cp2: five feet", 5),
    (0.427, "Cp1: three of five, at best", 5),
    (0.309, "three of five, at the centre", 5),
)
INK, OURS, SIX, FIVE, PAPER = "#22303c", "#3b7fc4", "#f4f6f8", "#e7eff8", "#c0392b"


def switching() -> list[Row]:
    """Where the feet go, and the margins at the centre in every step of the change, by circle radius."""
    switch = Switch(Walker(load_robot("legarm_hexapod")), "limb1", RADIUS, HEIGHT)
    ahead = switch.hexagon.feet["limb1"]
    arm = math.atan2(ahead[1], ahead[0])
    places = {
        leg: math.degrees((arm - math.atan2(foot[1], foot[0])) % (2.0 * math.pi))
        for leg, foot in switch.pentagon.feet.items()
    }
    printed = {"limb2": 36.0, "leg3": 108.0, "leg4": 180.0, "leg5": 252.0, "leg6": 324.0}
    off = max(abs(places[leg] - angle) for leg, angle in printed.items())
    rows = [row("Fig 14", "feet from the arm's direction, off 36 + 72 k, worst", 0.0, off, 1e-9, "deg")]
    feet = dict(switch.hexagon.feet)
    expected = {"Fig 14": (0.5, 0.309), "Fig 15": (0.309, 0.5)}
    for figure, beats in (("Fig 14", switch.to_pentapod()), ("Fig 15", switch.to_hexapod())):
        for beat, margin in zip(beats, expected[figure], strict=True):
            legs = " ".join(leg for leg in feet if leg not in (*beat.swing, *beat.raised))
            found = _centre(feet, beat)
            rows.append(row(figure, f"centre margin on {legs}", margin, found, 5e-4, "CR"))
    five = switch.pentagon.feet
    for swing in switch.pentapod().steps:
        legs = " ".join(leg for leg in five if leg not in swing)
        margin = _margin(np.array([foot for leg, foot in five.items() if leg not in swing]))
        rows.append(row("Fig 19", f"centre margin on {legs}", 0.309, margin, 5e-4, "CR"))
    return [*rows, row("section 4.3", "default bound of the body's shift", 0.118, SHIFT, 1e-9, "CR")]


def _centre(feet: dict[str, np.ndarray], beat: Beat) -> float:
    """Margin of the body's centre [CR] in a step; `feet` is brought to its end."""
    for leg in (*beat.swing, *beat.raised):
        feet.pop(leg, None)
    margin = _margin(np.array(list(feet.values())))
    if beat.stance is not None:
        feet.update({leg: beat.stance.feet[leg] for leg in beat.swing})
    return margin


def _margin(feet: np.ndarray) -> float:
    return float(support_polygon(feet).margin(np.zeros(2))) / RADIUS


def centre_margins(walked: Plan) -> NDArray[np.float64]:
    """Margin (N,) [m] of the body's origin at every sample, in the hull of the feet that stand."""
    trajectory, found = walked.trajectory, np.full(len(walked.trajectory.time), np.nan)
    for k, phase in enumerate(walked.bundle.phases):
        samples = np.flatnonzero(trajectory.phase == k)
        state = State(walked.robot.model, trajectory.q[samples[0]])
        feet = np.array([state.pose(contact["frame"]).translation[:2] for contact in phase["contacts"]])
        found[samples] = support_polygon(feet).margins(trajectory.q[samples, :2])
    return found


def margin_figure(walked: Plan, radius: float) -> Figure:
    """The margins of a walk that changes between six and five legs, over CR, beside figure 16's lines.

    Args:
        walked: a walk of the leg-arm hexapod, one limb of which is an arm for a while.
        radius: CR [m].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    _spans(axes, walked)
    trajectory = walked.trajectory
    for margin, name, feet in FIGURE_16:
        axes.axhline(margin, color=PAPER, lw=0.9, ls="--" if feet == 6 else ":")
        axes.text(trajectory.time[-1], margin, f" {margin:.3f} {name}", fontsize=7, va="center", color=PAPER)
    axes.plot(
        trajectory.time, centre_margins(walked) / radius, color=OURS, lw=1.0, label="body's middle, planned"
    )
    axes.plot(trajectory.time, trajectory.margin / radius, color=INK, lw=1.4, label="centre of mass, planned")
    promised = [phase["margin"] / radius for phase in walked.bundle.phases]
    starts = [phase["start"] for phase in walked.bundle.phases]
    starts, promised = [*starts, float(trajectory.time[-1])], [*promised, promised[-1]]
    axes.step(starts, promised, where="post", color=INK, lw=0.8, ls="-.", label="promised")
    axes.set_xlim(0.0, float(trajectory.time[-1]))
    axes.set_ylim(0.0, 0.95)
    axes.set_xlabel("time [s]; shaded: five legs walk")
    axes.set_ylabel("stability margin [CR]")
    axes.set_title(
        "Six legs, five, and six again, beside figure 16 (dashed: six legs, dotted: five)",
        loc="left",
        fontsize=10,
    )
    axes.legend(loc="lower center", fontsize=8, ncols=3)
    return figure


def figure_16() -> Figure:
    """`margin_figure` of the task `mobile_manipulation`, planned for it."""
    task = load_task("mobile_manipulation")
    robot = load_robot(task.robot)
    return margin_figure(plan(robot, task.script(robot)), RADIUS)


def _spans(axes: Axes, walked: Plan) -> None:
    """Shades the time in which a limb is no leg."""
    standing = [{contact["frame"] for contact in phase["contacts"]} for phase in walked.bundle.phases]
    every = set().union(*standing)
    arm = min(every, key=lambda foot: sum(foot in feet for feet in standing))
    away = [k for k, feet in enumerate(standing) if arm in feet]
    axes.set_facecolor(SIX)
    gap = max(range(len(away) - 1), key=lambda i: away[i + 1] - away[i])
    start, end = walked.bundle.phases[away[gap]]["end"], walked.bundle.phases[away[gap + 1]]["start"]
    axes.axvspan(start, end, color=FIVE, lw=0)


TABLES = (switching,)
