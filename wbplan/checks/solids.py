"""The shapes of a bundle in MuJoCo: robot, bodies and obstacles, placed sample by sample.

MuJoCo reads the URDF and moves the links by itself: neither the parser, the kinematics nor the distances are
those that a plan is made with.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, final
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import Bundle
from wbplan.obstacles import Box, Cylinder, HeightField, Mesh, Obstacle, Sphere

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_READ = (
    '<mujoco><compiler strippath="false" fusestatic="false" discardvisual="true" balanceinertia="true" '
    'boundinertia="1e-9" boundmass="1e-9"/></mujoco>'
)
_OBSTACLE, _BODY = "obstacle: ", "body: "
DEEP = 1.0  #: how far [m] a height field is solid below its lowest point
FAR = 1e3  #: [m], where what has no place is put

Q = (6, 3, 4, 5)  #: w x y z out of x y z qx qy qz qw


class Unreadable(Exception):
    """The shapes cannot be rebuilt; the message says why."""


@final
class Solids:
    """All shapes of a bundle.

    Attributes:
        model, data: MuJoCo's.
        owner: (G,) name of the link, body or obstacle of each shape.
        kind: (G,) 'link', 'body' or 'obstacle'.
        group: (G,) number of the rigid piece that each shape is on.
    """

    def __init__(self, bundle: Bundle, folders: Sequence[Path] = ()) -> None:
        self._bundle = bundle
        try:
            spec = mujoco.MjSpec.from_string(_text(bundle.urdf, folders))
            root = spec.worldbody.first_body()
            root.add_freejoint(name="#root")
            for item in bundle.plan.get("bodies", ()):
                body = spec.worldbody.add_body(name=_BODY + item["name"], mocap=True)
                body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=np.array(item["size"]) / 2.0)
            for item in bundle.obstacles:
                _add(spec, item)
            self.model = spec.compile()
        except (ValueError, RuntimeError, OSError, AttributeError) as error:
            raise Unreadable(f"MuJoCo cannot build the shapes: {' '.join(str(error).split())}") from None
        model = self.model
        model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-9, 200
        self.data = mujoco.MjData(model)
        bodies = [model.body(int(b)).name for b in range(model.nbody)]
        self.owner, self.kind = [], []
        for g in range(model.ngeom):
            name, geom = bodies[model.geom_bodyid[g]], model.geom(g).name
            if geom.startswith(_OBSTACLE):
                self.owner.append(geom.removeprefix(_OBSTACLE))
                self.kind.append("obstacle")
            elif name.startswith(_BODY):
                self.owner.append(name.removeprefix(_BODY))
                self.kind.append("body")
            else:
                self.owner.append(name)
                self.kind.append("link")
        self.group: Ints = np.array(model.body_weldid)[model.geom_bodyid].astype(np.int64)
        names = bundle.trajectory.joint_names
        self._joints = np.array([model.jnt_qposadr[model.joint(name).id] for name in names], dtype=np.int64)
        self._values = (
            np.column_stack([_joint(bundle, name) for name in names]) if names else np.zeros((0, 0))
        )
        self._mocap = {
            name.removeprefix(_BODY): int(model.body_mocapid[b])
            for b, name in enumerate(bodies)
            if name.startswith(_BODY)
        }
        plane = np.array(model.geom_type) == int(mujoco.mjtGeom.mjGEOM_PLANE)
        self._radius = np.where(plane, np.inf, np.array(model.geom_rbound))

    def place(self, k: int) -> None:
        """Put robot and bodies where they are at sample k."""
        motion, data = self._bundle.trajectory, self.data
        base = motion.q[k, :7]
        data.qpos[:3], data.qpos[3:7] = base[:3], base[list(Q)] / np.linalg.norm(base[3:])
        data.qpos[self._joints] = self._values[k]
        for name, number in self._mocap.items():
            pose = motion.bodies[name][k] if name in motion.bodies else np.full(7, np.nan)
            known = bool(np.isfinite(pose).all())
            data.mocap_pos[number] = pose[:3] if known else FAR
            data.mocap_quat[number] = pose[list(Q)] if known else (1.0, 0.0, 0.0, 0.0)
        mujoco.mj_kinematics(self.model, data)

    def neighbours(self, a: int, b: int) -> bool:
        """Whether two rigid pieces are one, or follow each other in the chain."""
        parent, weld = self.model.body_parentid, self.model.body_weldid
        return a == b or a == weld[parent[b]] or b == weld[parent[a]]

    def piece(self, link: str) -> int:
        """The rigid piece that a link is on, -1 where there is no such link."""
        body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, link)
        return int(self.model.body_weldid[body]) if body > 0 else -1

    def shapes_at(self, link: str, near: float) -> frozenset[int]:
        """The shapes of a link; where it has none, those on its piece whose box reaches to its origin."""
        own = frozenset(g for g, name in enumerate(self.owner) if name == link and self.kind[g] == "link")
        if own or self.piece(link) < 0:
            return own
        mujoco.mj_kinematics(self.model, self.data)
        origin, found = self.data.body(link).xpos, set()
        for g in np.flatnonzero(self.group == self.piece(link)):
            box = self.model.geom_aabb[g]
            local = self.data.geom_xmat[g].reshape(3, 3).T @ (origin - self.data.geom_xpos[g]) - box[:3]
            if np.linalg.norm(np.maximum(np.abs(local) - box[3:], 0.0)) < near:
                found.add(int(g))
        return frozenset(found)

    def distances(self, first: Ints, second: Ints, most: Array) -> Array:
        """(P,) distances [m] of pairs of shapes as they are placed; `most` (P,) where they are further."""
        data, found = self.data, np.array(most)
        gap = np.linalg.norm(data.geom_xpos[first] - data.geom_xpos[second], axis=1)
        near = np.flatnonzero(gap - self._radius[first] - self._radius[second] < most)
        for p in near:
            found[p] = mujoco.mj_geomDistance(
                self.model, data, int(first[p]), int(second[p]), float(most[p]), None
            )
        return found

    def between(self, a: int, b: int) -> tuple[Array, Array]:
        """The nearest points (3,) of two shapes as they are placed, world."""
        ends = np.zeros(6)
        mujoco.mj_geomDistance(self.model, self.data, a, b, FAR, ends)
        return ends[:3].copy(), ends[3:].copy()


def _joint(bundle: Bundle, name: str) -> Array:
    """(N,) of one joint; a continuous one, stored as cosine and sine, as its angle."""
    joint = bundle.model.joints[bundle.model.getJointId(name)]
    q = bundle.trajectory.q
    if joint.nq == 1:
        return q[:, joint.idx_q]
    angle: Array = np.arctan2(q[:, joint.idx_q + 1], q[:, joint.idx_q])
    return angle


def _text(urdf: str, folders: Iterable[Path]) -> str:
    """The URDF for MuJoCo: its collision shapes, with whole paths to their meshes."""
    root = ElementTree.fromstring(re.sub(r"^\s*<\?xml[^>]*\?>", "", urdf))
    places = [Path(folder) for folder in folders]
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for mesh in link.iterfind("collision/geometry/mesh"):
            mesh.set("filename", str(_mesh(mesh.get("filename", ""), places)))
    text = ElementTree.tostring(root, encoding="unicode")
    return re.sub(r"(<robot[^>]*>)", lambda found: found[1] + _READ, text, count=1)


def _mesh(name: str, folders: Sequence[Path]) -> Path:
    plain = re.sub(r"^(package|file)://", "", name)
    for path in [Path(plain), *(f / part for f in folders for part in (plain, *plain.split("/", 1)[1:]))]:
        if path.is_file():
            return path.resolve()
    raise Unreadable(
        f"mesh '{name}' is not in {', '.join(map(str, folders)) or 'the bundle'}; say where it is"
    )


def _add(spec: Any, item: Obstacle) -> None:
    """An obstacle as a shape of the world."""
    kinds, shape = mujoco.mjtGeom, item.shape
    T = np.array(item.pose.homogeneous)
    place, turn = T[:3, 3], T[:3, :3]
    given: Mapping[str, Any]
    if isinstance(shape, Box):
        given = {"type": kinds.mjGEOM_BOX, "size": np.array(shape.size) / 2.0}
    elif isinstance(shape, Sphere):
        given = {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
    elif isinstance(shape, Cylinder):
        given = {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, shape.length / 2.0, 0.0]}
    elif isinstance(shape, Mesh):
        spec.add_mesh(
            name=item.name, uservert=np.array(shape.vertices).ravel(), userface=shape.hull_faces.ravel()
        )
        given = {"type": kinds.mjGEOM_MESH, "meshname": item.name}
    elif isinstance(shape, HeightField):
        low, span = float(shape.heights.min()), max(float(np.ptp(shape.heights)), 1e-6)
        half = np.array([np.ptp(shape.x), np.ptp(shape.y)]) / 2.0
        spec.add_hfield(
            name=item.name, nrow=len(shape.y), ncol=len(shape.x), size=[*half, span, DEEP],
            userdata=((shape.heights.T - low) / span).ravel(),
        )  # fmt: skip
        place = place + turn @ np.array([shape.x[0] + half[0], shape.y[0] + half[1], low])
        given = {"type": kinds.mjGEOM_HFIELD, "hfieldname": item.name}
    else:
        normal = np.array(shape.normal)
        across = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        turn = turn @ np.column_stack([across, np.cross(normal, across), normal])
        given = {"type": kinds.mjGEOM_PLANE, "size": [0.0, 0.0, 0.05]}
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(turn).ravel())
    spec.worldbody.add_geom(name=_OBSTACLE + item.name, pos=place, quat=quaternion, **given)
