"""Which shapes there are in a phase, and which pairs of them are kept apart.

Of every two shapes on different joints a pair is made, less:

- links that the SRDF says never collide, or always touch;
- neighbours: shapes on a joint and on the joint before it;
- a carried body and the links that hold it: those on the holder's joint, before and after it, likewise for
  what a closed loop ties to the holder;
- feet in contact, and obstacles.

Feet that are not in contact, and frames of `Obstacles.except_for`, may touch obstacles but not go in by more
than `TOUCH`; pairs of `SelfCollision.except_for` may touch. All other pairs keep the promised distance.
What does not move in the phase relative to each other is measured once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, final
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SpecError
from wbplan.obstacles import Box, Cylinder, HeightField, Mesh, Obstacle, Sphere
from wbplan.problem.limits import SelfCollision
from wbplan.robot import Robot
from wbplan.state import find_frame

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How far [m] what may touch an obstacle may go into it: soles are balls about a point that is held.
TOUCH = 0.005

#: A shape that reaches this near [m] to the frame of a foot whose link has no shape is the foot's.
NEAR = 0.01

#: A ball whose centre is this near [m] to a foot's frame is about it.
CENTRED = 1e-4

WORLD_JOINT = 0


@final
@dataclass(frozen=True)
class Thing:
    """One convex shape: the name of its link, body or obstacle, and the joint that moves it (0: none)."""

    name: str
    joint: int
    link: bool
    obstacle: bool = False


@final
@dataclass(frozen=True, eq=False)
class CollisionModel:
    """Shapes and pairs of a phase.

    Attributes:
        geometry: `pinocchio.GeometryModel` with the pairs of convex shapes.
        things: of every shape of `geometry`; then every height field, which has no shape there.
        first, second: (P,) things of every pair; those with a height field come last, its field second.
        bound: (P,) the distance [m] to keep; promised: (P,) whether that is the phase's promise.
        influence: (P,) [m].
        fields: the height fields, as obstacles.
        still: pairs whose distance no motion of the phase changes: first, second, bound, promised.
    """

    geometry: Any
    things: tuple[Thing, ...]
    first: Ints
    second: Ints
    bound: Array
    promised: NDArray[np.bool_]
    influence: Array
    fields: tuple[Obstacle, ...]
    still: tuple[tuple[int, int, float, bool], ...]

    def name(self, pair: int) -> str:
        """The names of a pair, as 'leg3_shank - body'."""
        return f"{self.things[self.first[pair]].name} - {self.things[self.second[pair]].name}"


@lru_cache(maxsize=4)
def _shapes_in_urdf(robot: Robot) -> Any:
    """A robot's collision shapes: read once, as a plan asks for them in every phase."""
    root = ElementTree.fromstring(robot.urdf_text)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for mesh in link.iterfind("collision/geometry/mesh"):
            mesh.set("filename", str(robot.mesh_path(mesh.get("filename", ""))))
    capsules = _as_cylinders(root)
    text = ElementTree.tostring(root, encoding="unicode")
    geometry = pin.buildGeomFromUrdfString(robot.model, text, pin.GeometryType.COLLISION)
    if not geometry.ngeoms:
        raise SpecError(f"robot '{robot.name}': no link has a collision shape; no clearance can be kept")
    for item in geometry.geometryObjects:
        if item.name in capsules:
            item.geometry = coal.Capsule(item.geometry.radius, 2.0 * item.geometry.halfLength)
        if isinstance(item.geometry, coal.BVHModelBase):
            if not item.geometry.buildConvexHull(True, "Qt"):
                raise SpecError(f"robot '{robot.name}': shape '{item.name}' has no volume")
            item.geometry = item.geometry.convex
    return geometry


def _as_cylinders(root: ElementTree.Element) -> set[str]:
    """Makes cylinders of capsules, which the reader of URDFs leaves out; the names of these shapes."""
    found = set()
    for link in root.findall("link"):
        for i, shape in enumerate(link.findall("collision")):
            for capsule in shape.iterfind("geometry/capsule"):
                capsule.tag = "cylinder"
                found.add(f"{link.get('name')}_{i}")
    return found


def robot_shapes(robot: Robot) -> Any:
    """The robot's collision shapes as a `pinocchio.GeometryModel` of the caller's own, meshes as their hulls.

    Frames keep their numbers in a model with carried bodies, which come after them.
    """
    return pin.GeometryModel(_shapes_in_urdf(robot))


def has_shapes(robot: Robot) -> bool:
    """Whether any link has a collision shape."""
    return ElementTree.fromstring(robot.urdf_text).find("link/collision/geometry") is not None


def sole(robot: Robot, foot: str) -> float:
    """How far below a foot's frame the ground is while the foot stands, however its link leans [m].

    That is the radius of a ball whose centre is the frame, and 0 of feet whose frame is on their surface.

    Args:
        robot: with collision shapes.
        foot: frame of the foot.

    Raises:
        SpecError: no link has a shape, or there is no such frame.
    """
    frame = robot.model.frames[find_frame(robot.model, foot)]
    radii = [
        float(item.geometry.radius)
        for item in _shapes_in_urdf(robot).geometryObjects
        if item.parentJoint == frame.parentJoint
        and isinstance(item.geometry, coal.Sphere)
        and np.linalg.norm(item.placement.translation - frame.placement.translation) < CENTRED
    ]
    return max(radii, default=0.0)


