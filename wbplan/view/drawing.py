"""The nodes of a scene: what each thing is made of, and how it is shown, moved and hidden."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import meshcat
import numpy as np
from meshcat.commands import SetObject, SetTransform
from meshcat.path import Path as NodePath
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import ViewError
from wbplan.obstacles import Obstacle
from wbplan.view import shapes, terrain
from wbplan.view.figure import Figure
from wbplan.view.messages import SetProperty, Window

Array = NDArray[np.float64]

#: A margin nearer than this to what is required is drawn amber [m].
NEAR = 0.005
#: Heights of what lies on the ground, over each other [m].
GRID_Z, FILL_Z, EDGE_Z, DISC_Z = -0.0012, 0.0008, 0.0012, 0.0018


def grade(margin: ArrayLike, required: ArrayLike = 0.0) -> NDArray[np.int64]:
    """How good margins [m] are: 0 clear of what is required, 1 within 5 mm of it, 2 less than it."""
    spare = np.asarray(margin, dtype=np.float64) - np.asarray(required, dtype=np.float64)
    return np.where(spare < -1e-6, 2, np.where(spare < NEAR, 1, 0))


#: The eye's distance, about, in radii of what is seen.
VIEW_DISTANCE = 2.5
#: Half the width and height that what is seen may take in the picture, at a distance of 1: about nine
#: tenths of it, where the page's camera opens 36 degrees upright, and 8 : 5.
PICTURE = np.array([1.6, 1.0]) * np.tan(np.radians(18.0)) * 0.88
#: Names of the grades.
GRADES = ("clear", "near", "broken")


class Drawing:
    """Draws into a window below `/wbplan`, and sends only what changes.

    Args:
        target: a `Server`, a `Store`, or Meshcat's own Visualizer.
        unit: 1 for a robot of about a metre; the size of marks follows it.
    """

    def __init__(self, target: Window | meshcat.Visualizer, unit: float = 1.0) -> None:
        self.window: Window = target.window if isinstance(target, meshcat.Visualizer) else target
        self.unit = unit
        self._poses: dict[str, Array] = {}
        self._shown: dict[str, bool] = {}
        for path, key, value in (
            ("/Grid", "visible", False),
            ("/Axes", "visible", False),
            ("/Background", "top_color", [1.0, 1.0, 1.0]),
            ("/Background", "bottom_color", [0.867, 0.891, 0.914]),
        ):
            self.tell(path, key, value)

    # What every node can do.

    def put(self, path: str, thing: Any, *, shadow: bool = False) -> None:
        """Draws a Meshcat object at a node."""
        self.window.send(SetObject(thing, None, NodePath(tuple(path.strip("/").split("/")))))
        if not shadow:
            self.tell(f"{path}/<object>", "castShadow", False)
            self.tell(f"{path}/<object>", "receiveShadow", False)

    def move(self, path: str, pose: ArrayLike) -> None:
        """Moves a node to a (4, 4) pose in the world, or a (3,) place [m], if it is not there."""
        T = np.asarray(pose, dtype=np.float64)
        if T.shape == (3,):
            T = at(T)
        last = self._poses.get(path)
        if last is None or np.abs(T - last).max() > 1e-7:
            self._poses[path] = T
            self.window.send(SetTransform(T, NodePath(tuple(path.strip("/").split("/")))))

    def show(self, path: str, shown: bool) -> None:
        """Shows or hides a node with all below it."""
        if self._shown.get(path, True) != shown:
            self._shown[path] = shown
            self.tell(path, "visible", shown)

    def tell(self, path: str, key: str, value: Any) -> None:
        """Sets a node's property."""
        self.window.send(SetProperty(path, key, value))

    # What there is to see.

    def robot(self, figure: Figure) -> list[str]:
        """Draws all links; returns their nodes, in the order of `figure.links`."""
        for i, mesh in enumerate(figure.meshes):
            self.put(f"{node('robot', mesh.link)}/{i}", shapes.link(mesh), shadow=True)
        return [node("robot", link) for link in figure.links]

    def ground(self, centre: ArrayLike, radius: float) -> None:
        """Draws grid and ground around a place that is seen with a radius [m]."""
        step = _round_number(radius / 5.0)
        reach = 6.0 * radius
        where = np.append(np.round(np.asarray(centre)[:2] / (5 * step)) * 5 * step, GRID_Z)
        self.put("/wbplan/ground/grid", shapes.grid(reach, step))
        self.put("/wbplan/ground/shadow", shapes.ground(reach))
        self.tell("/wbplan/ground/shadow/<object>", "receiveShadow", True)
        self.move("/wbplan/ground", where)

    def body(self, name: str, size: ArrayLike) -> str:
        """Draws a box with its edges; returns its node."""
        path = node("bodies", name)
        self.put(f"{path}/sides", shapes.box(size), shadow=True)
        self.put(f"{path}/edges", shapes.box_edges(size))
        return path

    def obstacle(self, item: Obstacle) -> str:
        """Draws an obstacle where it stands; returns its node."""
        path = node("obstacles", item.name)
        for part, thing in terrain.things(item).items():
            self.put(f"{path}/{part}", thing, shadow=part == "sides")
        self.move(path, item.pose.homogeneous)
        return path

    def contact(self, name: str, normal: ArrayLike = (0.0, 0.0, 1.0)) -> str:
        """Draws a foot's mark: a disc `on` the ground and a ring `off` it; returns its node."""
        path = node("contacts", name)
        self.put(f"{path}/on", shapes.disc(0.020 * self.unit, shapes.TOUCHING, opacity=0.85, normal=normal))
        off = shapes.disc(0.018 * self.unit, shapes.LIFTED, hole=0.011 * self.unit, opacity=0.8)
        self.put(f"{path}/off", off)
        return path

    def force(self, name: str) -> str:
        """Draws the arrow of a planned force, of length 1; returns its node."""
        path = node("planned_forces", name)
        self.put(path, shapes.arrow(0.006 * self.unit, shapes.PLANNED))
        return path

    def cone(self, name: str, normal: ArrayLike, friction: float, height: float) -> str:
        """Draws a friction cone with its tip at the node; returns the node."""
        path = node("cones", name)
        self.put(path, shapes.cone(normal, friction, height, shapes.PLANNED))
        return path

    def support(self, name: str, polygon: ArrayLike, inset: ArrayLike | None, z: float = 0.0) -> str:
        """Draws a support polygon (V, 2) at a height [m], and in it the region where the margin is kept."""
        path = node("support", name)
        self.put(f"{path}/fill", shapes.filled(polygon, z + FILL_Z, shapes.SUPPORT, 0.13))
        self.put(f"{path}/edge", shapes.outlined(polygon, z + EDGE_Z, 0.005 * self.unit, shapes.SUPPORT, 0.9))
        if inset is not None and len(np.asarray(inset)) >= 3:
            edge = shapes.outlined(inset, z + EDGE_Z, 0.0025 * self.unit, shapes.SUPPORT, 0.65)
            self.put(f"{path}/inset", edge)
            self.show(f"{path}/inset", True)
        else:
            self.show(f"{path}/inset", False)
        return path

    def com(self) -> tuple[str, str]:
        """Draws the centre of mass and its projection, each in three colours; returns their nodes."""
        for grade_name, colour in zip(GRADES, (shapes.GREEN, shapes.AMBER, shapes.RED), strict=True):
            self.put(f"/wbplan/com/{grade_name}", shapes.sphere(0.017 * self.unit, colour))
            self.put(f"/wbplan/com_ground/{grade_name}/dot", shapes.disc(0.011 * self.unit, colour))
            ring = shapes.disc(0.024 * self.unit, colour, hole=0.020 * self.unit)
            self.put(f"/wbplan/com_ground/{grade_name}/ring", ring)
        return "/wbplan/com", "/wbplan/com_ground"

    def target(self, name: str) -> str:
        """Draws a target's frame; returns its node."""
        path = node("targets", name)
        self.put(path, shapes.triad(0.055 * self.unit))
        return path

    def trail(self, name: str, points: ArrayLike, colour: int) -> str:
        """Draws a line through (P, 3) [m]; returns its node."""
        path = node("trails", name)
        self.put(path, shapes.polyline(points, colour))
        return path

    def look(self, eye: ArrayLike, target: ArrayLike) -> None:
        """Aims the camera of wbplan's own page from one place at another [m], world."""
        self.tell("/wbplan/camera", "eye", [float(x) for x in np.asarray(eye)])
        self.tell("/wbplan/camera", "look_at", [float(x) for x in np.asarray(target)])

    def frame_view(self, points: ArrayLike, front: ArrayLike) -> None:
        """Aims the camera at points (P, 3) [m] so that all are seen, and lays the ground under them.

        The eye is ahead of the robot, to its left and above.

        Args:
            points: what has to be seen, world.
            front: (2,), the direction the robot faces.
        """
        seen = np.asarray(points, dtype=np.float64)
        heading = np.arctan2(*np.asarray(front, dtype=np.float64)[::-1]) + np.radians(38.0)
        rise = np.radians(27.0)
        away = np.array([np.cos(heading) * np.cos(rise), np.sin(heading) * np.cos(rise), np.sin(rise)])
        centre, distance = _fitted(seen, away)
        self.ground(centre, distance / VIEW_DISTANCE)
        self.look(centre + away * distance, centre)


