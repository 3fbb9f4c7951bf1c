"""Why a task does not get where it should: what holds it back in a tick, and what letting go would give.

A reason's gain is the derivative of the norm of the task's error after the tick, linearised, with respect to
what the reason is about, exact on the tick's active set (see `sensitivity`): a joint limit, the margin, the
place of a contact, another task's target.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError, listing
from wbplan.explain.sensitivity import Held, Slopes, slopes
from wbplan.program.qp import Multipliers, Solution
from wbplan.program.stack import Stack
from wbplan.state import State
from wbplan.statics import ease_of_pushes

Array = NDArray[np.float64]

#: What one unit is in SI.
UNITS = {
    "mm": 1e-3, "mm/s": 1e-3, "mm/s^2": 1e-3, "mm/s^3": 1e-3,
    "deg": np.pi / 180, "deg/s": np.pi / 180, "deg/s^2": np.pi / 180, "deg/s^3": np.pi / 180,
    "N": 1.0,
}  # fmt: skip

#: How a joint's limit is measured, by kind: what is appended to the unit of its position.
RATES = {"position": "", "speed": "/s", "acceleration": "/s^2", "jerk": "/s^3"}

#: Gains below this share of the largest, or below this in m or rad, are not told.
FAINT, LEAST = 1e-3, 1e-7

#: An error below this [m or rad] is none.
NONE = 1e-6

#: Multipliers below this share of the largest pull belong to bounds that are touched but do not hold.
WEAK = 1e-9

#: Without multipliers, a bound nearer than this [m or rad] counts as active.
TOUCH = 1e-9


@final
@dataclass(frozen=True)
class Reason:
    """One thing that holds a task back.

    Attributes:
        name: 'leg3_joint2 upper', 'contact(leg4_foot)', 'support polygon edge a-b', another task's label.
        kind: 'position', 'speed', 'acceleration' of a joint; 'margin' and other kinds of `RowBlock`; 'push';
            'contact', 'hard' or 'soft', of another task.
        unit: what one unit of it is: 'mm', 'deg', 'deg/s', 'N'.
        gain_per_unit: by how much the task's error [m or rad] falls for each unit that it gives way.
    """

    name: str
    kind: str
    unit: str
    gain_per_unit: float


@final
@dataclass(frozen=True)
class Why:
    """Why a task is off, as a sentence (`str`) and as numbers.

    Attributes:
        task: its label; part: 'position', 'orientation' or 'joints'.
        error: norm of that part's error after the tick, as its rows predict it; unit: 'm' or 'rad'.
        reasons: what holds it back, the largest gain by one unit first.
    """

    task: str
    part: str
    error: float
    unit: str
    reasons: tuple[Reason, ...]

    def __str__(self) -> str:
        # 'pose(box)' is the box; what somebody named themselves stays.
        match = re.fullmatch(r"\w+\(([^() ]+)\)", self.task)
        name = match[1] if match else self.task
        if self.error < NONE:
            return f"{name} is where it should be"
        off = f"{name} is {_amount(self.error, self.unit)} {'short' if self.unit == 'm' else 'off'}"
        if not self.reasons:
            return f"{off}: nothing holds it back, it is on its way"
        told = "; ".join(_told(reason, self.unit) for reason in self.reasons[:3])
        more = len(self.reasons) - 3
        return f"{off}: {told}" + (f"; and {more} more" if more > 0 else "")


def _amount(value: float, unit: str) -> str:
    return f"{1e3 * value:.3g} mm" if unit == "m" else f"{np.degrees(value):.3g} deg"


def _told(reason: Reason, unit: str) -> str:
    gives = f"gives back {_amount(reason.gain_per_unit, unit)}"
    one = f"1 {reason.unit}"
    if reason.kind in RATES:
        joint, side = reason.name.rsplit(" ", 1)
        limit = f"{side} limit" if reason.kind == "position" else f"{reason.kind} limit"
        return f"{joint} is at its {limit} ({one} more {gives})"
    if reason.kind == "margin":
        return f"the CoM is at {reason.name} ({one} less margin {gives})"
    if reason.kind == "push":
        return f"{reason.name} takes the CoM's room ({one} less {gives})"
    if reason.kind == "soft":
        return f"{reason.name} wants otherwise ({one} of its target {gives})"
    if reason.kind in ("contact", "hard"):
        return f"{reason.name} holds it ({one} elsewhere {gives})"
    return f"{reason.name} is at its {reason.kind} ({one} less {gives})"


def active_sets(stack: Stack, solution: Solution) -> tuple[Held, ...]:
    """Every level's step and active bounds: from multipliers, or from what the step touches."""
    x = solution.step[stack.free]
    if solution.levels:
        return tuple(
            _by_multipliers(stack, level.x, level.multipliers, level.stiffness) for level in solution.levels
        )
    if solution.multipliers is not None:
        return (_by_multipliers(stack, x, solution.multipliers, None),)
    box = np.where(stack.upper - x < TOUCH, 1.0, np.where(x - stack.lower < TOUCH, -1.0, 0.0))
    box[:6] = 0.0
    return (Held(x, box, stack.d - stack.C @ x < TOUCH),)


