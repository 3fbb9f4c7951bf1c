"""The distances of a phase at each tick, and the rows that keep them.

    n' (J_b - J_a) dq >= -share (d - distance)

with d the distance of a pair [m], n the unit normal from a to b, and J_a, J_b the Jacobians of the points of
a and b that are nearest. Of two convex bodies that do not touch, n turns without a jump, while the nearest
points of parallel edges or faces leap from one end to the other. Points that were nearest a while ago are
therefore remembered, up to four a pair, each with a row of its own: a plank coming down flat is held at both
its ends.

Rows are linear and links turn, so `Loop` measures the distances after its step, and corrects or refuses it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, final

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.collision import kernels
from wbplan.collision.broad import Broad
from wbplan.collision.fields import Field
from wbplan.collision.model import CollisionModel
from wbplan.compiled.kinematics import Kinematics

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Rows of a compiled phase; with more points near, the nearest have one.
CAPACITY = 48

#: Most triangles of height fields that may have rows in one tick; further ones are measured all the same.
TRIANGLES = 1024

#: Share of what is left of the distance that one tick may use up.
SHARE = 0.5

#: The tick stays this far [m] outside the promised distance: its rows are linear, the links' paths are not.
RESERVE = 1e-4

#: Tolerance [m] of the distances.
PRECISE = 1e-6

#: Speed [m/s] at which a pair that is too near is moved apart.
RECOVERY = 0.05


@final
class Clearance:
    """Distances, and the rows that keep them, of one phase; everything is allocated here.

    Attributes:
        model: shapes and pairs.
        least: the least distance [m] at the last `measure` of the pairs that promise one; influence where
            none is nearer.
        spare: (P,) distance less bound [m] of every pair at the last `measure`, infinite for far ones.
        checked: how many pairs were measured exactly; active: how many rows there are.
    """

    def __init__(self, model: CollisionModel, kinematics: Kinematics, dt: float) -> None:
        self.model, self._kinematics, self._dt = model, kinematics, dt
        self._data = model.geometry.createData()
        for request in self._data.distanceRequests:
            request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
            request.gjk_tolerance = PRECISE
        self._fields = [Field(item) for item in model.fields]
        self._shapes()
        self._pairs()
        self._slots()
        self.least, self.checked, self.active = np.inf, 0, 0
        self.spare = np.full(len(model.first), np.inf)

    def _shapes(self) -> None:
        objects, places = list(self.model.geometry.geometryObjects), self._data.oMg
        count, padded = len(objects), len(self.model.things)
        # Pinocchio keeps the shapes' poses in one piece of memory: two views of it spare many objects a tick.
        gap = places[1].translation.__array_interface__["data"][0] if count > 1 else 0
        gap -= places[0].translation.__array_interface__["data"][0] if count > 1 else 0
        stride = np.lib.stride_tricks.as_strided
        self._places = stride(places[0].translation, (count, 3), (gap, 8))
        self._rotations = stride(places[0].rotation, (count, 3, 3), (gap, *places[0].rotation.strides))
        if padded > count:  # height fields have no pose there; theirs is the world's
            self._places_all = np.zeros((padded, 3))
            self._rotations_all = np.tile(np.eye(3), (padded, 1, 1))
        else:
            self._places_all, self._rotations_all = self._places, self._rotations
        self._broad = Broad(self.model, self._rotations, self._places)
        self._middles = np.zeros((count, 3))

    def _pairs(self) -> None:
        model, shapes = self.model, len(self.model.geometry.geometryObjects)
        solid = int((model.second < shapes).sum())
        self._on_fields = [
            (p, int(model.first[p]), int(model.second[p]) - shapes) for p in range(solid, len(model.first))
        ]
        table = np.array(self._on_fields, dtype=np.int64).reshape(-1, 3)
        self._by_field = [table[table[:, 2] == k, :2].T for k in range(len(self._fields))]
        joints = np.array([thing.joint for thing in model.things], dtype=np.int64)
        self._joint_a, self._joint_b = joints[model.first], joints[model.second]
        pinocchio = self._kinematics.model
        self._moves = np.zeros((pinocchio.njoints, pinocchio.nv))
        for joint in range(1, pinocchio.njoints):
            for above in list(pinocchio.supports[joint])[1:]:
                start = pinocchio.joints[above].idx_v
                self._moves[joint, start : start + pinocchio.joints[above].nv] = 1.0
        self._reserved = model.bound + RESERVE
        self._allowed = np.zeros(len(model.first))
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self._results = self._data.distanceResults
        self._nearest = self._results_view() if solid > 1 else None
        self._still: list[tuple[int, float]] | None = None

    def _slots(self) -> None:
        n = CAPACITY
        self._key, self._pair = np.full(n, -1, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self._local = np.zeros((2, n, 3))
        self._world = np.zeros((2, n, 3))
        self._towards, self._gap = np.zeros((n, 3)), np.zeros(n)
        room = len(self.model.first) + TRIANGLES
        self._keys, self._of = np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
        self._distance, self._normal = np.zeros(room), np.zeros((room, 3))
        self._points = np.zeros((2, room, 3))

    # -- each tick ---------------------------------------------------------------------------------------

    def measure(self) -> None:
        """Distances at the kinematics' configuration, and which rows they make."""
        kin, model = self._kinematics, self.model
        pin.updateGeometryPlacements(kin.model, kin.data, model.geometry, self._data)
        found = self._broad.near()
        self._count = len(found)
        for p in found.tolist():
            pin.computeDistance(model.geometry, self._data, p)
        if self._nearest is None:
            copied = [(r.normal, r.getNearestPoint1(), r.getNearestPoint2()) for r in self._results]
            nearest = np.array(copied).reshape(-1, 9)
        else:
            nearest = self._nearest
        self.spare[:] = np.inf if self._broad.known else np.nan
        least = kernels.gather(
            nearest, found, model.bound, model.influence, self._keys, self._of, self._distance, self._normal,
            self._points, self.spare, model.promised,
        )  # fmt: skip
        self._broad.far(self._distance)
        if self._on_fields and self._broad.known:
            kernels.centres(self._rotations, self._places, self._broad.offset, self._middles)
            for number, field in enumerate(self._fields):
                self._measure_field(number, field)
        self.checked = self._count
        count = self._count
        if self._places_all is not self._places:
            self._places_all[: len(self._places)] = self._places
            self._rotations_all[: len(self._places)] = self._rotations
        self.active = kernels.remember(
            self._rotations_all, self._places_all, count, self._keys, self._of, model.first, model.second,
            self._distance, self._normal, *self._points, model.influence, model.bound, self._key, self._pair,
            *self._local, *self._world, self._towards, self._gap,
        )  # fmt: skip
        if self._still is None:
            self._still = self._measure_still()
        for p, _, _ in self._on_fields:
            if model.promised[p]:
                least = min(least, self.spare[p] + model.bound[p])
        self.least = float(min(least, self._still_least))

    def _note(self, key: int, pair: int, result: Any) -> None:
        """One measured distance; the spare of a pair is that of its nearest points."""
        k, distance = self._count, result.min_distance
        self.spare[pair] = min(self.spare[pair], distance - self.model.bound[pair])
        if k < len(self._keys):
            self._keys[k], self._of[k], self._distance[k] = key, pair, distance
            self._normal[k] = result.normal
            self._points[0, k], self._points[1, k] = result.getNearestPoint1(), result.getNearestPoint2()
            self._count = k + 1

    def _measure_still(self) -> list[tuple[int, float]]:
        """Number and distance of every pair that does not move, once and for all."""
        objects, found = self.model.geometry.geometryObjects, []
        self._still_least = np.inf
        poses = [coal.Transform3s(M.rotation, M.translation) for M in self._data.oMg]
        for k, (a, b, _, promised) in enumerate(self.model.still):
            self._result.clear()
            coal.distance(
                objects[a].geometry, poses[a], objects[b].geometry, poses[b], self._request, self._result
            )
            distance = float(self._result.min_distance)
            found.append((k, distance))
            if promised:
                self._still_least = min(self._still_least, distance)
        return found

    def _results_view(self) -> Array | None:
        """(P, 9) normal and nearest points of every pair, in coal's own memory: no objects are made of them.

        None where another version of coal keeps them elsewhere.
        """
        pin.computeDistance(self.model.geometry, self._data, 0)
        first, second = (self._results[k].normal.__array_interface__["data"][0] for k in (0, 1))
        view = np.lib.stride_tricks.as_strided(
            self._results[0].normal, (len(self._results), 9), (second - first, 8)
        )
        result = self._results[0]
        told = np.concatenate([result.normal, result.getNearestPoint1(), result.getNearestPoint2()])
        return view if np.array_equal(view[0], told, equal_nan=True) else None

    def _measure_field(self, number: int, field: Field) -> None:
        """Distances of all shapes to the triangles of a height field that may be near them."""
        pairs, shapes = self._by_field[number]
        reaches = self.model.influence[pairs]
        lows, highs = field.local_boxes(
            self._middles[shapes], self._rotations[shapes], self._broad.half[shapes]
        )
        for k in np.flatnonzero(lows[:, 2] - reaches <= field.highest).tolist():
            pair, shape, reach = int(pairs[k]), int(shapes[k]), float(reaches[k])
            item, pose = self.model.geometry.geometryObjects[shape], None
            for cell, prism in field.near(lows[k].tolist(), highs[k].tolist(), reach):
                pose = pose or coal.Transform3s(self._rotations[shape], self._places[shape])
                self._result.clear()
                coal.distance(item.geometry, pose, prism, field.pose, self._request, self._result)
                if self._result.min_distance < reach:
                    key = len(self.spare) + (cell * len(self._fields) + number) * len(self.spare) + pair
                    self._note(key, pair, self._result)

    def start(self) -> None:
        """A tick begins where `measure` was called last: what is too near there may stay so, no nearer."""
        np.minimum(self.spare, 0.0, out=self._allowed)

    def kept(self) -> bool:
        """Whether every pair keeps its distance, or was nearer before and is no nearer now."""
        return bool(kernels.all_kept(self.spare, self._allowed))

    def write(
        self, jacobian: Array, free: Any, driven: Any, step: Array, C: Array, d: Array, nothing: float,
        share: float = SHARE,
    ) -> None:  # fmt: skip
        """The rows C x <= d of the next step, x over the free columns; `nothing` in d for unused rows.

        `share` of what is left of a distance is what a step may use up.
        """
        least = np.full(len(self.spare), -RECOVERY * self._dt)
        self._fill(jacobian, free, driven, step, C, d, nothing, share, least)

    def relax(
        self, jacobian: Array, free: Any, driven: Any, step: Array, C: Array, d: Array, nothing: float
    ) -> None:
        """The rows without reserve, for a tick that has no step within it: none gets nearer than promised."""
        self._fill(
            jacobian, free, driven, step, C, d, nothing, 1.0, np.zeros(len(self.spare)), self.model.bound
        )

    def linearise(
        self, jacobian: Array, free: Any, driven: Any, step: Array, C: Array, d: Array, nothing: float
    ) -> None:
        """The rows of a correction: back outside the distance, at once."""
        least = np.where(self._allowed < 0.0, 0.0, -np.inf)
        self._fill(jacobian, free, driven, step, C, d, nothing, 1.0, least)

    def _fill(
        self, jacobian: Array, free: Any, driven: Any, step: Array, C: Array, d: Array, nothing: float,
        share: float, least: Array, bound: Array | None = None,
    ) -> None:  # fmt: skip
        bound = self._reserved if bound is None else bound
        kernels.fill(
            jacobian, self._moves, self._joint_a, self._joint_b, free, driven, step, self._key, self._pair,
            *self._world, self._towards, self._gap, bound, share, least, nothing, C, d,
        )  # fmt: skip

    # -- names -------------------------------------------------------------------------------------------

    def keep_names(self) -> Callable[[], list[str]]:
        """The rows' names at this moment, to be worked out whenever somebody asks."""
        return partial(self._named, self._key.copy(), self._pair.copy())

    def _named(self, key: Ints, pair: Ints) -> list[str]:
        return [
            f"clearance {self.model.name(int(p))}" if k >= 0 else "" for k, p in zip(key, pair, strict=True)
        ]

    def worst(self) -> tuple[str, float, float]:
        """The pair that is furthest inside its bound: names, distance [m], bound [m]."""
        p = int(self.spare.argmin())
        bound = float(self.model.bound[p])
        return self.model.name(p), float(self.spare[p]) + bound, bound

    def broken(self) -> list[tuple[str, float, float]]:
        """Names, distance [m] and promised distance [m] of pairs nearer than promised, the worst first."""
        model, things = self.model, self.model.things
        near = np.flatnonzero((self.spare < -1e-9) & model.promised)
        found = [(model.name(p), float(self.spare[p] + model.bound[p]), float(model.bound[p])) for p in near]
        for k, distance in self._still or ():
            a, b, bound, promised = model.still[k]
            if promised and distance < bound - 1e-9:
                found.append((f"{things[a].name} - {things[b].name}", distance, bound))
        worst: dict[str, tuple[str, float, float]] = {}
        for item in found:
            if item[0] not in worst or item[1] < worst[item[0]][1]:
                worst[item[0]] = item
        return sorted(worst.values(), key=lambda item: item[1] - item[2])

    def nearest(self) -> tuple[str, float, Array, Array] | None:
        """The nearest pair that is measured: names, distance [m], and its points (3,) in the world."""
        if not self._count:
            return None
        k = int(self._distance[: self._count].argmin())
        a, b = self._points[:, k].copy()
        return self.model.name(int(self._of[k])), float(self._distance[k]), a, b
