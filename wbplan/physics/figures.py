"""One picture of a simulation: base and joints beside the plan, feet, servos, objects, trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wbplan.pictures import blank

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wbplan.physics.simulate import Simulation
    from wbplan.physics.trials import Survival

Array = NDArray[np.float64]

SIZE = (14.0, 12.0)  #: [inch]
INK, FAINT, BOUND = "#22303c", "#8a97a3", "#c0392b"
POINTS = 2500  #: samples of a line


def figure(simulation: Simulation) -> Figure:
    """Draws a simulation over the plan's time."""
    drawn = blank(*SIZE)
    drawn.suptitle(f"{simulation.bundle.plan.get('task')}: {simulation.verdict}", color=INK, wrap=True)
    axes = drawn.subplots(4, 2)
    m, motion = simulation.measures, simulation.motion
    k = np.unique(np.linspace(0, len(m.time) - 1, min(POINTS, len(m.time))).astype(int))
    t = m.time[k]
    _lines(axes[0, 0], t, 1e3 * m.position[k], "xyz", "base, simulated less planned [mm]")
    _lines(axes[0, 1], t, np.degrees(m.rotation[k]), "xyz", "base rotation, likewise [deg]")
    worst = np.argsort(-np.abs(m.joints).max(axis=0))[:6]
    _lines(
        axes[1, 0],
        t,
        m.joints[np.ix_(k, worst)],
        [motion.names[j] for j in worst],
        "worst joint errors [rad, m]",
    )
    loads = np.argsort(-m.load.max(axis=0))[:6]
    _lines(
        axes[1, 1],
        t,
        m.load[np.ix_(k, loads)],
        [motion.names[j] for j in loads],
        "servo force / effort limit",
    )
    axes[1, 1].axhline(1.0, color=BOUND, lw=0.8)
    _lines(axes[2, 0], t, m.normal[k], motion.feet, "normal force on each foot [N]")
    _lines(axes[2, 1], t, 1e3 * m.slip[k], motion.feet, "slip of each foot in its stance [mm]")
    axes[2, 1].axhline(1e3 * simulation.options.bounds.slip, color=BOUND, lw=0.8)
    _objects(axes[3, 0], simulation, k)
    _trials(axes[3, 1], simulation.survival)
    for axis in axes.ravel()[:-1]:
        _phases(axis, simulation)
    for axis in axes.ravel():
        axis.grid(alpha=0.3)
    return drawn


def margin_figure(margins: Sequence[float], survivals: Sequence[Survival], stands: Sequence[bool]) -> Figure:
    """Survival over the planned stability margin [m], with 95 % intervals.

    Args:
        margins: least planned margin of each plan.
        survivals: of each plan's trials.
        stands: whether each plan stood undisturbed.
    """
    drawn = blank(8.0, 5.0)
    axis = drawn.subplots()
    for margin, survival, stood in zip(margins, survivals, stands, strict=True):
        low, high = survival.interval
        x, rate = 1e3 * margin, 100 * survival.rate
        bar = [[rate - 100 * low], [100 * high - rate]]
        axis.errorbar(
            [x], [rate], yerr=bar, fmt="o" if stood else "X", color=INK if stood else BOUND, capsize=3
        )
    order = np.argsort(margins)
    axis.plot([1e3 * margins[i] for i in order], [100 * survivals[i].rate for i in order], color=FAINT, lw=1)
    axis.axvline(0.0, color=BOUND, lw=0.8, ls="--")
    axis.set(xlabel="least planned margin [mm]", ylabel="stands [% of trials, 95 % interval]", ylim=(-3, 103))
    axis.set_title("does the planned margin tell what stands?  x: falls undisturbed", color=INK, fontsize=10)
    axis.grid(alpha=0.3)
    return drawn


def _lines(axis: Axes, time: Array, values: Array, names: Sequence[str], title: str) -> None:
    for column, name in zip(values.T, names, strict=True):
        axis.plot(time, column, lw=0.9, label=name)
    axis.set_title(title, fontsize=9, color=INK)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high + 0.25 * (high - low))  # room for the names
    axis.legend(fontsize=6, ncols=3, loc="upper left")
    axis.margins(x=0)


def _objects(axis: Axes, simulation: Simulation, k: NDArray[np.int64]) -> None:
    m = simulation.measures
    for name, drift in m.drift.items():
        axis.plot(m.time[k], 1e3 * drift[k], lw=0.9, label=f"{name}: place [mm]")
        axis.plot(m.time[k], np.degrees(m.turn[name][k]), lw=0.9, label=f"{name}: turn [deg]")
    record = simulation.record
    rows = np.searchsorted(record.time, m.time[k])
    for pad, force in record.pads.items():
        axis.plot(m.time[k], force[np.clip(rows, 0, len(force) - 1)], lw=0.6, label=f"{pad}: pressing [N]")
    if m.drift:
        axis.axhline(1e3 * simulation.options.bounds.drift, color=BOUND, lw=0.8)
        axis.legend(fontsize=6, ncols=2, loc="upper left")
    axis.set_title("objects, simulated less planned; pads", fontsize=9, color=INK)
    axis.margins(x=0)


def _trials(axis: Axes, survival: Survival | None) -> None:
    if survival is None:
        axis.set_title("no trials were asked for", fontsize=9, color=FAINT)
        axis.set_axis_off()
        return
    low, high = survival.interval
    kinds = list(survival.ladder)
    steps = [survival.ladder[kind] for kind in kinds]
    most = 2 * max([step for step in steps if step is not None], default=4.0)
    axis.barh(
        kinds,
        [most if step is None else step for step in steps],
        color=[FAINT if step is None else BOUND for step in steps],
    )
    told = f"{survival.stood} of {len(survival.trials)} trials stand ({100 * low:.0f} to {100 * high:.0f} %)"
    axis.set_title(
        f"{told}; red: alone it fells the plan at this multiple of its spread", fontsize=9, color=INK
    )
    axis.tick_params(axis="y", labelsize=7)


def _phases(axis: Axes, simulation: Simulation) -> None:
    for phase in simulation.bundle.phases:
        axis.axvline(float(phase["start"]), color=FAINT, lw=0.4, alpha=0.6)
    if simulation.verdict.time is not None:
        axis.axvline(simulation.verdict.time, color=BOUND, lw=1.2)
