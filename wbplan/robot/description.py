"""A robot as the planner knows it: model, limbs, tips, poses and roles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, listing
from wbplan.robot.reading import is_file
from wbplan.robot.urdf_links import mesh_places
from wbplan.state import State, find_frame, find_joint

ROLE_TOLERANCE = 1e-6
"""How far [rad or m] a joint may be from where a role holds it."""


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A checked URDF with what its SRDF (or the caller) adds to it.

    Attributes:
        name: name in the URDF.
        urdf_path: file it was read from.
        urdf_text: the URDF itself.
        model: Pinocchio's model, with a free-flyer root.
        limbs: limb -> its joints that move, in order.
        feet: limb -> frame of its foot.
        hands: limb -> frame of its hand.
        poses: named whole-body poses, joint -> value [rad or m].
        roles: limb -> role ("leg", "arm") -> the joints that the role holds -> value [rad or m].
        ignored_collisions: pairs of links that can never collide, or always touch.
        package_dirs: folders in which `package://` names are looked for.
        srdf_path: the SRDF that was read, if any.
        warnings: what deserves a look in these files, but does no harm.
    """

    name: str
    urdf_path: Path
    urdf_text: str
    model: pin.Model
    limbs: Mapping[str, tuple[str, ...]]
    feet: Mapping[str, str]
    hands: Mapping[str, str]
    poses: Mapping[str, Mapping[str, float]]
    roles: Mapping[str, Mapping[str, Mapping[str, float]]]
    ignored_collisions: frozenset[frozenset[str]]
    package_dirs: tuple[Path, ...] = ()
    srdf_path: Path | None = None
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {self.urdf_path.name!r})"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The actuated joints, in Pinocchio's order."""
        return tuple(self.model.names[2:])

    @property
    def pose_names(self) -> tuple[str, ...]:
        """Names that `state` takes: the SRDF's poses and "neutral"; "stand" too where the SRDF has none."""
        return tuple(dict.fromkeys([*self.poses, *([] if self.poses else ["stand"]), "neutral"]))

    @property
    def total_mass(self) -> float:
        """Mass of all links [kg]."""
        return float(sum(inertia.mass for inertia in self.model.inertias))

    def joint_index(self, name: str) -> tuple[int, int]:
        """Where a joint's position is in q and its speed in v.

        Raises:
            SpecError: there is no such joint.
        """
        index = find_joint(self.model, name)
        return int(self.model.idx_qs[index]), int(self.model.idx_vs[index])

    def joint_limits(self, name: str) -> tuple[float, float]:
        """Lower and upper position limit of a joint [rad or m].

        Raises:
            SpecError: there is no such joint.
        """
        index = self.joint_index(name)[0]
        return float(self.model.lowerPositionLimit[index]), float(self.model.upperPositionLimit[index])

    def frame_id(self, name: str) -> int:
        """Index of a frame in `model.frames`; a link's frame goes before a joint's of the same name.

        Raises:
            SpecError: there is no such frame; the message lists the closest names.
        """
        return find_frame(self.model, name)

    def role_of(self, limb: str, q: ArrayLike) -> str | None:
        """The role whose held joints are where it holds them in `q`, or None.

        Args:
            limb: name of the limb.
            q: (nq,) configuration.

        Raises:
            SpecError: there is no such limb, or `q` has another size.
        """
        if limb not in self.limbs:
            raise SpecError(f"robot '{self.name}': no limb {limb!r}; limbs: {listing(list(self.limbs))}")
        values = np.asarray(q, dtype=np.float64)
        if values.shape != (self.model.nq,):
            raise SpecError(f"q of robot '{self.name}': shape {values.shape}, expected ({self.model.nq},)")
        for role, held in self.roles.get(limb, {}).items():
            off = [abs(values[self.joint_index(joint)[0]] - value) for joint, value in held.items()]
            if max(off, default=0.0) <= ROLE_TOLERANCE:
                return role
        return None

    def standing_feet(self, q: ArrayLike) -> tuple[str, ...]:
        """Frames of the feet that exist in `q`: those of limbs that have no roles or are legs in it."""
        legs = [limb for limb in self.feet if not self.roles.get(limb) or self.role_of(limb, q) == "leg"]
        return tuple(self.feet[limb] for limb in legs)

    def state(self, pose_or_q: str | ArrayLike = "stand") -> State:
        """A state of the robot.

        A named pose puts the robot level at x = y = 0 with the lowest of its feet on z = 0 (feet of limbs
        that are not legs in that pose do not count); joints that the pose does not name are at 0, or at the
        limit nearest to it.

        Args:
            pose_or_q: name of a pose, or a configuration (nq,), which is taken as it is.

        Raises:
            SpecError: there is no such pose, or `q` is not a configuration of this robot.
        """
        if not isinstance(pose_or_q, str):
            return State(self.model, pose_or_q)
        if pose_or_q not in self.pose_names:
            raise SpecError(f"robot '{self.name}': no pose {pose_or_q!r}; poses: {listing(self.pose_names)}")
        q = self._level(self.poses.get(pose_or_q, {}))
        state = State(self.model, q)
        feet = self.standing_feet(q) or tuple(self.feet.values())
        if not feet:
            return state
        q[2] = 0.0 - min(float(state.pose(foot).translation[2]) for foot in feet)
        return State(self.model, q)

    def _level(self, joints: Mapping[str, float]) -> NDArray[np.float64]:
        """Base at the world's origin, joints as named, the others at 0 or at the limit nearest to it."""
        q: NDArray[np.float64] = np.array(pin.neutral(self.model), dtype=np.float64)
        q[7:] = np.clip(0.0, self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:])
        for joint, value in joints.items():
            q[self.joint_index(joint)[0]] = value
        return q

    def mesh_path(self, filename: str) -> Path:
        """The file that a mesh name of the URDF means.

        Raises:
            SpecError: there is none.
        """
        places = mesh_places(filename, self.urdf_path.parent, self.package_dirs)
        for place in places:
            if is_file(place):
                return place
        looked = listing([str(place) for place in places])
        raise SpecError(f"robot '{self.name}': mesh '{filename}' does not exist; looked at {looked}")

    def summary(self) -> str:
        """Mass, joints, limbs with their tips and roles, poses, limits and warnings, as plain text."""
        size = f"{len(self.joint_names)} joints, nq {self.model.nq}, nv {self.model.nv}"
        lines = [
            f"{self.name}: {self.total_mass:.3f} kg, {size}",
            f"urdf: {self.urdf_path}",
            f"srdf: {self.srdf_path or 'none'}",
            "limbs:",
        ]
        for limb, joints in self.limbs.items():
            parts = [f"{len(joints)} joints"]
            parts += [f"foot {self.feet[limb]}"] if limb in self.feet else []
            parts += [f"hand {self.hands[limb]}"] if limb in self.hands else []
            parts += [f"roles {', '.join(self.roles[limb])}"] if self.roles.get(limb) else []
            lines.append(f"  {limb}: {'; '.join(parts)}")
        lines += [f"poses: {', '.join(self.pose_names)}", "joints: lower, upper, speed, effort (SI units)"]
        width = max(len(name) for name in self.joint_names)
        for name in self.joint_names:
            (lower, upper), v = self.joint_limits(name), self.joint_index(name)[1]
            speed, effort = self.model.velocityLimit[v], self.model.effortLimit[v]
            lines.append(f"  {name:<{width}} {lower:9.4f} {upper:9.4f} {speed:9.4f} {effort:9.4f}")
        lines += [f"warning: {warning}" for warning in self.warnings]
        return "\n".join(lines)
