"""A finished plan as an animation: served, written to a file, or shown in a notebook."""

from __future__ import annotations

import contextlib
import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, ViewError
from wbplan.geometry import LARGEST, support_polygon
from wbplan.view import shapes
from wbplan.view.collisions import draw_collisions
from wbplan.view.drawing import DISC_Z, GRADES, Drawing, body_sizes, box_corners, grade, node, pose7
from wbplan.view.figure import Figure
from wbplan.view.forces import draw_forces
from wbplan.view.ghost import Ghost, draw_ghost
from wbplan.view.keys import FINE, apart, changes, holding, pick, quaternions
from wbplan.view.messages import SetAnimation, Store, Track, Window, floats
from wbplan.view.page import still_page, title_of
from wbplan.view.scene import facing, scale
from wbplan.view.server import Server
from wbplan.view.terrain import is_grid

if TYPE_CHECKING:
    from wbplan.bundle import Bundle

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


def serve(
    bundle: Bundle,
    host: str = "127.0.0.1",
    port: int | None = None,
    *,
    package_dirs: Sequence[str | Path] = (),
    ghost: Ghost | None = None,
    collisions: bool = False,
) -> Server:
    """Serves a plan's animation; the page repeats it until told otherwise.

    Args:
        bundle: the plan.
        host: address to listen on.
        port: port to listen on; None takes a free one.
        package_dirs: where the robot's meshes are looked for.
        ghost: a second robot, simulated, seen beside the planned one.
        collisions: also draw the collision shapes, and a rod between what is nearest to each other.

    Returns:
        The running server: `.url`, `.wait()`, `.stop()`.

    Raises:
        ViewError: the port is taken, the host is none of this machine, or a mesh is missing.
    """
    server = Server(host, port, title=title_of(bundle.plan))
    try:
        draw_plan(bundle, server, package_dirs=package_dirs, ghost=ghost, collisions=collisions)
    except BaseException:
        server.stop()
        raise
    return server


def play(
    bundle: Bundle,
    host: str = "127.0.0.1",
    port: int | None = None,
    *,
    package_dirs: Sequence[str | Path] = (),
    ghost: Ghost | None = None,
    collisions: bool = False,
) -> None:
    """Serves a plan's animation, prints where, and returns when Ctrl-C is pressed.

    Args:
        bundle: the plan.
        host: address to listen on.
        port: port to listen on; None takes a free one.
        package_dirs: where the robot's meshes are looked for.
        ghost: as `serve` takes it.
        collisions: likewise.

    Raises:
        ViewError: as `serve` does.
    """
    with serve(bundle, host, port, package_dirs=package_dirs, ghost=ghost, collisions=collisions) as server:
        try:  # from the moment that Ctrl-C is offered
            print(f"{title_of(bundle.plan)}: {server.url} (Ctrl-C ends it)", flush=True)
            server.wait()
        except KeyboardInterrupt:
            return


def page(bundle: Bundle, *, package_dirs: Sequence[str | Path] = (), collisions: bool = False) -> str:
    """A plan's animation as one web page that needs no server and no network.

    Args:
        bundle: the plan.
        package_dirs: where the robot's meshes are looked for.
        collisions: as `serve` takes it.

    Raises:
        ViewError: a mesh is missing.
    """
    store = Store()
    draw_plan(bundle, store, package_dirs=package_dirs, collisions=collisions)
    return still_page(title_of(bundle.plan), store.messages())


