"""Compiled loops of the clearance: which pairs are near, which rows they have, and the rows themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

#: A remembered point this near [m] to a new one of its pair is that point, moved on.
SAME = 0.004

#: Remembered points that have slid this far [m] past each other are forgotten.
SLID = 0.02

#: Rows that differ by less than this [m/rad or 1] everywhere are one.
ALIKE = 1e-6

#: Most remembered points of one pair.
MOST = 4


@njit(cache=True)  # type: ignore[untyped-decorator]
def centres(rotations: Any, places: Any, offset: Any, out: Any) -> None:
    """World places (G, 3) of the middles of the shapes' boxes."""
    for g in range(offset.shape[0]):
        for i in range(3):
            value = places[g, i]
            for j in range(3):
                value += rotations[g, i, j] * offset[g, j]
            out[g, i] = value


@njit(cache=True)  # type: ignore[untyped-decorator]
def gather(
    nearest: Any, found: Any, bound: Any, influence: Any, keys: Any, pairs: Any, distance: Any, normal: Any,
    points: Any, spare: Any, promised: Any,
) -> float:  # fmt: skip
    """Takes the results (P, 9), normal and points, of the pairs that were found.

    Returns:
        The least distance of those that promise one and are within their influence.
    """
    least = np.inf
    for k in range(found.shape[0]):
        p = found[k]
        keys[k] = pairs[k] = p
        gap = 0.0
        for i in range(3):
            normal[k, i] = nearest[p, i]
            points[0, k, i], points[1, k, i] = nearest[p, 3 + i], nearest[p, 6 + i]
            gap += nearest[p, i] * (nearest[p, 6 + i] - nearest[p, 3 + i])
        distance[k] = gap
        spare[p] = gap - bound[p]
        if promised[p] and gap <= influence[p]:  # what is further is not always looked at
            least = min(least, gap)
    return least


@njit(cache=True)  # type: ignore[untyped-decorator]
def all_kept(spare: Any, allowed: Any) -> bool:
    """Whether no pair is nearer than its bound, or than it was: to a micrometre, the distances' noise."""
    for p in range(spare.shape[0]):
        if not spare[p] >= (allowed[p] - 1e-6 if allowed[p] < 0.0 else -1e-9):
            return False
    return True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _to_world(rotations: Any, places: Any, g: int, local: Any, out: Any) -> None:
    for i in range(3):
        value = places[g, i]
        for j in range(3):
            value += rotations[g, i, j] * local[j]
        out[i] = value


@njit(cache=True)  # type: ignore[untyped-decorator]
def _to_local(rotations: Any, places: Any, g: int, world: Any, out: Any) -> None:
    for i in range(3):
        value = 0.0
        for j in range(3):
            value += rotations[g, j, i] * (world[j] - places[g, j])
        out[i] = value


@njit(cache=True)  # type: ignore[untyped-decorator]
def remember(
    rotations: Any, places: Any, count: int, keys: Any, pairs: Any, first: Any, second: Any, distance: Any,
    normal: Any, on_first: Any, on_second: Any, influence: Any, bound: Any, key: Any, pair: Any, local_a: Any,
    local_b: Any, world_a: Any, world_b: Any, towards: Any, gap: Any,
) -> int:  # fmt: skip
    """Brings the slots up to date with the nearest points that were just found.

    A slot keeps its pair as long as that is near, and its points, seen from their own links, as long as they
    face each other. The gap of remembered points along the pair's normal of today is never less than the
    pair's distance, so a slot never asks for more than its pair does.

    Of what was found: `count`, `keys`, `pairs`, `distance`, `normal`, `on_first`, `on_second`. Of the slots:
    `key` (-1 where one is free), `pair`, `local_a`, `local_b`, `world_a`, `world_b`, `towards`, `gap`.

    Returns:
        How many slots are in use.
    """
    point = np.zeros(3)
    for s in range(key.shape[0]):
        if key[s] < 0:
            continue
        f = -1
        for k in range(count):
            if keys[k] == key[s]:
                f = k
                break
        if f < 0:
            key[s] = -2
            continue
        p = pair[s]
        _to_world(rotations, places, first[p], local_a[s], world_a[s])
        _to_world(rotations, places, second[p], local_b[s], world_b[s])
        g, slid = 0.0, 0.0
        for i in range(3):
            towards[s, i] = normal[f, i]
            g += normal[f, i] * (world_b[s, i] - world_a[s, i])
        for i in range(3):
            slid += (world_b[s, i] - world_a[s, i] - g * normal[f, i]) ** 2
        gap[s] = g
        if g > influence[p] or slid > SLID * SLID:
            key[s] = -2
    for f in range(count):
        p = pairs[f]
        if distance[f] > influence[p]:
            continue
        into, of_pair, widest, free, loosest = -1, 0, -1, -1, -1
        for s in range(key.shape[0]):
            if key[s] < 0:
                if free < 0 or key[s] > key[free]:  # not one that was another pair's until now
                    free = s
                continue
            if loosest < 0 or gap[s] - bound[pair[s]] > gap[loosest] - bound[pair[loosest]]:
                loosest = s
            if key[s] != keys[f]:
                continue
            of_pair += 1
            if widest < 0 or gap[s] > gap[widest]:
                widest = s
            off = 0.0
            for i in range(3):
                off = max(off, abs(world_a[s, i] - on_first[f, i]), abs(world_b[s, i] - on_second[f, i]))
            if off < SAME and into < 0:
                into = s
        if into < 0:
            if of_pair >= MOST:
                into = widest
            elif free >= 0:
                into = free
            elif gap[loosest] - bound[pair[loosest]] > distance[f] - bound[p]:
                into = loosest
            else:
                continue
        key[into], pair[into], gap[into] = keys[f], p, distance[f]
        for i in range(3):
            world_a[into, i], world_b[into, i] = on_first[f, i], on_second[f, i]
            towards[into, i] = normal[f, i]
        _to_local(rotations, places, first[p], on_first[f], point)
        local_a[into] = point
        _to_local(rotations, places, second[p], on_second[f], point)
        local_b[into] = point
    used = 0
    for s in range(key.shape[0]):
        key[s] = max(key[s], -1)
        used += key[s] >= 0
    return used


