"""Does the planned stability margin tell what stands? Plans the clamp with ever shorter steps ahead and
replays each plan many times; writes a picture and a table.

    python tools/margins.py [TRIALS] [PICTURE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import wbplan as wb
from wbplan.physics.figures import margin_figure
from wbplan.taskfile import load_task

STRIDES = (0.046, 0.05, 0.053, 0.056, 0.06, 0.065, 0.08, 0.10)  # [m]


def main(trials: int, picture: Path) -> None:
    """One plan for each stride: its least margin, how many of its trials stand, and the picture of it."""
    task = load_task("clamp")
    robot = wb.load_robot(task.robot)
    margins, survivals, stands = [], [], []
    for stride in STRIDES:
        script = task.script(robot, {"stride": stride, "margin": -0.05})
        plan = wb.plan(robot, script, task=f"clamp, stride {stride:g} m")
        done = plan.simulate(trials=trials, ladder=())
        margin = float(np.nanmin(plan.trajectory.margin))
        low, high = done.survival.interval
        print(
            f"stride {1e3 * stride:.0f} mm, margin {1e3 * margin:6.1f} mm: "
            f"{done.survival.stood} stand ({100 * low:.0f} to {100 * high:.0f} %); {done.verdict.word}",
            flush=True,
        )
        margins.append(margin)
        survivals.append(done.survival)
        stands.append(done.stands)
    margin_figure(margins, survivals, stands).savefig(picture)


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 20,
        Path(sys.argv[2] if len(sys.argv) > 2 else "margins.png"),
    )
