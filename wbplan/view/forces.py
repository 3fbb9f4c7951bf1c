"""Forces as arrows, and the friction cones that they have to be in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.view.drawing import Drawing
from wbplan.view.keys import FINE, changes
from wbplan.view.messages import Track

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

LEAST = 0.3  #: forces below this [N] are not drawn
ARROW = 0.45  #: length of a plan's longest force, in units of the robot
CONE = 0.4  #: of a friction cone's side, in that length


def draw_forces(
    forces: Mapping[str, Array],
    places: Mapping[str, Array],
    phases: Sequence[Mapping[str, Any]],
    phase: NDArray[np.int64],
    time: Array,
    draw_in: Drawing,
) -> tuple[list[Track], list[tuple[str, Bools]]]:
    """Draws planned forces and the cones of the feet.

    Args:
        forces: frame -> (N, 3) [N], world, on the robot.
        places: frame -> (N, 3) [m], world.
        phases: as in plan.json.
        phase: (N,) which it is.
        time: (N,) [s].
        draw_in: where.

    Returns:
        The tracks; and nodes, each with the samples (N,) in which it is to be seen.
    """
    most = max((float(np.linalg.norm(force, axis=1).max()) for force in forces.values()), default=0.0)
    if not 0.0 < most < np.inf:
        return [], []
    length = ARROW * draw_in.unit
    tracks: list[Track] = []
    for name, force in forces.items():
        tracks += arrow_tracks(draw_in.force(name), time, np.hstack([places[name], force]), length / most)
    cones: dict[tuple[Any, ...], tuple[str, Bools]] = {}
    for number, told in enumerate(phases):
        now = phase == number
        for contact in told["contacts"]:
            normal = tuple(np.round(contact.get("normal") or (0.0, 0.0, 1.0), 4))
            key = (contact["frame"], normal, contact["friction"])
            if key in cones:
                path, shown = cones[key]
                cones[key] = (path, np.logical_or(shown, now))
                continue
            name, place = key[0], places[key[0]]
            path = draw_in.cone(f"{name}{len(cones)}", normal, key[2], CONE * length)
            fine = np.round(place / FINE) * FINE
            kept = changes(fine)
            tracks.append(Track(path, "position", time[kept], fine[kept]))
            cones[key] = (path, now)
    return tracks, list(cones.values())


def arrow_tracks(path: str, time: Array, values: Array, per_newton: float) -> list[Track]:
    """Tracks of an arrow of length 1 along z, turned and stretched.

    Args:
        path: its node.
        time: (N,) [s].
        values: (N, 6) place [m] and force [N], world.
        per_newton: its length [m].
    """
    size = np.linalg.norm(values[:, 3:], axis=1)
    ways = np.where(size[:, None] > 1e-9, values[:, 3:], [0.0, 0.0, 1.0])
    turns = np.array([pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).coeffs() for way in ways])
    length = np.maximum(size * per_newton, 1e-4)
    tracks = moving(path, time, values[:, :3], turns)
    stretch = np.column_stack([np.ones(len(time)), np.ones(len(time)), length])
    kept = changes(np.round(stretch / FINE) * FINE)
    tracks.append(Track(path, "scale", time[kept], stretch[kept]))
    shown = size > LEAST
    first = np.flatnonzero(np.append(True, shown[1:] != shown[:-1]))
    tracks.append(Track(path, "visible", time[first], shown[first]))
    return tracks


def moving(path: str, time: Array, places: Array, turns: Array) -> list[Track]:
    """Tracks of a node at places (N, 3) [m], turned by quaternions (N, 4) x y z w."""
    tracks = []
    for key, values in (("position", places), ("quaternion", turns)):
        fine = np.round(values / FINE) * FINE
        kept = changes(fine)
        tracks.append(Track(path, key, time[kept], fine[kept]))
    return tracks
