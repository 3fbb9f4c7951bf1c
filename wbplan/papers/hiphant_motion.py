"""HIphanT: its two experiments, by the shipped tasks `static_endpoint` and `linear_motion`."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled.phase import compile_phase
from wbplan.geometry import support_polygon
from wbplan.papers.hiphant import configuration
from wbplan.papers.rows import Row
from wbplan.planner import Plan, plan
from wbplan.problem.contacts import Contact
from wbplan.problem.objectives import ManipulabilityTask
from wbplan.problem.script import Phase
from wbplan.program.stack import Stack
from wbplan.robot import load_robot
from wbplan.state import State
from wbplan.taskfile import load_task

__all__ = ["TABLES", "configuration", "linear", "static"]

Array = NDArray[np.float64]

row = partial(Row, "HIphanT")
OTHER_ARM = "the paper does not give its arm"


@lru_cache(maxsize=8)
def planned(name: str, **values: float) -> Plan:
    """A shipped task, planned once."""
    task, robot = load_task(name), load_robot("hiphant")
    return plan(robot, task.script(robot, {**task.values([]), **values}), task=name)


def manipulability(q: Array) -> float:
    """The tip's w at a configuration, equation 38, whether or not a plan has it among its tasks."""
    robot = load_robot("hiphant")
    feet = tuple(Contact(foot) for foot in robot.feet.values())
    phase = Phase("w", contacts=feet, soft=(ManipulabilityTask("arm_tip", name="w"),))
    stack = Stack(compile_phase(robot, phase, q), dt=0.01)
    return stack.ascents[0].value_at(q)


def from_middle(found: Plan) -> float:
    """How far [m] the CoM is from the middle of the feet at the end."""
    state = State(found.robot.model, found.trajectory.q[-1])
    feet = np.array([state.pose(foot).translation[:2] for foot in found.robot.feet.values()])
    return float(np.linalg.norm(found.trajectory.com[-1, :2] - support_polygon(feet).middle()))


def static() -> list[Row]:
    """Section 4.2: the tip stays, its manipulability rises."""
    found = planned("static_endpoint")
    w = found.trajectory.measures["manipulability(arm_tip).manipulability"]
    off = found.trajectory.errors["pose(arm_tip).position"]
    turned = found.trajectory.errors["pose(arm_tip).orientation"]
    table = "section 4.2"
    return [
        row(table, "w at the start", 6.54, float(w[0]), goal="beside", why=OTHER_ARM),
        row(table, "w at the end", 6.835, float(w[-1]), goal="beside", why=OTHER_ARM),
        row(table, "rise of w", 4.511, 100.0 * float(w[-1] / w[0] - 1.0), unit="%", goal="least"),
        row(table, "least rise of w in a tick, below 0", 0.0, float(min(np.diff(w).min(), 0.0)), 1e-9),
        row(
            table, "tip off its place, rms", 1e-5, float(np.sqrt(np.mean(off**2))), unit="m", goal="most",
            why="the print's 10e-5 is a sum of squares",
        ),
        row(
            table, "tip off its orientation, rms", 1e-5, float(np.sqrt(np.mean(turned**2))), unit="rad",
            goal="most",
        ),
    ]  # fmt: skip


def linear() -> list[Row]:
    """Section 4.3: the tip goes 0.4 m along +y, with both objectives, with either, and with none.

    As in the paper nothing keeps links clear of the ground; a row says what is left where 5 mm are kept.
    """
    free = partial(planned, "linear_motion", clearance=0.0)
    both, balanced = free(), free(manipulability=0.0)
    raised, none = free(balance=0.0), free(balance=0.0, manipulability=0.0)
    kept = (planned("linear_motion"), planned("linear_motion", manipulability=0.0))
    clear = [manipulability(found.trajectory.q[-1]) for found in kept]
    w = [manipulability(found.trajectory.q[-1]) for found in (both, balanced, raised, none)]
    far = [from_middle(found) for found in (both, balanced, raised, none)]
    table, off = "section 4.3", 0.0
    way = State(both.robot.model, both.trajectory.q[0]).pose("arm_tip").translation
    for q in both.trajectory.q[::20]:
        tip = State(both.robot.model, q).pose("arm_tip").translation
        off = max(off, float(np.hypot(tip[0] - way[0], tip[2] - way[2])))
    return [
        row(table, "tip's way along y", 0.4, float(tip[1] - way[1]), 1e-5, "m"),
        row(table, "tip off the line", 0.0, off, 1e-5, "m"),
        row(table, "w: both objectives over balance alone", 8.87, 100.0 * (w[0] / w[1] - 1.0), unit="%",
            goal="least"),
        row(table, "the same with shanks 5 mm clear of the ground", None, 100.0 * (clear[0] / clear[1] - 1.0),
            unit="%"),
        row(table, "w: both objectives over none", None, 100.0 * (w[0] / w[3] - 1.0), unit="%"),
        row(table, "w: manipulability alone over none", None, 100.0 * (w[2] / w[3] - 1.0), unit="%"),
        row(table, "CoM from the middle, both objectives", 0.1175, far[0], unit="m", goal="most"),
        row(table, "CoM from the middle, manipulability alone", 0.3427, far[2], unit="m", goal="beside",
            why=OTHER_ARM + "; its CoM leaves the feet, ours does not"),
        row(table, "CoM from the middle, balance alone", None, far[1], unit="m"),
        row(table, "CoM from the middle, no objective", None, far[3], unit="m"),
        row(table, "balance brings the CoM nearer", "yes", "yes" if far[0] < far[2] else "no"),
    ]  # fmt: skip


TABLES = (static, linear)