def _fitted(points: Array, away: Array) -> tuple[Array, float]:
    """Where to look (3,) and from how far [m], so that points (P, 3) fill the picture.

    Each round moves the centre to the middle of the points' picture and the eye to where the picture just
    holds them; since what is near looks larger, a few rounds are needed.

    Args:
        points: what has to be seen.
        away: (3,), unit, from what is seen to the eye.
    """
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(away, right)])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    size = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1e-3)
    distance = VIEW_DISTANCE * size
    for _ in range(12):
        depth = np.maximum(distance - (points - centre) @ away, 0.05 * size)
        picture = ((points - centre) @ axes.T) / depth[:, None]
        low, high = picture.min(axis=0), picture.max(axis=0)
        distance *= float(np.clip(((high - low) / (2.0 * PICTURE)).max(), 0.5, 2.0))
        centre = centre + axes.T @ ((low + high) / 2.0) * float(np.median(depth))
    # The time bar takes the picture's lower edge, so all is raised a little.
    return centre - axes[1] * 0.04 * distance * PICTURE[1], max(distance, size)


def node(kind: str, name: str) -> str:
    """The path of a named thing; a slash in a name would part it."""
    return f"/wbplan/{kind}/{name.replace('/', '_') or '_'}"


def at(place: ArrayLike) -> Array:
    """(4, 4) pose of a place (3,) [m], unturned."""
    T = np.eye(4)
    T[:3, 3] = place
    return T


