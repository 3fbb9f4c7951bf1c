"""One picture of a plan: balance, tracking, joints and base.

matplotlib is imported when a picture is made, not before, and nothing of pyplot's global state is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle import NO_MARGIN, Bundle
from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes, support_polygon
from wbplan.pictures import blank, unruffled, write
from wbplan.plots.measures import draw_measures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SIZE = (15.0, 11.0)  #: [inch]
TIME = "viridis"  #: colour map of time
INK, FAINT, BOUND = "#22303c", "#8a97a3", "#c0392b"
FEW = 12  #: support polygons that can be told apart
DASHED = (0, (4, 3))
MOST_LINES = 8  #: tasks with a line of their own in a panel
FLOOR = 1e-8  #: errors below it are drawn at it: nothing is learnt from less


def save(bundle: Bundle, path: str | Path) -> Path:
    """Draw a plan into a PNG file.

    Raises:
        BundleError: the file cannot be written.
    """
    return write(figure(bundle), path)


@unruffled()
def figure(bundle: Bundle) -> Figure:
    """Draw a plan; the figure shows itself in a notebook.

    Left: the CoM's path in the support polygons, seen from above, and the base's pose. Right, over time:
    the margin and what was promised, the tasks' errors, and every joint within its limits.
    """
    drawing = blank(*SIZE)
    engine: Any = drawing.get_layout_engine()
    engine.set(w_pad=0.06, h_pad=0.05)
    columns = drawing.add_gridspec(1, 2, width_ratios=[1.0, 1.35])
    left = columns[0].subgridspec(3, 1, height_ratios=[3.0, 1.0, 1.0])
    joints = len(bundle.trajectory.joint_names)
    right = columns[1].subgridspec(4, 1, height_ratios=[1.25, 1.1, 1.1, min(2.6, 0.8 + 0.075 * joints)])
    _top_view(drawing, drawing.add_subplot(left[0]), bundle)
    _base(place := drawing.add_subplot(left[1]), drawing.add_subplot(left[2], sharex=place), bundle)
    margin = drawing.add_subplot(right[0])
    panels = [drawing.add_subplot(right[i], sharex=margin) for i in (1, 2, 3)]
    _margin(margin, bundle)
    draw_measures(margin, bundle)
    _errors(panels[0], bundle, ("position",), "m")
    _errors(panels[1], bundle, ("orientation", "joints"), "rad")
    _joints(drawing, panels[2], bundle)
    return drawing


# --------------------------------------------------------------------------------------------------- balance


def _polygons(bundle: Bundle) -> Iterator[tuple[dict[str, Any], Array, HalfPlanes | None]]:
    """Each phase, its feet (C, 3) [m] when it begins, and its support polygon if it has one."""
    model, motion = bundle.model, bundle.trajectory
    data = model.createData()
    for phase in bundle.phases:
        first = int(np.argmin(np.abs(motion.time - phase["start"])))
        pin.framesForwardKinematics(model, data, motion.q[first])
        names = [contact["frame"] for contact in phase["contacts"]]
        feet = np.array([data.oMf[model.getFrameId(name)].translation.copy() for name in names]).reshape(
            -1, 3
        )
        try:
            yield phase, feet, support_polygon(phase.get("region", feet[:, :2]))
        except SpecError:
            yield phase, feet, None


def _top_view(drawing: Figure, axes: Axes, bundle: Bundle) -> None:
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    motion = bundle.trajectory
    clock = Normalize(motion.time[0], motion.time[-1])
    named: list[tuple[str, Array]] = []
    outlines: dict[tuple[float, ...], tuple[dict[str, Any], HalfPlanes]] = {}
    for phase, feet, polygon in _polygons(bundle):
        for contact, foot in zip(phase["contacts"], feet, strict=True):
            if all(contact["frame"] != n or np.linalg.norm(foot - p) > 5e-3 for n, p in named):
                named.append((contact["frame"], foot))
        if polygon is not None:
            key = (round(phase["margin"], 4), *np.round(polygon.vertices, 3).ravel())
            outlines.setdefault(key, (phase, polygon))
    faint = min(1.0, FEW / max(len(outlines), 1))
    for phase, polygon in outlines.values():
        _outline(axes, phase, polygon, colormaps[TIME](clock(phase["start"])), faint)
    axes.plot([], [], color=FAINT, linewidth=1.2, label="support polygon, by phase")
    if faint == 1.0:
        axes.plot([], [], color=FAINT, linewidth=0.9, linestyle=DASHED, label="promised margin inside it")
    _feet(axes, named)
    path = motion.com[:, :2]
    pieces = LineCollection(
        list(np.stack([path[:-1], path[1:]], axis=1)), cmap=TIME, norm=clock, linewidths=2.6
    )
    pieces.set_array(motion.time[:-1])
    pieces.set_capstyle("round")
    pieces.set_zorder(4)
    axes.add_collection(pieces)
    axes.plot(
        *path[0], "o", color="white", markeredgecolor=INK, markersize=9, zorder=5, label="CoM at the start"
    )
    axes.plot(
        *path[-1], "s", color=INK, markeredgecolor="white", markersize=8, zorder=6, label="CoM at the end"
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(x=0.2, y=0.14)  # room for the feet's names
    axes.grid(color="#eceff1", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    _title(axes, "Centre of mass over the feet, from above")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=8, frameon=False)
    bar = drawing.colorbar(pieces, cax=axes.inset_axes((1.02, 0.0, 0.025, 1.0)))
    bar.set_label("time [s]")
    bar.outline.set_visible(False)


def _outline(axes: Axes, phase: dict[str, Any], polygon: HalfPlanes, color: Any, faint: float) -> None:
    """A support polygon, and the promised margin in it unless there are too many to tell apart."""
    edge: Any = {"edgecolor": (*color[:3], 0.8 * faint), "linewidth": 0.4 + 0.8 * faint}
    axes.fill(*polygon.vertices.T, facecolor=(*color[:3], 0.05 * faint), **edge)
    inset = polygon.inset(max(phase["margin"], 0.0))
    if faint == 1.0 and phase["margin"] > 0.0 and len(inset):
        axes.fill(*inset.T, facecolor="none", edgecolor=(*color[:3], 0.7), linewidth=0.9, linestyle=DASHED)


def _feet(axes: Axes, named: list[tuple[str, Array]]) -> None:
    """Footholds as dots, each foot's first one with its name on the side away from the middle."""
    if not named:
        return
    spots = np.array([spot[:2] for _, spot in named])
    axes.plot(*spots.T, ".", color=INK, markersize=5, zorder=3)
    middle = spots.mean(axis=0)
    for name, spot in dict(reversed(named)).items():  # of each foot the first
        up = spot[1] >= middle[1] - 1e-3
        axes.annotate(
            _short(name.removesuffix("_foot"), 24),
            tuple(spot[:2].tolist()),
            xytext=(0.0, 7.0 if up else -7.0),
            textcoords="offset points",
            ha="center",
            va="bottom" if up else "top",
            fontsize=8,
            color=INK,
        )


