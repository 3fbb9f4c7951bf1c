"""Why tasks of a plan are off: at a time that is asked for, and noted along the way for the view."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import Trajectory
from wbplan.errors import SolveError, SpecError, WbplanError
from wbplan.explain.why import Why
from wbplan.paths import number
from wbplan.problem.limits import SupportPolygon
from wbplan.problem.tasks import FrameTask
from wbplan.tick import Loop, Tick

Array = NDArray[np.float64]

#: Seconds from one note to the next, and how many a plan has at most.
EVERY, MOST = 0.5, 200

#: A task that is off by less than this [m], [rad] is not worth a note.
WORTH = {"position": 1e-3, "orientation": np.radians(0.1)}


def worst(tick: Tick, loop: Loop) -> Why | None:
    """Why the soft task is off that counts most: of the highest level, then by weight times error.

    None where no task is off by more than `WORTH`, or no limit is active.
    """
    rows = loop.stack.rows
    off = []
    for label, part, span in rows.labels:
        error = tick.errors[f"{label}.{part}"]
        if span.start >= rows.hard and error > WORTH[part]:
            level = rows.levels[span.start - rows.hard]
            off.append((-level, float(rows.weight[span].max()) * error, label, part))
    if not off or all(active.kind == "hard" for active in tick.active):
        return None
    *_, label, part = max(off)
    why = tick.why(label, part)
    return why if why.reasons else None


@final
class Notes:
    """Sentences about the worst task, sampled along a plan."""

    def __init__(self, duration: float) -> None:
        self._every = max(EVERY, duration / MOST)
        self._next = 0.0
        self.found: list[dict[str, Any]] = []

    def take(self, loop: Loop, tick: Tick, t: float) -> None:
        """Note what is worth it at time `t` [s] of the plan, the end of a tick."""
        if t < self._next - 1e-9:
            return
        self._next += self._every
        why = worst(tick, loop)
        if why is not None:
            self.found.append({"time": t, "until": self._next, "task": why.task, "text": str(why)})


def asked_of_support(loop: Loop, begun: Callable[..., Loop], ticks: int, error: SolveError) -> str:
    """How far hard tasks would take the CoM, where a support polygon stands against them.

    The phase is gone through once more without its polygon: the least margin then is what they ask for.

    Args:
        loop: at the last state that keeps every promise.
        begun: the keyword `phase` -> its loop, from the state in which the phase began.
        ticks: of the phase.
        error: what said that no step exists.

    Returns:
        A sentence with what is asked and what is possible, [m]; nothing where no support is in the way.
    """
    phase, polygon, model = loop.compiled.phase, loop.compiled.polygon, loop.compiled.model
    against = next(
        (c.name for c in error.clashes if c.name.startswith(("support polygon", "support region"))), None
    )
    if against is None or polygon is None or phase.margin is None:
        return ""
    limits = tuple(limit for limit in phase.limits if not isinstance(limit, SupportPolygon))
    free = begun(phase=replace(phase, limits=limits))
    root = next(f.name for f in model.frames if f.parentJoint == 1 and f.name != "root_joint")
    given = [t.label for t in phase.soft_tasks if isinstance(t, FrameTask) and t.frame == root and not t.root]
    asked, at = polygon.margin(free.stack.kinematics.com[:2]), dict(free.stack.errors())
    with contextlib.suppress(WbplanError):
        for _ in range(ticks):
            free.step()
            margin = polygon.margin(free.stack.kinematics.com[:2])
            if margin < asked:
                asked, at = margin, dict(free.stack.errors())
    if asked >= phase.margin:
        return ""
    now = loop.stack.errors()
    said = f"; {against}: hard tasks ask for a margin of {asked:.4f} m, {phase.margin:.4f} m is to be kept"
    ways = [(at[key], now[key], label) for label in given if (key := f"{label}.position") in now]
    said += "".join(
        f"; '{label}' would have to give way by {much:.4f} m, {possible:.4f} m is possible"
        for much, possible, label in ways
        if much > possible + 1e-4
    )
    return said


def why_at(
    loops: Sequence[tuple[float, Loop]], motion: Trajectory, t: float, task: str, part: str | None
) -> Why:
    """The tick of a plan that starts at time `t` [s] once more, and why a task is off after it.

    Args:
        loops: start [s] and loop of every phase.
        motion: what was planned.
        t: time [s] of the plan; the sample at or before it counts.
        task: as for `Tick.why`.
        part: likewise.

    Raises:
        SpecError: the time is not the plan's, or there is no such task in the phase.
    """
    t = number(t, "Plan.why: t", "a time in seconds")
    first, last = float(motion.time[0]), float(motion.time[-1])
    if not first <= t <= last:
        raise SpecError(f"Plan.why: t: expected a time from {first:.4g} to {last:.4g} s, got {t:.4g}")
    k = min(int(np.searchsorted(motion.time, t + 1e-9, side="right")) - 1, len(motion.time) - 2)
    start, loop = loops[int(motion.phase[k])]
    loop.put(motion.q[k], float(motion.time[k]) - start)
    return loop.step().why(task, part)
