"""Coulomb's friction cone, as rays and faces of an inner pyramid, and as the second-order cone itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError

Array = NDArray[np.float64]


def axes_of(normal: ArrayLike) -> Array:
    """(3, 3) columns: two tangents and the unit normal, right-handed."""
    n = np.asarray(normal, dtype=np.float64)
    n = n / np.linalg.norm(n)
    side = np.cross(n, np.eye(3)[0 if abs(n[0]) < 0.9 else 1])
    side /= np.linalg.norm(side)
    return np.column_stack([side, np.cross(n, side), n])


def rays(normal: ArrayLike, friction: float, sides: int = 8, *, outer: bool = False) -> Array:
    """(sides, 3) edges of a pyramid in (or around) the cone |f_t| <= friction f_n, each with f_n = 1.

    The inner pyramid's edges lie on the cone: what it allows, friction allows. The outer one's faces touch
    the cone: its edges allow 1 / cos(pi / sides) of friction, with four sides 41 % more than there is.

    Args:
        normal: (3,) of the ground, pointing at the foot.
        friction: coefficient [-].
        sides: of the pyramid, at least 3.
        outer: around the cone instead of in it.

    Raises:
        SpecError: fewer than three sides.
    """
    if sides < 3:
        raise SpecError(f"friction pyramid: expected 3 sides or more, got {sides}")
    a, b, n = axes_of(normal).T
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    mu = friction / np.cos(np.pi / sides) if outer else friction
    edges: Array = n + mu * (np.outer(np.cos(angle), a) + np.outer(np.sin(angle), b))
    return edges


def faces(normal: ArrayLike, friction: float, sides: int = 4) -> Array:
    """(sides, 3) rows G of the inner pyramid: G f <= 0 inside."""
    a, b, n = axes_of(normal).T
    # Edges are at half steps (see `rays`), so faces look along whole ones.
    angle = 2.0 * np.pi * np.arange(sides) / sides
    out: Array = np.outer(np.cos(angle), a) + np.outer(np.sin(angle), b)
    rows: Array = out - friction * np.cos(np.pi / sides) * n
    return rows


def friction_use(forces: ArrayLike, normals: ArrayLike, friction: ArrayLike, least: float = 1e-6) -> Array:
    """Share of the friction that forces use: |f_t| / (friction f_n), exact; 1 is on the cone.

    A force of less than `least` uses none; one that pulls uses infinitely much.

    Args:
        forces: (..., C, 3) [N], world, on the robot.
        normals: (C, 3) unit.
        friction: (C,).
        least: [N].
    """
    f, n = np.asarray(forces, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    along = np.sum(f * n, axis=-1)
    across = np.linalg.norm(f - along[..., None] * n, axis=-1)
    room = np.asarray(friction) * along
    with np.errstate(divide="ignore", invalid="ignore"):
        use = np.where(room > 0.0, across / room, np.inf)
    share: Array = np.where(np.linalg.norm(f, axis=-1) <= least, 0.0, use)
    return share