def collision_model(compiled: CompiledPhase) -> CollisionModel:
    """Shapes and pairs of a phase.

    Raises:
        SpecError: a name of `except_for` is neither a frame nor a body, a mesh has no volume, or the robot
            has no shapes.
    """
    return _build(_Kind(_what_counts(compiled), compiled))


@final
@dataclass(frozen=True)
class _Kind:
    """Phases that have the same collision model: shapes are placed and paired once for all of them."""

    counts: tuple[Any, ...]
    compiled: CompiledPhase = field(compare=False)


def _what_counts(compiled: CompiledPhase) -> tuple[Any, ...]:
    """All of a phase that its collision model depends on."""
    phase, frames = compiled.phase, compiled.model.frames
    return (
        compiled.robot,
        tuple(
            (h.body.name, h.body.size, h.holder, frames[h.frame].placement.homogeneous.tobytes())
            for h in compiled.held
        ),
        tuple((body.name, body.size, pose.homogeneous.tobytes()) for body, pose in compiled.standing),
        frozenset(d.joint for d in compiled.driven if d.path.constant),
        tuple(phase.closures),
        phase.self_collision,
        id(phase.obstacles),  # the same as long as a phase of this kind is kept
        frozenset(contact.frame for contact in phase.contacts),
    )


@lru_cache(maxsize=16)
def _build(kind: _Kind) -> CollisionModel:
    return _Builder(kind.compiled).build()


