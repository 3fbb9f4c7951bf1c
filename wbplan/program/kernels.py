"""The inner loops of a tick, compiled: errors of all rows, and the QP's matrices.

Everything here is arithmetic on arrays that the caller owns; there are no decisions about tasks in it. In
numpy the same work costs some sixty small calls of about a microsecond each.

A frame row is a 6-vector w against Pinocchio's world Jacobian J, whose columns are spatial velocities
(v_O, omega) at the world's origin. For frame b seen from root a, with unit axis u of the root:

    along u:  u . (v_b - v_a at b's origin) = (u, p_b x u) . (J_b - J_a)
    about u:  u . (omega_b - omega_a)       = (0, u)       . (J_b - J_a)

J_b and J_a are J with the columns that do not move b, or a, set to zero; so one mask per row, support of b
minus support of a, turns w J into the row, and common ancestors cancel exactly. A row of the CoM is one of
Pinocchio's CoM Jacobian.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

#: Below this angle [rad] the derivative of the rotation logarithm is taken for the identity plus half a turn.
SMALL_TURN = 1e-4


@njit(cache=True)  # type: ignore[untyped-decorator]
def rotation_log(r: Any, out: Any) -> None:
    """Rotation vector [rad] of a rotation (3, 3), by way of its quaternion: exact up to half a turn."""
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        w = 0.25 * s
        x, y, z = (r[2, 1] - r[1, 2]) / s, (r[0, 2] - r[2, 0]) / s, (r[1, 0] - r[0, 1]) / s
    elif r[0, 0] > r[1, 1] and r[0, 0] > r[2, 2]:
        s = 2.0 * math.sqrt(1.0 + r[0, 0] - r[1, 1] - r[2, 2])
        w = (r[2, 1] - r[1, 2]) / s
        x, y, z = 0.25 * s, (r[0, 1] + r[1, 0]) / s, (r[0, 2] + r[2, 0]) / s
    elif r[1, 1] > r[2, 2]:
        s = 2.0 * math.sqrt(1.0 + r[1, 1] - r[0, 0] - r[2, 2])
        w = (r[0, 2] - r[2, 0]) / s
        x, y, z = (r[0, 1] + r[1, 0]) / s, 0.25 * s, (r[1, 2] + r[2, 1]) / s
    else:
        s = 2.0 * math.sqrt(1.0 + r[2, 2] - r[0, 0] - r[1, 1])
        w = (r[1, 0] - r[0, 1]) / s
        x, y, z = (r[0, 2] + r[2, 0]) / s, (r[1, 2] + r[2, 1]) / s, 0.25 * s
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    n = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if n < 1e-12 else 2.0 * math.atan2(n, w) / n
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@njit(cache=True)  # type: ignore[untyped-decorator]
def log_derivative(e: Any, out: Any) -> None:
    """J (3, 3) with log(exp(e) exp(d)) = e + J d to first order: I + [e]/2 + c [e]^2."""
    x, y, z = e[0], e[1], e[2]
    square = x * x + y * y + z * z
    if square < SMALL_TURN * SMALL_TURN:
        c = 1.0 / 12.0
    else:
        angle = math.sqrt(square)
        c = 1.0 / square - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
    out[0, 0], out[1, 1], out[2, 2] = (
        1.0 - c * (y * y + z * z),
        1.0 - c * (x * x + z * z),
        1.0 - c * (x * x + y * y),
    )
    out[0, 1], out[1, 0] = -0.5 * z + c * x * y, 0.5 * z + c * x * y
    out[0, 2], out[2, 0] = 0.5 * y + c * x * z, -0.5 * y + c * x * z
    out[1, 2], out[2, 1] = -0.5 * x + c * y * z, 0.5 * x + c * y * z


@njit(cache=True)  # type: ignore[untyped-decorator]
def measure(
    p: Any,
    r: Any,
    com: Any,
    place: Any,
    place_goal: Any,
    turn: Any,
    turn_goal: Any,
    com_goal: Any,
    chosen: Any,
    n_hard: int,
    all_error: Any,
    error: Any,
    normals: Any,
    offsets: Any,
) -> tuple[float, float]:
    """Errors, target minus actual along the root's axes, of every target and of the rows chosen from them.

    Shapes:
        p: (F, 3) [m], r: (F, 3, 3): poses of the frames read. com: (3,) [m].
        place: (K, 2) frame and root of each position target; place_goal: (K, 3) [m], in the root.
        turn: (T, 2) frame and root of each rotation target; turn_goal: (T, 3, 3), in the root.
        com_goal: (M, 3) [m].
        chosen: (n,) which of the 3 (K + T + M) components is each row; the first n_hard rows are hard.
        all_error: (K + T + M, 3) and error: (n,) are written.
        normals: (E, 2), offsets: (E,) [m]: the support polygon's edges.

    Returns:
        The largest absolute error of a hard row (nan if one is), and the least distance [m] to an edge.
    """
    places, turns = place.shape[0], turn.shape[0]
    relative = np.empty((3, 3))
    gap = np.empty((3, 3))
    for k in range(places):
        b, a = place[k, 0], place[k, 1]
        d0, d1, d2 = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
        for i in range(3):
            all_error[k, i] = place_goal[k, i] - (r[a, 0, i] * d0 + r[a, 1, i] * d1 + r[a, 2, i] * d2)
    for k in range(turns):
        b, a = turn[k, 0], turn[k, 1]
        for i in range(3):
            for j in range(3):
                relative[i, j] = r[a, 0, i] * r[b, 0, j] + r[a, 1, i] * r[b, 1, j] + r[a, 2, i] * r[b, 2, j]
        for i in range(3):
            for j in range(3):
                gap[i, j] = (
                    turn_goal[k, i, 0] * relative[j, 0]
                    + turn_goal[k, i, 1] * relative[j, 1]
                    + turn_goal[k, i, 2] * relative[j, 2]
                )
        rotation_log(gap, all_error[places + k])
    for k in range(com_goal.shape[0]):
        for i in range(3):
            all_error[places + turns + k, i] = com_goal[k, i] - com[i]
    drift = 0.0
    for n in range(chosen.shape[0]):
        value = all_error[chosen[n] // 3, chosen[n] % 3]
        error[n] = value
        if n < n_hard and not abs(value) <= drift:
            drift = abs(value)
    margin = np.inf
    for e in range(offsets.shape[0]):
        margin = min(margin, offsets[e] - normals[e, 0] * com[0] - normals[e, 1] * com[1])
    return drift, margin


@njit(cache=True)  # type: ignore[untyped-decorator]
def wrenches(p: Any, r: Any, place: Any, turn: Any, turn_error: Any, chosen: Any, out: Any) -> None:
    """The w (n, 6) of every frame row for poses p, r and the rotation errors (T, 3) that `measure` left."""
    places, turns = place.shape[0], turn.shape[0]
    derivative = np.empty((turns, 3, 3))
    for k in range(turns):
        log_derivative(turn_error[k], derivative[k])
    for n in range(chosen.shape[0]):
        k, i = chosen[n] // 3, chosen[n] % 3
        if k < places:
            b, a = place[k, 0], place[k, 1]
            u0, u1, u2 = r[a, 0, i], r[a, 1, i], r[a, 2, i]
            out[n, 0], out[n, 1], out[n, 2] = u0, u1, u2
            out[n, 3] = p[b, 1] * u2 - p[b, 2] * u1
            out[n, 4] = p[b, 2] * u0 - p[b, 0] * u2
            out[n, 5] = p[b, 0] * u1 - p[b, 1] * u0
        elif k < places + turns:
            a, d = turn[k - places, 1], derivative[k - places]
            out[n, 0], out[n, 1], out[n, 2] = 0.0, 0.0, 0.0
            for j in range(3):
                out[n, 3 + j] = d[i, 0] * r[a, j, 0] + d[i, 1] * r[a, j, 1] + d[i, 2] * r[a, j, 2]


@njit(cache=True)  # type: ignore[untyped-decorator]
def rows(
    jacobian: Any,
    com_jacobian: Any,
    wrench: Any,
    mask: Any,
    chosen: Any,
    frame_groups: int,
    free: Any,
    driven: Any,
    driven_step: Any,
    out: Any,
    given: Any,
) -> None:
    """Rows (n, nf) over the free columns, and what the driven columns give each row in this tick (n,)."""
    for n in range(chosen.shape[0]):
        given[n] = 0.0
        if chosen[n] >= 3 * frame_groups:
            axis = chosen[n] % 3
            for c in range(free.shape[0]):
                out[n, c] = com_jacobian[axis, free[c]]
            for c in range(driven.shape[0]):
                given[n] += com_jacobian[axis, driven[c]] * driven_step[c]
            continue
        w0, w1, w2 = wrench[n, 0], wrench[n, 1], wrench[n, 2]
        w3, w4, w5 = wrench[n, 3], wrench[n, 4], wrench[n, 5]
        for c in range(free.shape[0]):
            column = free[c]
            sign = mask[n, column]
            if sign == 0.0:
                out[n, c] = 0.0
            else:
                out[n, c] = sign * (
                    w0 * jacobian[0, column]
                    + w1 * jacobian[1, column]
                    + w2 * jacobian[2, column]
                    + w3 * jacobian[3, column]
                    + w4 * jacobian[4, column]
                    + w5 * jacobian[5, column]
                )
        for c in range(driven.shape[0]):
            column = driven[c]
            sign = mask[n, column] * driven_step[c]
            if sign != 0.0:
                for i in range(6):
                    given[n] += sign * wrench[n, i] * jacobian[i, column]


@njit(cache=True)  # type: ignore[untyped-decorator]
def cost(
    soft: Any,
    weight: Any,
    rhs: Any,
    error: Any,
    curvature: Any,
    diagonal: Any,
    stiffness: Any,
    pull: Any,
    goal: Any,
    step: Any,
    joints: Any,
    H: Any,
    g: Any,
) -> float:
    """H and g of 1/2 |weight (J x - rhs)|^2 over soft rows, the diagonal, and the posture tasks.

    Shapes:
        soft: (s, nf) rows; weight, rhs, error, curvature: (s,).
        diagonal: (nf,) what always stands on H's diagonal.
        stiffness, goal, step: (t, nf - 6) of each posture task; pull: (t,); joints: (nf - 6,) where they are.

    Returns:
        The curvature damping that was added to the diagonal.
    """
    nf = diagonal.shape[0]
    damping = 0.0
    for k in range(soft.shape[0]):
        damping += curvature[k] * abs(error[k])
    for i in range(nf):
        g[i] = 0.0
        for j in range(i + 1):
            H[i, j] = 0.0
        H[i, i] = diagonal[i] + damping
    for k in range(soft.shape[0]):
        square = weight[k] * weight[k]
        for i in range(nf):
            value = square * soft[k, i]
            if value != 0.0:
                g[i] -= value * rhs[k]
                for j in range(i + 1):
                    H[i, j] += value * soft[k, j]
    for i in range(nf):
        for j in range(i):
            H[j, i] = H[i, j]
    for t in range(pull.shape[0]):
        for i in range(nf - 6):
            wanted = pull[t] * (goal[t, i] - step[t, i] - joints[i]) + step[t, i]
            g[6 + i] -= stiffness[t, i] * wanted
    return damping


@njit(cache=True)  # type: ignore[untyped-decorator]
def polygon(
    normals: Any,
    com_jacobian: Any,
    free: Any,
    driven: Any,
    driven_step: Any,
    most: Any,
    C: Any,
    d: Any,
) -> None:
    """C and d of N J x <= most (E,) [m]: by how much this tick may bring the CoM nearer to each edge."""
    for e in range(most.shape[0]):
        x, y = normals[e, 0], normals[e, 1]
        for c in range(free.shape[0]):
            C[e, c] = x * com_jacobian[0, free[c]] + y * com_jacobian[1, free[c]]
        d[e] = most[e]
        for c in range(driven.shape[0]):
            column = driven[c]
            d[e] -= (x * com_jacobian[0, column] + y * com_jacobian[1, column]) * driven_step[c]


@njit(cache=True)  # type: ignore[untyped-decorator]
def approach(
    distances: Any,
    closing: Any,
    ticks: float,
    factor: float,
    back: float,
    ramp: float,
    ease: int,
    most: Any,
) -> None:
    """By how much this tick may bring the CoM nearer to each edge, most (E,) [m].

    Inside, so that it stops before the edge when all joints slow down (see `joint_box`), but never less than
    that slowing leads on by itself. Outside, inward: up to `back`, and by no more than `ramp` faster than
    before.

    Shapes:
        distances: (E,) of the CoM to the edges [m]; closing: (E,) by how much the last tick shortened them.
        ticks, factor: of `joint_box.stopping`; back, ramp: [m]; ease: of `joint_box.box`.
    """
    for e in range(distances.shape[0]):
        slower = closing[e] * factor if closing[e] > 0.0 else closing[e]
        if distances[e] >= 0.0:
            most[e] = distances[e]
            if ease == 0:
                most[e] = min(distances[e], max(2.0 * distances[e] / (ticks + 1.0), slower))
        else:
            most[e] = max(-back, distances[e], slower - ramp)
