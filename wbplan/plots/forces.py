"""A second picture of a plan: the forces that carry it, and what they spare."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import NO_MARGIN, Bundle
from wbplan.pictures import blank, unruffled, write
from wbplan.plots.overview import BOUND, FAINT, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SIZE = (12.0, 11.0)  #: [inch]
ABOVE: Any = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "borderaxespad": 0.0}
NAMED = 6  #: joints with a line of their own


def save(bundle: Bundle, path: str | Path) -> Path:
    """Draw a plan's forces into a PNG file.

    Raises:
        BundleError: the file cannot be written.
    """
    return write(figure(bundle), path)


@unruffled()
def figure(bundle: Bundle) -> Figure:
    """Draw a plan's forces over time.

    From the top: the feet's normal forces; the share of friction that each foot uses; the share of its torque
    that each joint gives; the margin in metres, and the largest push on the CoM in newtons that the contacts
    bear whatever its direction.
    """
    drawing = blank(*SIZE)
    panels = drawing.subplots(4, 1, sharex=True, height_ratios=[1.1, 1.0, 1.2, 1.0])
    _feet(panels[0], panels[1], bundle)
    _joints(panels[2], bundle)
    _spare(panels[3], bundle)
    for axes in panels:
        axes.grid(color="#e6eaee", linewidth=0.6)
        axes.set_axisbelow(True)
        for phase in bundle.phases[1:]:
            axes.axvline(phase["start"], color=FAINT, linewidth=0.5, alpha=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    panels[3].set_xlabel("time [s]")
    panels[0].set_title(f"{bundle.plan.get('task', 'plan')}: forces", loc="left", color=INK)
    return drawing


def _feet(normal: Axes, use: Axes, bundle: Bundle) -> None:
    """Normal force [N] and |f_t| / (friction f_n) of every foot, while it stands."""
    motion = bundle.trajectory
    feet = list(dict.fromkeys(c["frame"] for phase in bundle.phases for c in phase["contacts"]))
    pushed = {
        (i, p["frame"]): p["force"] for i, phase in enumerate(bundle.phases) for p in phase.get("pushes", ())
    }
    for foot in feet:
        along, share = np.full((2, len(motion)), np.nan)
        for number, phase in enumerate(bundle.phases):
            now = motion.phase == number
            told = next((c for c in phase["contacts"] if c["frame"] == foot), None)
            if told is None or foot not in motion.forces:
                continue
            force = motion.forces[foot][now] + np.asarray(pushed.get((number, foot), (0.0, 0.0, 0.0)))
            n = np.array(told.get("normal") or (0.0, 0.0, 1.0), dtype=np.float64)
            n /= np.linalg.norm(n)
            along[now] = force @ n
            across = np.linalg.norm(force - np.outer(force @ n, n), axis=1)
            share[now] = across / np.maximum(told["friction"] * along[now], 1e-9)
        normal.plot(motion.time, along, linewidth=1.2, label=foot)
        use.plot(motion.time, np.minimum(share, 2.0), linewidth=1.2)
    normal.set_ylabel("normal force [N]")
    normal.set_ylim(bottom=0.0)
    if feet:
        normal.legend(ncols=min(len(feet), 6), fontsize=8, frameon=False, **ABOVE)
    _promised(use, bundle, "friction_use")
    use.set_ylabel("friction used [share]")


def _joints(axes: Axes, bundle: Bundle) -> None:
    """|torque| / effort; those that come nearest to it by name, the others in grey."""
    motion, model = bundle.trajectory, bundle.model
    if motion.torque is not None:
        effort = np.asarray(model.effortLimit[6:], dtype=np.float64)
        share = np.abs(motion.torque) / np.where(np.isfinite(effort) & (effort > 0.0), effort, np.inf)
        order = np.argsort(-share.max(axis=0))
        for j in order[NAMED:][::-1]:
            axes.plot(motion.time, share[:, j], color=FAINT, linewidth=0.6, alpha=0.6)
        for j in order[:NAMED]:
            axes.plot(motion.time, share[:, j], linewidth=1.2, label=motion.joint_names[j])
        axes.legend(ncols=NAMED, fontsize=8, frameon=False, **ABOVE)
    _promised(axes, bundle, "torque_use")
    axes.set_ylabel("torque used [share]")


def _promised(axes: Axes, bundle: Bundle, key: str) -> None:
    """The bound that each phase promises; nothing where it promises none."""
    for phase in bundle.phases:
        if key in phase:
            axes.hlines(phase[key], phase["start"], phase["end"], color=BOUND, linewidth=1.0, linestyle="--")
    axes.set_ylim(0.0, max(1.08, axes.get_ylim()[1]))


def _spare(axes: Axes, bundle: Bundle) -> None:
    """Margin [m], and on the right the largest push [N]."""
    motion = bundle.trajectory
    axes.plot(motion.time, motion.margin, color=INK, linewidth=1.3)
    for phase in bundle.phases:
        if phase["margin"] > 0.1 * NO_MARGIN:
            axes.hlines(
                phase["margin"], phase["start"], phase["end"], color=BOUND, linewidth=1.0, linestyle="--"
            )
    axes.set_ylabel("margin [m]")
    if motion.push is not None and np.isfinite(motion.push).any():
        other: Any = axes.twinx()
        other.plot(motion.time, motion.push, color="#7a4fc0", linewidth=1.1)
        other.set_ylabel("largest push [N]", color="#7a4fc0")
        other.set_ylim(bottom=min(0.0, float(np.nanmin(motion.push))))
        other.spines[["top"]].set_visible(False)
