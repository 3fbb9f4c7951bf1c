"""What a person reads in the terminal: a plan's report, a robot's summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from wbplan.bundle import NO_MARGIN, Bundle
from wbplan.physics import Simulation
from wbplan.robot import Robot


def print_plan(bundle: Bundle, console: Console) -> None:
    """Prints a plan's phases, its worst values, and its planning time beside its motion time.

    Args:
        bundle: the plan.
        console: where to.
    """
    plan = bundle.plan
    set_to = ", ".join(f"{key}={_value(value)}" for key, value in plan.get("parameters", {}).items())
    console.print(f"{plan['task']} on {plan['robot']} with {plan['backend']}, dt = {plan['dt']:g} s")
    if set_to:
        console.print(f"  {set_to}")
    console.print(_phases(bundle))
    console.print(_tasks(bundle))
    report: Mapping[str, Any] = plan["report"]
    planning, motion = float(report["seconds_planning"]), float(report["seconds_motion"])
    faster = f", {motion / planning:.1f} times faster than it moves" if planning > 0.0 else ""
    console.print(f"  planned in {planning:.2f} s for {motion:.2f} s of motion{faster}")
    if "median_us" in report and "p99_us" in report:
        console.print(
            f"  {report.get('ticks', len(bundle.trajectory))} ticks, "
            f"median {report['median_us']:.0f} us, 99th percentile {report['p99_us']:.0f} us"
        )
    for warning in report.get("warnings", []):
        console.print(f"  warning: {warning}")


def print_robot(robot: Robot, console: Console) -> None:
    """Prints a robot's mass, limbs, roles, poses, joints with their limits, frames and warnings.

    Args:
        robot: the robot.
        console: where to.
    """
    console.print(robot.summary(), soft_wrap=True)
    links = [frame.name for frame in robot.model.frames if frame.type == pin.BODY]
    console.print("frames of links: " + ", ".join(links), soft_wrap=True)
    console.print("problems: none")


def print_simulation(simulation: Simulation, console: Console) -> None:
    """Prints a simulation's verdict, what was measured, and what came of the trials.

    Args:
        simulation: the simulation.
        console: where to.
    """
    report = simulation.report()
    measured: Mapping[str, Any] = report["measured"]
    table = _table("measured", "worst", "t [s]", "where")
    rows = [
        ("base off its plan [mm]", "base_position", 1e3),
        ("base off its plan [deg]", "base_rotation", 180.0 / np.pi),
        ("joint off its plan [rad, m]", "joint_error", 1.0),
        ("servo force / effort", "torque", 1.0),
        ("foot slip [mm]", "foot_slip", 1e3),
        ("friction used [share]", "friction_use", 1.0),
        ("foot lifted off [s]", "lift_off", 1.0),
        ("force between links [N]", "self_collision", 1.0),
    ]
    for title, key, scale in rows:
        row = measured[key]
        where = row.get("where") or (row.get("links", "") if row["worst"] > 0.0 else "")
        table.add_row(title, f"{scale * row['worst']:.3g}", f"{row['time'] or 0.0:.2f}", where)
    for name, off in measured["objects"].items():
        drift, turn = off["drift"], off["turn"]
        table.add_row(f"{name} off its plan [mm]", f"{1e3 * drift['worst']:.3g}", f"{drift['time']:.2f}", "")
        table.add_row(
            f"{name} off its plan [deg]", f"{np.degrees(turn['worst']):.3g}", f"{turn['time']:.2f}", ""
        )
    console.print(table)
    for name, force in report["squeeze"].items():
        console.print(
            f"  assumed: '{name}' is pressed with {force:.1f} N, friction {report['grip'][name]:.2f}"
        )
    console.print(
        f"  {report['engine']}: {simulation.seconds:.2f} s, {simulation.real_time_factor:.1f} times real time"
    )
    console.print(f"undisturbed: {simulation.verdict}", soft_wrap=True)
    survival = simulation.survival
    if survival is not None:
        low, high = survival.interval
        told = ", ".join(f"{word} {n}" for word, n in report["trials"]["verdicts"].items())
        console.print(
            f"disturbed: {survival.stood} of {len(survival.trials)} stand, {100 * survival.rate:.0f} % "
            f"(95 %: {100 * low:.0f} to {100 * high:.0f} %); {told}"
        )
        alone = [f"{kind} at {step:g}" for kind, step in survival.ladder.items() if step is not None]
        console.print(
            "what fells it alone, at which multiple of its spread: " + (", ".join(alone) or "nothing"),
            soft_wrap=True,
        )


def _phases(bundle: Bundle) -> Table:
    """When each phase was, on how many feet, and its least margin beside the promised one."""
    table = _table("phase", "start [s]", "end [s]", "feet", "margin [mm]", "promised")
    motion = bundle.trajectory
    for number, phase in enumerate(bundle.phases):
        margins = motion.margin[motion.phase == number]
        margins = margins[np.isfinite(margins)]
        promised = phase.get("margin")
        table.add_row(
            phase["name"],
            f"{phase['start']:.2f}",
            f"{phase['end']:.2f}",
            str(len(phase["contacts"])),
            f"{1e3 * margins.min():.1f}" if margins.size else "",
            "" if promised is None or promised <= NO_MARGIN else f"{1e3 * promised:.1f}",
        )
    return table


def _tasks(bundle: Bundle) -> Table:
    """The worst error of each task over the whole plan; hard ones first, soft ones may rightly be far off."""
    table = _table("worst error of", "", "position [mm]", "rotation [deg]")
    worst: dict[tuple[bool, str], dict[str, float]] = {}
    for phase in bundle.phases:
        for task in phase["tasks"]:
            row = worst.setdefault((not task.get("hard", False), task["name"]), {})
            for kind in ("position", "orientation"):
                if task.get(kind) is not None:
                    row[kind] = max(row.get(kind, 0.0), task[kind])
    scales = {"position": 1e3, "orientation": 180.0 / np.pi}
    for (soft, name), row in sorted(worst.items(), key=lambda item: item[0][0]):
        if row:
            shown = [f"{scale * row[kind]:.3g}" if kind in row else "" for kind, scale in scales.items()]
            table.add_row(name, "soft" if soft else "hard", *shown)
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column(first)
    for heading in others:
        table.add_column(heading, justify="right")
    return table


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ",".join(_value(item) for item in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_value(item)}" for key, item in value.items())
    return str(value)
