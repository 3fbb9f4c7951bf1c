"""The phase's rows as one quadratic program in the tick's step dq.

    minimise    1/2 |weight (J dq - rhs)|^2 over soft rows  +  1/2 dq' D dq  -  h' dq
    subject to  A dq = b              contacts, hard tasks
                C dq <= d             support polygon
                lower <= dq <= upper  joint positions, speeds and accelerations (see `joint_box`)

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

from wbplan.collision import CAPACITY, SHARE, Clearance, collision_model
from wbplan.compiled.kinematics import Kinematics
from wbplan.compiled.phase import CompiledPhase
from wbplan.paths import ask, number
from wbplan.program import kernels
from wbplan.program.ascent import Ascent
from wbplan.program.blocks import RowBlock, edge_names, name_rows
from wbplan.program.joint_box import RECOVERY, UNBOUNDED, JointBox
from wbplan.program.levels import Level
from wbplan.program.posture import Posture
from wbplan.program.rows import Rows, levers

Array = NDArray[np.float64]

#: Always on the diagonal [1/rad^2]: keeps the cost strictly convex where nothing is asked.
REGULARISATION = 1e-6

#: Drift of a hard row [m or rad] that may wait for a tick.
SLIGHT = 2e-5

#: The tick stays this far [m] inside the promised margin: its row is linear, the CoM's path is not.
MARGIN_RESERVE = 1e-4


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
        box: the joints' box, whose arrays lower and upper are.
        driven: columns of the joints whose motion is given; driven_step: how far each goes in this tick;
            driving: whether any of them moves.
        easing: how much less careful this tick is than it should be, see `ease`.
        closer: (E,) [m] by how much nearer the CoM may come to each edge.
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
        self.drift, self.margin, self.easing = 0.0, np.inf, 0
        self._hard_rows()
        self._soft_rows()
        self.box = JointBox(phase, dt)
        self.lower, self.upper, self.q_index = self.box.lower, self.box.upper, self.box.q_index
        self._polygon()
        self._clearance()
        self._gaps, self._closing = np.full(len(self.d), UNBOUNDED), np.zeros(len(self.d))
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
        self.hard_joint_goal = np.array([float(ask(path, 0.0)) for _, path, _ in self.hard_joints])
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
        self._weight, self._soft_error = rows.weight[soft], rows.error[soft]
        self._soft_motion = rows.motion[soft]
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

    def _polygon(self) -> None:
        polygon = self.phase.polygon
        self.normals = np.zeros((0, 2)) if polygon is None else np.ascontiguousarray(polygon.normals)
        self._offsets = np.zeros(0) if polygon is None else np.ascontiguousarray(polygon.offsets)
        edges = len(self._offsets)
        self.C, self.d = np.zeros((edges, len(self.free))), np.zeros(edges)
        self.blocks: list[RowBlock] = []
        if edges:
            self.blocks.append(RowBlock("margin", "m", slice(0, edges), lambda: self.edge_names))
        self.closer = np.zeros(edges)
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
            self.hard_joint_goal[i] = float(ask(path, t))
        for posture in self.postures:
            posture.aim(t)

    def advance(self, t: float) -> None:
        """Move targets and driven joints on from time `t` [s] by a tick, keeping how far each goes."""
        self.easing = 0
        self.rows.advance(t, self.dt)
        t += self.dt
        for posture in self.postures:
            posture.advance(t)
        q = self.kinematics.q
        for k, driven in self._moving_driven:
            goal = number(ask(driven.path, t), f"driven joint at {t:.4g} s", "a finite position")
            self.driven_step[k] = goal - q[7 + driven.joint]
        for i, (joint, path, _) in enumerate(self.hard_joints):
            self.hard_joint_goal[i] = number(ask(path, t), f"hard posture at {t:.4g} s", "a finite position")
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
        near = slice(len(self.closer), None)
        if self.clearance is not None:
            self.clearance.write(kin.jacobian, *self._near, share=1.0)
            self._gaps[near], self._closing[near] = self.d[near], self.C[near] @ self.box.last
        self.fill_box()
        self._limit()

    def _limit(self) -> None:
        """Fill d: how much nearer things may come."""
        self._fill_polygon(self.closer)
        near = slice(len(self.closer), None)
        self.d[near] = self._gaps[near]
        if self.easing == 0:
            self.d[near] = self.box.slowed(self._gaps[near], self._closing[near], SHARE)

    def _fill_polygon(self, most: Array) -> None:
        if self.phase.phase.support is not None:
            kernels.polygon(
                self.normals, self.kinematics.com_jacobian, self.free, self.driven, self.driven_step, most,
                *self._edges,
            )  # fmt: skip

    def distances(self) -> Array:
        """(E,) of the CoM at the last `measure` to each edge of the support polygon [m]."""
        gaps: Array = self._offsets - self.normals @ self.kinematics.com[:2]
        return gaps

    def fill_box(self) -> None:
        """Fill lower, upper and closer for this configuration."""
        support, box, edges = self.phase.phase.support, self.box, len(self.closer)
        if support is None:
            box.fill(self.kinematics.q, self._gaps, self._closing, self.easing)
            return
        inside, closing = self._gaps[:edges], self._closing[:edges]
        inside[:] = self.distances() - (support.margin + MARGIN_RESERVE)
        closing[:] = self.normals @ self.box.com_step[:2]
        box.fill(self.kinematics.q, self._gaps, self._closing, self.easing)
        back, ramp = support.recovery_speed * self.dt, support.recovery_speed * self.dt**2 / RECOVERY
        kernels.approach(inside, closing, box.ticks, box.factor, back, ramp, self.easing, self.closer)

    def ease(self) -> bool:
        """Be less careful in this tick, which found no step; False if that has been tried.

        All joints are to be able to stop together (0), or each by itself (1), or with nearly all of its
        acceleration (2): where hard tasks lead on, they cannot together. Drift waits (3).
        """
        if self.easing >= 2 + (self.drift <= SLIGHT) or self.phase.phase.joint_limits is None:
            return False
        self.easing += 1
        self.fill_box()
        self._limit()
        self.b[: self.rows.hard] -= self.hard_error[: self.rows.hard] * (self.easing == 3)
        return True

    def begin(self, step: Array, older: Array) -> None:
        """Start after a step (nv,) [m, rad], and one (nv,) before it."""
        self.kinematics.differentiate()
        self.box.took(step[self.free], self.kinematics.com_jacobian @ step)
        self.box.older[:] = older[self.free[6:]]

    def soft_damping(self) -> float:
        """The damping on H's diagonal for the errors of the last `measure`."""
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

        A CoM that is `recovering`, from outside its margin, need not be brought inside.
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
            inside = self.distances() - (support.margin + MARGIN_RESERVE)
            self._fill_polygon(np.maximum(inside, 0.0) if recovering else inside)
        if self.clearance is not None:
            self.clearance.linearise(kin.jacobian, *self._near)
        self.driven_step[:] = given

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
