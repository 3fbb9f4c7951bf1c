"""Screws: lines, twists and wrenches as six numbers, and the two products the papers use.

A screw here is **(direction, moment)**, angular part first, as in the papers: a rotation about a line through
r along s is (s, r x s), a translation along s is (0, s); as a twist of a body that is (omega, v_O), with v_O
the velocity of the body's point at the origin. Pinocchio's motions and Jacobians have the linear part first;
`swap` goes from one to the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

Array = NDArray[np.float64]

RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest count as zero."""


def skew(vector: ArrayLike) -> Array:
    """[r]x with `[r]x w = r x w`; (3,) -> (3, 3)."""
    x, y, z = np.asarray(vector, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def line(direction: ArrayLike, point: ArrayLike) -> Array:
    """The zero-pitch screw (s, r x s) of a line.

    Args:
        direction: (3,), normalised here.
        point: (3,) [m], any point of the line.
    """
    s = np.asarray(direction, dtype=np.float64)
    s = s / np.linalg.norm(s)
    return np.concatenate([s, np.cross(np.asarray(point, dtype=np.float64), s)])


def slide(direction: ArrayLike) -> Array:
    """The screw (0, s) of a translation along s; as a wrench, a couple about s."""
    s = np.asarray(direction, dtype=np.float64)
    return np.concatenate([np.zeros(3), s / np.linalg.norm(s)])


def swap(screws: ArrayLike) -> Array:
    """Exchanges the halves: (angular, linear) <-> (linear, angular), for (6,) or rows (..., 6)."""
    both = np.asarray(screws, dtype=np.float64)
    return np.concatenate([both[..., 3:], both[..., :3]], axis=-1)


def klein(first: ArrayLike, second: ArrayLike) -> float:
    """Klein form {a; b} = s_a . m_b + s_b . m_a: zero where the screws are reciprocal."""
    return float(np.asarray(first, dtype=np.float64) @ swap(second))


def lie(first: ArrayLike, second: ArrayLike) -> Array:
    """Lie product [a b] = (s_a x s_b, s_a x m_b - s_b x m_a)."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return np.concatenate([np.cross(a[:3], b[:3]), np.cross(a[:3], b[3:]) - np.cross(b[:3], a[3:])])


def adjoint(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """(6, 6) that takes screws from frame b to frame a, given R_a_b and p_a_b [m]."""
    r = np.asarray(rotation, dtype=np.float64)
    return np.block([[r, np.zeros((3, 3))], [skew(translation) @ r, r]])


def rank(screws: ArrayLike, tolerance: float = RANK_TOLERANCE) -> int:
    """Rank of screws given as rows (n, 6).

    Args:
        screws: rows; lengths should be of the order of 1, or else scaled so that moments are.
        tolerance: share of the largest singular value below which one counts as zero.
    """
    rows = np.atleast_2d(np.asarray(screws, dtype=np.float64))
    values = np.linalg.svd(rows, compute_uv=False) if rows.size else np.zeros(0)
    return int(np.sum(values > tolerance * values[0])) if values.size and values[0] > 0.0 else 0


def reciprocal(screws: ArrayLike, tolerance: float = RANK_TOLERANCE) -> Array:
    """An orthonormal basis (6 - rank, 6) of all screws reciprocal to the given rows (n, 6).

    For the twists that a chain allows these are the wrenches it transmits to its last body.
    """
    rows = np.asarray(screws, dtype=np.float64).reshape(-1, 6)
    if not rows.size:
        return np.eye(6)
    return np.asarray(null_space(swap(rows), rcond=tolerance).T, dtype=np.float64)
