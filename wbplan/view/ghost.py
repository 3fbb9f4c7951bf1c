"""A second robot beside the planned one: simulated, translucent, with the forces on its feet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.view import shapes
from wbplan.view.drawing import Drawing, node
from wbplan.view.figure import Figure
from wbplan.view.forces import arrow_tracks, moving
from wbplan.view.keys import quaternions
from wbplan.view.messages import Track

Array = NDArray[np.float64]

LENGTH = 0.006  #: of an arrow [m] for each newton


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
        tracks += moving(path, time, T[:, :3, 3], quaternions(T[:, :3, :3]))
    for name, values in ghost.bodies.items():
        path = node("ghost_bodies", name)
        draw_in.put(path, shapes.box_edges(ghost.sizes[name]))
        tracks += moving(path, time, values[rows, :3], values[rows, 3:])
    for name, values in ghost.forces.items():
        path = node("forces", name)
        draw_in.put(path, shapes.arrow(0.004 * draw_in.unit))
        tracks += arrow_tracks(path, time, values[rows], LENGTH)
    return tracks
