"""Pictures of gaits: margins over a cycle, and which legs stand when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from wbplan.gaits.gait import Gait
from wbplan.gaits.margins import best_margin, cycle_margins
from wbplan.pictures import blank

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, FAINT, BOUND, STANDS = "#22303c", "#8a97a3", "#c0392b", "#3b7fc4"
COLUMNS = 3


def cycle_figure(
    gaits: Sequence[tuple[Gait, Mapping[str, ArrayLike], float]], heading: float, title: str = ""
) -> Figure:
    """Margin of the body's middle over one cycle of steady walking, and the legs' stances, for each gait.

    Args:
        gaits: gait, its stance (leg -> foot (2,) [m]), and the stroke of its longest stance [m].
        heading: of travel [rad].
        title: of the figure.
    """
    columns = min(COLUMNS, len(gaits))
    rows = -(-len(gaits) // columns)
    figure = blank(5.0 * columns, 3.0 * rows + 0.4)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[2.0, 1.0] * rows)
    ahead = np.array([np.cos(heading), np.sin(heading)])
    for k, (gait, stance, stroke) in enumerate(gaits):
        row, column = divmod(k, columns)
        above = figure.add_subplot(grid[2 * row, column])
        _margins(above, gait, stance, gait.stride(stroke) * ahead)
        below = figure.add_subplot(grid[2 * row + 1, column], sharex=above)
        _stands(below, gait)
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8
    )
    if title:
        figure.suptitle(title, color=INK, fontsize=11)
    return figure


def _margins(axes: Axes, gait: Gait, stance: Mapping[str, ArrayLike], travel: ArrayLike) -> None:
    times, margins = cycle_margins(gait, stance, travel)
    axes.plot(times, 1e3 * margins, color=INK, lw=1.4, label="straight ahead")
    best = 1e3 * best_margin(gait, stance, travel)
    axes.axhline(best, color=STANDS, lw=1.0, ls="--", label="best that sway can keep")
    axes.axhline(0.0, color=BOUND, lw=0.8, label="edge of the support")
    axes.set_title(f"{gait.name}, duty {gait.duty_factor:.3g}", fontsize=9, loc="left", color=INK)
    axes.set_ylabel("margin [mm]", fontsize=8)
    axes.tick_params(labelsize=7, labelbottom=False)
    axes.grid(alpha=0.25)
    least, most = 1e3 * float(margins.min()), max(1e3 * float(margins.max()), best)
    low = 0.8 * least if least > 0.5 * most else min(0.0, 1.1 * least) - 0.04 * most
    axes.set_ylim(low, most + 0.1 * (most - low))


def _stands(axes: Axes, gait: Gait) -> None:
    ends = np.concatenate([[0.0], np.cumsum(gait.lasting)])
    for line, leg in enumerate(gait.legs):
        for k in range(gait.step_count):
            if leg not in gait.steps[k]:
                axes.barh(line, ends[k + 1] - ends[k], left=ends[k], height=0.7, color=STANDS, lw=0)
    axes.set_yticks(range(len(gait.legs)), list(gait.legs), fontsize=6)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("share of the cycle; bars: standing", fontsize=7, color=FAINT)
    axes.tick_params(labelsize=7)
