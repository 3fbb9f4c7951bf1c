"""Where the centre of mass may be, seen from above, so that forces in the friction cones hold the robot.

Forces f_i at points p_i, in their cones, and a load (F, M) that acts on the robot beside its weight m g:

    sum f_i + F = m g z,      sum p_i x f_i + M = c x m g z.

The second line names c's horizontal place only. The set of such c is the projection of a polytope: a convex
polygon, whatever the contacts' heights and slopes.

Source: T. Bretl, S. Lall, "Testing static equilibrium for legged robots", IEEE Trans. Robotics 24(4), 2008:
the polygon from inside by its vertices and from outside by its tangents, each the answer of a linear program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes, support_polygon
from wbplan.statics.cones import rays
from wbplan.statics.simplex import Sweep

Array = NDArray[np.float64]

SIDES = 16  #: of the pyramid: 2 % less friction than there is
SHARP = (
    5e-4  #: [m], of a phase's region corners that stand out by less are left out: each is a row of every tick
)
STRENGTH = 10.0  #: all normal forces together may be this many weights: feet can wedge, not without end
ALIKE = 1e-6  #: unit normals nearer than this are one
LEVEL = 1e-4  #: [m], as for the checks: contacts nearer than this to a plane are in it


@final
@dataclass(frozen=True, eq=False)
class Region:
    """A static-equilibrium region.

    Attributes:
        polygon: its half-planes; all of it holds for the inner pyramids, hence for the cones.
        error: [m], no point of the pyramids' region is farther outside of `polygon`.
        programs: linear programs solved; pivots: simplex steps in all of them.
    """

    polygon: HalfPlanes
    error: float
    programs: int
    pivots: int


@final
@dataclass(frozen=True, eq=False)
class TorqueLimits:
    """Joint torques that a region keeps: |bias - sum J_i^T f_i| <= effort.

    Attributes:
        bias: (J,) [N m] torques of the pose without contacts (gravity and loads).
        jacobians: (C, 3, J) of the contact points in the joints.
        effort: (J,) [N m].
        weight: [N] of all that the contacts carry.
    """

    bias: Array
    jacobians: Array
    effort: Array
    weight: float


def hull_is_exact(points: ArrayLike, normals: ArrayLike, friction: ArrayLike) -> bool:
    """Whether the hull of the contacts, seen from above, is their equilibrium region.

    It is where the contacts lie in one plane, which is the ground at each of them, and the vertical is in
    every cone. Then vertical forces hold every CoM over the hull; and about the point where the weight's line
    meets the plane only normal forces have a moment in it, so that this point is a mean of the contacts.

    Args:
        points: (C, 3) [m].
        normals: (C, 3) unit.
        friction: (C,).
    """
    p, n = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    if not len(p):
        return True
    one = bool((np.abs(n - n[0]) <= ALIKE).all())
    flat = bool((np.abs((p - p.mean(axis=0)) @ n[0]) <= LEVEL).all())
    up = n[0, 2]
    steep = np.inf if up <= 0.0 else float(np.linalg.norm(n[0, :2])) / float(up)
    return one and flat and bool((np.asarray(friction) >= steep).all())


def equilibrium_region(
    points: ArrayLike,
    normals: ArrayLike,
    friction: ArrayLike,
    *,
    sides: int = SIDES,
    outer: bool = False,
    load: ArrayLike = (0.0,) * 6,
    torques: TorqueLimits | None = None,
    tolerance: float = 1e-6,
) -> Region:
    """The region of contacts anywhere.

    Args:
        points: (C, 3) [m], world.
        normals: (C, 3) of the ground, pointing at the robot.
        friction: (C,) coefficients [-].
        sides: of each friction pyramid.
        outer: pyramids around the cones: a region that is too large, to bound the error of the other.
        load: (6,) force and moment about the world's origin that act on the robot, per newton of weight
            [-, m].
        torques: limits of the joints, where they count.
        tolerance: [m], corners that stand out by less are left out.

    Raises:
        SpecError: the contacts cannot hold the weight anywhere, or only along a line.
    """
    p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    n, mu = np.asarray(normals, dtype=np.float64).reshape(-1, 3), np.asarray(friction, dtype=np.float64)
    if not len(p):
        raise SpecError("equilibrium region: needs contacts, found none")
    here = p.mean(axis=0)
    extent = max(float(np.abs(p - here).max()), 1e-3)
    edges = np.array([rays(a, m, sides, outer=outer) for a, m in zip(n, mu, strict=True)]).reshape(-1, 3)
    feet = np.repeat((p - here) / extent, sides, axis=0)
    F, M = np.split(np.asarray(load, dtype=np.float64), 2)
    M = (M - np.cross(here, F)) / extent  # moments about `here`, lengths in units of `extent`
    turn = np.cross(feet, edges).T
    A, b = np.vstack([edges.T, turn[2]]), np.array([-F[0], -F[1], 1.0 - F[2], -M[2]])
    A, b, C = _with_bounds(A, b, np.vstack([-turn[1], turn[0]]), sides, torques, edges)
    try:
        sweep = Sweep(A, b, C)
    except SpecError as fault:
        raise SpecError(f"equilibrium region of {len(p)} contacts: {fault}") from None
    shift = np.array([-M[1], M[0]])
    corners, error, programs = _polygon(sweep, tolerance / extent)
    return Region(
        support_polygon((corners + shift) * extent + here[:2]), error * extent, programs, sweep.pivots
    )


def support_region(
    points: ArrayLike, normals: ArrayLike, friction: ArrayLike, loads: Sequence[Array]
) -> Region:
    """The region that holds under every one of some loads, and so under everything between them.

    Args:
        points: (C, 3) [m], world.
        normals: (C, 3).
        friction: (C,).
        loads: each (6,) as for `equilibrium_region`.

    Raises:
        SpecError: there is no such region.
    """
    found = [equilibrium_region(points, normals, friction, load=load, tolerance=SHARP) for load in loads]
    polygon = found[0].polygon
    for other in found[1:]:
        polygon = support_polygon(polygon.common(other.polygon))
    return Region(
        polygon,
        max(region.error for region in found),
        sum(region.programs for region in found),
        sum(region.pivots for region in found),
    )


def _with_bounds(
    A: Array, b: Array, C: Array, sides: int, torques: TorqueLimits | None, edges: Array
) -> tuple[Array, Array, Array]:
    """The program with its inequalities, each with a slack variable: strength, and torques where given."""
    count = A.shape[1]
    G, h = np.ones((1, count)), np.array([STRENGTH])
    if torques is not None:
        each = torques.jacobians[np.arange(count) // sides]
        # Per newton of weight: bias / weight - T x, between -effort and effort.
        T = np.einsum("rij,ri->jr", each, edges)
        room, bias = torques.effort / torques.weight, torques.bias / torques.weight
        used = np.isfinite(room) & (np.abs(T).max(axis=1, initial=0.0) > 1e-12)
        held = np.isfinite(room) & ~used & (np.abs(bias) > room)
        if held.any():
            raise SpecError("equilibrium region: a joint that carries no contact is beyond its torque limit")
        G = np.vstack([G, T[used], -T[used]])
        h = np.concatenate([h, room[used] + bias[used], room[used] - bias[used]])
    rows = len(G)
    scale = np.maximum(np.abs(G).max(axis=1), 1e-12)
    G, h = G / scale[:, None], h / scale
    full = np.vstack([np.hstack([A, np.zeros((len(A), rows))]), np.hstack([G, np.eye(rows)])])
    return full, np.concatenate([b, h]), np.hstack([C, np.zeros((2, rows))])


def _polygon(sweep: Sweep, tolerance: float) -> tuple[Array, float, int]:
    """Corners (V, 2), counter-clockwise; how far the region may reach beyond them; programs asked.

    Between two neighbours the region ends at their line, or there is a corner farther out.
    """
    first = [sweep.highest(np.array(d)) for d in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))]
    corners = [c for k, c in enumerate(first) if np.abs(c - first[k - 1]).max() > tolerance]
    programs, error, k = len(first), 0.0, 0
    while k < len(corners) and len(corners) > 1:
        a, b = corners[k], corners[(k + 1) % len(corners)]
        along = b - a
        out = np.array([along[1], -along[0]]) / np.hypot(*along)
        found = sweep.highest(out)
        programs += 1
        beyond = float(out @ (found - a))
        if beyond > tolerance:
            corners.insert(k + 1, found)
        else:
            error = max(error, beyond)
            k += 1
    return np.array(corners or first[:1]), error, programs
