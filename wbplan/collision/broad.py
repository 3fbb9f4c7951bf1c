"""Which pairs of shapes may be near.

No two shapes come nearer to each other than by how far they travel. A pair that was found to be apart is
therefore left alone until its shapes may have travelled that far; a bound of what each joint's shapes have
travelled is added up from tick to tick. Only then are the boxes round both shapes compared again. It does not
matter who moved the robot, nor how far at once: the bound is of the poses, not of speeds.

Where two links are concerned, the bound is of their motion as seen from the body: a robot that walks does not
come nearer to itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import coal
import numpy as np
from numba import njit
from numpy.typing import NDArray

from wbplan.collision.model import WORLD_JOINT, CollisionModel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Distances and sums of travels are this exact [m]; pairs are looked at that much earlier.
EXACT = 1e-5


@final
class Broad:
    """The pairs of convex shapes, in groups with the same two joints.

    Args:
        model: shapes and pairs; those with height fields are not looked at.
        rotations: (G, 3, 3) world rotations of the shapes; places: (G, 3) their places [m]; both are read
            whenever `near` is called.

    Attributes:
        offset: (G, 3) middles of the shapes' boxes in their own frames [m]; half: (G, 3) half their edges.
        found: numbers of the pairs that the last `near` found.
        known: False where some pose was no number then, and no pair was looked at.
    """

    def __init__(self, model: CollisionModel, rotations: Array, places: Array) -> None:
        self._rotations, self._places = rotations, places
        shapes = list(model.geometry.geometryObjects)
        self.offset, self.half = np.zeros((len(shapes), 3)), np.zeros((len(shapes), 3))
        self._plane = np.zeros((len(shapes), 4))
        for g, item in enumerate(shapes):
            self._measure(g, item)
        solid = int((model.second < len(shapes)).sum())
        self._first, self._second = model.first[:solid], model.second[:solid]
        self._reach = model.influence[:solid]
        self._groups(np.array([thing.joint for thing in model.things], dtype=np.int64))
        self._bodies(shapes)
        self._all = np.zeros(max(solid, 1), dtype=np.int64)
        self._due, self._at = np.full(solid, -np.inf), np.zeros(solid)
        self._group_due = np.full(len(self._start) - 1, -np.inf)
        self.found: Ints = self._all[:0]
        self.known = False

    def _measure(self, g: int, item: Any) -> None:
        """The box round a shape; of a half-space n x <= b in the world, n and b."""
        if isinstance(item.geometry, coal.Halfspace):
            normal = item.placement.rotation @ np.array(item.geometry.n)
            self._plane[g] = *normal, float(item.geometry.d + normal @ item.placement.translation)
            return
        item.geometry.computeLocalAABB()
        low, high = np.array(item.geometry.aabb_local.min_), np.array(item.geometry.aabb_local.max_)
        self.offset[g], self.half[g] = (low + high) / 2.0, (high - low) / 2.0

    def _groups(self, joints: Ints) -> None:
        """Pairs sorted by their two joints: `order[start[g]:start[g + 1]]` are group g."""
        both = np.column_stack([joints[self._first], joints[self._second]]).reshape(-1, 2)
        kinds, which = np.unique(both, axis=0, return_inverse=True)
        which = which.reshape(-1)
        self._order = np.argsort(which, kind="stable").astype(np.int64)
        self._start = np.concatenate([[0], np.cumsum(np.bincount(which, minlength=len(kinds)))])
        self._start = self._start.astype(np.int64)
        self._joints = np.ascontiguousarray(kinds, dtype=np.int64)

    def _bodies(self, shapes: Sequence[Any]) -> None:
        """One shape of each joint stands for all of them: it carries a ball that holds them."""
        parents = np.array([item.parentJoint for item in shapes], dtype=np.int64)
        used = sorted({int(j) for j in parents if j != WORLD_JOINT})
        slot = {joint: k for k, joint in enumerate(used)}
        slot[WORLD_JOINT] = -1
        self._joints = np.array([[slot[int(j)] for j in pair] for pair in self._joints], dtype=np.int64)
        self._joints = self._joints.reshape(-1, 2)
        first = [int(np.flatnonzero(parents == joint)[0]) for joint in used]
        self._shape_of = np.array(first, dtype=np.int64)
        self._centre, self._radius = np.zeros((len(used), 3)), np.zeros(len(used))
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        for k, joint in enumerate(used):
            here = shapes[first[k]].placement
            cloud = np.array(
                [
                    here.actInv(shapes[g].placement.act(corner))
                    for g in np.flatnonzero(parents == joint)
                    for corner in self.offset[g] + corners * self.half[g]
                ]
            )
            self._centre[k] = (cloud.min(axis=0) + cloud.max(axis=0)) / 2.0
            self._radius[k] = np.linalg.norm(cloud - self._centre[k], axis=1).max()
        # Where they were last, in the world and seen from the first one, and how far they have come since.
        self._was = np.zeros((2, len(used), 4, 3))
        self._travel = np.zeros((2, len(used)))

    def near(self) -> Ints:
        """Numbers of all pairs that may be within their influence; pairs that are not may be among them."""
        count = _near(
            self._rotations, self._places, self._shape_of, self._centre, self._radius, self._was,
            self._travel,
            self.offset, self.half, self._plane, self._first, self._second, self._reach, self._joints,
            self._start, self._order, self._group_due, self._due, self._at, self._all,
        )  # fmt: skip
        self.known = count >= 0
        self.found = self._all[: max(count, 0)]
        return self.found

    def far(self, distance: Array) -> None:
        """Told the exact distances (F,) [m] of what `near` found, leaves alone those that are not near."""
        _leave(self.found, distance, self._reach, self._at, self._due)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _moved(was: Any, now: Any, radius: float) -> float:
    """How far a point of a ball travelled at most: its middle's way, and its turn's chord at the rim."""
    way = turn = 0.0
    for i in range(3):
        way += (now[3, i] - was[3, i]) ** 2
        for j in range(3):
            turn += (now[i, j] - was[i, j]) ** 2
    # The largest singular value of a difference of rotations is its Frobenius norm over sqrt(2).
    return float(np.sqrt(way) + radius * np.sqrt(0.5 * turn))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _add_travel(
    rotations: Any, places: Any, shape: Any, centre: Any, radius: Any, was: Any, travel: Any
) -> bool:
    """Adds up what the balls travelled, in the world and as seen from the first one; False if unknown."""
    now, seen, sound = np.empty((4, 3)), np.empty((4, 3)), True
    root = np.zeros((4, 3))
    for k in range(shape.shape[0]):
        g = shape[k]
        for i in range(3):
            now[3, i] = places[g, i]
            for j in range(3):
                now[i, j] = rotations[g, i, j]
                now[3, i] += rotations[g, i, j] * centre[k, j]
        if k == 0:
            root[:] = now
        for i in range(3):
            seen[3, i] = 0.0
            for m in range(3):
                seen[3, i] += root[m, i] * (now[3, m] - root[3, m])
            for j in range(3):
                seen[i, j] = 0.0
                for m in range(3):
                    seen[i, j] += root[m, i] * now[m, j]
        travel[0, k] += _moved(was[0, k], now, radius[k])
        travel[1, k] += _moved(was[1, k], seen, radius[k])
        sound = sound and np.isfinite(travel[0, k]) and np.isfinite(travel[1, k])
        was[0, k], was[1, k] = now, seen
    return sound


@njit(cache=True)  # type: ignore[untyped-decorator]
def _near(
    rotations: Any, places: Any, shape: Any, centre: Any, radius: Any, was: Any, travel: Any, offset: Any,
    half: Any, plane: Any, first: Any, second: Any, reach: Any, joints: Any, start: Any, order: Any,
    group_due: Any, due: Any, at: Any, found: Any,
) -> int:  # fmt: skip
    """Looks at the groups that are due, and in them at the pairs that are.

    Returns:
        How many it found; -1 where a pose is no number.
    """
    if not _add_travel(rotations, places, shape, centre, radius, was, travel):
        was[:], travel[:], group_due[:], due[:] = 0.0, 0.0, -np.inf, -np.inf  # after it all begins anew
        return -1
    count = 0
    t = np.empty(3)
    for group in range(joints.shape[0]):
        a, b = joints[group, 0], joints[group, 1]
        come = travel[1, a] + travel[1, b] if a >= 0 and b >= 0 else travel[0, max(a, b)]
        if come < group_due[group]:
            continue
        soonest = np.inf
        for k in range(start[group], start[group + 1]):
            p = order[k]
            if not come < due[p]:
                i, j = first[p], second[p]
                for m in range(3):
                    t[m] = places[j, m] - places[i, m]
                    for n in range(3):
                        t[m] += rotations[j, m, n] * offset[j, n] - rotations[i, m, n] * offset[i, n]
                if plane[j, 0] != 0.0 or plane[j, 1] != 0.0 or plane[j, 2] != 0.0:
                    gap = _over(plane[j], places[i], rotations[i], offset[i], half[i])
                else:
                    gap = _apart(rotations[i], half[i], rotations[j], half[j], t)
                at[p] = come
                if gap < reach[p]:
                    due[p] = -np.inf
                    found[count] = p
                    count += 1
                else:
                    due[p] = come + gap - reach[p] - EXACT
            soonest = min(soonest, due[p])
        group_due[group] = soonest
    return count


@njit(cache=True)  # type: ignore[untyped-decorator]
def _leave(found: Any, distance: Any, reach: Any, at: Any, due: Any) -> None:
    for k in range(found.shape[0]):
        p = found[k]
        if distance[k] > reach[p] + EXACT:
            due[p] = at[p] + distance[k] - reach[p] - EXACT


@njit(cache=True)  # type: ignore[untyped-decorator]
def _over(plane: Any, place: Any, R: Any, offset: Any, half: Any) -> float:
    """Distance of a box from a half-space n x <= b, (n, b) = plane."""
    gap = -plane[3]
    for i in range(3):
        gap += plane[i] * place[i]
        for k in range(3):
            gap += plane[i] * R[i, k] * offset[k]
    for k in range(3):
        gap -= half[k] * abs(plane[0] * R[0, k] + plane[1] * R[1, k] + plane[2] * R[2, k])
    return float(gap)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _apart(R: Any, ha: Any, S: Any, hb: Any, t: Any) -> float:
    """A lower bound of the distance of two boxes with half edges ha, hb: the best of seven directions.

    R and S are the boxes' rotations and t the way from the first one's middle to the other's.
    """
    best = -1.0e30
    for axis in range(7):
        if axis == 6:
            length = np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
            if length < 1e-12:
                continue
            x, y, z = t[0] / length, t[1] / length, t[2] / length
        elif axis < 3:
            x, y, z = R[0, axis], R[1, axis], R[2, axis]
        else:
            x, y, z = S[0, axis - 3], S[1, axis - 3], S[2, axis - 3]
        gap = abs(x * t[0] + y * t[1] + z * t[2])
        for k in range(3):
            gap -= ha[k] * abs(x * R[0, k] + y * R[1, k] + z * R[2, k])
            gap -= hb[k] * abs(x * S[0, k] + y * S[1, k] + z * S[2, k])
        best = max(best, gap)
    return best