def _margin(axes: Axes, bundle: Bundle) -> None:
    motion = bundle.trajectory
    margin = np.where(np.isfinite(motion.margin), motion.margin, np.nan)
    axes.plot(motion.time, margin, color="#1f6f8b", linewidth=1.6, label="margin")
    labelled = False
    for phase in bundle.phases:
        if phase["margin"] > 0.1 * NO_MARGIN:
            span, bound = (phase["start"], phase["end"]), phase["margin"]
            axes.plot(
                span, (bound, bound), color=BOUND, linewidth=1.6, label=None if labelled else "promised"
            )
            labelled = True
    if np.isfinite(margin).any():
        k = int(np.nanargmin(margin))
        axes.plot(
            motion.time[k], margin[k], "v", color="#1f6f8b", markersize=6, label=f"least: {margin[k]:.4f} m"
        )
        axes.set_ylim(min(0.0, float(np.nanmin(margin)) * 1.1), max(1e-3, float(np.nanmax(margin)) * 1.12))
    axes.set_ylabel("margin [m]")
    axes.tick_params(labelbottom=False)
    _legend(axes)
    _bands(axes, bundle)
    _title(axes, "Support margin of the CoM", pad=_phase_names(axes, bundle))


# -------------------------------------------------------------------------------------------------- tracking