def _by_multipliers(stack: Stack, x: Array, m: Multipliers, stiffness: Array | None) -> Held:
    weak = WEAK * max(float(np.abs(stack.g).max(initial=0.0)), 1.0)
    box = np.sign(np.where(np.abs(m.box) > weak, m.box, 0.0))
    return Held(x, box, m.rows > weak, stiffness)


def explain(stack: Stack, held: tuple[Held, ...], task: str, part: str | None = None) -> Why:
    """Why a task is off after a tick.

    Args:
        stack: with the tick's matrices in it: measured, advanced and assembled.
        held: what `active_sets` gave.
        task: label of a task, or the frame of one.
        part: 'position', 'orientation' or 'joints'; by default the one that is off most.

    Raises:
        SpecError: there is no such task or part.
    """
    x = held[-1].x
    label, parts = _find(stack, task)
    if part is not None and part not in parts:
        raise SpecError(f"why('{task}'): part '{part}' does not exist; there are: {listing(list(parts))}")
    after = {name: _after(stack, label, name, x) for name in parts}
    norms = {name: float(np.linalg.norm(error)) for name, (error, _) in after.items()}
    chosen = part or max(norms, key=lambda name: norms[name])
    unit = "m" if chosen == "position" else "rad"
    error, rows = after[chosen]
    if norms[chosen] < NONE:
        return Why(label, chosen, norms[chosen], unit, ())
    found = slopes(stack, held, -rows.T @ error / norms[chosen])
    reasons = [r for r in _reasons(stack, held, found, label) if r.gain_per_unit > LEAST]
    reasons.sort(key=lambda r: -r.gain_per_unit)
    reasons = [r for r in reasons if r.gain_per_unit > FAINT * reasons[0].gain_per_unit]
    return Why(label, chosen, norms[chosen], unit, tuple(reasons))


def _find(stack: Stack, task: str) -> tuple[str, tuple[str, ...]]:
    """The label and parts of a task by its label or frame."""
    parts: dict[str, list[str]] = {}
    for label, part, _ in stack.rows.labels:
        if not label.startswith("contact("):
            parts.setdefault(label, []).append(part)
    for label in [*(p.label for p in stack.postures), *(label for *_, label in stack.hard_joints)]:
        parts.setdefault(label, ["joints"])
    if task in parts:
        return task, tuple(parts[task])
    named = [t.label for t in stack.phase.phase.frame_tasks if t.frame == task and t.label in parts]
    if len(named) == 1:
        return named[0], tuple(parts[named[0]])
    what = f"is the frame of {len(named)} tasks" if named else "does not exist"
    raise SpecError(f"why: task '{task}' {what}; there are: {listing(named or list(parts))}")


def _after(stack: Stack, label: str, part: str, x: Array) -> tuple[Array, Array]:
    """A task's error after step x, and its rows (k, nf)."""
    if part == "joints":
        n = len(x)
        for posture in stack.postures:
            if posture.label == label:
                columns = 6 + np.flatnonzero(posture.stiffness > 0.0)
                here = stack.kinematics.q[stack.q_index[columns - 6]] + x[columns]
                return posture.goal[columns - 6] - here, np.eye(n)[columns]
        at = [stack.rows.hard + i for i, (*_, name) in enumerate(stack.hard_joints) if name == label]
        return stack.b[at] - stack.A[at] @ x, stack.A[at]
    span = next(s for name, kind, s in stack.rows.labels if (name, kind) == (label, part))
    if span.stop <= stack.rows.hard:
        return stack.b[span] - stack.A[span] @ x, stack.A[span]
    soft = slice(span.start - stack.rows.hard, span.stop - stack.rows.hard)
    rows = np.concatenate([level.rows for level in stack.levels])[soft]
    # What the pull leaves of the error, and what the step leaves of what was asked of it.
    left = np.concatenate([(1.0 - level.pulls) * level.error + level.rhs for level in stack.levels])[soft]
    return left - rows @ x, rows


