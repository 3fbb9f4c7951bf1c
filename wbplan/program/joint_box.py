"""The box on a tick's step: joint positions, speeds and accelerations that never contradict each other.

Everything is counted in steps, how far a joint goes in one tick [rad, m]: x = v dt, after a step p. With
A = a dt^2, V = v_max dt and B = BRAKING A the box is

    |x - p| <= A,    |x| <= V,    |x| <= B M,    -2 (q - lower) / (M + 1) <= x <= 2 (upper - q) / (M + 1)

where M is the number of ticks in which all joints together come to rest when each slows by at most B a tick.
Feet on the ground and closed loops tie joints together, so that one alone may not be able to brake; but all
speeds times one factor is a motion that every such tie allows (but for curvature: BRAKING leaves some of the
acceleration for it). Slowing so for M ticks the steps x (1 - 1/M), x (1 - 2/M), ... lead on by x (M - 1) / 2:
whoever keeps the bounds above, on the CoM's way to an edge of the support polygon likewise, stops in time.

M is free to choose, the larger the faster joints may be, and the earlier they slow down before a limit. It is
the largest for which slowing down as much as the acceleration allows, all x = (1 - min(1, 2 / M_p)) p with
M_p = max |p| / B, keeps the bounds again, but may always be M_p + GROWTH. A state that is within the bounds
for that slower motion only keeps to it, as long as each joint by itself can still stop in time,

    x <= brake(upper - q),   brake(d) = B (d / B / (n + 1) + n / 2),   n = floor((sqrt(1 + 8 d / B) - 1) / 2)

the longest step for which x, x - B, x - 2B, ... add up to d at most. So the box is never empty, and what it
allows never leaves the limits. A state outside of them comes back along the same curve.

Joints of a limb that a hard task leads along a path do not count in M: they brake by themselves, or the tick
has no step and cares less (`Stack.ease`).

With a bound j on a joint's jerk too, after steps p and o before it, braking is two first-order lags: x goes
towards s, and s towards rest, by a share m a tick. What lags behind a quantity stays within any bounds that
both are in, so with J = j dt^3

    m = min(BRAKING J / 2A, B / V)        s = p + (x - p) / m
    |x - 2p + o| <= J,    |s| <= V,    lower <= q + x / m <= upper
    lower <= q - p + 2p / m + (x - p) / m^2 <= upper

beside |x - p| <= A and |x| <= V never contradict each other either, in a joint by itself. The last two are
where it would come to rest with the first lag alone, and with both.

Source: A. Del Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of
robot manipulators", 2018, for one joint by itself; the common M is for joints that are tied together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SpecError
from wbplan.program.jerk_box import jerk_box, ways_to_rest

Array = NDArray[np.float64]

#: What a tick knows of those before it: two steps, ticks before rest, braking, the step of the CoM.
Pace = tuple[Array, Array, float, Array, Array]

#: Share of the acceleration by which joints slow in each of the M ticks; at a limit they use twice of it.
BRAKING = 0.45

#: By how much M may always grow in a tick: joints that take over from one that stops have to speed up.
GROWTH = 1.0

#: A CoM that comes from outside its margin is on its way back at full recovery speed after this time [s].
RECOVERY = 0.1

#: Stands for no bound in the QP.
UNBOUNDED = 1e20

#: Ticks before rest, where none is asked for.
NEVER = 1e15

#: Bounds nearer to each other than this share are one.
SAME = 1e-9


@njit(cache=True)  # type: ignore[untyped-decorator]
def stopping(
    q: Any,
    q_index: Any,
    q_lower: Any,
    q_upper: Any,
    slowing: Any,
    previous: Any,
    led: Any,
    distances: Any,
    closing: Any,
    left: float,
) -> tuple[float, float]:
    """M, and the factor 1 - min(1, 2 / M_p) of the steps when all slow down at once; see the module.

    Shapes:
        q_lower, q_upper: (n,) position limits; slowing: (n,) B; previous: (n,) the step p; led: as in `box`.
        distances: (E,) of the CoM to the edges that it keeps inside [m]; closing: (E,) by how much the last
            step shortened them. left: ticks before rest.
    """
    ticks = 0.0
    for i in range(slowing.shape[0]):
        if not led[i]:
            ticks = max(ticks, abs(previous[i]) / slowing[i])
    factor = max(0.0, 1.0 - 2.0 / max(ticks, 2.0))
    most = min(ticks + 1.0 / BRAKING, left)
    if factor > 0.0:
        for i in range(slowing.shape[0]):
            p, here = previous[i], q[q_index[i]]
            gap = q_upper[i] - here if p > 0.0 else here - q_lower[i]
            if gap >= 0.0 and not led[i] and factor * abs(p) * (most + 1.0) > 2.0 * gap:
                most = 2.0 * gap / (factor * abs(p)) - 1.0
        for e in range(distances.shape[0]):
            if distances[e] >= 0.0 and factor * closing[e] * (most + 1.0) > 2.0 * distances[e]:
                most = 2.0 * distances[e] / (factor * closing[e]) - 1.0
    return max(most, min(ticks + GROWTH, left), 1.0), factor


@njit(cache=True)  # type: ignore[untyped-decorator]
def box(
    q: Any,
    q_index: Any,
    q_lower: Any,
    q_upper: Any,
    reach: Any,
    most: Any,
    slowing: Any,
    previous: Any,
    led: Any,
    left: float,
    ticks: float,
    factor: float,
    ease: int,
    lower: Any,
    upper: Any,
) -> None:
    """Write lower and upper (6 + n,) of n free joints; see the module.

    Shapes:
        q_lower, q_upper: (n,) position limits; reach: (n,) V; most: (n,) A; slowing: (n,) B.
        previous: (n,) the step p; led: (n,) whether a hard task's path leads the joint, which then stops by
            itself or not at all; left: ticks before rest; ticks, factor: of `stopping`.
        ease: 0, all joints can stop together; 1, each by itself; 2, by itself with nearly all of A.
    """
    for i in range(q_index.shape[0]):
        here, p, a, v = q[q_index[i]], previous[i], most[i], reach[i]
        for side in (1.0, -1.0):
            gap = q_upper[i] - here if side > 0.0 else here - q_lower[i]
            if gap < 0.0:
                bound = -min(v, brake(-gap, slowing[i]))
            else:
                bound = alone = min(v, _alone(gap, 2.0 * BRAKING * a, left))
                if ease <= 1:
                    bound = min(alone, _alone(gap, slowing[i], left))
                if ease <= 0 and not led[i]:
                    together = min(bound, slowing[i] * ticks, 2.0 * gap / (ticks + 1.0))
                    bound = max(together, min(alone, side * p * factor))
            if side > 0.0:
                upper[6 + i] = max(min(bound, p + a), p - a)
            else:
                lower[6 + i] = min(max(-bound, p - a), p + a)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _alone(gap: float, slowing: float, left: float) -> float:
    """The longest step of a joint that slows by `slowing` a tick, by itself, for its limit and for rest."""
    fastest = slowing * left
    return fastest if slowing * gap >= fastest * (fastest + slowing) else min(fastest, brake(gap, slowing))


@njit(cache=True)  # type: ignore[untyped-decorator]
def brake(gap: float, slowing: float) -> float:
    """The longest step x after which x - slowing, x - 2 slowing, ... still stops within `gap`."""
    n = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * gap / slowing) - 1.0))
    found: float = gap / (n + 1.0) + 0.5 * n * slowing
    return found


@final
class JointBox:
    """The box of a phase's free joints, filled each tick for the steps before it.

    Args:
        phase: the phase.
        dt: length of a tick [s].

    Attributes:
        lower, upper: (nf,) bounds on the step of the free columns; the base, first, has none.
        q_index: (n,) where the free joints are in q.
        last: (nf,) the last step of the free columns.
        previous, older: (n,) the last step and the one before it; com_step: (3,) the CoM's last step [m].
        left: ticks before the robot is to be at rest, this one included.
        reach, most: (n,) how far the speed limits let the joints go in a tick, and how much further or less
            far than in the last one.
        jerky: whether there is a bound on jerk; lost: a joint that cannot stop in time within it, or -1.
        ticks: M of the last `fill`; factor: of the steps, when all joints slow down at once.
    """

    def __init__(self, phase: CompiledPhase, dt: float) -> None:
        model, limits, joints = phase.model, phase.phase.joint_limits, phase.free[6:]
        n = len(joints)
        self.dt = dt
        self.lower, self.upper = np.full(6 + n, -UNBOUNDED), np.full(6 + n, UNBOUNDED)
        self.q_index = joints + 1
        self.last, self.older, self.left = np.zeros(6 + n), np.zeros(n), NEVER
        self.previous = self.last[6:]
        self.com_step = np.zeros(3)
        self.ticks, self.factor = 1.0, 0.0
        self.reach, self.most, self.slowing, self._jerk = np.full((4, n), UNBOUNDED)
        self._led = phase.led[joints - 6]
        self._limited, self.jerky, self.lost = limits is not None, False, -1
        if limits is None:
            return
        self._q_lower = np.array(model.lowerPositionLimit)[self.q_index]
        self._q_upper = np.array(model.upperPositionLimit)[self.q_index]
        self.reach = limits.speed * np.array(model.velocityLimit)[joints] * dt
        self.most = phase.acceleration[joints - 6] * dt**2
        self.slowing = BRAKING * phase.braking[joints - 6] * dt**2
        if phase.jerk is not None:
            self.jerky = True
            self._jerk = phase.jerk[joints - 6] * dt**3
            self._share = np.minimum(
                0.9, np.minimum(BRAKING * self._jerk / (2 * self.most), self.slowing / self.reach)
            )
            if (slow := np.flatnonzero(self._share < 1e-9)).size:
                name = phase.robot.joint_names[joints[slow[0]] - 6]
                raise SpecError(
                    f"phase '{phase.phase.name}': jerk of joint '{name}' is too small to come to rest"
                )
            self._rest = ways_to_rest(self._share, self.reach, self.slowing)

    def brake_as(self, acceleration: Array) -> None:
        """Count on no more for braking than these (n,) accelerations of the free joints [rad/s^2, m/s^2]."""
        if self._limited:
            self.slowing = np.minimum(self.slowing, BRAKING * acceleration * self.dt**2)

    def fill(self, q: Array, distances: Array, closing: Array, ease: int = 0) -> None:
        """Write lower, upper, ticks and factor for the step from `q`.

        Args:
            q: (nq,).
            distances: (E,) [m] from the CoM to the edges that it keeps inside.
            closing: (E,) [m], by how much the last step shortened them.
            ease: of `box`.
        """
        if not self._limited:
            return
        limits = (q, self.q_index, self._q_lower, self._q_upper)
        p, left = self.previous, self.left
        self.ticks, self.factor = stopping(*limits, self.slowing, p, self._led, distances, closing, left)
        box(
            *limits, self.reach, self.most, self.slowing, p, self._led, left, self.ticks, self.factor, ease,
            self.lower, self.upper,
        )  # fmt: skip
        if self.jerky:
            self.lost = jerk_box(
                *limits, self.reach, self.most, self._jerk, self._share, self._rest, p, self.older, left,
                self.lower, self.upper,
            )  # fmt: skip

    @contextmanager
    def relaxed(self, column: int, kind: str, by: float, *, up: bool) -> Iterator[None]:
        """With one limit of a joint wider by so much [rad, m, per s, ...], until the block ends."""
        names = ("_q_lower", "_q_upper", "reach", "most", "slowing", "_jerk")
        kept, j = {name: getattr(self, name) for name in names}, column - 6
        for name in names:
            setattr(self, name, kept[name].copy())
        if kind == "speed":
            self.reach[j] += by * self.dt
        elif kind == "acceleration":
            self.most[j] += by * self.dt**2
            self.slowing[j] += BRAKING * by * self.dt**2
        elif kind == "jerk":
            self._jerk[j] += by * self.dt**3
        elif up:
            self._q_upper[j] += by
        else:
            self._q_lower[j] -= by
        yield
        for name in names:
            setattr(self, name, kept[name])

    def took(self, step: Array, com_step: Array) -> None:
        """The free columns went on by a step (nf,), the CoM by (3,) [m]."""
        self.older[:] = self.previous
        self.last[:], self.com_step[:] = step, com_step

    def keep_pace(self) -> Pace:
        """What this tick knows of those before it, for `put_pace`."""
        return self.last.copy(), self.older.copy(), self.left, self.slowing, self.com_step.copy()

    def put_pace(self, pace: Pace) -> None:
        """Know of the ticks before what was kept."""
        self.last[:], self.older[:], self.left, self.slowing, self.com_step[:] = pace

    def slowed(self, gaps: Array, closing: Array, share: float) -> Array:
        """By how much the next step may shorten distances that are to stay above zero, so that it can stop.

        Args:
            gaps: (k,) what is left of them [m].
            closing: (k,) by how much the last step shortened them.
            share: of what is left, that no step uses up more of.
        """
        slow = np.maximum(min(share, 2.0 / (self.ticks + 1.0)) * gaps, self.factor * closing)
        most: Array = np.where(gaps > 0.0, np.minimum(gaps, slow), gaps)
        return most

    def history(self) -> tuple[Array, Array, float]:
        """What `kind` has to know of this tick, kept."""
        return self.previous.copy(), self.older.copy(), self.ticks

    def kind(self, column: int, bound: float, history: tuple[Array, Array, float]) -> str:
        """What a bound of the box is: 'acceleration', 'jerk', 'speed' or 'position'.

        Args:
            column: of the box.
            bound: its value.
            history: `history` of its tick.
        """
        j, (previous, older, ticks) = column - 6, history
        p = float(previous[j])
        if abs(bound - p) >= self.most[j] * (1 - SAME) or abs(bound) >= self.slowing[j] * ticks * (1 - SAME):
            return "acceleration"
        if self.jerky and abs(bound - 2 * p + older[j]) >= self._jerk[j] * (1 - SAME):
            return "jerk"
        return "speed" if abs(bound) >= self.reach[j] * (1 - SAME) else "position"