def pose7(numbers: ArrayLike) -> Array:
    """(4, 4) pose from x y z qx qy qz qw.

    Raises:
        ViewError: not seven finite numbers.
    """
    v = np.asarray(numbers, dtype=np.float64)
    if v.shape != (7,) or not np.isfinite(v).all() or np.linalg.norm(v[3:]) < 1e-9:
        raise ViewError(f"view: a pose has to be x y z qx qy qz qw, found {np.array2string(v, precision=4)}")
    x, y, z, w = v[3:] / np.linalg.norm(v[3:])
    T = at(v[:3])
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return T


def box_corners(size: ArrayLike, pose: Array) -> Array:
    """(8, 3) [m]: corners of a box of three edge lengths at a (4, 4) pose."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    placed: Array = (signs * np.asarray(size) / 2.0) @ pose[:3, :3].T + pose[:3, 3]
    return placed


def body_sizes(bodies: Mapping[str, Any] | Iterable[Any]) -> dict[str, tuple[float, float, float]]:
    """Edge lengths [m] by name, from a mapping, from `Body` objects, or from a bundle's entries.

    Raises:
        ViewError: an entry is none of these.
    """
    if isinstance(bodies, Mapping):
        pairs: list[tuple[Any, Any]] = list(bodies.items())
    else:
        entries: list[Any] = list(bodies)
        pairs = [(b["name"], b["size"]) if isinstance(b, Mapping) else (b.name, b.size) for b in entries]
    sizes = {}
    for name, given in pairs:
        size = np.asarray(
            getattr(given, "size", given) if not isinstance(given, np.ndarray) else given, dtype=float
        )
        if size.shape != (3,) or not (np.isfinite(size).all() and (size > 0).all()):
            raise ViewError(f"view: body '{name}': size has to be three lengths [m] above 0, found {size}")
        sizes[str(name)] = (float(size[0]), float(size[1]), float(size[2]))
    return sizes


def _round_number(value: float) -> float:
    """1, 2 or 5 times a power of ten, not above the value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * 1.0001))
