"""Steps that move none of a set of rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

Array = NDArray[np.float64]

#: Rows [m/rad, rad/rad] whose part that is not in the rows before is shorter than this do not bind levels
#: below: these may move them by so much per radian of their own motion, 1e-9 m in a tick of 0.1 rad.
DEPENDENT = 1e-8


def null_basis(rows: Array) -> Array:
    """(n, p) orthonormal basis of the steps that move none of the rows (m, n)."""
    m, n = rows.shape
    if m == 0 or n == 0:
        return np.eye(n)
    factor, _, tau, _, _ = lapack.dgeqp3(rows.T)
    rank = int(np.count_nonzero(np.abs(np.diagonal(factor)) > DEPENDENT))
    if rank == 0:
        return np.eye(n)
    square = np.zeros((n, n), order="F")
    square[:, :rank] = factor[:, :rank]
    full, _, _ = lapack.dorgqr(square, np.concatenate([tau[:rank], np.zeros(n - rank)]), overwrite_a=True)
    return np.ascontiguousarray(full[:, rank:])
