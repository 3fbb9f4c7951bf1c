"""How far a stance is from falling: all wrenches that its contacts can give, as half-spaces."""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from wbplan.errors import SpecError
from wbplan.statics.cones import rays

Array = NDArray[np.float64]


@final
class WrenchCone:
    """All sums of forces in the inner pyramids: a . (force, moment) >= 0 for each facet a.

    The rays' section is a polytope of five dimensions; its hull gives the facets, once for a set of contacts.

    Args:
        points: (C, 3) [m].
        normals: (C, 3).
        friction: (C,).
        sides: of each pyramid.

    Attributes:
        facets: (K, 6) with unit length in scaled moments.

    Raises:
        SpecError: the contacts cannot give wrenches in all six directions (fewer than three, or in a line).
    """

    def __init__(self, points: ArrayLike, normals: ArrayLike, friction: ArrayLike, sides: int = 8) -> None:
        p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        n, mu = np.asarray(normals, dtype=np.float64).reshape(-1, 3), np.asarray(friction, dtype=np.float64)
        self.middle = p.mean(axis=0) if len(p) else np.zeros(3)
        self.scale = max(float(np.abs(p - self.middle).max(initial=0.0)), 1e-3)
        forces = np.array([rays(a, m, sides) for a, m in zip(n, mu, strict=True)]).reshape(-1, 3)
        arms = np.repeat((p - self.middle) / self.scale, sides, axis=0)
        x = np.hstack([forces, np.cross(arms, forces)])
        if len(p) < 3 or np.linalg.svd(x, compute_uv=False)[-1] < 1e-9:
            raise SpecError(f"wrench cone: {len(p)} contacts give no wrenches in some direction")
        axis = x.mean(axis=0) / np.linalg.norm(x.mean(axis=0))
        along = x @ axis
        if along.min() < 1e-6:
            raise SpecError("wrench cone: the contacts oppose each other; every wrench can be given")
        flat = np.linalg.svd(axis[None])[2][1:]
        try:
            hull = ConvexHull((x / along[:, None]) @ flat.T, qhull_options="QJ").equations
        except QhullError as fault:
            raise SpecError(f"wrench cone: {str(fault).splitlines()[0]}") from None
        facets = -(hull[:, :-1] @ flat + hull[:, -1:] * axis)
        self.facets: Array = facets / np.linalg.norm(facets, axis=1)[:, None]

    def room(self, wrenches: ArrayLike, com: ArrayLike) -> Array:
        """(N,) [N] the largest push on the CoM, in the worst horizontal direction, that is borne too.

        Negative where they do not even bear the wrench.

        Args:
            wrenches: (N, 6) [N], [N m] that the contacts have to give, about the world's origin.
            com: (N, 3) [m].
        """
        w, c = np.asarray(wrenches, dtype=np.float64), np.asarray(com, dtype=np.float64)
        force = w[:, :3]
        moment = (w[:, 3:] - np.cross(self.middle, force)) / self.scale
        spare = force @ self.facets[:, :3].T + moment @ self.facets[:, 3:].T
        arm = (c - self.middle) / self.scale
        # a . (d, arm x d) = d . (a_f + a_m x arm), its horizontal part
        fx, fy, _, mx, my, mz = self.facets.T
        one = np.ones(len(arm))
        x = np.column_stack([one, arm[:, 2], arm[:, 1]]) @ np.vstack([fx, my, -mz])
        y = np.column_stack([one, arm[:, 0], arm[:, 2]]) @ np.vstack([fy, mz, -mx])
        steep = np.maximum(np.hypot(x, y), 1e-12)
        least: Array = (spare / steep).min(axis=1)
        return least


def tilt(push: ArrayLike, weight: ArrayLike) -> Array:
    """[rad], how far ground and all may tilt before the stance gives: tan(tilt) = F / W, for a push F."""
    steep: Array = np.arctan2(np.asarray(push, dtype=np.float64), np.asarray(weight, dtype=np.float64))
    return steep
