"""The part of the joints' box that keeps a bound on their jerk; what it is says `joint_box`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What counts as kept [rad, m].
ROUNDING = 1e-12


@njit(cache=True)  # type: ignore[untyped-decorator]
def jerk_box(
    q: Any,
    q_index: Any,
    q_lower: Any,
    q_upper: Any,
    reach: Any,
    most: Any,
    jerk: Any,
    share: Any,
    rest: Any,
    previous: Any,
    older: Any,
    left: float,
    lower: Any,
    upper: Any,
) -> int:
    """Narrow lower and upper (6 + n,) of the joints that have a bound on their jerk; see `joint_box`.

    Returns the first joint that cannot stop before its limit, or -1.

    Shapes:
        jerk: (n,) J; share: (n,) m; previous, older: (n,) the steps p and o.
        rest: (n, 3) how many ticks before rest slowing down begins, and the bounds of x and s in the last.
    """
    lost = -1
    for i in range(q_index.shape[0]):
        if not jerk[i] < np.inf:
            continue
        here, p, m = q[q_index[i]], previous[i], share[i]
        least, longest = p - most[i], p + most[i]
        middle = min(max(2.0 * p - older[i], least), longest)
        least, longest = max(least, middle - jerk[i]), min(longest, middle + jerk[i])
        s_most = reach[i]
        x_most = max(s_most, (1.0 - m) * abs(p) + m * s_most)  # what comes too fast slows down as s tells it
        if left < rest[i, 0]:
            growth = (1.0 - m) ** (1.0 - left)
            x_most = min(x_most, growth * (rest[i, 1] - (left - 1.0) * m * rest[i, 2]))
            s_most = min(s_most, growth * rest[i, 2])
        up = min(x_most, (1.0 - m) * p + m * s_most)
        down = max(-x_most, (1.0 - m) * p - m * s_most)
        end = here - p + 2.0 * p / m  # where both lags end, for x = p
        most_up = min(m * (q_upper[i] - here), p + m * m * (q_upper[i] - end))
        most_down = max(m * (q_lower[i] - here), p + m * m * (q_lower[i] - end))
        inside = q_lower[i] <= here <= q_upper[i]
        if lost < 0 and inside and max(least - most_up, most_down - longest) > ROUNDING:
            lost = i
        up, down = min(up, most_up), max(down, most_down)
        upper[6 + i] = min(max(up, least), longest)
        lower[6 + i] = min(max(down, least), upper[6 + i])
    return lost


def ways_to_rest(share: Array, reach: Array, last: Array) -> Array:
    """(n, 3) of `jerk_box`: steps fall to `last` when one tick is left, from any speed within reach.

    Backwards from there s may grow by 1 / (1 - m) a tick, and x by as much less what s adds to it.
    """
    rest = np.zeros((len(share), 3))
    for i, (m, v, x) in enumerate(zip(share, reach, last, strict=True)):
        shrinks = -math.log1p(-m)

        def fast_enough(t: float, m: float = m, v: float = v, x: float = x, rate: float = shrinks) -> bool:
            growth = math.exp(min((t - 1) * rate, 300.0))
            return growth * x / (2 * m * t) >= v and growth * x / 2 >= v

        # Where x may be fast enough is known; the bound of s falls first, and is searched where it rises.
        low = max(2.0, math.ceil(1.0 + math.log(max(2.0 * v / x, 1.0)) / shrinks))
        if not fast_enough(low):
            low, high = max(low, 1.0 / shrinks), max(2.0 * low, 2.0 / shrinks)
            while not fast_enough(high):
                high *= 2.0
            while high - low > 1.0:
                middle = math.floor(0.5 * (low + high))
                low, high = (low, middle) if fast_enough(middle) else (middle, high)
            low = math.ceil(high)
        rest[i] = low, x, x / (2 * m * low)
    return rest
