"""Rows of frame tasks and contacts, all frames at once.

Every row of every frame task is a 6-vector w against Pinocchio's world Jacobian J, whose columns are
spatial velocities (v_O, omega) at the world's origin. For frame b seen from root a, with unit axis u:

    along u:  u . (v_b - v_a at b's origin) = (u, p_b x u) . (J_b - J_a)
    about u:  u . (omega_b - omega_a)       = (0, u)       . (J_b - J_a)

J_b and J_a are J with the columns that do not move b, or a, set to zero; so one mask per row, support of
b minus support of a, turns w J into the row, and common ancestors cancel exactly.

Errors are target minus actual along the root's axes; a row is the derivative of minus its error, so that
row . dq = error closes it. For rotations, e = log(R_target R_ab^T) and the row is Jlog(e) applied to the
relative angular velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.compiled import WORLD, FrameTarget
from wbplan.kinematics import Kinematics

Array = NDArray[np.float64]

# p @ _CROSS is minus the cross-product matrix of p, row by row: u @ that = p x u.
_CROSS = np.zeros((3, 9))
_CROSS[2, 1] = _CROSS[0, 5] = _CROSS[1, 6] = 1.0
_CROSS[1, 2] = _CROSS[2, 3] = _CROSS[0, 7] = -1.0

#: Below this angle [rad] the derivative of the rotation logarithm is taken for the identity (off by half of it).
_SMALL_TURN = 1e-4


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


@final
class FrameRows:
    """Errors and rows of frame targets, written into arrays allocated once.

    Args:
        model: the model that the targets' frame numbers belong to.
        targets: the frame targets, hard ones first.

    Attributes:
        frames: numbers of the frames that have to be read, for `Kinematics`.
        error: (n,) target minus actual, of the rows asked for, in the targets' order.
        motion: (n,) how far the targets themselves move in the step that `advance` took.
        wrench: (n, 6) the w of each row; mask: (n, nv).
        spans: per target, (first position row, count, first rotation row, count).
        position_targets, position_goal (P, 3), position_error (P, 3): the targets that ask for a position,
            where it is asked for now, and all three axes of its error; rotation_targets,
            rotation_goal (R, 3, 3), rotation_error (R, 3) likewise.
    """

    def __init__(self, model: Any, targets: Sequence[FrameTarget]) -> None:
        self.targets = tuple(targets)
        self.frames = sorted({t.frame for t in targets} | {t.root for t in targets if t.root != WORLD})
        slot = {frame: k for k, frame in enumerate(self.frames)}
        slot[WORLD] = len(self.frames)
        position = [t for t in targets if (t.position_weight > 0).any()]
        rotation = [t for t in targets if (t.rotation_weight > 0).any()]
        self._place = {id(t): k for k, t in enumerate(position)}
        self._turn = {id(t): k for k, t in enumerate(rotation)}
        self._layout(model, len(position))
        count, turns = len(position), len(rotation)
        self._world = slot[WORLD]
        self._body = np.array([slot[t.frame] for t in position], dtype=np.intp)
        self._relative_places = [
            (k, slot[t.frame], slot[t.root]) for k, t in enumerate(position) if t.root != WORLD
        ]
        self._turns = [(k, slot[t.frame], slot[t.root]) for k, t in enumerate(rotation)]
        self.position_goal = np.zeros((count, 3))
        self.rotation_goal = np.tile(np.eye(3), (turns, 1, 1))
        self._all_error = np.zeros((count + turns, 3))
        self.position_error, self.rotation_error = self._all_error[:count], self._all_error[count:]
        self.position_targets, self.rotation_targets = tuple(position), tuple(rotation)
        self._all_motion = np.zeros((count + turns, 3))
        self._all_wrench = np.zeros((count + turns, 3, 6))
        self._flat = self._all_wrench.reshape(-1, 6)
        self._linear = self._all_wrench[:count]
        self._linear[:, :, :3] = np.eye(3)
        self._points, self._moment = np.zeros((count, 3)), np.zeros((count, 9))
        self._relative_moment = np.zeros((3, 3))
        self._moving = [t for t in targets if not t.path.constant]
        self.live = any(t.path.live for t in targets)
        self.aim(0.0, every=True)

    def _layout(self, model: Any, count: int) -> None:
        """Choose the rows asked for out of all (position and rotation) x (three axes)."""
        chosen: list[int] = []
        masks, weights, gains = [], [], []
        spans = []
        for t in self.targets:
            mask = support_mask(model, t.frame) - support_mask(model, t.root)
            span = []
            for weight, index in ((t.position_weight, self._place), (t.rotation_weight, self._turn)):
                axes = np.flatnonzero(weight > 0)
                offset = (index[id(t)] if len(axes) else 0) + (count if weight is t.rotation_weight else 0)
                span += [len(chosen), len(axes)]
                chosen += [3 * offset + int(axis) for axis in axes]
                masks += [mask] * len(axes)
                weights += [float(weight[axis]) for axis in axes]
                gains += [t.gain] * len(axes)
            spans.append((span[0], span[1], span[2], span[3]))
        self.spans = tuple(spans)
        self._chosen = np.array(chosen, dtype=np.intp)
        size = len(chosen)
        self.mask = np.array(masks).reshape(size, model.nv)
        self.weight, self.gain = np.array(weights), np.array(gains)
        self.error, self.motion = np.zeros(size), np.zeros(size)
        self.wrench = np.zeros((size, 6))
        self.hard_rows = sum(s[1] + s[3] for s, t in zip(spans, self.targets, strict=True) if t.hard)

    def aim(self, t: float, *, every: bool = False) -> None:
        """Put the targets where they are at time `t` [s]; those that never move only when `every`."""
        for target in self.targets if every else self._moving:
            value = target.path.at(t)
            place, turn = self._place.get(id(target)), self._turn.get(id(target))
            if place is not None:
                self.position_goal[place] = value.translation if isinstance(value, pin.SE3) else value
            if turn is not None:
                self.rotation_goal[turn] = value.rotation if isinstance(value, pin.SE3) else value

    def advance(self, t: float) -> None:
        """Move the targets on to time `t` [s] and keep how far they went in `motion`."""
        if not self._moving:
            return
        count = len(self.position_goal)
        for target in self._moving:
            value = target.path.at(t)
            place, turn = self._place.get(id(target)), self._turn.get(id(target))
            if place is not None:
                goal = value.translation if isinstance(value, pin.SE3) else value
                np.subtract(goal, self.position_goal[place], out=self._all_motion[place])
                self.position_goal[place] = goal
            if turn is not None:
                goal = value.rotation if isinstance(value, pin.SE3) else value
                self._all_motion[count + turn] = pin.log3(goal @ self.rotation_goal[turn].T)
                self.rotation_goal[turn] = goal
        self._all_motion.take(self._chosen, out=self.motion)

    def measure(self, kinematics: Kinematics) -> None:
        """Write `error` from the current poses and targets."""
        p, r = kinematics.translations, kinematics.rotations
        p.take(self._body, axis=0, out=self._points)
        np.subtract(self.position_goal, self._points, out=self.position_error)
        for k, body, root in self._relative_places:
            offset = r[root].T @ (p[body] - p[root])
            np.subtract(self.position_goal[k], offset, out=self.position_error[k])
        for k, body, root in self._turns:
            actual = r[body] if root == self._world else r[root].T @ r[body]
            self.rotation_error[k] = pin.log3(self.rotation_goal[k] @ actual.T)
        self._all_error.take(self._chosen, out=self.error)

    def write(self, kinematics: Kinematics) -> None:
        """Write `wrench` for the poses that `measure` saw last."""
        count = len(self.position_goal)
        np.matmul(self._points, _CROSS, out=self._moment)
        for k, _, root in self._relative_places:
            axes = kinematics.rotations[root].T
            self._linear[k, :, :3] = axes
            np.matmul(axes, self._moment[k].reshape(3, 3), out=self._relative_moment)
            self._moment[k] = self._relative_moment.reshape(9)
        self._linear[:, :, 3:] = self._moment.reshape(count, 3, 3)
        for k, _, root in self._turns:
            axes = kinematics.rotations[root].T
            error = self.rotation_error[k]
            if error.dot(error) > _SMALL_TURN**2:
                axes = pin.Jlog3(pin.exp3(error)) @ axes
            self._all_wrench[count + k, :, 3:] = axes
        self._flat.take(self._chosen, axis=0, out=self.wrench)