def write_html(bundle: Bundle, path: str | Path, *, package_dirs: Sequence[str | Path] = ()) -> None:
    """Writes `page` to a file, whole or not at all.

    Args:
        bundle: the plan.
        path: the file; its folder has to exist.
        package_dirs: where the robot's meshes are looked for.

    Raises:
        ViewError: the file cannot be written, or a mesh is missing.
    """
    goal = Path(path)
    text = page(bundle, package_dirs=package_dirs)
    part = goal.with_name(f".{goal.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(goal)
    except OSError as error:
        raise ViewError(f"view: {goal} cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def inline(
    bundle: Bundle,
    *,
    height: int = 520,
    package_dirs: Sequence[str | Path] = (),
    collisions: bool = False,
) -> Any:
    """A plan's animation as a notebook's output, which still works after the kernel has ended.

    Args:
        bundle: the plan.
        height: of the cell's output, in pixels.
        package_dirs: where the robot's meshes are looked for.
        collisions: as `serve` takes it.

    Returns:
        An `IPython.display.HTML`.
    """
    from IPython import display

    text = html.escape(page(bundle, package_dirs=package_dirs, collisions=collisions), quote=True)
    style = f"width: 100%; height: {int(height)}px; border: 0; border-radius: 8px"
    title = html.escape(title_of(bundle.plan))
    show: Any = display.HTML
    return show(f'<div><iframe srcdoc="{text}" style="{style}" title="{title}"></iframe></div>')


def draw_plan(
    bundle: Bundle,
    target: Window,
    *,
    package_dirs: Sequence[str | Path] = (),
    ghost: Ghost | None = None,
    collisions: bool = False,
) -> None:
    """Draws a plan with its whole motion into a window.

    Args:
        bundle: the plan.
        target: a `Server` or a `Store`.
        package_dirs: where the robot's meshes are looked for.
        ghost: as `serve` takes it.
        collisions: likewise.

    Raises:
        ViewError: the plan has no samples, or a mesh is missing.
    """
    _Playback(bundle, target, package_dirs).draw(ghost, collisions)


class _Playback:
    """One plan on its way into an animation; every method adds nodes and their tracks."""

    def __init__(self, bundle: Bundle, target: Window, package_dirs: Sequence[str | Path]) -> None:
        self.plan: Mapping[str, Any] = bundle.plan
        self.bundle, self.package_dirs = bundle, package_dirs
        self.trajectory, self.obstacles = bundle.trajectory, bundle.obstacles
        if len(self.trajectory.time) == 0:
            raise ViewError("view: the plan has no samples, nothing can be shown")
        self.figure = Figure(bundle.urdf, package_dirs=package_dirs)
        self.draw_in = Drawing(target, unit=scale(self.figure))
        self.phases: list[Mapping[str, Any]] = list(self.plan["phases"])
        self.picked = pick(self.trajectory.time, self.trajectory.phase)
        self.time: Array = self.trajectory.time[self.picked] - self.trajectory.time[0]
        self.phase: NDArray[np.int64] = np.clip(self.trajectory.phase[self.picked], 0, len(self.phases) - 1)
        self.duration = max(float(self.time[-1]), 1e-3)
        self.feet = list(dict.fromkeys(c["frame"] for phase in self.phases for c in phase["contacts"]))
        self.pushing = list(self.trajectory.forces)
        # A closure may also name a carried body, which the robot's model does not have.
        self.tips = [name for name in dict.fromkeys(holding(self.phases)) if self.figure.has(name)]
        self.tracks: list[Track] = []

    def draw(self, ghost: Ghost | None = None, collisions: bool = False) -> None:
        """Draws everything; the animation, which binds to what is there, last."""
        self._kinematics()
        self._robot()
        self._contacts()
        self._support()
        self._com()
        self._obstacles()
        self._forces()
        boxes = self._bodies()
        self._targets()
        self._trails()
        self._camera(boxes)
        self._story()
        if collisions:
            shown = (self.picked, self.time, self.package_dirs)
            self.tracks += draw_collisions(self.draw_in, self.bundle, *shown)
        if ghost is not None:
            self.tracks += draw_ghost(ghost, self.draw_in, self.figure, self.time)
        self.draw_in.window.send(SetAnimation(self.tracks, self.duration))

    def _kinematics(self) -> None:
        """Poses (N, L, 4, 4) of links, places (N, 3) of tips, and corners of the space that is taken."""
        frames = list(dict.fromkeys([*self.feet, *self.tips, *self.pushing]))
        poses, places, corners = [], [], []
        every = max(1, len(self.picked) // 24)
        for i, k in enumerate(self.picked):
            self.figure.place(self.trajectory.q[k])
            poses.append(np.array(self.figure.link_poses()))
            places.append([self.figure.position(frame) for frame in frames])
            if i % every == 0:
                corners.append(self.figure.corners())
        self.poses: Array = np.array(poses)
        self.places = {frame: np.array(places)[:, i] for i, frame in enumerate(frames)}
        self.corners: Array = np.vstack(corners)

    def _robot(self) -> None:
        for i, path in enumerate(self.draw_in.robot(self.figure)):
            self._moving(path, self.poses[:, i, :3, 3], quaternions(self.poses[:, i, :3, :3]))

    def _contacts(self) -> None:
        touching = [{c["frame"]: c for c in phase["contacts"]} for phase in self.phases]
        for foot in self.feet:
            normals = [told[foot].get("normal") or (0.0, 0.0, 1.0) for told in touching if foot in told]
            path = self.draw_in.contact(foot, normals[0])
            on = np.array([foot in told for told in touching])[self.phase]
            self._moving(path, self.places[foot] + [0.0, 0.0, DISC_Z])
            self._visible(f"{path}/on", on)
            self._visible(f"{path}/off", ~on)

    def _support(self) -> None:
        """One node for each different polygon, shown in the phases that have it."""
        drawn: dict[bytes, tuple[str, Bools]] = {}
        self.ground = np.zeros(len(self.phases))
        for number, phase in enumerate(self.phases):
            now = self.phase == number
            if not now.any():
                continue
            points = np.array([self.places[c["frame"]][np.argmax(now)] for c in phase["contacts"]]).reshape(
                -1, 3
            )
            self.ground[number] = points[:, 2].mean() if len(points) else 0.0
            try:
                region = support_polygon(phase.get("region") or points[:, :2])
                inset = region.inset(phase["margin"]) if phase["margin"] > 0.0 else None
            except SpecError:
                continue  # fewer than three contacts, or all in line: nothing to draw
            shape = np.round(region.vertices, 4)
            key = shape.tobytes() + np.float64(phase["margin"]).tobytes()
            if key not in drawn:
                path = self.draw_in.support(str(len(drawn)), region.vertices, inset, self.ground[number])
                drawn[key] = (path, now)
            else:
                drawn[key] = (drawn[key][0], np.logical_or(drawn[key][1], now))
        for path, shown in drawn.values():
            self._visible(path, shown)

    def _com(self) -> None:
        sphere, shadow = self.draw_in.com()
        com = self.trajectory.com[self.picked]
        self._moving(sphere, com)
        height = self.ground[self.phase] + DISC_Z
        self._moving(shadow, np.column_stack([com[:, :2], height]))
        asked = np.array([phase["margin"] if phase["margin"] > -1e8 else 0.0 for phase in self.phases])
        margin = self.trajectory.margin[self.picked]
        grades = grade(np.where(np.isfinite(margin), margin, np.inf), asked[self.phase])
        for i, name in enumerate(GRADES):
            for path in (sphere, shadow):
                self._visible(f"{path}/{name}", grades == i)

    def _obstacles(self) -> None:
        """Draws what stands in the world, in the phases in which it does."""
        for item in self.obstacles:
            if not is_grid(item):
                there = np.array([item.name in phase.get("obstacles", ()) for phase in self.phases])
                self._visible(self.draw_in.obstacle(item), there[self.phase])

    def _forces(self) -> None:
        """Planned forces on the robot, and the friction cones that those of the feet have to be in."""
        forces = {name: force[self.picked] for name, force in self.trajectory.forces.items()}
        tracks, shown = draw_forces(forces, self.places, self.phases, self.phase, self.time, self.draw_in)
        self.tracks += tracks
        for path, now in shown:
            self._visible(path, now)

    def _bodies(self) -> list[Array]:
        """Draws the bodies; returns corners (8, 3) of each where it first and last is."""
        sizes = body_sizes(self.plan.get("bodies", ()))
        corners = []
        for name, poses in self.trajectory.bodies.items():
            if name in sizes:
                path = self.draw_in.body(name, sizes[name])
            else:
                path = node("bodies", name)
                self.draw_in.put(path, shapes.triad(0.07 * self.draw_in.unit))
            known = self._posed(path, poses[self.picked])
            if name in sizes:
                corners += [
                    box_corners(sizes[name], pose7(pose)) for pose in known[:: max(1, len(known) - 1)]
                ]
        return corners

    def _targets(self) -> None:
        for name, poses in self.trajectory.targets.items():
            if np.isfinite(poses).all(axis=1).any():
                self._posed(self.draw_in.target(name), poses[self.picked])

    def _trails(self) -> None:
        moving = {
            frame: places for frame, places in self.places.items() if np.ptp(places, axis=0).max() > 0.005
        }
        colours = shapes.swatch(list(moving))
        for frame, places in moving.items():
            kept = apart(places, 0.002 * self.draw_in.unit)
            path = self.draw_in.trail(frame, places[kept], colours[frame])
            self.draw_in.tell(path, "times", floats(self.time[kept]))

    def _camera(self, boxes: Sequence[Array]) -> None:
        # Where it faces is told by the robot at the start: later it may have turned or walked past the boxes.
        start = self.corners[: max(1, len(self.figure.links) * 8)]
        front = facing(start, boxes, None)
        if not boxes:
            path = self.trajectory.q[-1, :2] - self.trajectory.q[0, :2]
            front = path if np.linalg.norm(path) > 0.2 * self.draw_in.unit else front
        self.draw_in.frame_view(np.vstack([self.corners, *boxes]), front)

    def _story(self) -> None:
        first = float(self.trajectory.time[0])
        starts = [float(phase["start"]) - first for phase in self.phases]
        story = {
            "title": title_of(self.plan),
            "duration": self.duration,
            "names": [str(phase["name"]) for phase in self.phases],
            "starts": starts,
            "times": floats(self.time),
            "margins": floats(self.trajectory.margin[self.picked]),
            "asked": [float(phase["margin"]) for phase in self.phases],
            "why": [
                [float(note["time"]) - first, float(note["until"]) - first, str(note["text"])]
                for note in self.plan.get("why", ())
            ],
        }
        self.draw_in.tell("/wbplan/overlay", "story", story)

    # Tracks.

    def _posed(self, path: str, poses: Array) -> Array:
        """A node at poses (N, 7), hidden where they are not known; returns those that are."""
        known: Bools = np.abs(poses).max(axis=1) <= LARGEST  # NaN is not
        if known.any():
            held = poses[np.maximum.accumulate(np.where(known, np.arange(len(poses)), int(np.argmax(known))))]
            self._moving(path, held[:, :3], held[:, 3:])
        self._visible(path, known)
        return poses[known]

    def _moving(self, path: str, places: ArrayLike, quaternions: Array | None = None) -> None:
        for key, values in (("position", places), ("quaternion", quaternions)):
            if values is None:
                continue
            fine = np.round(np.asarray(values, dtype=np.float64) / FINE) * FINE
            kept = changes(fine)
            self.tracks.append(Track(path, key, self.time[kept], fine[kept]))

    def _visible(self, path: str, shown: Bools) -> None:
        if shown.all():
            return
        first = np.flatnonzero(np.append(True, shown[1:] != shown[:-1]))
        self.tracks.append(Track(path, "visible", self.time[first], shown[first]))
