"""What tasks without a target are at, drawn into a panel of `plots`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wbplan.bundle import Bundle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("#7d3c98", "#b9770e", "#1e8449")


def draw_measures(axes: Axes, bundle: Bundle) -> None:
    """Each tip's manipulability w over time, on a scale of its own behind the panel's lines.

    The scale has no ticks; w at both ends is told in the legend.
    """
    drawn = {
        name.removesuffix(".manipulability"): values
        for name, values in bundle.trajectory.measures.items()
        if np.isfinite(values).any()
    }
    for (name, values), color in zip(drawn.items(), COLORS * len(drawn), strict=False):
        known = values[np.isfinite(values)]
        low, high = float(known.min()), float(known.max())
        room = max(high - low, 1e-3 * abs(high), 1e-9)
        scale: Any = axes.twinx()
        scale.plot(bundle.trajectory.time, values, color=color, linewidth=1.3, linestyle=(0, (5, 1.5)))
        scale.set_ylim(low - 0.15 * room, high + 0.15 * room)
        scale.set_axis_off()
        axes.plot(
            [], [], color=color, linewidth=1.3, linestyle=(0, (5, 1.5)),
            label=f"w, {name.split('(')[-1].rstrip(')')}:\n{known[0]:.3g} to {known[-1]:.3g}",
        )  # fmt: skip
    if drawn:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.03), fontsize=8, frameon=False, handlelength=1.4)
