"""Ground to walk on: heights of a terrain, and footholds that lie firmly on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import GaitError
from wbplan.gaits.schedule import Ground
from wbplan.obstacles import Terrain
from wbplan.paths import number

Array = NDArray[np.float64]
#: A limb and its foothold (3,) [m] -> a better one.
Place = Callable[[str, Array], Array]

#: Directions in which the ground round a foothold is looked at, and in which a better one is looked for.
ROUND = 8
#: Places looked at in each direction.
RINGS = 12
#: Distance [m] over which the slope of a ground is found that only tells heights.
NEAR = 1e-3


@final
@dataclass(frozen=True, eq=False)
class Over:
    """Where feet stand on a terrain, and on the floor where it has nothing.

    Args:
        terrain: obstacles seen from above.
        floor: its height [m].
        sole: how far feet's frames are over the ground [m].
    """

    terrain: Terrain
    floor: float = 0.0
    sole: float = 0.0

    def __call__(self, x: float, y: float) -> float:
        """Height [m] at x, y [m]."""
        found = float(self.terrain.height(x, y))
        return self.sole + (found if np.isfinite(found) else self.floor)

    def normal(self, x: float, y: float) -> tuple[float, float, float]:
        """Unit normal of the surface at x, y [m]."""
        a, b, c = (float(value) for value in self.terrain.normal(x, y))
        return a, b, c


def over(terrain: Terrain, floor: float = 0.0, sole: float = 0.0) -> Over:
    """The ground that a terrain is, with its slopes.

    Args:
        terrain: obstacles seen from above.
        floor: its height where it has nothing [m].
        sole: how far feet's frames are over the ground [m].
    """
    return Over(terrain, floor, sole)


def normal_at(ground: Ground, foot: Array) -> tuple[float, float, float]:
    """Unit normal of the ground at a foothold (3,) [m]; by differences where only heights are known."""
    x, y = float(foot[0]), float(foot[1])
    if isinstance(ground, Over):
        return ground.normal(x, y)
    along_x, along_y = (
        (ground(x + dx, y + dy) - ground(x - dx, y - dy)) / (2.0 * NEAR)
        for dx, dy in ((NEAR, 0.0), (0.0, NEAR))
    )
    length = math.sqrt(along_x**2 + along_y**2 + 1.0)
    return -along_x / length, -along_y / length, 1.0 / length


def firm(ground: Ground, radius: float, reach: float, rise: float = 0.005) -> Place:
    """Moves footholds away from edges: to the nearest place where the ground is even all round the foot.

    Args:
        ground: its height.
        radius: of the foot [m].
        reach: how far a foothold may be moved [m].
        rise: by how much the ground under a foot may differ from the height at its middle [m].

    Returns:
        A limb and its foothold -> a better one; raises `GaitError` where there is none.
    """
    radius = number(radius, "firm: radius", "a length of 0 or more [m]", least=0.0)
    reach = number(reach, "firm: reach", "a length of 0 or more [m]", least=0.0)
    angles = 2.0 * np.pi * np.arange(ROUND) / ROUND
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    shifts = [np.zeros(2), *(r * d for r in reach * np.arange(1, RINGS + 1) / RINGS for d in circle)]

    def place(limb: str, foot: Array) -> Array:
        for shift in shifts:
            x, y = foot[:2] + shift
            z = ground(float(x), float(y))
            rim = (np.array([x, y]) + radius * circle).tolist()
            if all(abs(ground(a, b) - z) <= rise for a, b in rim):
                return np.array([x, y, z])
        raise GaitError(
            f"'{limb}': no firm foothold within {reach:.3f} m of ({foot[0]:.3f}, {foot[1]:.3f}) m: the "
            f"ground differs by more than {rise:.3f} m under a foot of {radius:.3f} m everywhere"
        )

    return place
