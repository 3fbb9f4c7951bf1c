"""What a person reads in the terminal: a plan's report, a robot's summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from wbplan.bundle import NO_MARGIN, Bundle
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
    report: Mapping[str, Any] = plan["report"]
    for name, value in report.get("worst", {}).items():
        console.print(f"  worst {name}: {_value(value)}")
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


def _phases(bundle: Bundle) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("phase")
    for heading in (
        "start [s]",
        "end [s]",
        "feet",
        "margin [mm]",
        "promised",
        "position [mm]",
        "rotation [deg]",
    ):
        table.add_column(heading, justify="right")
    motion = bundle.trajectory
    for number, phase in enumerate(bundle.phases):
        margins = motion.margin[motion.phase == number]
        promised = phase.get("margin")
        table.add_row(
            phase["name"],
            f"{phase['start']:.2f}",
            f"{phase['end']:.2f}",
            str(len(phase["contacts"])),
            _worst(-margins, -1e3),
            "" if promised is None or promised <= NO_MARGIN else f"{1e3 * promised:.1f}",
            _worst(_errors(phase["tasks"], "position"), 1e3),
            _worst(_errors(phase["tasks"], "orientation"), 180.0 / np.pi),
        )
    return table


def _errors(tasks: Sequence[Mapping[str, Any]], kind: str) -> list[float]:
    """The worst errors of a phase's hard tasks; soft ones may rightly be far off."""
    return [task[kind] for task in tasks if task.get("hard") and task.get(kind) is not None]


def _worst(values: Any, scale: float) -> str:
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    return f"{scale * finite.max():.3g}" if finite.size else ""


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ",".join(_value(item) for item in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_value(item)}" for key, item in value.items())
    return str(value)