def _errors(axes: Axes, bundle: Bundle, parts: tuple[str, ...], unit: str) -> None:
    """Errors whose last name is one of `parts`; a colour means the same task in every panel."""
    time, colors, contacts = bundle.trajectory.time, _colors(bundle), []
    rest = 0
    for key, values in bundle.trajectory.errors.items():
        name, _, part = key.rpartition(".")
        if part not in parts or not np.isfinite(values).any():
            continue
        drawn = np.maximum(values, FLOOR)
        if name.startswith("contact("):
            contacts.append(values)
        elif name in colors:
            said, style = (name, "-") if part == parts[0] else (f"{name}, {part}", "--")
            axes.plot(time, drawn, style, color=colors[name], linewidth=1.3, label=_short(said, 40))
        else:
            rest += 1
            axes.plot(time, drawn, color="#c3cbd2", linewidth=0.8, zorder=1)
    if contacts:
        worst = np.fmax.reduce(contacts)
        axes.plot(
            time, np.maximum(worst, FLOOR), color=FAINT, linewidth=0.9, zorder=1.5, label="worst contact"
        )
    if rest:
        axes.plot([], [], color="#c3cbd2", linewidth=0.8, label=f"{rest} with smaller errors")
    axes.set_yscale("log")
    if not axes.lines:
        axes.set_ylim(FLOOR, 1.0)
        axes.text(0.5, 0.5, "no such task", transform=axes.transAxes, ha="center", va="center", color=FAINT)
    axes.set_ylabel(f"error [{unit}]")
    _title(
        axes, {"m": "Position errors of the tasks", "rad": "Orientation and joint errors of the tasks"}[unit]
    )
    axes.tick_params(labelbottom=False)
    _legend(axes)
    _bands(axes, bundle)


def _colors(bundle: Bundle) -> dict[str, str]:
    """Colours of the tasks with the largest errors, contacts apart."""
    worst: dict[str, float] = {}
    for key, values in bundle.trajectory.errors.items():
        name = key.rpartition(".")[0]
        if not name.startswith("contact(") and np.isfinite(values).any():
            worst[name] = max(worst.get(name, 0.0), float(np.nanmax(values)))
    order = sorted(worst, key=lambda name: -worst[name])
    return {name: f"C{i}" for i, name in enumerate(order[:MOST_LINES])}


# ------------------------------------------------------------------------------------------- joints and base


def _joints(drawing: Figure, axes: Axes, bundle: Bundle) -> None:
    """Where each joint is between its limits: -1 at the lower one, +1 at the upper one."""
    motion, model = bundle.trajectory, bundle.model
    names, used = [], []
    for name in motion.joint_names:
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            lower, upper = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            if np.isfinite(upper - lower) and upper > lower:
                names.append(name)
                used.append((2.0 * motion.q[:, joint.idx_q] - lower - upper) / (upper - lower))
    _title(axes, "Joints between their limits")
    axes.set_xlabel("time [s]")
    if not names:
        axes.text(
            0.5, 0.5, "no joint has limits", transform=axes.transAxes, ha="center", va="center", color=FAINT
        )
        return
    middles = (motion.time[1:] + motion.time[:-1]) / 2
    edges = np.concatenate([motion.time[:1], middles, motion.time[-1:]])
    rows = np.arange(len(names) + 1)
    mesh = axes.pcolormesh(edges, rows, np.array(used), cmap="RdBu_r", vmin=-1.0, vmax=1.0, rasterized=True)
    limbs = [name.partition("_")[0] for name in names]
    for row in range(1, len(names)):
        if limbs[row] != limbs[row - 1]:
            axes.axhline(row, color="white", linewidth=2.0)
    if len(names) <= 32:
        axes.set_yticks(rows[:-1] + 0.5, [_short(name, 24) for name in names], fontsize=6.5)
    else:
        starts = [row for row in rows[:-1] if row == 0 or limbs[row] != limbs[row - 1]]
        ends = [*starts[1:], len(names)]
        axes.set_yticks(np.add(starts, ends) / 2, [_short(limbs[a], 24) for a in starts])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    for edge in [phase["start"] for phase in bundle.phases[1:]]:
        axes.axvline(edge, color=INK, linewidth=0.4, alpha=0.35)
    bar = drawing.colorbar(mesh, cax=axes.inset_axes((1.015, 0.0, 0.018, 1.0)), ticks=[-1, 0, 1])
    bar.ax.set_yticklabels(["lower", "middle", "upper"], fontsize=8)
    bar.outline.set_visible(False)
    for side in axes.spines.values():
        side.set_visible(False)


