"""MANA's figures 8 to 10 drawn anew: body as prescribed, with feet as ball joints, with feet that roll.

Run as

    python tools/rolling.py [PICTURE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from wbplan.papers.mana_simulated import Comparison, compare

THEORY, JOINTS, ROLLING = (
    {"color": "#c0392b", "lw": 2.4, "label": "prescribed"},
    {"color": "#1e8449", "lw": 0, "marker": "+", "ms": 6, "label": "feet as ball joints"},
    {"color": "#1f4e9c", "lw": 1.2, "ls": "--", "label": "feet that roll"},
)


def main(picture: Path) -> None:
    """Draws both motions into one picture and prints the worst errors."""
    drawn = Figure(figsize=(15.0, 8.5), layout="constrained")
    axes = drawn.subplots(2, 4)
    helix, sway = compare("body_helix"), compare("body_sway")
    _plan_view(axes[0, 0], helix)
    _over_time(axes[1, 0], helix, 2, "Fig 8: body z [mm]")
    for k, axis in enumerate("XYZ"):
        _over_time(axes[0, 1 + k], sway, k, f"Fig 9: translation along {axis} [mm]")
        _over_time(axes[1, 1 + k], sway, 3 + k, f"Fig 10: turn about {axis} [deg]")
    axes[0, 0].legend(fontsize=8, loc="center", bbox_to_anchor=(0.5, 0.3))
    drawn.savefig(picture, dpi=90)
    for name, done in (("helix", helix), ("combined", sway)):
        for feet in ("joint", "ball"):
            place, turn = done.worst(feet)
            print(f"{name}, feet as {feet}s: {place:.2f} mm, {turn:.2f} deg at worst")


def _plan_view(axis, done: Comparison) -> None:
    few = np.arange(0, len(done.time), 250)
    axis.plot(*done.prescribed[:, :2].T, **THEORY)
    axis.plot(*done.joints[few, :2].T, **JOINTS)
    axis.plot(*done.rolling[:, :2].T, **ROLLING)
    axis.set_title("Fig 8: helix from above [mm]", fontsize=10)
    axis.set_aspect("equal")
    axis.grid(alpha=0.3)


def _over_time(axis, done: Comparison, column: int, title: str) -> None:
    few = np.arange(0, len(done.time), 250)
    axis.plot(done.time, done.prescribed[:, column], **THEORY)
    axis.plot(done.time[few], done.joints[few, column], **JOINTS)
    axis.plot(done.time, done.rolling[:, column], **ROLLING)
    axis.set_title(title, fontsize=10)
    axis.set_xlabel("time [s]")
    axis.grid(alpha=0.3)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rolling.png"))
