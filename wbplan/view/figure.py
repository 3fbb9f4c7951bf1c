"""The robot as it is drawn: its meshes, and where they are for a configuration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import ModelError, ViewError, listing
from wbplan.view.robot_meshes import LinkMesh, robot_meshes

Array = NDArray[np.float64]


class Figure:
    """A robot's shapes and their kinematics.

    Args:
        urdf_text: content of the URDF; its root link moves freely.
        urdf_dir: folder from which relative mesh names count.
        package_dirs: where `package://` names are looked for.

    Raises:
        ModelError: the URDF cannot be read.
        ViewError: a mesh is missing.

    Attributes:
        model: Pinocchio's model, free-flyer root.
        meshes: what is drawn.
        links: names of the links that are drawn.
    """

    def __init__(
        self, urdf_text: str, *, urdf_dir: Path | None = None, package_dirs: Sequence[str | Path] = ()
    ) -> None:
        try:
            self.model = pin.buildModelFromXML(urdf_text, pin.JointModelFreeFlyer())
        except (RuntimeError, ValueError) as error:
            raise ModelError(f"view: the robot's URDF cannot be read: {error}") from error
        self.meshes: list[LinkMesh] = robot_meshes(urdf_text, urdf_dir=urdf_dir, package_dirs=package_dirs)
        self.links: list[str] = list(dict.fromkeys(mesh.link for mesh in self.meshes))
        self._data = self.model.createData()
        self._ids = [self.model.getFrameId(link, pin.BODY) for link in self.links]
        self._corners = [self._box(link) for link in self.links]

    def place(self, q: ArrayLike) -> None:
        """Takes a configuration; the methods below answer for it.

        Args:
            q: (nq,), free-flyer order x y z qx qy qz qw, then joints.

        Raises:
            ViewError: q has the wrong length or is not finite.
        """
        configuration = np.asarray(q, dtype=np.float64)
        if configuration.shape != (self.model.nq,) or not np.isfinite(configuration).all():
            raise ViewError(
                f"view: q has to be {self.model.nq} finite numbers, found shape {configuration.shape}"
                + ("" if np.isfinite(configuration).all() else " with numbers that are not finite")
            )
        pin.framesForwardKinematics(self.model, self._data, configuration)

    def link_poses(self) -> list[Array]:
        """(4, 4) poses in the world, one for each of `links`."""
        return [self._data.oMf[i].homogeneous for i in self._ids]

    def has(self, frame: str) -> bool:
        """Whether the robot has a frame of this name."""
        return bool(self.model.existFrame(frame))

    def position(self, frame: str) -> Array:
        """(3,) [m], a frame's origin in the world.

        Raises:
            ViewError: no such frame.
        """
        if not self.has(frame):
            names = [f.name for f in self.model.frames]
            raise ViewError(f"view: the robot has no frame '{frame}'; it has {listing(names)}")
        return np.array(self._data.oMf[self.model.getFrameId(frame)].translation)

    def corners(self) -> Array:
        """(C, 3) [m]: corners of the boxes around all links, in the world."""
        placed = [
            corners @ T_world_link[:3, :3].T + T_world_link[:3, 3]
            for corners, T_world_link in zip(self._corners, self.link_poses(), strict=True)
        ]
        return np.vstack(placed) if placed else np.zeros((1, 3))

    def _box(self, link: str) -> Array:
        vertices = np.vstack([mesh.vertices for mesh in self.meshes if mesh.link == link])
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        return np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