class _Builder:
    """Collects the shapes of a phase, then its pairs."""

    def __init__(self, compiled: CompiledPhase) -> None:
        self.compiled, self.model, self.robot = compiled, compiled.model, compiled.robot
        self.geometry = robot_shapes(self.robot)
        frames = self.model.frames
        self.things = [
            Thing(frames[g.parentFrame].name, g.parentJoint, True) for g in self.geometry.geometryObjects
        ]
        self.fields: list[Obstacle] = []
        self.pairs: list[tuple[int, int, float, bool, float]] = []
        self.still: list[tuple[int, int, float, bool]] = []
        resting = {6 + d.joint for d in compiled.driven if d.path.constant}
        self.moving = [self._columns(joint) - resting for joint in range(self.model.njoints)]

    def build(self) -> CollisionModel:
        phase = self.compiled.phase
        for held in self.compiled.held:
            joint, placement = (
                self.model.frames[held.frame].parentJoint,
                self.model.frames[held.frame].placement,
            )
            self._add(Thing(held.body.name, joint, False), coal.Box(*held.body.size), placement)
        moving = len(self.things)
        if phase.self_collision is not None:
            self._among_itself(moving, phase.self_collision)
        if phase.obstacles is not None:
            for body, pose in self.compiled.standing:
                self._add(Thing(body.name, WORLD_JOINT, False, True), coal.Box(*body.size), pose)
            solid = [item for item in phase.obstacles.shapes if not isinstance(item.shape, HeightField)]
            for item in solid:
                self._add(Thing(item.name, WORLD_JOINT, False, True), _shape(item), item.pose)
            self.fields = [item for item in phase.obstacles.shapes if isinstance(item.shape, HeightField)]
            self.things += [Thing(item.name, WORLD_JOINT, False, True) for item in self.fields]
            self._against_the_world(moving)
        shapes = len(self.geometry.geometryObjects)
        self.pairs.sort(key=lambda pair: (pair[1] >= shapes, pair[0], pair[1]))
        paired = np.zeros((shapes, shapes), dtype=np.bool_)
        for first, second, *_ in self.pairs:
            if second < shapes:
                paired[first, second] = True
        self.geometry.setCollisionPairs(paired)  # row by row, as they are sorted
        columns: list[Any] = list(zip(*self.pairs, strict=True)) or [[]] * 5
        return CollisionModel(
            self.geometry,
            tuple(self.things),
            np.array(columns[0], dtype=np.int64),
            np.array(columns[1], dtype=np.int64),
            np.array(columns[2], dtype=np.float64),
            np.array(columns[3], dtype=np.bool_),
            np.array(columns[4], dtype=np.float64),
            tuple(self.fields),
            tuple(self.still),
        )

    def _add(self, thing: Thing, shape: Any, placement: Any) -> None:
        name = f"{thing.name}#{len(self.things)}"
        self.geometry.addGeometryObject(pin.GeometryObject(name, thing.joint, 0, placement, shape))
        self.things.append(thing)

    def _columns(self, joint: int) -> set[int]:
        """Columns of the velocity that move a joint."""
        joints = [self.model.joints[k] for k in list(self.model.supports[joint])[1:]] if joint else []
        return {column for j in joints for column in range(j.idx_v, j.idx_v + j.nv)}

    def _among_itself(self, count: int, limit: SelfCollision) -> None:
        ignored, closer = self.robot.ignored_collisions, {frozenset(pair) for pair in limit.except_for}
        for name in {name for pair in limit.except_for for name in pair}:
            self._named(name, "SelfCollision")
        holding = {held.body.name: self._holders(held.holder) for held in self.compiled.held}
        for i in range(count):
            for j in range(i + 1, count):
                a, b = self.things[i], self.things[j]
                names = frozenset((a.name, b.name))
                if a.joint == b.joint or names in ignored:
                    continue
                if a.link and b.link and self._neighbours(a.joint, b.joint):
                    continue
                if b.joint in holding.get(a.name, ()) or a.joint in holding.get(b.name, ()):
                    continue
                bound = 0.0 if names in closer else limit.distance
                if self.moving[a.joint] == self.moving[b.joint]:
                    self.still.append((i, j, bound, names not in closer))
                else:
                    self.pairs.append((i, j, bound, names not in closer, limit.influence))

    def _neighbours(self, a: int, b: int) -> bool:
        return int(self.model.parents[a]) == b or int(self.model.parents[b]) == a

    def _holders(self, holder: str) -> set[int]:
        """Joints of the links that hold what a frame holds: its own, and what a loop ties to it."""
        frames, closures = {holder}, self.compiled.phase.closures
        while True:
            tied = {f for pair in closures if frames & set(pair) for f in pair} - frames
            if not tied:
                break
            frames |= tied
        joints = {int(self.model.frames[find_frame(self.model, f)].parentJoint) for f in frames}
        return {k for k in range(self.model.njoints) for j in joints if k == j or self._neighbours(j, k)}

    def _against_the_world(self, moving: int) -> None:
        limit, phase = self.compiled.phase.obstacles, self.compiled.phase
        assert limit is not None
        standing = self._shapes_of([c.frame for c in phase.contacts])
        feet = self._shapes_of(self.robot.feet.values())
        touching = dict.fromkeys(("",), feet)
        for item in limit.except_for:
            frame, obstacle = item if isinstance(item, tuple) else (item, "")
            found = self._named(frame, "Obstacles")
            if obstacle and obstacle not in {t.name for t in self.things[moving:]}:
                continue  # a body that is carried just now, say
            touching[obstacle] = touching.get(obstacle, frozenset()) | found
        for i in range(moving):
            if i in standing:
                continue
            for j in range(moving, len(self.things)):
                may = i in touching[""] or i in touching.get(self.things[j].name, ())
                bound = -TOUCH if may else limit.distance
                self.pairs.append((i, j, bound, not may, limit.influence))

    def _named(self, name: str, limit: str) -> frozenset[int]:
        """Shapes of a carried body or of a frame's link, which `except_for` names."""
        if any(held.body.name == name for held in self.compiled.held):
            return frozenset(i for i, thing in enumerate(self.things) if thing.name == name)
        if any(body.name == name for body, _ in self.compiled.standing):
            return frozenset()
        try:
            find_frame(self.model, name)
        except SpecError as error:
            raise SpecError(f"phase '{self.compiled.phase.name}': {limit}.except_for: {error}") from None
        return self._shapes_of([name])

    def _shapes_of(self, frames: Iterable[str]) -> frozenset[int]:
        """The shapes of the frames' links; where a link has none, those on its joint that reach there."""
        found: set[int] = set()
        for name in frames:
            frame = self.model.frames[find_frame(self.model, name)]
            own = [i for i, thing in enumerate(self.things) if thing.link and thing.name == name]
            if not own:
                own = [
                    i
                    for i, item in enumerate(self.geometry.geometryObjects)
                    if self.things[i].link
                    and item.parentJoint == frame.parentJoint
                    and _reaches(item, frame.placement)
                ]
            found.update(own)
        return frozenset(found)


def _reaches(item: Any, placement: Any) -> bool:
    """Whether a shape reaches to within `NEAR` of a frame on its joint."""
    result = coal.DistanceResult()
    at = item.placement
    coal.distance(
        item.geometry, coal.Transform3s(at.rotation, at.translation), coal.Sphere(1e-6),
        coal.Transform3s(np.eye(3), placement.translation), coal.DistanceRequest(), result,
    )  # fmt: skip
    return bool(result.min_distance < NEAR)


def _shape(item: Obstacle) -> Any:
    """An obstacle's shape for coal."""
    shape = item.shape
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.length)
    if isinstance(shape, Mesh):
        return convex(*shape.hull)
    if isinstance(shape, HeightField):
        raise TypeError("a height field is no convex shape")
    return coal.Halfspace(np.array(shape.normal), 0.0)


def convex(corners: Array, faces: Sequence[Sequence[int]] | Ints) -> Any:
    """A convex body for coal from its corners (V, 3) and triangles (F, 3)."""
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in corners:
        points.append(np.array(corner, dtype=np.float64))
    for face in faces:
        triangles.append(coal.Triangle(*(int(k) for k in face)))
    return coal.Convex(points, triangles)
