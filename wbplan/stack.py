"""The phase's rows as one quadratic program in the tick's step dq.

    minimise    1/2 |weight (J dq - rhs)|^2 over soft rows  +  1/2 dq' D dq  -  h' dq
    subject to  A dq = b              contacts, hard tasks
                C dq <= d             support polygon
                lower <= dq <= upper  joint positions and speeds

D and h hold what is diagonal: posture, damping, and a curvature damping. A Gauss-Newton step neglects the
curvature of a task's error; near a stretched limb the true Hessian then exceeds J'J by up to
|error| x (lever arm), and full steps chatter about the nearest reachable point for ever. Adding
weight^2 gain |error| x (half the lever arm, or 1/2 for rotations) to the diagonal keeps every step short of
twice the way to the optimum, so steps settle; for a target that is tracked the term vanishes with the error.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.compiled import WORLD, ComTarget, CompiledPhase, JointTarget
from wbplan.geometry import HalfPlanes
from wbplan.kinematics import Kinematics
from wbplan.rows import FrameRows

Array = NDArray[np.float64]

#: Always on the diagonal [1/rad^2]: keeps the cost strictly convex where nothing is asked.
REGULARISATION = 1e-6

#: The tick stays this far [m] inside the promised margin: its row is linear, the CoM's path is not.
MARGIN_RESERVE = 1e-4


def reach(model: Any, frame: int) -> float:
    """Length [m] of the chain from the base to a frame: no joint of it has a longer lever arm."""
    if frame == WORLD:
        return 0.0
    joints = [j for j in model.supports[model.frames[frame].parentJoint] if j > 1]
    links = [model.jointPlacements[j].translation for j in joints] + [model.frames[frame].placement.translation]
    return float(sum(np.linalg.norm(link) for link in links))


@final
class Posture:
    """A soft posture task over the free joints.

    Attributes:
        stiffness: (nf - 6,) squared weights; pull: fraction of the error removed per tick.
        goal: (nf - 6,) target now; step: how far it moved in the last `advance`.
    """

    def __init__(self, target: JointTarget, free: NDArray[np.intp], dt: float) -> None:
        self.label = target.label
        column = {int(c) - 6: k for k, c in enumerate(free[6:])}
        self.stiffness = target.weight[free[6:] - 6] ** 2
        self.pull = 1.0 - float(np.exp(-target.gain * dt))
        self.goal, self.step = np.zeros(len(column)), np.zeros(len(column))
        for j, path in target.paths:
            self.goal[column[j]] = float(path.at(0.0))
        self._moving = [(column[j], path) for j, path in target.paths if not path.constant]
        self._q_index = 7 + free[6:] - 6

    def next_goal(self, q: Array) -> Array:
        """(nf - 6,) where the next step should lead: the target, short of the share of the error that stays."""
        goal: Array = self.goal - (1.0 - self.pull) * (self.goal - self.step - q[self._q_index])
        return goal

    def aim(self, t: float) -> None:
        """Put the target where it is at time `t` [s]."""
        for k, path in self._moving:
            self.goal[k], self.step[k] = float(path.at(t)), 0.0

    def advance(self, t: float) -> None:
        """Move the target on to time `t` [s]."""
        for k, path in self._moving:
            value = float(path.at(t))
            self.step[k], self.goal[k] = value - self.goal[k], value


@final
class Stack:
    """Matrices of a compiled phase, filled in place.

    `measure` gives errors and margin at the kinematics' current q; `assemble` everything else.

    Attributes:
        J: (n, nf) rows in the order: hard frames | soft frames | hard CoM and joints | soft CoM.
        A, b; C, d; H, g; lower, upper: the QP (see the module), lower and upper over the free columns.
        hard_error: (m,) error of the hard rows at the last `measure`.
        driven: columns of the joints whose motion is given; driven_step: how far each goes in this tick.
        postures: soft posture tasks; hard_joints: (joint, path, label) of hard ones; hard_joint_goal: their targets.
    """

    def __init__(self, phase: CompiledPhase, dt: float) -> None:
        self.phase, self.dt = phase, dt
        self.rows = FrameRows(phase.model, phase.frame_targets)
        self.kinematics = Kinematics(phase.model, self.rows.frames)
        self._free = phase.free
        self.driven = np.array([6 + d.joint for d in phase.driven], dtype=np.intp)
        self._driving = any(not d.path.constant for d in phase.driven)
        self._mask = np.ascontiguousarray(self.rows.mask[:, phase.free])
        self._driven_mask = self.rows.mask[:, self.driven]
        self._coms = [(c, np.flatnonzero(c.weight > 0)) for c in phase.com_targets]
        self._allocate()
        self._joint_box()
        self._diagonal()

    def _allocate(self) -> None:
        rows, nf = self.rows, len(self._free)
        hard_com = sum(len(axes) for c, axes in self._coms if c.hard)
        soft_com = sum(len(axes) for c, axes in self._coms if not c.hard)
        self.hard_joints = [
            (j, path, t.label) for t in self.phase.joint_targets if t.hard for j, path in t.paths if t.weight[j] > 0
        ]
        self.hard_joint_goal = np.array([float(path.at(0.0)) for _, path, _ in self.hard_joints])
        self._hard_joint_step = np.zeros(len(self.hard_joints))
        self.n_hard = rows.hard_rows + hard_com + len(self.hard_joints)
        n_soft = len(rows.error) - rows.hard_rows + soft_com
        self.A, self.b = np.zeros((self.n_hard, nf)), np.zeros(self.n_hard)
        self._soft, self._soft_rhs = np.zeros((n_soft, nf)), np.zeros(n_soft)
        self._soft_error = np.zeros(n_soft)
        weights, gains = [rows.weight[rows.hard_rows :]], [rows.gain[rows.hard_rows :]]
        for c, axes in self._coms:
            if not c.hard:
                weights.append(c.weight[axes])
                gains.append(np.full(len(axes), c.gain))
        self._weight = np.concatenate(weights)
        self._pull = 1.0 - np.exp(-np.concatenate(gains) * self.dt)
        self._curvature = 0.5 * self._lever() * self._weight**2 * self._pull
        self._weighted = np.zeros((n_soft, nf))
        self._weight_column, self._minus_weight = self._weight[:, None], -self._weight
        self.hard_error = np.zeros(self.n_hard)
        self.H, self.g = np.zeros((nf, nf)), np.zeros(nf)
        edges = 0 if self.phase.polygon is None else len(self.phase.polygon.offsets)
        self.C, self.d = np.zeros((edges, nf)), np.zeros(edges)
        self._J = np.zeros((6, nf))
        self._W = np.zeros((len(rows.error), nf))
        self._H_diagonal = self.H.reshape(-1)[:: nf + 1]
        self._com_goal = [np.array(c.path.at(0.0), dtype=float) for c, _ in self._coms]
        self._com_step = [np.zeros(3) for _ in self._coms]
        self.driven_step = np.zeros(len(self.driven))

    def _lever(self) -> Array:
        """Bound on the curvature of each soft row's error, per unit of error: lever arm [m], or 1 for a rotation."""
        model, levers = self.phase.model, []
        for target, (_, positions, _, rotations) in zip(self.rows.targets, self.rows.spans, strict=True):
            if not target.hard:
                arm = max(reach(model, target.frame), reach(model, target.root))
                levers += [arm] * positions + [1.0] * rotations
        longest = max(reach(model, k) for k in range(len(model.frames)))
        levers += [longest for com, axes in self._coms if not com.hard for _ in axes]
        return np.array(levers)

    def _joint_box(self) -> None:
        """Bounds of the free joints; the base (first six columns) has none."""
        model, free = self.phase.model, self._free
        limits, nf = self.phase.phase.joint_limits, len(free)
        joints = free[6:] - 6
        self._q_index = 7 + joints
        self._q_lower, self._q_upper = np.full(nf - 6, -np.inf), np.full(nf - 6, np.inf)
        self._reach = np.full(nf - 6, np.inf)
        self.lower, self.upper = np.full(nf, -1e20), np.full(nf, 1e20)
        self._lower, self._upper = self.lower[6:], self.upper[6:]
        if limits is not None:
            self._q_lower = np.array(model.lowerPositionLimit)[self._q_index]
            self._q_upper = np.array(model.upperPositionLimit)[self._q_index]
            self._reach = limits.speed * np.array(model.velocityLimit)[free[6:]] * self.dt
        self._back = -self._reach

    def _diagonal(self) -> None:
        """What never changes on the diagonal, and the posture tasks' share of it."""
        self._base_diagonal = np.full(len(self._free), REGULARISATION + self.phase.damping)
        self.postures = [Posture(t, self._free, self.dt) for t in self.phase.joint_targets if not t.hard]
        for posture in self.postures:
            self._base_diagonal[6:] += posture.stiffness

    # -- each tick -----------------------------------------------------------------------------------

    def measure(self, q: Array) -> None:
        """Kinematics, errors and margin at `q` for the targets as they stand now."""
        self.kinematics.update(q)
        self.rows.measure(self.kinematics)
        k, hard = 0, self.rows.hard_rows
        self.hard_error[:hard] = self.rows.error[:hard]
        self._soft_error[: len(self.rows.error) - hard] = self.rows.error[hard:]
        at_hard, at_soft = hard, len(self.rows.error) - hard
        for k, (com, axes) in enumerate(self._coms):
            error = (self._com_goal[k] - self.kinematics.com)[axes]
            if com.hard:
                self.hard_error[at_hard : at_hard + len(axes)] = error
                at_hard += len(axes)
            else:
                self._soft_error[at_soft : at_soft + len(axes)] = error
                at_soft += len(axes)
        for i, (joint, _, _) in enumerate(self.hard_joints):
            self.hard_error[at_hard + i] = self.hard_joint_goal[i] - q[7 + joint]

    @property
    def margin(self) -> float:
        """Stability margin [m] at the last `measure`; infinite where the phase has no polygon."""
        polygon = self.phase.polygon
        if polygon is None:
            return np.inf
        return float((polygon.offsets - polygon.normals @ self.kinematics.com[:2]).min())

    @property
    def live(self) -> bool:
        """Whether a target may have been set since the last tick."""
        return self.rows.live or any(c.path.live for c, _ in self._coms)

    def aim(self, t: float) -> None:
        """Put all targets where they are at time `t` [s]."""
        self.rows.aim(t, every=True)
        for k, (com, _) in enumerate(self._coms):
            self._com_goal[k] = np.array(com.path.at(t), dtype=float)
        for i, (_, path, _) in enumerate(self.hard_joints):
            self.hard_joint_goal[i] = float(path.at(t))
        for posture in self.postures:
            posture.aim(t)

    def advance(self, t: float) -> None:
        """Move all targets on to time `t` [s], keeping how far each goes, and so the driven joints."""
        self.rows.advance(t)
        for k, (com, _) in enumerate(self._coms):
            goal = np.array(com.path.at(t), dtype=float)
            self._com_step[k] = goal - self._com_goal[k]
            self._com_goal[k] = goal
        for i, (_, path, _) in enumerate(self.hard_joints):
            value = float(path.at(t))
            self._hard_joint_step[i], self.hard_joint_goal[i] = value - self.hard_joint_goal[i], value
        for posture in self.postures:
            posture.advance(t)
        if self._driving:
            q = self.kinematics.q
            for i, d in enumerate(self.phase.driven):
                self.driven_step[i] = float(d.path.at(t)) - q[7 + d.joint]

    def assemble(self) -> None:
        """Fill H, g, A, b, C, d, lower and upper for the step to the targets that `advance` set."""
        kin, rows = self.kinematics, self.rows
        kin.differentiate()
        rows.write(kin)
        kin.jacobian.take(self._free, axis=1, out=self._J)
        hard, soft = rows.hard_rows, len(rows.error) - rows.hard_rows
        np.matmul(rows.wrench, self._J, out=self._W)
        np.multiply(self._W[:hard], self._mask[:hard], out=self.A[:hard])
        np.multiply(self._W[hard:], self._mask[hard:], out=self._soft[:soft])
        self.b[:] = self.hard_error
        self.b[:hard] += rows.motion[:hard]
        np.multiply(self._pull, self._soft_error, out=self._soft_rhs)
        self._soft_rhs[:soft] += rows.motion[hard:]
        if self._driving:
            given = ((rows.wrench @ kin.jacobian[:, self.driven]) * self._driven_mask) @ self.driven_step
            self.b[:hard] -= given[:hard]
            self._soft_rhs[:soft] -= given[hard:]
        self._com_rows(hard, soft)
        self._cost()
        self._limits()

    def _com_rows(self, at_hard: int, at_soft: int) -> None:
        if not self._coms and not self.hard_joints:
            return
        J = self.kinematics.com_jacobian
        for k, (com, axes) in enumerate(self._coms):
            step = self._com_step[k][axes]
            if self._driving:
                step = step - J[np.ix_(axes, self.driven)] @ self.driven_step
            into, rhs, at = (self.A, self.b, at_hard) if com.hard else (self._soft, self._soft_rhs, at_soft)
            into[at : at + len(axes)] = J[np.ix_(axes, self._free)]
            rhs[at : at + len(axes)] += step
            if com.hard:
                at_hard += len(axes)
            else:
                at_soft += len(axes)
        for i, (joint, _, _) in enumerate(self.hard_joints):
            self.A[at_hard + i, np.searchsorted(self._free, 6 + joint)] = 1.0
            self.b[at_hard + i] += self._hard_joint_step[i]

    def _cost(self) -> None:
        np.multiply(self._soft, self._weight_column, out=self._weighted)
        np.matmul(self._weighted.T, self._weighted, out=self.H)
        self._H_diagonal += self._base_diagonal + self._curvature_damping()
        np.matmul(self._weighted.T, self._minus_weight * self._soft_rhs, out=self.g)
        for posture in self.postures:
            self.g[6:] -= posture.stiffness * (posture.next_goal(self.kinematics.q) - self.kinematics.q[self._q_index])

    def _curvature_damping(self) -> float:
        return float(np.abs(self._soft_error) @ self._curvature)

    def diagonal_damping(self) -> float:
        """What stands on the whole diagonal of H: regularisation, damping tasks and curvature damping."""
        return REGULARISATION + self.phase.damping + self._curvature_damping()

    def com_goal(self, target: ComTarget) -> tuple[Array, Array]:
        """Where a CoM task's target is now [m], and how far it moved in the last `advance`."""
        k = next(k for k, (com, _) in enumerate(self._coms) if com is target)
        return self._com_goal[k], self._com_step[k]

    def fill_box(self) -> None:
        """Fill lower and upper for the current configuration."""
        q = self.kinematics.q[self._q_index]
        for bound, into in ((self._q_lower, self._lower), (self._q_upper, self._upper)):
            np.subtract(bound, q, out=into)
            np.minimum(into, self._reach, out=into)
            np.maximum(into, self._back, out=into)

    def _limits(self) -> None:
        self.fill_box()
        polygon, limit = self.phase.polygon, self.phase.phase.support
        if polygon is None or limit is None:
            return
        J = self.kinematics.com_jacobian[:2]
        np.matmul(polygon.normals, J.take(self._free, axis=1), out=self.C)
        np.maximum(self._room(polygon, limit.margin), -limit.recovery_speed * self.dt, out=self.d)
        if self._driving:
            self.d -= polygon.normals @ (J[:, self.driven] @ self.driven_step)

    def _room(self, polygon: HalfPlanes, margin: float) -> Array:
        """(E,) how far [m] the CoM may still move towards each edge; negative where it has to come back."""
        room: Array = polygon.offsets - polygon.normals @ self.kinematics.com[:2] - (margin + MARGIN_RESERVE)
        return room

    def linearise(self, *, recovering: bool) -> None:
        """Fill A, b, C and d for a correction at the configuration that `measure` saw last: no target moves.

        Args:
            recovering: the CoM comes from outside the margin, so the correction need not bring it inside.
        """
        motion, steps, driving = self.rows.motion.copy(), self._com_step, self._driving
        self.rows.motion[:], self._com_step, self._driving = 0.0, [np.zeros(3) for _ in steps], False
        lower, upper = self.lower.copy(), self.upper.copy()
        self.assemble()
        self.rows.motion[:], self._com_step, self._driving = motion, steps, driving
        self.lower[:], self.upper[:] = lower, upper
        polygon, limit = self.phase.polygon, self.phase.phase.support
        if polygon is not None and limit is not None:
            room = self._room(polygon, limit.margin)
            self.d[:] = np.maximum(room, 0.0) if recovering else room

    def reach(self, column: int) -> float:
        """How far [m or rad] the speed limit lets a free column move in one tick."""
        return float(self._reach[column - 6])

    # -- names -----------------------------------------------------------------------------------------

    def hard_names(self) -> list[tuple[str, str]]:
        """(label, unit) of every hard row."""
        names: list[tuple[str, str]] = []
        for target, (_, n, _, m) in zip(self.rows.targets, self.rows.spans, strict=True):
            if target.hard:
                names += [(target.label, "m")] * n + [(target.label, "rad")] * m
        for com, axes in self._coms:
            if com.hard:
                names += [(com.label, "m")] * len(axes)
        return names + [(label, "rad") for _, _, label in self.hard_joints]

    def edge_names(self) -> list[str]:
        """Name of every support-polygon row: the two feet that its edge joins."""
        if self.phase.polygon is None:
            return []
        feet = [c.frame for c in self.phase.phase.contacts]
        return [f"support polygon edge {feet[i]}-{feet[j]}" for i, j in self.phase.polygon.edges]

    def box_names(self) -> list[tuple[str, str]]:
        """(lower, upper) bound's name of every free column."""
        names: list[tuple[str, str]] = [("base", "base")] * 6
        joints = self.phase.robot.joint_names
        return names + [(f"{joints[c - 6]} lower", f"{joints[c - 6]} upper") for c in self._free[6:]]

    def errors(self) -> dict[str, float]:
        """Norm of every task's error at the last `measure`: '<label>.position' [m], '.orientation' [rad]."""
        found: dict[str, float] = {}
        for target, (i, n, j, m) in zip(self.rows.targets, self.rows.spans, strict=True):
            if n:
                found[f"{target.label}.position"] = float(np.linalg.norm(self.rows.error[i : i + n]))
            if m:
                found[f"{target.label}.orientation"] = float(np.linalg.norm(self.rows.error[j : j + m]))
        for k, (com, axes) in enumerate(self._coms):
            error = (self._com_goal[k] - self.kinematics.com)[axes]
            found[f"{com.label}.position"] = float(np.linalg.norm(error))
        q = self.kinematics.q
        for posture in self.postures:
            gap = (posture.goal - q[self._q_index])[posture.stiffness > 0]
            found[f"{posture.label}.joints"] = float(np.linalg.norm(gap))
        for i, (joint, _, label) in enumerate(self.hard_joints):
            found[f"{label}.joints"] = float(np.hypot(found.get(f"{label}.joints", 0.0), self.hard_joint_goal[i] - q[7 + joint]))
        return found