@njit(cache=True)  # type: ignore[untyped-decorator]
def fill(
    jacobian: Any, moves: Any, joint_a: Any, joint_b: Any, free: Any, driven: Any, driven_step: Any, key: Any,
    pair: Any, world_a: Any, world_b: Any, towards: Any, gap: Any, bound: Any, share: float, least: Any,
    nothing: float, C: Any, d: Any,
) -> None:  # fmt: skip
    """C and d of n' (J_a - J_b) x <= share (gap - bound) for every slot; `nothing` in d where one is free.

    `jacobian` (6, nv) is Pinocchio's, the spatial velocity at the world's origin, linear rows first; `moves`
    (joints, nv) is 1 where a column moves a joint; d of a pair that is nearer than its bound is not below
    `least` (P,) [m].
    """
    for s in range(key.shape[0]):
        if key[s] < 0:
            C[s, :] = 0.0
            d[s] = nothing
            continue
        p = pair[s]
        a, b = joint_a[p], joint_b[p]
        n0, n1, n2 = towards[s, 0], towards[s, 1], towards[s, 2]
        xa, xb = world_a[s], world_b[s]
        a0, a1, a2 = xa[1] * n2 - xa[2] * n1, xa[2] * n0 - xa[0] * n2, xa[0] * n1 - xa[1] * n0
        b0, b1, b2 = xb[1] * n2 - xb[2] * n1, xb[2] * n0 - xb[0] * n2, xb[0] * n1 - xb[1] * n0
        spare = gap[s] - bound[p]
        d[s] = share * spare if spare > 0.0 else max(spare, least[p])
        size = 0.0
        for c in range(free.shape[0] + driven.shape[0]):
            column = free[c] if c < free.shape[0] else driven[c - free.shape[0]]
            ma, mb = moves[a, column], moves[b, column]
            value = 0.0
            if ma != mb:  # what moves both does not move them apart
                value = n0 * jacobian[0, column] + n1 * jacobian[1, column] + n2 * jacobian[2, column]
                if ma > mb:
                    value += a0 * jacobian[3, column] + a1 * jacobian[4, column] + a2 * jacobian[5, column]
                else:
                    value += b0 * jacobian[3, column] + b1 * jacobian[4, column] + b2 * jacobian[5, column]
                    value = -value
            if c < free.shape[0]:
                C[s, c] = value
                size += value * value
            else:
                d[s] -= value * driven_step[c - free.shape[0]]
        if size < 1e-12:  # no free joint moves the pair: a row could only forbid what nothing can change
            C[s, :] = 0.0
            d[s] = nothing
    for s in range(key.shape[0]):  # rows that are alike are one, with the lesser bound
        if d[s] >= nothing:
            continue
        for r in range(s):
            if d[r] >= nothing:
                continue
            alike = True
            for c in range(free.shape[0]):
                if abs(C[s, c] - C[r, c]) > ALIKE:
                    alike = False
                    break
            if alike:
                d[r] = min(d[r], d[s])
                C[s, :] = 0.0
                d[s] = nothing
                break
