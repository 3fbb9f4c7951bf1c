"""The motion that `q` alone says: frames, steps and centre of mass at every sample."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle import NO_MARGIN, Bundle, Trajectory
from wbplan.obstacles import Obstacle

Array = NDArray[np.float64]

EDGE = 1e-9  #: [s], a sample this near to a phase's edge lies on it


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses in the world over K samples: `rotation` (K, 3, 3), `position` (K, 3) [m]."""

    rotation: Array
    position: Array

    def __getitem__(self, samples: Any) -> Poses:
        return Poses(self.rotation[samples], self.position[samples])

    def __matmul__(self, inner: Poses) -> Poses:
        """T_world_b = T_world_a @ T_a_b."""
        return Poses(self.rotation @ inner.rotation, self.act(inner.position))

    def act(self, points: Array) -> Array:
        """Points (3,) or (K, 3) of this frame, in the world."""
        moved: Array = np.einsum("kij,kj->ki", self.rotation, np.broadcast_to(points, self.position.shape))
        return moved + self.position

    def seen_from(self, root: Poses) -> Poses:
        """T_root_this from T_world_this and T_world_root."""
        back = np.swapaxes(root.rotation, 1, 2)
        return Poses(back @ self.rotation, np.einsum("kij,kj->ki", back, self.position - root.position))

    def distance(self, other: Poses) -> Array:
        """(K,) [m] between the origins."""
        gap: Array = np.linalg.norm(self.position - other.position, axis=1)
        return gap

    def turn(self, other: Poses) -> Array:
        """(K,) [rad], the angle between the rotations.

        ||R1 - R2||_F = 2 sqrt(2) sin(angle / 2), which keeps its precision at small angles.
        """
        chord = np.linalg.norm(self.rotation - other.rotation, axis=(1, 2)) / np.sqrt(8.0)
        angle: Array = 2.0 * np.arcsin(np.minimum(chord, 1.0))
        return angle

    @staticmethod
    def of(numbers: Any) -> Poses:
        """From (K, 7) x y z qx qy qz qw; quaternions need not have length 1."""
        values = np.atleast_2d(np.asarray(numbers, dtype=np.float64))
        x, y, z, w = (values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1)[:, None]).T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return Poses(np.moveaxis(np.array(rows), 2, 0), values[:, :3])


@dataclass(frozen=True, eq=False)
class Window:
    """A phase and the samples that it covers, both edges included."""

    index: int
    name: str
    promises: Mapping[str, Any]
    samples: NDArray[np.int64]

    @property
    def feet(self) -> tuple[str, ...]:
        """The frames in contact."""
        return tuple(contact["frame"] for contact in self.promises["contacts"])

    @property
    def normals(self) -> Array:
        """(C, 3) unit normals of the contacts, world."""
        normals = np.array(
            [c.get("normal", (0.0, 0.0, 1.0)) for c in self.promises["contacts"]], dtype=np.float64
        )
        normals = normals.reshape(-1, 3)
        unit: Array = normals / np.linalg.norm(normals, axis=1)[:, None]
        return unit

    @property
    def margin(self) -> float | None:
        """The promised margin [m], if one is promised."""
        margin = float(self.promises["margin"])
        return None if margin <= 0.1 * NO_MARGIN else margin


@dataclass(frozen=True, eq=False)
class Replay:
    """What the robot of the bundle's URDF does when it follows `q`.

    Attributes:
        model: `pinocchio.Model`.
        record: the trajectory as recorded.
        plan: plan.json's content.
        windows: the phases.
        step: (N-1, nv) [m/s, rad/s], constant tangent velocity from each sample to the next.
        frames: name -> poses over all samples, of every frame that a phase names.
        com: (N, 3) [m], world, of the robot alone.
        mass: [kg], of the robot alone.
        obstacles: what stands in the world in any phase.
    """

    model: Any
    record: Trajectory
    plan: Mapping[str, Any]
    windows: tuple[Window, ...]
    step: Array
    frames: Mapping[str, Poses]
    com: Array
    mass: float
    obstacles: tuple[Obstacle, ...] = ()

    @staticmethod
    def of(bundle: Bundle) -> Replay:
        """Compute the motion; expects finite values at increasing times."""
        model, motion = bundle.model, bundle.trajectory
        windows = tuple(
            Window(i, phase["name"], phase, _covered(motion.time, phase))
            for i, phase in enumerate(bundle.phases)
        )
        q = np.array(motion.q, dtype=np.float64)
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]  # its length has a row of its own
        data = model.createData()
        names = sorted({name for window in windows for name in _frames(window.promises)})
        ids = [model.getFrameId(name) for name in names]
        rotation, position = np.empty((len(names), len(q), 3, 3)), np.empty((len(names), len(q), 3))
        com = np.empty((len(q), 3))
        step = np.empty((len(q) - 1, model.nv))
        for k, configuration in enumerate(q):
            com[k] = pin.centerOfMass(model, data, configuration)  # runs the forward kinematics
            for i, frame in enumerate(ids):
                pose = pin.updateFramePlacement(model, data, frame)
                rotation[i, k], position[i, k] = pose.rotation, pose.translation
            if k:
                step[k - 1] = pin.difference(model, q[k - 1], configuration)
        step /= np.diff(motion.time)[:, None]
        frames = {name: Poses(rotation[i], position[i]) for i, name in enumerate(names)}
        mass = pin.computeTotalMass(model)
        return Replay(model, motion, bundle.plan, windows, step, frames, com, mass, bundle.obstacles)

    @property
    def phase_names(self) -> list[str]:
        """(N,) the phase recorded for each sample."""
        return [self.windows[i].name for i in self.record.phase]

    def times(self, samples: Any) -> Array:
        """Times [s] of samples."""
        chosen: Array = self.record.time[samples]
        return chosen

    def total_com(self, window: Window, samples: NDArray[np.int64]) -> Array:
        """(K, 3) [m], world: centre of mass of the robot and of what the phase carries."""
        moment, mass = self.mass * self.com[samples], self.mass
        for item in window.promises["carried"]:
            center = np.array(item.get("com", (0.0, 0.0, 0.0)), dtype=np.float64)
            moment = moment + item["mass"] * self.held_pose(item, samples).act(center)
            mass += item["mass"]
        return moment / mass

    def held_pose(self, item: Mapping[str, Any], samples: NDArray[np.int64]) -> Poses:
        """Where a carried object is: T_world_object = T_world_frame T_frame_object."""
        pose = np.tile(np.array(item["pose"], dtype=np.float64), (len(samples), 1))
        return self.frames[item["frame"]][samples] @ Poses.of(pose)


def _covered(time: Array, phase: Mapping[str, Any]) -> NDArray[np.int64]:
    return np.flatnonzero((time >= phase["start"] - EDGE) & (time <= phase["end"] + EDGE))


def _frames(phase: Mapping[str, Any]) -> Iterable[str]:
    yield from (contact["frame"] for contact in phase["contacts"])
    yield from (item["frame"] for item in phase["carried"])
    yield from (push["frame"] for push in phase.get("pushes", ()))
    for loop in phase["closures"]:
        yield from (loop["frame_a"], loop["frame_b"])