def _reasons(stack: Stack, held: tuple[Held, ...], found: Slopes, label: str) -> Iterator[Reason]:
    yield from _bounds(stack, held, found)
    for k, (name, kind, unit) in enumerate(stack.row_names()):
        if name and found.rows[k]:
            one = "mm" if unit == "m" else "deg"
            # The CoM slows down before an edge: a tick may take only this share of what is left.
            share = _share(stack) if kind == "margin" else 1.0
            yield Reason(name, kind, one, -share * float(found.rows[k]) * UNITS[one])
    yield from _pushes(stack, found)
    groups: dict[tuple[str, str, str], list[float]] = {}
    for (name, unit), slope in zip(stack.hard_names(), found.hard, strict=True):
        kind = "contact" if name.startswith("contact(") else "hard"
        groups.setdefault((name, kind, "mm" if unit == "m" else "deg"), []).append(float(slope))
    by_rows = np.concatenate([np.zeros(stack.rows.hard), *found.rhs])
    for name, part, span in stack.rows.labels:
        if span.start >= stack.rows.hard and name != label:
            one = "mm" if part == "position" else "deg"
            groups.setdefault((name, "soft", one), []).extend(by_rows[span].tolist())
    for posture, slope in zip(stack.postures, np.concatenate(found.joints), strict=True):
        if posture.label != label:
            groups.setdefault((posture.label, "soft", "deg"), []).extend(slope.tolist())
    for (name, kind, one), values in groups.items():
        if name != label:
            yield Reason(name, kind, one, float(np.linalg.norm(values)) * UNITS[one])


def _share(stack: Stack) -> float:
    """Of what is left to an edge of the support polygon, what a tick may take."""
    return 2.0 / (stack.box.ticks + 1.0) if stack.easing == 0 else 1.0


def _pushes(stack: Stack, found: Slopes) -> Iterator[Reason]:
    """Pushes that leave the CoM less room: the region's active edges move as a push becomes less."""
    compiled, edges = stack.phase, found.rows[: len(stack.normals)]
    if compiled.polygon is None or not compiled.phase.pushes or not edges.any():
        return
    state = State(compiled.model, stack.kinematics.q)
    eased = ease_of_pushes(compiled.phase, compiled.model, state, compiled.contact_points, compiled.polygon)
    for frame, moved in eased.items():
        yield Reason(f"push({frame})", "push", "N", -_share(stack) * float(edges @ moved))


def _bounds(stack: Stack, held: tuple[Held, ...], found: Slopes) -> Iterator[Reason]:
    """Joint limits: by how much each moves the bounds that are active, and what these give."""
    names = stack.box_names()
    upper = np.array([level.box for level in held]).sum(axis=0) > 0.0
    joints = stack.phase.robot.joint_names
    for column in np.flatnonzero(found.box):
        up = bool(upper[column])
        kind = stack.box.kind(
            int(column), float((stack.upper if up else stack.lower)[column]), stack.box.history()
        )
        base = "mm" if _slides(stack, int(column)) else "deg"
        one = base + RATES[kind]
        by = 1e-3 * UNITS[one]
        with stack.box.relaxed(int(column), kind, by, up=up):
            stack.fill_box()
            low, high = stack.lower.copy(), stack.upper.copy()
        stack.fill_box()
        moved = np.where(upper, high - stack.upper, low - stack.lower)
        gain = -float(found.box[6:] @ moved[6:]) * UNITS[one] / by
        name = names[column][int(up)] if kind == "position" else f"{joints[stack.free[column] - 6]} {kind}"
        yield Reason(name, kind, one, gain)


def keep_goals(stack: Stack) -> tuple[Array, ...]:
    """The goals of this moment where a live target may change them, else nothing; for `put_goals`."""
    if not stack.live:
        return ()
    return tuple(goal.copy() for goal in _goals(stack))


def put_goals(stack: Stack, goals: tuple[Array, ...]) -> None:
    """Put the goals where they were when they were kept."""
    for kept, goal in zip(goals, _goals(stack), strict=False):
        goal[:] = kept


def _goals(stack: Stack) -> list[Array]:
    rows = stack.rows
    postures = [posture.goal for posture in stack.postures]
    return [rows.position_goal, rows.rotation_goal, rows.com_goal, *postures]


def _slides(stack: Stack, column: int) -> bool:
    """Whether a free column is that of a sliding joint."""
    return "JointModelP" in stack.phase.model.joints[int(stack.free[column]) - 4].shortname()
