"""Which row stands where, and where each row's target is now.

Rows are chosen out of (targets) x (three axes): positions first, then rotations, then CoM. Hard rows come
before soft ones, and those of a higher level before those of a lower. `kernels` does the
arithmetic; this module knows the layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wbplan.compiled.aims import ComTarget
from wbplan.compiled.kinematics import Kinematics
from wbplan.compiled.phase import WORLD, CompiledPhase, FrameTarget
from wbplan.paths import ask, checked
from wbplan.program import kernels
from wbplan.sampling import sample

Array = NDArray[np.float64]

#: Ticks for which the targets are evaluated at once.
STRETCH = 128


def support_mask(model: Any, frame: int) -> Array:
    """(nv,) ones at the velocity columns that move a frame, zeros elsewhere."""
    mask = np.zeros(model.nv)
    if frame == WORLD:
        return mask
    for joint in model.supports[model.frames[frame].parentJoint]:
        first = model.joints[joint].idx_v
        if joint > 0:
            mask[first : first + model.joints[joint].nv] = 1.0
    return mask


def reach(model: Any, frame: int) -> float:
    """Length [m] of the chain from the base to a frame: no joint of it has a longer lever arm."""
    if frame == WORLD:
        return 0.0
    joints = [j for j in model.supports[model.frames[frame].parentJoint] if j > 1]
    links = [model.jointPlacements[j].translation for j in joints] + [
        model.frames[frame].placement.translation
    ]
    return float(sum(np.linalg.norm(link) for link in links))


def reaches(model: Any) -> Array:
    """`reach` [m] of every frame; that of the world, number -1, comes last."""
    along = np.zeros(model.njoints)
    for joint in range(2, model.njoints):
        along[joint] = along[model.parents[joint]] + np.linalg.norm(model.jointPlacements[joint].translation)
    found = [along[f.parentJoint] + np.linalg.norm(f.placement.translation) for f in model.frames]
    return np.array([*found, 0.0])


def _pairs(targets: Sequence[FrameTarget], slot: dict[int, int]) -> NDArray[np.intp]:
    """(k, 2) where the frame and the root of each target stand among the frames that are read."""
    return np.array([(slot[t.frame], slot[t.root]) for t in targets], dtype=np.intp).reshape(-1, 2)


@dataclass
class _Ahead:
    """Where the targets that move will be in the next ticks.

    Attributes:
        t: time [s] at which the tick number `next` of this stretch starts.
        places, turns, coms: which goals move; points (STRETCH, k, 3), rotations, com_points: where to.
        motion: (STRETCH, n) how far each row's target moves in each tick.
    """

    t: float
    places: NDArray[np.intp]
    turns: NDArray[np.intp]
    coms: NDArray[np.intp]
    points: Array
    rotations: Array
    com_points: Array
    motion: Array
    next: int = 0


@final
class Rows:
    """Rows of frame and CoM targets: layout, targets now, errors.

    Attributes:
        frames: numbers of the frames that have to be read, for `Kinematics`.
        labels: (label, unit, span) of each target's part: 'position' or 'orientation' rows at `span`.
        hard: number of hard rows, which come first; levels: the level of each soft row, in order.
        weight, gain: (n,) of each row; motion: (n,) how far its target moved in the last `advance`.
        error: (n,) target minus actual at the last `measure`.
        position_targets, position_goal (K, 3), position_error (K, 3): targets that ask for a position, where
            it is asked for now, and all three axes of its error; rotation_targets, rotation_goal (T, 3, 3),
            rotation_error (T, 3) likewise; com_targets, com_goal (M, 3), com_error (M, 3).
    """

    def __init__(
        self, model: Any, frame_targets: Sequence[FrameTarget], com_targets: Sequence[ComTarget]
    ) -> None:
        self.frames = sorted({f for t in frame_targets for f in (t.frame, t.root) if f != WORLD})
        slot = {frame: k for k, frame in enumerate([*self.frames, WORLD])}
        self.position_targets = tuple(t for t in frame_targets if (t.position_weight > 0).any())
        self.rotation_targets = tuple(t for t in frame_targets if (t.rotation_weight > 0).any())
        self.com_targets = tuple(com_targets)
        places, turns, coms = len(self.position_targets), len(self.rotation_targets), len(com_targets)
        self.place, self.turn = _pairs(self.position_targets, slot), _pairs(self.rotation_targets, slot)
        self.position_goal, self.rotation_goal = np.zeros((places, 3)), np.tile(np.eye(3), (turns, 1, 1))
        self.com_goal = np.zeros((coms, 3))
        self.all_error = np.zeros((places + turns + coms, 3))
        self.position_error, self.rotation_error = (
            self.all_error[:places],
            self.all_error[places : places + turns],
        )
        self.com_error = self.all_error[places + turns :]
        self.frame_groups = places + turns
        self._ahead: _Ahead | None = None
        self._choose(model, slot)
        self._moving()
        self.aim(0.0)

    def _choose(self, model: Any, slot: dict[int, int]) -> None:
        """Lay out the rows: hard before soft, each target's positions before its rotations."""
        places = len(self.position_targets)
        parts: list[tuple[Any, str, int, Array]] = []  # target, part, group, weights
        parts += [(t, "position", k, t.position_weight) for k, t in enumerate(self.position_targets)]
        parts += [
            (t, "orientation", places + k, t.rotation_weight) for k, t in enumerate(self.rotation_targets)
        ]
        parts += [(t, "position", self.frame_groups + k, t.weight) for k, t in enumerate(self.com_targets)]
        parts.sort(key=lambda part: (not part[0].hard, part[0].level))
        chosen: list[int] = []
        masks: list[Array] = []
        weights: list[float] = []
        gains: list[float] = []
        self.labels: list[tuple[str, str, slice]] = []
        self.hard = 0
        self.levels: list[int] = []
        for target, part, group, weight in parts:
            axes = np.flatnonzero(weight > 0)
            self.labels.append((target.label, part, slice(len(chosen), len(chosen) + len(axes))))
            chosen += [3 * group + int(axis) for axis in axes]
            mask = np.ones(model.nv)
            if isinstance(target, FrameTarget):
                mask = support_mask(model, target.frame) - support_mask(model, target.root)
            masks += [mask] * len(axes)
            weights += [float(w) for w in weight[axes]]
            gains += [target.gain] * len(axes)
            self.hard += len(axes) * target.hard
            if not target.hard:
                self.levels += [target.level] * len(axes)
        self.targets_of_rows = [t for t, _, _, w in parts for _ in np.flatnonzero(w > 0)]
        self.chosen = np.array(chosen, dtype=np.intp)
        size = len(chosen)
        self.mask = np.array(masks).reshape(size, model.nv)
        self.weight, self.gain = np.array(weights), np.array(gains)
        self.error, self.motion, self.wrench = np.zeros(size), np.zeros(size), np.zeros((size, 6))

    def _moving(self) -> None:
        """Where each target that moves has its goal: (path, position index, rotation index, CoM index)."""
        place = {id(t): k for k, t in enumerate(self.position_targets)}
        turn = {id(t): k for k, t in enumerate(self.rotation_targets)}
        frames = {id(t): t for t in (*self.position_targets, *self.rotation_targets)}
        self._paths: list[tuple[Any, int | None, int | None, int | None]]
        self._paths = [(t.path, place.get(key), turn.get(key), None) for key, t in frames.items()]
        self._paths += [(t.path, None, None, k) for k, t in enumerate(self.com_targets)]
        self._moving_paths = [item for item in self._paths if not item[0].constant]
        self.live = any(path.live for path, *_ in self._paths)

    def aim(self, t: float) -> None:
        """Put all targets where they are at time `t` [s], at rest."""
        self._ahead = None
        self.motion[:] = 0.0
        for path, place, turn, com in self._paths:
            value = checked(ask(path, t), f"{type(path).__name__} at {t:.4g} s")
            pose = isinstance(value, pin.SE3)
            if place is not None:
                self.position_goal[place] = value.translation if pose else value
            if turn is not None:
                self.rotation_goal[turn] = value.rotation if pose else value
            if com is not None:
                self.com_goal[com] = value

    def advance(self, t: float, dt: float) -> None:
        """Move the targets on from `t` to `t + dt` [s] and keep how far they went in `motion`."""
        if self.live or not self._moving_paths:
            if self.live:
                self.aim(t + dt)
            return
        ahead = self._ahead
        if ahead is None or ahead.next == STRETCH or abs(ahead.t - t) > 1e-9 * dt:
            ahead = self._ahead = self._look_ahead(t, dt)
        k = ahead.next
        self.position_goal[ahead.places] = ahead.points[k]
        self.rotation_goal[ahead.turns] = ahead.rotations[k]
        self.com_goal[ahead.coms] = ahead.com_points[k]
        self.motion[:] = ahead.motion[k]
        ahead.next, ahead.t = k + 1, t + dt

    def _look_ahead(self, t: float, dt: float) -> _Ahead:
        """Targets of the next ticks, all at once."""
        times: Array = t + dt * np.arange(STRETCH + 1, dtype=np.float64)
        samples = [(item, sample(item[0], times)) for item in self._moving_paths]
        places = [(place, points) for (_, place, _, _), (points, _) in samples if place is not None]
        turns = [(turn, rotations) for (_, _, turn, _), (_, rotations) in samples if turn is not None]
        coms = [(com, points) for (_, _, _, com), (points, _) in samples if com is not None]
        motion = np.zeros((STRETCH, *self.all_error.shape))
        for place, points in places:
            motion[:, place] = np.diff(points, axis=0)
        for turn, rotations in turns:
            steps = rotations[1:] @ rotations[:-1].transpose(0, 2, 1)
            motion[:, len(self.place) + turn] = Rotation.from_matrix(steps).as_rotvec()
        for com, points in coms:
            motion[:, self.frame_groups + com] = np.diff(points, axis=0)
        return _Ahead(
            t,
            np.array([place for place, _ in places], dtype=np.intp),
            np.array([turn for turn, _ in turns], dtype=np.intp),
            np.array([com for com, _ in coms], dtype=np.intp),
            np.array([points[1:] for _, points in places]).reshape(-1, STRETCH, 3).swapaxes(0, 1),
            np.array([rotations[1:] for _, rotations in turns]).reshape(-1, STRETCH, 3, 3).swapaxes(0, 1),
            np.array([points[1:] for _, points in coms]).reshape(-1, STRETCH, 3).swapaxes(0, 1),
            motion.reshape(STRETCH, -1)[:, self.chosen],
        )

    def measure(self, kinematics: Kinematics, normals: Array, offsets: Array) -> tuple[float, float]:
        """Write errors; returns the largest of a hard row, and the least distance to an edge [m]."""
        drift, margin = kernels.measure(
            kinematics.translations,
            kinematics.rotations,
            kinematics.com,
            self.place,
            self.position_goal,
            self.turn,
            self.rotation_goal,
            self.com_goal,
            self.chosen,
            self.hard,
            self.all_error,
            self.error,
            normals,
            offsets,
        )
        return drift, margin

    def write(self, kinematics: Kinematics) -> None:
        """Write `wrench` for the poses that `measure` saw last."""
        kernels.wrenches(
            kinematics.translations,
            kinematics.rotations,
            self.place,
            self.turn,
            self.rotation_error,
            self.chosen,
            self.wrench,
        )


def levers(phase: CompiledPhase, rows: Rows, span: slice) -> Array:
    """Bound on the curvature of each row, per unit of its error: lever arm [m], or 1 for a rotation."""
    reach, found = reaches(phase.model), []
    # A base on its feet moves by the legs that it stands on: their length is its lever arm.
    held = (t for t in phase.frame_targets if t.hard)
    standing = max((reach[t.frame] for t in held), default=0.0)
    for target, row in zip(rows.targets_of_rows[span], rows.chosen[span], strict=True):
        if not isinstance(target, FrameTarget):
            found.append(reach.max())
        elif row // 3 < len(rows.position_targets):
            found.append(max(standing, reach[target.frame], reach[target.root]))
        else:
            found.append(1.0)
    return np.array(found)