def _base(place: Axes, turn: Axes, bundle: Bundle) -> None:
    """The base's way from its start, and its roll, pitch and yaw."""
    motion = bundle.trajectory
    for i, name in enumerate("xyz"):
        place.plot(motion.time, motion.q[:, i] - motion.q[0, i], color=f"C{i}", linewidth=1.4, label=name)
    place.set_ylabel("moved [m]")
    place.tick_params(labelbottom=False)
    _title(place, "Base: way from its start, and orientation")
    rotations = [pin.Quaternion(np.array(q[3:7])).normalized().toRotationMatrix() for q in motion.q]
    angles = np.unwrap(np.array([pin.rpy.matrixToRpy(rotation) for rotation in rotations]), axis=0)
    for i, name in enumerate(("roll", "pitch", "yaw")):
        turn.plot(motion.time, np.degrees(angles[:, i]), color=f"C{i}", linewidth=1.4, label=name)
    turn.set(ylabel="turned [deg]", xlabel="time [s]")
    for axes in (place, turn):
        # A base that stands still is a flat line, not magnified noise.
        low, high = axes.get_ylim()
        least = 2e-3 if axes is place else 0.2
        if high - low < least:
            axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)
        _legend(axes)
        _bands(axes, bundle)


# ---------------------------------------------------------------------------------------------------- common


def _title(axes: Axes, text: str, pad: float = 6.0) -> None:
    axes.set_title(text, loc="left", fontsize=10.5, fontweight="bold", color=INK, pad=pad)


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.03), fontsize=8, frameon=False, handlelength=1.4)


def _bands(axes: Axes, bundle: Bundle) -> None:
    """Every other phase shaded, in quiet axes from the first to the last sample."""
    axes.set_xlim(*bundle.trajectory.time[[0, -1]])
    for phase in bundle.phases[1::2]:
        axes.axvspan(phase["start"], phase["end"], color="#eef2f5", zorder=0, linewidth=0)
    axes.grid(axis="y", color="#e3e8ec", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _phase_names(axes: Axes, bundle: Bundle) -> float:
    """Write the phases' names above the axes, slanted if they would touch; returns their height [points]."""
    start, end = bundle.trajectory.time[[0, -1]]
    names = [_short(phase["name"], 24) for phase in bundle.phases]
    middles = [(phase["start"] + phase["end"]) / 2 for phase in bundle.phases]
    letter, line = 0.0095 * (end - start), 0.027 * (end - start)
    pairs = zip(pairwise(middles), pairwise(names), strict=True)
    if all(b - a > letter * (len(m) + len(n) + 3) / 2 for (a, b), (m, n) in pairs):
        for middle, name in zip(middles, names, strict=True):
            _above(axes, middle, middle, name, 0.0)
        return 18.0
    # Side by side with the same slant; where phases are short, beside their middle, a line leading there.
    places: list[float] = []
    for middle in middles:
        places.append(max(middle, places[-1] + line) if places else middle)
    for i in reversed(range(len(places))):
        places[i] = min(places[i], end - line * (len(places) - 1 - i))
    for middle, place, name in zip(middles, places, names, strict=True):
        if place >= start:  # else there are more phases than names have room
            _above(axes, middle, place, name, 55.0)
    return 24.0 + 3.5 * max(len(name) for name in names)


def _above(axes: Axes, middle: float, place: float, name: str, slant: float) -> None:
    """A phase's name above the axes at `place`, meaning the phase around `middle`."""
    lead = 1.07 if slant else 1.02
    across = axes.get_xaxis_transform()
    if slant:
        axes.plot([middle, place], [1.0, lead], transform=across, color=FAINT, linewidth=0.6, clip_on=False)
    style: dict[str, Any] = {
        "ha": "left" if slant else "center",
        "va": "bottom",
        "fontsize": 7.5,
        "color": INK,
    }
    axes.text(place, lead, name, transform=across, rotation=slant, rotation_mode="anchor", **style)


def _short(name: str, most: int) -> str:
    return name if len(name) <= most else name[: most - 1] + "…"
