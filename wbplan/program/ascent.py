"""Manipulability through the stance legs: its logarithm, its gradient, and what both put into the QP.

Let J be the Jacobian of the tip and A that of the contacts, both over all velocity columns, and V a diagonal
of what each column may do per unit of cost. Motions that keep the contacts are those of

    G = V - V A' (A V A')^-1 A V,        w^2 = det S,  S = J G J'.

With K = V A' (A V A')^-1 and B = J - J K A the derivative of S is (dJ - J K dA) G J' plus its transpose, so

    d log w = tr(Y (dJ - J K dA)),       Y = V B' S^-1.

Both J and A are made of joint axes, whose derivatives are spatial cross products: seen at a point, with
columns (v, omega), column c changes along column k by (omega_k x v_c, omega_k x omega_c) if k carries c, and
by (omega_c x v_k, 0) if not. Summed against the weights above that takes no Hessian in memory.

Where the legs may follow at no cost and have joints enough to follow any motion of the base, A drops out:
G = V, with nothing for the legs. That is the case of HIphanT's equation 34.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import NDArray

from wbplan.compiled.aims import AscentTarget
from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SpecError
from wbplan.program.rows import reach, support_mask

Array = NDArray[np.float64]

#: Legs that have to be charged, as they cannot follow every motion of the base, cost no less than this.
LEAST_COST = 1e-3

#: What stance legs that follow for nothing cost in the step, as a share of other joints: a leg near its end
#: of reach has to turn ever faster, and would chatter there for nothing. w itself is made without.
FOLLOW = 1e-3

#: On the diagonal of A V A', as a share of its trace: keeps contacts that depend on each other solvable.
RIDGE = 1e-14

#: Below this least pivot S counts as singular: w is 0 and has no gradient.
SINGULAR = 1e-14


@njit(cache=True)  # type: ignore[untyped-decorator]
def factor(matrix: Any) -> float:
    """Cholesky factor in the lower triangle, in place; returns the least pivot, 0 or less where it fails."""
    n, least = matrix.shape[0], np.inf
    for i in range(n):
        for j in range(i + 1):
            s = matrix[i, j]
            for k in range(j):
                s -= matrix[i, k] * matrix[j, k]
            if i == j:
                least = min(least, s)
                if not s > 0.0:
                    return 0.0
                matrix[i, i] = np.sqrt(s)
            else:
                matrix[i, j] = s / matrix[j, j]
    return least


@njit(cache=True)  # type: ignore[untyped-decorator]
def solve(chol: Any, columns: Any) -> None:
    """Columns (n, c) replaced by (L L')^-1 columns."""
    n = chol.shape[0]
    for c in range(columns.shape[1]):
        for i in range(n):
            s = columns[i, c]
            for k in range(i):
                s -= chol[i, k] * columns[k, c]
            columns[i, c] = s / chol[i, i]
        for i in range(n - 1, -1, -1):
            s = columns[i, c]
            for k in range(i + 1, n):
                s -= chol[k, i] * columns[k, c]
            columns[i, c] = s / chol[i, i]


@njit(cache=True)  # type: ignore[untyped-decorator]
def add_derivative(
    point: Any, mask: Any, carries: Any, linear: Any, angular: Any, sign: float, out: Any
) -> None:
    """Add sign * sum over columns c of (dv_c . linear_c + domega_c . angular_c) / dq_k to out (nv,).

    Shapes:
        point: (6, nv) columns (v, omega) seen at the point; mask: (nv,) columns that move it.
        carries: (nv, nv), whether column k moves the axis of column c.
        linear, angular: (nv, 3) weights.
    """
    nv = mask.shape[0]
    for k in range(nv):
        if mask[k] == 0.0:
            continue
        v0, v1, v2 = point[0, k], point[1, k], point[2, k]
        w0, w1, w2 = point[3, k], point[4, k], point[5, k]
        total = 0.0
        for c in range(nv):
            if mask[c] == 0.0:
                continue
            a0, a1, a2 = linear[c, 0], linear[c, 1], linear[c, 2]
            if carries[k, c]:
                x0, x1, x2 = point[0, c], point[1, c], point[2, c]
                total += w0 * (x1 * a2 - x2 * a1) + w1 * (x2 * a0 - x0 * a2) + w2 * (x0 * a1 - x1 * a0)
                x0, x1, x2 = point[3, c], point[4, c], point[5, c]
                a0, a1, a2 = angular[c, 0], angular[c, 1], angular[c, 2]
                total += w0 * (x1 * a2 - x2 * a1) + w1 * (x2 * a0 - x0 * a2) + w2 * (x0 * a1 - x1 * a0)
            else:
                x0, x1, x2 = point[3, c], point[4, c], point[5, c]
                total += v0 * (a1 * x2 - a2 * x1) + v1 * (a2 * x0 - a0 * x2) + v2 * (a0 * x1 - a1 * x0)
        out[k] += sign * total


@njit(cache=True)  # type: ignore[untyped-decorator]
def seen_at(jacobian: Any, p: Any, mask: Any, out: Any) -> None:
    """Pinocchio's Jacobian at the world's origin (6, nv) as seen at a point, columns off the mask zero."""
    for c in range(mask.shape[0]):
        m = mask[c]
        w0, w1, w2 = jacobian[3, c], jacobian[4, c], jacobian[5, c]
        out[0, c] = m * (jacobian[0, c] + w1 * p[2] - w2 * p[1])
        out[1, c] = m * (jacobian[1, c] + w2 * p[0] - w0 * p[2])
        out[2, c] = m * (jacobian[2, c] + w0 * p[1] - w1 * p[0])
        out[3, c], out[4, c], out[5, c] = m * w0, m * w1, m * w2


@njit(cache=True)  # type: ignore[untyped-decorator]
def log_manipulability(
    jacobian: Any, tip: Any, feet: Any, tip_mask: Any, foot_masks: Any, carries: Any, mobility: Any,
    first: int, last: int, points: Any, A: Any, M: Any, KA: Any, B: Any, S: Any, Y: Any, linear: Any,
    angular: Any, gradient: Any,
) -> tuple[float, float]:  # fmt: skip
    """Logarithm of w, and its gradient.

    Shapes:
        jacobian: (6, nv). tip: (3,), feet: (C, 3) [m]; tip_mask: (nv,), foot_masks: (C, nv).
        mobility: (nv,) the diagonal V. first, last: which rows of the tip's velocity.
        points: (C + 1, 6, nv), A: (3C, nv), M: (3C, 3C), KA: (3C, nv), B: (m, nv), S: (m, m), Y: (m, nv),
            linear, angular: (nv, 3): room to work in. gradient: (nv,), written.

    Returns:
        log w (minus infinity where S is singular), and how fast log w rises along its own steepest ascent
        by motions that keep the contacts: g' G g.
    """
    nv, m, count = mobility.shape[0], last - first, feet.shape[0]
    gradient[:] = 0.0
    seen_at(jacobian, tip, tip_mask, points[count])
    J = points[count, first:last]
    B[:] = J
    if count:
        for f in range(count):
            seen_at(jacobian, feet[f], foot_masks[f], points[f])
            A[3 * f : 3 * f + 3] = points[f, :3]
        trace = 0.0
        for i in range(3 * count):
            for j in range(i + 1):
                s = 0.0
                for c in range(nv):
                    s += A[i, c] * mobility[c] * A[j, c]
                M[i, j] = s
            trace += M[i, i]
        for i in range(3 * count):
            M[i, i] += RIDGE * trace
        if factor(M) <= 0.0:
            return -np.inf, 0.0
        KA[:] = A
        solve(M, KA)  # (A V A')^-1 A
        for r in range(m):
            for i in range(3 * count):
                s = 0.0
                for c in range(nv):
                    s += J[r, c] * mobility[c] * KA[i, c]
                # J K's entry (r, i)
                for c in range(nv):
                    B[r, c] -= s * A[i, c]
    for r in range(m):
        for t in range(r + 1):
            s = 0.0
            for c in range(nv):
                s += B[r, c] * mobility[c] * B[t, c]
            S[r, t] = s
    if factor(S) <= SINGULAR:
        return -np.inf, 0.0
    value = 0.0
    for r in range(m):
        value += np.log(S[r, r])
    for r in range(m):
        for c in range(nv):
            Y[r, c] = mobility[c] * B[r, c]
    solve(S, Y)
    linear[:] = 0.0
    angular[:] = 0.0
    for r in range(m):
        for c in range(nv):
            if first + r < 3:
                linear[c, first + r] = Y[r, c]
            else:
                angular[c, first + r - 3] = Y[r, c]
    add_derivative(points[count], tip_mask, carries, linear, angular, 1.0, gradient)
    angular[:] = 0.0
    for f in range(count):
        linear[:] = 0.0
        for i in range(3):
            for r in range(m):
                s = 0.0
                for c in range(nv):
                    s += J[r, c] * mobility[c] * KA[3 * f + i, c]
                for c in range(nv):
                    linear[c, i] += s * Y[r, c]
        add_derivative(points[f], foot_masks[f], carries, linear, angular, -1.0, gradient)
    rise = 0.0
    for c in range(nv):
        rise += gradient[c] * mobility[c] * gradient[c]
    for i in range(3 * count):
        a, b = 0.0, 0.0
        for c in range(nv):
            a += A[i, c] * mobility[c] * gradient[c]
            b += KA[i, c] * mobility[c] * gradient[c]
        rise -= a * b
    return value, rise


@final
class Manipulability:
    """log w of a tip over one set of contacts, in arrays allocated once.

    Args:
        model: the model.
        data: Pinocchio's data, of which Jacobian and frame placements are read at each `evaluate`.
        frame: number of the tip's frame; feet: of the frames in contact that count, see the module.
        rows: of the tip's velocity, linear before angular.
        mobility: (nv,) the diagonal V.

    Attributes:
        gradient: (nv,) of log w at the last `evaluate` [1/m, 1/rad].
    """

    def __init__(
        self, model: Any, data: Any, frame: int, feet: tuple[int, ...], rows: slice, mobility: Array
    ) -> None:
        nv, count, m = model.nv, len(feet), rows.stop - rows.start
        joint = [j for j in range(1, model.njoints) for _ in range(model.joints[j].nv)]
        carries = np.array([[k in list(model.supports[c]) for c in joint] for k in joint])
        self.gradient = np.zeros(nv)
        self._jacobian = data.J
        self._sources = [data.oMf[f].translation for f in (*feet, frame)]
        self._places = np.zeros((count + 1, 3))
        masks = np.array([support_mask(model, f) for f in (*feet, frame)])
        self._arguments = (
            self._places[count], self._places[:count], masks[count], masks[:count], carries,
            np.array(mobility), rows.start, rows.stop, np.zeros((count + 1, 6, nv)),
            np.zeros((3 * count, nv)), np.zeros((3 * count, 3 * count)), np.zeros((3 * count, nv)),
            np.zeros((m, nv)), np.zeros((m, m)), np.zeros((m, nv)), np.zeros((nv, 3)), np.zeros((nv, 3)),
            self.gradient,
        )  # fmt: skip

    def evaluate(self) -> tuple[float, float]:
        """Logarithm of w, and how fast it rises along its steepest ascent, for what the data holds."""
        for source, place in zip(self._sources, self._places, strict=True):
            place[:] = source
        value, rise = log_manipulability(self._jacobian, *self._arguments)
        return value, rise


@final
class Ascent:
    """One manipulability task: what it adds to the QP.

    The step x costs weight^2 (1/2 L x' W x - share pull g x), where g is the gradient of log w, W the inverse
    of V (`FOLLOW` at least for stance legs) and L a measure of the curvature of log w in that norm. Alone it
    makes the step share pull / L along G g: that of steepest ascent, short of the top however flat it is.

    Where legs follow for nothing L is `curvature_bound`. Where they are charged, w goes to 0 with a leg's
    last direction, and log w is as curved there as it is steep: 3 g' G g is added.

    Attributes:
        label: of the task.
        stiffness: (nf,) weight^2 L W; slope: (nf,) weight^2 share pull g, at the last `update`.
        varies: whether the stiffness changes from tick to tick.
    """

    def __init__(self, target: AscentTarget, phase: CompiledPhase, dt: float, data: Any) -> None:
        self.label = target.label
        model, self._free = phase.model, phase.free
        mobility, feet = _mobility(target, phase)
        self._own = model.createData()
        self._tip = (target.frame, feet, target.rows, mobility)
        self._now = Manipulability(model, data, *self._tip)
        self._elsewhere = Manipulability(model, self._own, *self._tip)
        self._model = model
        self._bound = curvature_bound(model, target.frame)
        self.varies = bool(feet)
        self._pull = 1.0 - float(np.exp(-target.gain * dt))
        self._most = target.rate * dt
        self._square = target.weight**2
        cost = np.divide(1.0, mobility, out=np.full_like(mobility, FOLLOW), where=mobility > 0)
        self._unit = self._square * np.maximum(cost, FOLLOW)[phase.free]
        self.stiffness: Array = self._bound * self._unit
        self.slope = np.zeros(len(phase.free))
        if not np.isfinite(self._log_at(phase.q_start)):
            raise SpecError(
                f"phase '{phase.phase.name}', {target.label}: the tip cannot be moved in every direction "
                "asked for, so that w is 0 and has no gradient; ask for fewer with kind=, or start elsewhere"
            )

    def update(self) -> None:
        """Stiffness and slope where the stack's data stands; its Jacobian is up to date."""
        _, rise = self._now.evaluate()
        curvature = self._bound
        if self.varies:
            curvature += 3.0 * rise
            np.multiply(curvature, self._unit, out=self.stiffness)
        expected = self._pull / curvature * rise
        share = min(1.0, self._most / expected) if expected > 0.0 else 0.0
        np.multiply(self._square * share * self._pull, self._now.gradient[self._free], out=self.slope)

    def write(self, H: Array, g: Array) -> None:
        """Add the task to the QP's cost (nf, nf) and (nf,)."""
        np.einsum("ii->i", H)[:] += self.stiffness
        g -= self.slope

    @property
    def wanted(self) -> Array:
        """(nf,) the step at which the task alone costs least."""
        step: Array = np.divide(
            self.slope, self.stiffness, out=np.zeros_like(self.slope), where=self.stiffness > 0.0
        )
        return step

    def _log_at(self, q: Array) -> float:
        pin.computeJointJacobians(self._model, self._own, q)
        pin.updateFramePlacements(self._model, self._own)
        return self._elsewhere.evaluate()[0]

    def value_at(self, q: Array) -> float:
        """The manipulability w at a configuration (nq,)."""
        return float(np.exp(self._log_at(q)))


def curvature_bound(model: Any, frame: int) -> float:
    """A bound on the curvature of log w per rad^2 (or m^2): 1 + (length of the chain to the tip)^2 [m^2]."""
    return 1.0 + reach(model, frame) ** 2


def _mobility(target: AscentTarget, phase: CompiledPhase) -> tuple[Array, tuple[int, ...]]:
    """The diagonal V, and the contacts that have to be reckoned with: none where legs follow for nothing."""
    model = phase.model
    given = np.ones(model.nv)
    given[phase.free] = 0.0
    mobility = 1.0 - given
    legs = np.zeros(model.nv)
    for foot in target.feet:
        legs = np.maximum(legs, support_mask(model, foot))
    legs *= (1.0 - support_mask(model, target.frame)) * mobility
    stance = np.flatnonzero(legs)
    if target.legs == 0.0 and _legs_follow(phase, target, stance):
        mobility[stance] = 0.0
        return mobility, ()
    mobility[stance] = 1.0 / max(target.legs, LEAST_COST) ** 2
    return mobility, target.feet


def _legs_follow(phase: CompiledPhase, target: AscentTarget, stance: NDArray[np.intp]) -> bool:
    """Whether the legs' joints can take up any motion of the feet, but for single configurations."""
    model, data = phase.model, phase.model.createData()
    random, best = np.random.default_rng(0), 0
    for _ in range(3):
        q = np.array(phase.q_start)
        q[7:] += random.uniform(-0.2, 0.2, len(q) - 7)
        pin.computeJointJacobians(model, data, q)
        A = np.vstack(
            [
                pin.getFrameJacobian(model, data, foot, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3, stance]
                for foot in target.feet
            ]
        )
        best = max(best, int(np.linalg.matrix_rank(A, tol=1e-6)))
    return best == 3 * len(target.feet)
