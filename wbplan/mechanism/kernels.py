"""The inner loops of forward displacement, compiled: chains, and Newton's method on the loop equations.

For stance leg i with foot point f_i(q) in the body's frame and B_i in the world, the loop equation is

    r_i = f_i(q) + R'(p - B_i) = 0,    dr_i = J_i dq + v + [R'(p - B_i)]x w

where the body moves by R <- R exp(w), p <- p + R v. The unknowns are (v, w) and the passive joints.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit


@njit(cache=True)  # type: ignore[untyped-decorator]
def turn_of(vector: Any) -> Any:
    """Rotation matrix (3, 3) of a rotation vector (3,) [rad]."""
    out = np.eye(3)
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if angle < 1e-300:
        return out
    x, y, z = vector[0] / angle, vector[1] / angle, vector[2] / angle
    c, s = math.cos(angle), math.sin(angle)
    d = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + x * x * d, x * y * d - z * s, x * z * d + y * s
    out[1, 0], out[1, 1], out[1, 2] = x * y * d + z * s, c + y * y * d, y * z * d - x * s
    out[2, 0], out[2, 1], out[2, 2] = x * z * d - y * s, y * z * d + x * s, c + z * z * d
    return out


@njit(cache=True)  # type: ignore[untyped-decorator]
def cross(a: Any, b: Any) -> Any:
    """Cross product of two (3,)."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@njit(cache=True)  # type: ignore[untyped-decorator]
def product(a: Any, b: Any) -> Any:
    """Product of two (3, 3)."""
    out = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            out[i, k] = a[i, 0] * b[0, k] + a[i, 1] * b[1, k] + a[i, 2] * b[2, k]
    return out


@njit(cache=True)  # type: ignore[untyped-decorator]
def chain_pose(screws: Any, q: Any) -> Any:
    """Rotation (3, 3) and translation (3,) of the product of exponentials, and the screws (n, 6) at q."""
    rotation, translation = np.eye(3), np.zeros(3)
    at = np.empty((len(q), 6))
    turned, moved, step, centre = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty(3)
    for j in range(len(q)):
        s = screws[j]
        for i in range(3):
            turned[i] = rotation[i, 0] * s[0] + rotation[i, 1] * s[1] + rotation[i, 2] * s[2]
            moved[i] = rotation[i, 0] * s[3] + rotation[i, 1] * s[4] + rotation[i, 2] * s[5]
        at[j, :3] = turned
        at[j, 3] = moved[0] + translation[1] * turned[2] - translation[2] * turned[1]
        at[j, 4] = moved[1] + translation[2] * turned[0] - translation[0] * turned[2]
        at[j, 5] = moved[2] + translation[0] * turned[1] - translation[1] * turned[0]
        square = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
        if square < 1e-24:
            translation += moved * q[j]
            continue
        # The turned screw's axis goes through `centre`; all so far turns about it, and slides by its pitch.
        w = at[j]
        centre[0] = (w[1] * w[5] - w[2] * w[4]) / square
        centre[1] = (w[2] * w[3] - w[0] * w[5]) / square
        centre[2] = (w[0] * w[4] - w[1] * w[3]) / square
        pitch = (w[0] * w[3] + w[1] * w[4] + w[2] * w[5]) / square
        step[:] = turn_of(turned * q[j])
        arm = translation - centre
        for i in range(3):
            translation[i] = centre[i] + pitch * q[j] * turned[i]
            for k in range(3):
                translation[i] += step[i, k] * arm[k]
        rotation = product(step, rotation)
    return rotation, translation, at


@njit(cache=True)  # type: ignore[untyped-decorator]
def loop_equations(
    screws: Any, counts: Any, tips: Any, feet: Any, columns: Any, q: Any, rotation: Any, position: Any,
    residual: Any, jacobian: Any,
) -> None:  # fmt: skip
    """Fills residual (3L,) [m] and jacobian (3L, 6 + passive joints); columns < 0 where q is given."""
    jacobian[:] = 0.0
    for i in range(len(counts)):
        n = counts[i]
        turn, shift, at = chain_pose(screws[i, :n], q[i, :n])
        foot = turn @ tips[i] + shift
        arm = rotation.T @ (position - feet[i])
        residual[3 * i : 3 * i + 3] = foot + arm
        for k in range(3):
            jacobian[3 * i + k, k] = 1.0
        jacobian[3 * i, 4], jacobian[3 * i, 5] = -arm[2], arm[1]
        jacobian[3 * i + 1, 3], jacobian[3 * i + 1, 5] = arm[2], -arm[0]
        jacobian[3 * i + 2, 3], jacobian[3 * i + 2, 4] = -arm[1], arm[0]
        for j in range(n):
            c = columns[i, j]
            if c >= 0:
                jacobian[3 * i : 3 * i + 3, 6 + c] = cross(at[j, :3], foot) + at[j, 3:]


@njit(cache=True)  # type: ignore[untyped-decorator]
def close_loops(
    screws: Any, counts: Any, tips: Any, feet: Any, columns: Any, passive: Any, q: Any, rotation: Any,
    position: Any, iterations: Any, tolerance: Any, damping: Any,
) -> Any:  # fmt: skip
    """Damped Gauss-Newton from where q, rotation and position are; returns (worst residual [m], steps)."""
    rows, unknowns = 3 * len(counts), 6 + passive
    residual, jacobian = np.empty(rows), np.empty((rows, unknowns))
    worst = 0.0
    for step in range(iterations):
        loop_equations(screws, counts, tips, feet, columns, q, rotation, position, residual, jacobian)
        worst = np.max(np.abs(residual))
        if worst < tolerance:
            return worst, step
        normal = jacobian.T @ jacobian
        mu = damping * (residual @ residual) + 1e-14
        for k in range(unknowns):
            normal[k, k] += mu
        change = np.linalg.solve(normal, -(jacobian.T @ residual))
        biggest = np.max(np.abs(change[3:]))
        if biggest > 1.0:
            change *= 1.0 / biggest
        position += rotation @ change[:3]
        rotation[:] = rotation @ turn_of(change[3:6])
        for i in range(len(counts)):
            for j in range(counts[i]):
                if columns[i, j] >= 0:
                    q[i, j] += change[6 + columns[i, j]]
    loop_equations(screws, counts, tips, feet, columns, q, rotation, position, residual, jacobian)
    return np.max(np.abs(residual)), iterations


@njit(cache=True)  # type: ignore[untyped-decorator]
def close_from_many(
    screws: Any, counts: Any, tips: Any, feet: Any, columns: Any, passive: Any, q: Any, rotations: Any,
    positions: Any, iterations: Any, tolerance: Any, damping: Any,
) -> Any:  # fmt: skip
    """`close_loops` from every start: q (S, L, n), rotations (S, 3, 3), positions (S, 3); residuals (S,)."""
    worst = np.empty(len(q))
    for s in range(len(q)):
        worst[s] = close_loops(
            screws, counts, tips, feet, columns, passive, q[s], rotations[s], positions[s], iterations,
            tolerance, damping,
        )[0]  # fmt: skip
    return worst
