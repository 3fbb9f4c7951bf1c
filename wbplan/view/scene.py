"""A robot and what it is doing, drawn live."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import meshcat
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.obstacles import Obstacle
from wbplan.view import shapes
from wbplan.view.drawing import (
    DISC_Z,
    GRADES,
    VIEW_DISTANCE,
    Drawing,
    body_sizes,
    box_corners,
    grade,
    node,
    pose7,
)
from wbplan.view.figure import Figure
from wbplan.view.messages import Window
from wbplan.view.terrain import is_grid

Array = NDArray[np.float64]

#: A trail keeps this many points, each at least `TRAIL_STEP` [m] from the last.
TRAIL_LENGTH, TRAIL_STEP = 400, 0.003


class Scene:
    """Draws one robot, and on each `update` sends to the pages only what has changed.

    Args:
        target: a `Server`; or Meshcat's own Visualizer, whose page then keeps its own camera and light.
        robot_urdf_text: content of the robot's URDF.
        package_dirs: where `package://` meshes are looked for.
        bodies: the objects that `update` will place: `Body` objects, or edge lengths [m] by name.
        urdf_dir: folder from which relative mesh names count; the working folder if absent.
        trails: frames whose past positions are drawn as lines.
        front: (2,), where the robot faces in the world; the camera looks at it from there. If absent:
            towards the bodies, else along x.
        obstacles: what stands in the world.

    Raises:
        ModelError: the URDF cannot be read.
        ViewError: a mesh is missing, a body has no size, or a trail's frame does not exist.
    """

    def __init__(
        self,
        target: Window | meshcat.Visualizer,
        robot_urdf_text: str,
        package_dirs: Sequence[str | Path] = (),
        bodies: Mapping[str, Any] | Iterable[Any] = (),
        *,
        urdf_dir: Path | None = None,
        trails: Sequence[str] = (),
        front: ArrayLike | None = None,
        obstacles: Iterable[Obstacle] = (),
    ) -> None:
        self._sizes = body_sizes(bodies)
        self._figure = Figure(robot_urdf_text, urdf_dir=urdf_dir, package_dirs=package_dirs)
        self._front = front
        self._trails: dict[str, list[Array]] = {name: [] for name in trails}
        self._colours = shapes.swatch(list(trails))
        for name in trails:
            self._figure.position(name)
        self._draw = Drawing(target, unit=scale(self._figure))
        self._links = self._draw.robot(self._figure)
        for name, size in self._sizes.items():
            self._draw.show(self._draw.body(name, size), False)
        for item in obstacles:
            if not is_grid(item):
                self._draw.obstacle(item)
        for path in self._draw.com():
            self._draw.show(path, False)
        self._graded: dict[str, int] = {}
        self._contacts: set[str] = set()
        self._targets: set[str] = set()
        self._support: tuple[bytes, bytes] | None = None
        self._label = ""
        self._aimed = False

    def look(self, eye: ArrayLike, target: ArrayLike) -> None:
        """Aims the camera from one place at another, (3,) [m] each, world; it then stays there."""
        if not self._aimed:
            self._draw.ground(
                target, float(np.linalg.norm(np.asarray(eye) - np.asarray(target))) / VIEW_DISTANCE
            )
        self._aimed = True
        self._draw.look(eye, target)

    def update(
        self,
        q: ArrayLike,
        *,
        contacts: Iterable[tuple[str, ArrayLike]] = (),
        polygon: ArrayLike | None = None,
        inset: ArrayLike | None = None,
        com: ArrayLike | None = None,
        margin: float | None = None,
        required: float = 0.0,
        bodies: Mapping[str, ArrayLike] | None = None,
        targets: Mapping[str, ArrayLike] | None = None,
        label: str = "",
    ) -> None:
        """Draws the present; what is not given is hidden, only bodies stay where they were.

        Args:
            q: (nq,), x y z qx qy qz qw, then joints.
            contacts: frames that touch the ground, each with the place (3,) [m] where. A frame that was
                in contact earlier is marked as lifted.
            polygon: (V, 2) [m], the support polygon.
            inset: (W, 2) [m], the part of it that keeps the required margin.
            com: (3,) [m], centre of mass.
            margin: of the centre of mass [m]: green, amber within 5 mm of `required`, red below it.
            required: the margin asked for [m].
            bodies: (7,) poses x y z qx qy qz qw in the world, by name.
            targets: (7,) poses in the world, by name; one with a NaN is hidden.
            label: shown in the page's corner: a first line, and smaller ones below.

        Raises:
            ViewError: q or a pose has the wrong shape, or a name is not known.
        """
        self._figure.place(q)
        for path, pose in zip(self._links, self._figure.link_poses(), strict=True):
            self._draw.move(path, pose)
        touching = {name: np.asarray(place, dtype=np.float64) for name, place in contacts}
        self._update_bodies(bodies or {})
        self._update_contacts(touching)
        ground = float(np.mean([place[2] for place in touching.values()])) if touching else 0.0
        self._update_support(polygon, inset, ground)
        self._update_com(com, margin, required, ground)
        self._update_targets(targets or {})
        self._update_trails()
        if label != self._label:
            self._label = label
            self._draw.tell("/wbplan/overlay", "label", label)
        if not self._aimed:
            self._aim(bodies or {})

    def _update_bodies(self, bodies: Mapping[str, ArrayLike]) -> None:
        for name, pose in bodies.items():
            if name not in self._sizes:
                # Known only by its pose: drawn as a frame.
                self._sizes[name] = (0.0, 0.0, 0.0)
                self._draw.put(node("bodies", name), shapes.triad(0.07 * self._draw.unit))
            self._draw.move(node("bodies", name), pose7(pose))
            self._draw.show(node("bodies", name), True)

    def _update_contacts(self, touching: Mapping[str, Array]) -> None:
        for name in touching:
            if name not in self._contacts:
                self._figure.position(name)
                self._contacts.add(name)
                self._draw.contact(name)
        for name in self._contacts:
            path = node("contacts", name)
            place = touching.get(name)
            self._draw.move(path, (self._figure.position(name) if place is None else place) + [0, 0, DISC_Z])
            self._draw.show(f"{path}/on", place is not None)
            self._draw.show(f"{path}/off", place is None)

    def _update_support(self, polygon: ArrayLike | None, inset: ArrayLike | None, ground: float) -> None:
        path = node("support", "live")
        corners = (
            np.zeros((0, 2)) if polygon is None else np.asarray(polygon, dtype=np.float64).reshape(-1, 2)
        )
        kept = np.zeros((0, 2)) if inset is None else np.asarray(inset, dtype=np.float64).reshape(-1, 2)
        known = (corners.tobytes(), kept.tobytes())
        if len(corners) >= 3 and known != self._support:
            self._support = known
            self._draw.support("live", corners, kept, ground)
        self._draw.show(path, len(corners) >= 3)

    def _update_com(
        self, com: ArrayLike | None, margin: float | None, required: float, ground: float
    ) -> None:
        for path in ("/wbplan/com", "/wbplan/com_ground"):
            self._draw.show(path, com is not None)
        if com is None:
            return
        place = np.asarray(com, dtype=np.float64)
        self._draw.move("/wbplan/com", place)
        self._draw.move("/wbplan/com_ground", [place[0], place[1], ground + DISC_Z])
        present = 0 if margin is None else int(grade(margin, required))
        for i, name in enumerate(GRADES):
            self._draw.show(f"/wbplan/com/{name}", i == present)
            self._draw.show(f"/wbplan/com_ground/{name}", i == present)

    def _update_targets(self, targets: Mapping[str, ArrayLike]) -> None:
        asked = {name: pose for name, pose in targets.items() if np.isfinite(np.asarray(pose)).all()}
        for name, pose in asked.items():
            if name not in self._targets:
                self._targets.add(name)
                self._draw.target(name)
            self._draw.move(node("targets", name), pose7(pose))
        for name in self._targets:
            self._draw.show(node("targets", name), name in asked)

    def _update_trails(self) -> None:
        for name, points in self._trails.items():
            place = self._figure.position(name)
            if points and np.linalg.norm(place - points[-1]) < TRAIL_STEP * self._draw.unit:
                continue
            points.append(place)
            del points[:-TRAIL_LENGTH]
            if len(points) > 1:
                self._draw.trail(name, np.array(points), self._colours[name])

    def _aim(self, bodies: Mapping[str, ArrayLike]) -> None:
        self._aimed = True
        robot = self._figure.corners()
        boxes = [box_corners(self._sizes[name], pose7(pose)) for name, pose in bodies.items()]
        self._draw.frame_view(np.vstack([robot, *boxes]), facing(robot, boxes, self._front))


def scale(figure: Figure) -> float:
    """The size of marks beside this robot: 1 where it is about a metre across."""
    neutral = np.zeros(figure.model.nq)
    neutral[6] = 1.0
    for joint in figure.model.joints:
        if joint.nq == 2 and joint.nv == 1:  # a joint without limits is kept as cosine and sine
            neutral[joint.idx_q] = 1.0
    figure.place(neutral)
    extent = float(np.linalg.norm(np.ptp(figure.corners(), axis=0)))
    return float(np.clip(extent, 0.05, 10.0))


def facing(robot: Array, boxes: Sequence[Array], front: ArrayLike | None) -> Array:
    """(2,): the direction from which the scene is looked at."""
    if front is not None:
        return np.asarray(front, dtype=np.float64)[:2]
    if boxes:
        towards = np.vstack(boxes).mean(axis=0) - (robot.min(axis=0) + robot.max(axis=0)) / 2.0
        if np.linalg.norm(towards[:2]) > 1e-3:
            return np.asarray(towards[:2])
    return np.array([1.0, 0.0])
