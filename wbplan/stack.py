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

from collections.abc import Callable
from functools import partial
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan import kernels
from wbplan.ascent import Ascent
from wbplan.blocks import RowBlock, edge_names, name_rows
from wbplan.collision import CAPACITY, Clearance, collision_model
from wbplan.compiled import CompiledPhase
from wbplan.kinematics import Kinematics
from wbplan.levels import Level
from wbplan.paths import number
from wbplan.posture import Posture
from wbplan.rows import Rows, levers

Array = NDArray[np.float64]

#: Always on the diagonal [1/rad^2]: keeps the cost strictly convex where nothing is asked.
REGULARISATION = 1e-6

#: The tick stays this far [m] inside the promised margin: its row is linear, the CoM's path is not.
MARGIN_RESERVE = 1e-4

#: Stands for no bound in the QP.
UNBOUNDED = 1e20


@final
class Stack:
    """Matrices of a compiled phase, filled in place.

    `aim` and `advance` move the targets, `measure` gives errors and margin at a configuration, `assemble`
    everything else for the step from there.

    Attributes:
        A, b; C, d; H, g; lower, upper: the QP (see the module), over the free columns. A's rows are those of
            `rows` that are hard, then hard joints.
        hard_error: (m,) error of the hard rows at the last `measure`; drift: the largest of them.
        margin: stability margin [m] at the last `measure`; infinite where the phase has no polygon.
        blocks: what the rows of C are.
        clearance: distances between links, bodies and obstacles; None where the phase promises none.
        levels: the soft tasks by priority; H and g are those of the first.
        normals: (E, 2) of the support polygon's edges.
        driven: columns of the joints whose motion is given; driven_step: how far each goes in this tick;
            driving: whether any of them moves.
        ascents: manipulability tasks.
        postures: soft posture tasks; hard_joints: (joint, path, label) of hard ones, hard_joint_goal: where.
    """

    def __init__(self, phase: CompiledPhase, dt: float) -> None:
        self.phase, self.dt = phase, dt
        self.rows = Rows(phase.model, phase.frame_targets, phase.com_targets)
        self.kinematics = Kinematics(phase.model, self.rows.frames)
        self.free = phase.free
        self.driven = np.array([6 + d.joint for d in phase.driven], dtype=np.intp)
        self.driven_step = np.zeros(len(self.driven))
        self._moving_driven = [(k, d) for k, d in enumerate(phase.driven) if not d.path.constant]
        self.driving = bool(self._moving_driven)
        self.drift, self.margin = 0.0, np.inf
        self._hard_rows()
        self._soft_rows()
        self._joint_box()
        self._polygon()
        self._clearance()
        self.ascents = tuple(Ascent(target, phase, dt, self.kinematics.data) for target in phase.ascents)

    def _hard_rows(self) -> None:
        rows, nf = self.rows, len(self.free)
        self.hard_joints = [
            (j, path, t.label)
            for t in self.phase.joint_targets
            if t.hard
            for j, path in t.paths
            if t.weight[j] > 0
        ]
        self.hard_joint_goal = np.array([float(path.at(0.0)) for _, path, _ in self.hard_joints])
        self.n_hard = rows.hard + len(self.hard_joints)
        self.A, self.b = np.zeros((self.n_hard, nf)), np.zeros(self.n_hard)
        for i, (joint, _, _) in enumerate(self.hard_joints):
            self.A[rows.hard + i, np.searchsorted(self.free, 6 + joint)] = 1.0
        self.hard_error = np.zeros(self.n_hard)
        self._hard_given = np.zeros(rows.hard)
        self._hard_part = self._part(slice(0, rows.hard), self.A[: rows.hard], self._hard_given)

    def _soft_rows(self) -> None:
        rows, nf = self.rows, len(self.free)
        soft = slice(rows.hard, len(rows.error))
        count = len(rows.error) - rows.hard
        self._weight, self._soft_error, self._soft_motion = (
            rows.weight[soft],
            rows.error[soft],
            rows.motion[soft],
        )
        self._pull = 1.0 - np.exp(-rows.gain[soft] * self.dt)
        self._curvature = 0.5 * self.levers(soft) * self._weight**2 * self._pull
        self._soft, self._soft_given, self._soft_rhs = np.zeros((count, nf)), np.zeros(count), np.zeros(count)
        self._soft_part = self._part(soft, self._soft, self._soft_given)
        targets = sorted((t for t in self.phase.joint_targets if not t.hard), key=lambda t: t.level)
        self._posture_goal, self._posture_step = np.zeros((2, len(targets), nf - 6))
        self.postures = [
            Posture(t, self.free, self.dt, self._posture_goal[k], self._posture_step[k])
            for k, t in enumerate(targets)
        ]
        self._stiffness = np.zeros((len(targets), nf - 6))
        for k, posture in enumerate(self.postures):
            self._stiffness[k] = posture.stiffness
        self._posture_pull = np.array([p.pull for p in self.postures])
        count = len(self.phase.phase.levels)
        self.levels = [self._level(k, count, [t.level for t in targets]) for k in range(count)]
        self.H, self.g = self.levels[0].H, self.levels[0].g

    def _level(self, k: int, count: int, postures: list[int]) -> Level:
        """The k-th level of soft tasks: where its rows and posture tasks stand."""
        nf = len(self.free)
        rows = slice(*np.searchsorted(self.rows.levels, (k, k + 1)))
        tasks = slice(*np.searchsorted(postures, (k, k + 1)))
        diagonal = np.full(nf, REGULARISATION + (self.phase.damping if k == count - 1 else 0.0))
        diagonal[6:] += self._stiffness[tasks].sum(axis=0)
        return Level(
            self._soft[rows], self._weight[rows], self._soft_rhs[rows], self._soft_error[rows],
            self._curvature[rows], self._pull[rows], diagonal, self._stiffness[tasks],
            self._posture_pull[tasks], self._posture_goal[tasks], self._posture_step[tasks],
            np.zeros((nf, nf)), np.zeros(nf),
        )  # fmt: skip

    def _part(self, span: slice, out: Array, given: Array) -> tuple[Any, ...]:
        """Arguments of `kernels.rows` for a span of rows: all views, taken once."""
        rows, kin = self.rows, self.kinematics
        return (
            kin.jacobian, kin.com_jacobian, rows.wrench[span], rows.mask[span], rows.chosen[span],
            rows.frame_groups, self.free, self.driven, self.driven_step, out, given,
        )  # fmt: skip

    def levers(self, rows: slice) -> Array:
        """Bound on each row's curvature, per unit of its error: lever arm [m], or 1 for a rotation."""
        return levers(self.phase, self.rows, rows)

    def _joint_box(self) -> None:
        """Bounds of the free joints; the base (first six columns) has none."""
        model, limits, nf = self.phase.model, self.phase.phase.joint_limits, len(self.free)
        self.q_index = self.free[6:] + 1
        self._q_lower, self._q_upper = np.full(nf - 6, -np.inf), np.full(nf - 6, np.inf)
        self._reach = np.full(nf - 6, np.inf)
        self.lower, self.upper = np.full(nf, -UNBOUNDED), np.full(nf, UNBOUNDED)
        if limits is not None:
            self._q_lower = np.array(model.lowerPositionLimit)[self.q_index]
            self._q_upper = np.array(model.upperPositionLimit)[self.q_index]
            self._reach = limits.speed * np.array(model.velocityLimit)[self.free[6:]] * self.dt
        else:
            self._reach[:], self._q_lower[:], self._q_upper[:] = UNBOUNDED, -UNBOUNDED, UNBOUNDED

    def _polygon(self) -> None:
        polygon = self.phase.polygon
        self.normals = np.zeros((0, 2)) if polygon is None else np.ascontiguousarray(polygon.normals)
        self._offsets = np.zeros(0) if polygon is None else np.ascontiguousarray(polygon.offsets)
        edges = len(self._offsets)
        self.C, self.d = np.zeros((edges, len(self.free))), np.zeros(edges)
        self.blocks: list[RowBlock] = []
        if edges:
            self.blocks.append(RowBlock("margin", "m", slice(0, edges), lambda: self.edge_names))
        self._edges = (self.C, self.d)

    def _clearance(self) -> None:
        """Rows below the polygon's, as many at every tick."""
        self.clearance: Clearance | None = None
        if self.phase.phase.clearance is None:
            return
        self.clearance = Clearance(collision_model(self.phase), self.kinematics, self.dt)
        edges, nf = len(self.d), len(self.free)
        self.C, self.d = np.zeros((edges + CAPACITY, nf)), np.full(edges + CAPACITY, UNBOUNDED)
        self._edges, near = (self.C[:edges], self.d[:edges]), slice(edges, edges + CAPACITY)
        self._near = (self.free, self.driven, self.driven_step, self.C[near], self.d[near], UNBOUNDED)
        self.blocks.append(RowBlock("clearance", "m", near, self.clearance.keep_names))

    # -- each tick ---------------------------------------------------------------------------------------

    @property
    def live(self) -> bool:
        """Whether a target may have been set since the last tick."""
        return self.rows.live

    def aim(self, t: float) -> None:
        """Put all targets where they are at time `t` [s]."""
        self.rows.aim(t)
        for i, (_, path, _) in enumerate(self.hard_joints):
            self.hard_joint_goal[i] = float(path.at(t))
        for posture in self.postures:
            posture.aim(t)

    def advance(self, t: float) -> None:
        """Move all targets and driven joints on from time `t` [s] by a tick, keeping how far each goes."""
        self.rows.advance(t, self.dt)
        t += self.dt
        for posture in self.postures:
            posture.advance(t)
        q = self.kinematics.q
        for k, driven in self._moving_driven:
            goal = number(driven.path.at(t), f"driven joint at {t:.4g} s", "a finite position")
            self.driven_step[k] = goal - q[7 + driven.joint]
        for i, (joint, path, _) in enumerate(self.hard_joints):
            self.hard_joint_goal[i] = number(path.at(t), f"hard posture at {t:.4g} s", "a finite position")
            self.hard_error[self.rows.hard + i] = self.hard_joint_goal[i] - q[7 + joint]

    def measure(self, q: Array) -> None:
        """Kinematics, errors and margin at `q` for the targets as they stand now."""
        rows = self.rows
        self.kinematics.update(q)
        if self.clearance is not None:
            self.clearance.measure()
        self.drift, self.margin = rows.measure(self.kinematics, self.normals, self._offsets)
        self.hard_error[: rows.hard] = rows.error[: rows.hard]
        for i, (joint, _, _) in enumerate(self.hard_joints):
            error = self.hard_joint_goal[i] - q[7 + joint]
            self.hard_error[rows.hard + i] = error
            self.drift = max(self.drift, abs(error))

    def assemble(self) -> None:
        """Fill H, g, A, b, C, d, lower and upper for the step to the targets that `advance` set."""
        rows, kin = self.rows, self.kinematics
        kin.differentiate()
        rows.write(kin)
        kernels.rows(*self._hard_part)
        kernels.rows(*self._soft_part)
        self.b[:] = self.hard_error
        self.b[: rows.hard] += rows.motion[: rows.hard] - self._hard_given
        np.multiply(self._pull, self._soft_error, out=self._soft_rhs)
        self._soft_rhs += self._soft_motion - self._soft_given
        joints = kin.q[self.q_index]
        for level in self.levels:
            level.assemble(joints)
        for ascent in self.ascents:
            ascent.update()
            ascent.write(self.levels[-1].H, self.levels[-1].g)
        self.fill_box()
        support = self.phase.phase.support
        if support is not None:
            self._fill_polygon(support.margin, -support.recovery_speed * self.dt)
        if self.clearance is not None:
            self.clearance.write(kin.jacobian, *self._near)

    def _fill_polygon(self, margin: float, least: float) -> None:
        kin = self.kinematics
        kernels.polygon(
            self.normals, self._offsets, kin.com, kin.com_jacobian, self.free, self.driven, self.driven_step,
            margin + MARGIN_RESERVE, least, *self._edges,
        )  # fmt: skip

    def distances(self) -> Array:
        """(E,) of the CoM at the last `measure` to each edge of the support polygon [m]."""
        gaps: Array = self._offsets - self.normals @ self.kinematics.com[:2]
        return gaps

    def fill_box(self) -> None:
        """Fill lower and upper for the current configuration."""
        kernels.box(
            self.kinematics.q, self.q_index, self._q_lower, self._q_upper, self._reach, self.lower, self.upper
        )

    def soft_damping(self) -> float:
        """The damping on H's diagonal for the errors of the last `measure`, without assembling H."""
        return REGULARISATION + self.phase.damping + float(np.abs(self._soft_error) @ self._curvature)

    def relax(self) -> bool:
        """Ask what is outside its limits only not to go further out; False where that changes nothing."""
        before = self.d.copy()
        np.maximum(self._edges[1], 0.0, out=self._edges[1])
        if self.clearance is not None:
            self.clearance.relax(self.kinematics.jacobian, *self._near)
        return not np.array_equal(before, self.d)

    def linearise(self, *, recovering: bool) -> None:
        """Fill A, b, C and d for a correction at the configuration that `measure` saw last: no target moves.

        Args:
            recovering: the CoM comes from outside the margin, so the correction need not bring it inside.
        """
        rows, kin = self.rows, self.kinematics
        given = self.driven_step.copy()
        self.driven_step[:] = 0.0
        kin.differentiate()
        rows.write(kin)
        kernels.rows(*self._hard_part)
        self.b[:] = self.hard_error
        support = self.phase.phase.support
        if support is not None:
            self._fill_polygon(support.margin, 0.0 if recovering else -np.inf)
        if self.clearance is not None:
            self.clearance.linearise(kin.jacobian, *self._near)
        self.driven_step[:] = given

    def reach(self, column: int) -> float:
        """How far [m or rad] the speed limit lets a free column move in one tick."""
        return float(self._reach[column - 6])

    def box_kind(self, column: int, *, up: bool) -> str:
        """What makes a free column's bound: 'position' or 'speed'."""
        bound = self.upper[column] if up else -self.lower[column]
        return "speed" if bound >= self._reach[column - 6] * (1.0 - 1e-9) else "position"

    def relaxed_box(self, column: int, kind: str, by: float, *, up: bool) -> tuple[Array, Array]:
        """Lower and upper as they would be were a limit of one joint wider by so much [rad, m, or per s]."""
        kept, j = (self._q_lower.copy(), self._q_upper.copy(), self._reach.copy()), column - 6
        if kind == "speed":
            self._reach[j] += by * self.dt
        elif up:
            self._q_upper[j] += by
        else:
            self._q_lower[j] -= by
        self.fill_box()
        moved = self.lower.copy(), self.upper.copy()
        self._q_lower, self._q_upper, self._reach = kept
        self.fill_box()
        return moved

    # -- names -------------------------------------------------------------------------------------------

    def hard_names(self) -> list[tuple[str, str]]:
        """(label, unit) of every hard row."""
        names: list[tuple[str, str]] = []
        for label, part, span in self.rows.labels:
            if span.stop <= self.rows.hard:
                names += [(label, "m" if part == "position" else "rad")] * (span.stop - span.start)
        joints = enumerate(list(self.phase.model.joints)[2:])
        sliding = {j for j, joint in joints if "JointModelP" in joint.shortname()}
        return names + [(label, "m" if j in sliding else "rad") for j, _, label in self.hard_joints]

    def row_names(self) -> list[tuple[str, str, str]]:
        """(name, kind, unit) of every row of C as it is now."""
        return self.keep_row_names()()

    def keep_row_names(self) -> Callable[[], list[tuple[str, str, str]]]:
        """`row_names` of this moment, to be worked out whenever somebody asks."""
        return partial(name_rows, self.blocks, [block.keep() for block in self.blocks])

    def edge_names(self) -> list[str]:
        """Name of every support-polygon row: the two feet that its edge joins, or a side of the region."""
        return edge_names(self.phase)

    def box_names(self) -> list[tuple[str, str]]:
        """(lower, upper) bound's name of every free column."""
        joints = [self.phase.robot.joint_names[c - 6] for c in self.free[6:]]
        return [("base", "base")] * 6 + [(f"{joint} lower", f"{joint} upper") for joint in joints]

    def errors(self) -> dict[str, float]:
        """Norm of every task's error at the last `measure`.

        Keys: '<label>.position' [m], '<label>.orientation' [rad], '<label>.joints' [rad].
        """
        return self.keep_errors()()

    def keep_errors(self) -> Callable[[], dict[str, float]]:
        """`errors` of this moment, to be worked out whenever somebody asks."""
        joints = self.kinematics.q[self.q_index]
        return partial(
            self._name_errors, self.rows.error.copy(), self.hard_error[self.rows.hard :].copy(),
            self._posture_goal - joints,
        )  # fmt: skip

    def keep_measures(self) -> Callable[[], dict[str, float]]:
        """What is reported of this moment beside errors, to be worked out whenever somebody asks.

        Keys: '<task>.manipulability', w of a manipulability task.
        """
        q, ascents = self.kinematics.q.copy(), self.ascents
        return lambda: {f"{ascent.label}.manipulability": ascent.value_at(q) for ascent in ascents}

    def _name_errors(self, error: Array, hard_joints: Array, postures: Array) -> dict[str, float]:
        found = {f"{label}.{part}": _norm(error[span]) for label, part, span in self.rows.labels}
        for posture, gap in zip(self.postures, postures, strict=True):
            found[f"{posture.label}.joints"] = _norm(gap[posture.stiffness > 0])
        for (_, _, label), gap in zip(self.hard_joints, hard_joints, strict=True):
            key = f"{label}.joints"
            found[key] = float(np.hypot(found.get(key, 0.0), gap))
        return found


def _norm(vector: Array) -> float:
    return float(np.sqrt(vector @ vector))
