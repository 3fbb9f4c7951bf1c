"""A second robot beside the planned one: simulated, translucent, with the forces on its feet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.view import shapes
from wbplan.view.drawing import Drawing, node
from wbplan.view.figure import Figure
from wbplan.view.keys import FINE, changes, quaternions
from wbplan.view.messages import Track

Array = NDArray[np.float64]

LENGTH = 0.006  #: of an arrow [m] for each newton
LEAST = 0.3  #: forces below this [N] are not drawn


@final
@dataclass(frozen=True, eq=False)
class Ghost:
    """Another motion of the plan's robot.

    Attributes:
        time: (K,) [s] from the plan's start, rising.
        q: (K, nq) configurations.
        forces: name -> (K, 6): a place [m] and the force [N] that acts on the robot there, world.
        bodies: object -> (K, 7) x y z qx qy qz qw.
        sizes: object -> its edge lengths [m].
    """

    time: Array
    q: Array
    forces: Mapping[str, Array] = field(default_factory=dict)
    bodies: Mapping[str, Array] = field(default_factory=dict)
    sizes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


def draw_ghost(ghost: Ghost, draw_in: Drawing, figure: Figure, time: Array) -> list[Track]:
    """Draws a ghost and returns its tracks at times (N,) [s]; after its end it stays where it was."""
    rows = np.clip(np.searchsorted(ghost.time, time + 1e-9, side="right") - 1, 0, len(ghost.time) - 1)
    poses = []
    for q in ghost.q[rows]:
        figure.place(q)
        poses.append(np.array(figure.link_poses()))
    links = np.array(poses)
    for i, mesh in enumerate(figure.meshes):
        draw_in.put(f"{node('ghost', mesh.link)}/{i}", shapes.ghost(mesh))
    tracks: list[Track] = []
    for i, link in enumerate(figure.links):
        path, T = node("ghost", link), links[:, i]
        tracks += _moving(path, time, T[:, :3, 3], quaternions(T[:, :3, :3]))
    for name, values in ghost.bodies.items():
        path = node("ghost_bodies", name)
        draw_in.put(path, shapes.box_edges(ghost.sizes[name]))
        tracks += _moving(path, time, values[rows, :3], values[rows, 3:])
    for name, values in ghost.forces.items():
        tracks += _arrow(draw_in, name, time, values[rows])
    return tracks


def _arrow(draw_in: Drawing, name: str, time: Array, values: Array) -> list[Track]:
    """An arrow of length 1 along z, turned and stretched."""
    path = node("forces", name)
    draw_in.put(path, shapes.arrow(0.004 * draw_in.unit))
    size = np.linalg.norm(values[:, 3:], axis=1)
    ways = np.where(size[:, None] > 1e-9, values[:, 3:], [0.0, 0.0, 1.0])
    turns = np.array([pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).coeffs() for way in ways])
    length = np.maximum(size * LENGTH, 1e-4)
    tracks = _moving(path, time, values[:, :3], turns)
    stretch = np.column_stack([np.ones(len(time)), np.ones(len(time)), length])
    kept = changes(np.round(stretch / FINE) * FINE)
    tracks.append(Track(path, "scale", time[kept], stretch[kept]))
    shown = size > LEAST
    first = np.flatnonzero(np.append(True, shown[1:] != shown[:-1]))
    tracks.append(Track(path, "visible", time[first], shown[first]))
    return tracks


def _moving(path: str, time: Array, places: Array, turns: Array) -> list[Track]:
    tracks = []
    for key, values in (("position", places), ("quaternion", turns)):
        fine = np.round(values / FINE) * FINE
        kept = changes(fine)
        tracks.append(Track(path, key, time[kept], fine[kept]))
    return tracks
