"""The centre of mass over a walk: inside every step's support with the margin asked, and smooth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import proxsuite
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.optimize import linprog

from wbplan.geometry import HalfPlanes

Array = NDArray[np.float64]

#: Kept beyond the margin asked [m], for what ticks are off the curve by.
SPARE = 1e-3
#: Spline pieces in a step, and points in each at which the margin is asked for.
PIECES, POINTS = 4, 4


@final
@dataclass(frozen=True, eq=False)
class Stay:
    """A time in which the centre of mass has to be inside one polygon.

    Attributes:
        begin, end: [s].
        polygon: the support.
    """

    begin: float
    end: float
    polygon: HalfPlanes


@final
@dataclass(frozen=True, eq=False)
class Sway:
    """The centre of mass: its nominal motion and what it departs from it by.

    Attributes:
        nominal: times (N,) [s] -> (N, 2) [m].
        spline: the departure, likewise; None where there is none.
        least: least margin of each stay [m], at the points looked at.
    """

    nominal: Callable[[Array], Array]
    spline: BSpline | None
    least: tuple[float, ...]

    def at(self, times: Array) -> Array:
        """Places (N, 2) [m] at times (N,) [s]."""
        places = self.nominal(times)
        return places if self.spline is None else places + self.spline(times)


def largest_margin(stays: Sequence[Stay], start: Array, goal: Array) -> float:
    """The largest margin [m] that can be kept all through.

    The supports do not change within a stay: the body may go straight from one boundary to the next, and only
    its places there are to be found (a linear program).

    Args:
        stays: in order, without gaps.
        start: where it begins (2,) [m].
        goal: where it ends (2,) [m].
    """
    count = len(stays) + 1
    rows, offsets = [], []
    for k, stay in enumerate(stays):
        for corner in (k, k + 1):
            block = np.zeros((len(stay.polygon.offsets), 2 * count + 1))
            block[:, 2 * corner : 2 * corner + 2] = stay.polygon.normals
            block[:, -1] = 1.0
            rows.append(block)
            offsets.append(stay.polygon.offsets)
    cost = np.zeros(2 * count + 1)
    cost[-1] = -1.0
    fixed = {0: start[0], 1: start[1], 2 * count - 2: goal[0], 2 * count - 1: goal[1]}
    bounds = [(fixed[i], fixed[i]) if i in fixed else (None, None) for i in range(2 * count + 1)]
    found = linprog(cost, A_ub=np.vstack(rows), b_ub=np.concatenate(offsets), bounds=bounds)
    return float(found.x[-1]) if found.x is not None else -np.inf


def common_margins(stays: Sequence[Stay]) -> Array:
    """The largest margin [m] of a point in each stay's support and the next one's too; the last alone."""
    nexts = [*stays[1:], stays[-1]]
    return np.array([_common(a.polygon, b.polygon) for a, b in zip(stays, nexts, strict=True)])


def _common(one: HalfPlanes, other: HalfPlanes) -> float:
    """Radius [m] of the largest circle in both; negative where they do not meet."""
    rows = np.vstack([one.normals, other.normals])
    found = linprog(
        [0.0, 0.0, -1.0],
        A_ub=np.column_stack([rows, np.ones(len(rows))]),
        b_ub=np.concatenate([one.offsets, other.offsets]),
        bounds=[(None, None)] * 3,
    )
    return float(found.x[2])


def sway(
    stays: Sequence[Stay], nominal: Callable[[Array], Array], margin: float, still: float
) -> Sway | None:
    """The smoothest departure from the nominal motion that keeps the margin in every stay.

    A cubic spline d(t), at rest and zero at both ends, that costs the integral of |d|^2 + tau^4 |d''|^2 under
    N_k (c(t) + d(t)) <= offset_k - margin at points of every stay k; nothing where the nominal motion does.

    Args:
        stays: in order, without gaps.
        nominal: times (N,) -> (N, 2) [m].
        margin: [m].
        still: tau [s]; the larger, the smoother.

    Returns:
        None where there is none.
    """
    knots = np.unique(np.concatenate([np.linspace(s.begin, s.end, PIECES + 1) for s in stays]))
    times, which = _points(stays)
    places = nominal(times)
    slack = np.concatenate([stay.polygon.margins(places[which == k]) for k, stay in enumerate(stays)])
    if slack.min() >= margin + SPARE:
        return Sway(nominal, None, _least(slack, which))
    full = np.concatenate([[knots[0]] * 3, knots, [knots[-1]] * 3])
    count = len(full) - 4
    free = np.arange(2, count - 2)  # the two at either end are zero: at rest there
    basis = BSpline.design_matrix(times, full, 3).toarray()[:, free]
    grid = np.linspace(knots[0], knots[-1], 4 * len(knots))
    here = BSpline.design_matrix(grid, full, 3).toarray()[:, free]
    bent = np.column_stack([BSpline(full, np.eye(count)[j], 3).derivative(2)(grid) for j in free])
    gram = (here.T @ here + still**4 * bent.T @ bent) / len(grid)
    control = _solve(gram, basis, stays, which, places, margin + SPARE)
    if control is None:
        return None
    coefficients = np.zeros((count, 2))
    coefficients[free] = control
    spline = BSpline(full, coefficients, 3)
    moved = places + spline(times)
    least = np.concatenate([s.polygon.margins(moved[which == k]) for k, s in enumerate(stays)])
    return Sway(nominal, spline, _least(least, which)) if least.min() >= margin else None


def _points(stays: Sequence[Stay]) -> tuple[Array, NDArray[np.intp]]:
    """Times to look at, both ends of every stay among them, and which stay each belongs to."""
    times = [np.linspace(s.begin, s.end, PIECES * POINTS + 1) for s in stays]
    which = [np.full(len(t), k) for k, t in enumerate(times)]
    return np.concatenate(times), np.concatenate(which)


def _least(margins: Array, which: NDArray[np.intp]) -> tuple[float, ...]:
    return tuple(float(margins[which == k].min()) for k in range(int(which.max()) + 1))


def _solve(
    gram: Array, basis: Array, stays: Sequence[Stay], which: NDArray[np.intp], places: Array, margin: float
) -> Array | None:
    """Control points (K, 2) of the least cost; None where the program has no solution."""
    count = gram.shape[0]
    rows, upper = [], []
    for k, stay in enumerate(stays):
        mine = which == k
        for normal, offset in zip(stay.polygon.normals, stay.polygon.offsets, strict=True):
            rows.append(np.hstack([normal[0] * basis[mine], normal[1] * basis[mine]]))
            upper.append(offset - margin - places[mine] @ normal)
    matrix, bound = np.vstack(rows), np.concatenate(upper)
    keep = np.abs(matrix).max(axis=1) > 1e-12
    if (bound[~keep] < -1e-9).any():
        return None
    # Rows that no departure of a tenth of the feet's extent could reach are left out.
    near = keep & (bound < 0.5 * max(float(np.ptp(s.polygon.vertices)) for s in stays))
    scale = np.zeros((count, count))
    cost = sparse.csc_matrix(np.block([[gram, scale], [scale, gram]]) / np.diag(gram).max())
    problem = proxsuite.proxqp.sparse.QP(2 * count, 0, int(near.sum()))
    problem.settings.eps_abs = 1e-7
    problem.settings.max_iter = 2000
    lower = np.full(int(near.sum()), -1e20)
    problem.init(cost, np.zeros(2 * count), None, None, sparse.csc_matrix(matrix[near]), lower, bound[near])
    problem.solve()
    if problem.results.info.status != proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
        return None
    return np.asarray(problem.results.x).reshape(2, count).T
