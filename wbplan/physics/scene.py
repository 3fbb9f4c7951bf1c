"""The simulated world: robot, ground where the feet tread, objects and what they stand on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle import Bundle
from wbplan.errors import PhysicsError
from wbplan.obstacles import Terrain
from wbplan.physics.engine import compiled, keep_movable, mujoco
from wbplan.physics.motion import Motion, grip_of
from wbplan.physics.options import Options
from wbplan.physics.spec import FLOOR, NOTHING, OBJECT, ROBOT, STAND, robot_spec
from wbplan.physics.terrain import FLAT, TREAD, add_ground

Array = NDArray[np.float64]
Ids = NDArray[np.int64]

NEAR = 0.01  #: a shape whose surface is this near to a tip's frame [m] belongs to the tip
SMALL_FOOT = 0.003  #: radius [m] of the ball that a foot without a shape gets
RIM = 0.02  #: how far a stand reaches out [m] under what stands on it


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled world and where things are in it.

    Attributes:
        model: `mujoco.MjModel`.
        qpos: (J,) where the joints' positions are, in Pinocchio's order.
        dof: (J,) their speeds.
        act: (J,) their servos.
        root: body of the base.
        foot_geoms: for each of the motion's feet, its shapes.
        foot_bodies: for each foot, the body of its frame.
        pad_geoms: frame -> its shapes.
        push_geoms: frame that pushes on what is around -> its shapes.
        objects: name -> (body, where its pose is in qpos).
        kind: (G,) collision bits of every shape: 1 ground, 2 robot, 4 object, 8 stand.
        pins: for each foot, the number of its ball joint to the ground, or -1.
        welds: object -> number of its weld to its holder.
        floor: height of the floor [m].
    """

    model: Any
    qpos: Ids
    dof: Ids
    act: Ids
    root: int
    foot_geoms: tuple[Ids, ...]
    foot_bodies: Ids
    pad_geoms: Mapping[str, Ids]
    push_geoms: Mapping[str, Ids]
    objects: Mapping[str, tuple[int, int]]
    kind: Ids
    pins: Ids
    welds: Mapping[str, int]
    floor: float

    def start(self, motion: Motion) -> Any:
        """Fresh data: the plan's first pose, lifted until no shape is inside the ground."""
        mj = mujoco()
        data = mj.MjData(self.model)
        data.qpos[:7] = to_mujoco(motion.base[0])
        data.qpos[self.qpos] = motion.joints[0]
        for name, (_, at) in self.objects.items():
            data.qpos[at : at + 7] = to_mujoco(motion.objects[name][0])
        mj.mj_forward(self.model, data)
        depth = [float(c.dist) for c in data.contact if {int(self.kind[g]) for g in c.geom} == {FLOOR, ROBOT}]
        data.qpos[2] -= min([0.0, *depth])
        data.ctrl[self.act] = motion.joints[0]
        mj.mj_forward(self.model, data)
        return data


def to_mujoco(pose: Array) -> Array:
    """From x y z qx qy qz qw to x y z qw qx qy qz."""
    return pose[..., [0, 1, 2, 6, 3, 4, 5]]


def from_mujoco(pose: Array) -> Array:
    """From x y z qw qx qy qz to x y z qx qy qz qw."""
    return pose[..., [0, 1, 2, 4, 5, 6, 3]]


def scene_of(
    bundle: Bundle,
    motion: Motion,
    options: Options,
    *,
    ignored: frozenset[frozenset[str]] | None = None,
    folders: Sequence[Path] = (),
) -> Scene:
    """Builds the world for a plan.

    Args:
        bundle: the plan.
        motion: the same, read for the simulator.
        options: what is assumed.
        ignored: pairs of links that never collide, as an SRDF has them; None: those that touch at the start.
        folders: where meshes are looked for.

    Raises:
        PhysicsError: the robot cannot be simulated.
    """
    mj = mujoco()
    spec = robot_spec(bundle.urdf, options.servo, folders=folders)
    _set_solver(spec, options)
    pads = [pad for span in motion.spans for pad in span.pads]
    tips = list(dict.fromkeys([*motion.feet, *pads, *motion.pushing]))
    shapes = _tip_shapes(spec, bundle.model, tips)
    for foot in motion.feet:
        if not shapes[foot]:
            spec.body(foot).add_geom(
                name=f"{foot}#ball", type=mj.mjtGeom.mjGEOM_SPHERE, size=[SMALL_FOOT, 0, 0], condim=3,
                contype=ROBOT, conaffinity=FLOOR | ROBOT | OBJECT, mass=0.0,
            )  # fmt: skip
            shapes[foot] = [f"{foot}#ball"]
        for name in shapes[foot]:
            geom = spec.geom(name)
            geom.priority = 1
            if options.feet == "joint":
                geom.contype = geom.conaffinity = NOTHING
    for span in motion.spans:
        for pad in span.pads:
            for name in shapes[pad]:
                spec.geom(name).priority = 2
                grip = grip_of(span, motion.friction, options)
                spec.geom(name).friction = [grip, grip * options.patch, 0.0001]
                spec.geom(name).condim = 4
                if span.fingers:  # MuJoCo's usual contact gives way by half a millimetre to a light object
                    spec.geom(name).solref = [2.0 * options.dt, 1.0]
    floor = add_ground(spec, motion, bundle.obstacles)
    _add_objects(spec, bundle, motion, floor, options)
    pins = _add_pins(spec, motion, options)
    welds = _add_welds(spec, bundle, motion, options)
    for pair in ignored or ():
        _exclude(spec, *sorted(pair))
    if ignored is None:
        _exclude_touching(spec, motion)
    return _compiled(spec, motion, shapes, pins, welds, floor)


def _set_solver(spec: Any, options: Options) -> None:
    mj = mujoco()
    spec.option.timestep = options.dt
    spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mj.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0  # at 10 a box that is held creeps down by millimetres a second
    spec.option.gravity = [0.0, 0.0, -9.81]


def _tip_shapes(spec: Any, model: Any, tips: Iterable[str]) -> dict[str, list[str]]:
    """For each tip, the shapes fixed to it whose surface passes through its frame's origin."""
    mj = mujoco()
    world = compiled(spec)
    data = mj.MjData(world)
    mj.mj_kinematics(world, data)
    found: dict[str, list[str]] = {}
    for tip in tips:
        body = mj.mj_name2id(world, mj.mjtObj.mjOBJ_BODY, tip)
        if body < 0 or not model.existFrame(tip, pin.BODY):
            raise PhysicsError(f"plan.json: '{tip}' is no link of the URDF; only links touch things")
        origin, group = data.xpos[body], world.body_weldid[body]
        found[tip] = [
            world.geom(g).name
            for g in range(world.ngeom)
            if world.body_weldid[world.geom_bodyid[g]] == group
            and abs(_distance(world, data, g, origin)) < NEAR
        ]
    return found


def _distance(model: Any, data: Any, geom: int, point: Array) -> float:
    """Distance [m] of a point from a shape's surface, inside < 0; of meshes, from their bounding box."""
    kind, size = mujoco().mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    local = data.geom_xmat[geom].reshape(3, 3).T @ (point - data.geom_xpos[geom])
    name = kind.name
    if name == "mjGEOM_SPHERE":
        return float(np.linalg.norm(local) - size[0])
    if name == "mjGEOM_CAPSULE":
        local[2] -= np.clip(local[2], -size[1], size[1])
        return float(np.linalg.norm(local) - size[0])
    if name == "mjGEOM_CYLINDER":
        out = np.array([np.hypot(local[0], local[1]) - size[0], abs(local[2]) - size[1]])
    elif name == "mjGEOM_MESH":
        box = model.geom_aabb[geom]
        out = np.abs(local - box[:3]) - box[3:]
    else:
        out = np.abs(local) - size
    return float(np.linalg.norm(np.maximum(out, 0.0)) + min(out.max(), 0.0))


def _add_objects(spec: Any, bundle: Bundle, motion: Motion, floor: float, options: Options) -> None:
    """Objects as free boxes; where one stands in the air, something to stand on."""
    mj = mujoco()
    ground = [options.ground, 0.005, 0.0001]
    for item in bundle.plan.get("bodies", ()):
        name = item["name"]
        if name not in motion.objects or not item["mass"] > 0.0:
            continue
        inertia = pin.Inertia.FromBox(item["mass"], *item["size"]).inertia
        if spec.body(name) is not None:
            raise PhysicsError(f"plan.json: object '{name}' is called as a link or another object is")
        body = spec.worldbody.add_body(name=name, explicitinertial=True)
        body.mass, body.inertia = item["mass"], np.diag(inertia)
        body.ipos = _com_of(bundle, name)
        keep_movable(body)
        body.add_freejoint(name=name)
        body.add_geom(
            name=name, type=mj.mjtGeom.mjGEOM_BOX, size=np.array(item["size"]) / 2.0, friction=ground,
            contype=OBJECT, conaffinity=FLOOR | ROBOT | OBJECT | STAND, condim=3,
        )  # fmt: skip
        for number, pose in enumerate(_resting(motion, name)):
            R = pin.Quaternion(pose[3:]).toRotationMatrix()
            lowest = pose[2] - np.abs(R[2]) @ np.array(item["size"]) / 2.0
            if lowest - max(floor, Terrain(bundle.obstacles).height(pose[0], pose[1])) > FLAT:
                spec.worldbody.add_geom(
                    name=f"{name}_stand{number}", type=mj.mjtGeom.mjGEOM_BOX, friction=ground, condim=3,
                    size=[*(np.array(item["size"][:2]) / 2.0 + RIM), TREAD / 2.0],
                    pos=[pose[0], pose[1], lowest - TREAD / 2.0], contype=STAND, conaffinity=0,
                )  # fmt: skip


def _com_of(bundle: Bundle, name: str) -> Any:
    for phase in bundle.phases:
        for item in phase["carried"]:
            if item["name"] == name:
                return item.get("com", [0.0, 0.0, 0.0])
    return [0.0, 0.0, 0.0]


def _resting(motion: Motion, name: str) -> list[Array]:
    """The poses in which an object is before and after it is carried."""
    poses = motion.objects[name]
    rests = [poses[0]]
    for span in motion.spans:
        if span.name == name and span.end < motion.duration - 1e-6:
            rests.append(poses[motion.sample(span.end)])
    return rests


def _add_pins(spec: Any, motion: Motion, options: Options) -> list[str]:
    if options.feet != "joint":
        return []
    mj = mujoco()
    for foot in motion.feet:
        spec.add_equality(
            name=f"{foot}_pin", type=mj.mjtEq.mjEQ_CONNECT, objtype=mj.mjtObj.mjOBJ_BODY, name1=foot,
            name2="world", active=False,
            solref=[2.0 * options.dt, 1.0], solimp=[0.999, 0.9999, 0.001, 0.5, 2.0],
        )  # fmt: skip
    return [f"{foot}_pin" for foot in motion.feet]


def _add_welds(spec: Any, bundle: Bundle, motion: Motion, options: Options) -> list[str]:
    if not options.weld:
        return []
    mj = mujoco()
    names = []
    for span in motion.spans:
        if span.name not in names:
            names.append(span.name)
            spec.add_equality(
                name=f"{span.name}_weld", type=mj.mjtEq.mjEQ_WELD, objtype=mj.mjtObj.mjOBJ_BODY,
                name1=span.holder, name2=span.name, active=False,
            )  # fmt: skip
    return names


def _exclude(spec: Any, one: str, other: str) -> None:
    if spec.body(one) is not None and spec.body(other) is not None:
        spec.add_exclude(name=f"{one}--{other}", bodyname1=one, bodyname2=other)


def _exclude_touching(spec: Any, motion: Motion) -> None:
    """Without an SRDF: links that overlap in the first pose are taken to be made so."""
    mj = mujoco()
    model = compiled(spec)
    data = mj.MjData(model)
    data.qpos[:7] = to_mujoco(motion.base[0])
    for name, value in zip(motion.names, motion.joints[0], strict=True):
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
    mj.mj_forward(model, data)
    pairs = {
        frozenset(model.body(model.geom_bodyid[g]).name for g in contact.geom)
        for contact in data.contact
        if all(model.geom_contype[g] == ROBOT for g in contact.geom)
    }
    for pair in pairs:
        _exclude(spec, *sorted(pair))


def _compiled(
    spec: Any,
    motion: Motion,
    shapes: Mapping[str, list[str]],
    pins: list[str],
    welds: list[str],
    floor: float,
) -> Scene:
    mj = mujoco()
    model = compiled(spec)

    def ids(kind: str, names: Iterable[str]) -> Ids:
        return np.array([getattr(model, kind)(name).id for name in names], dtype=np.int64)

    joints = ids("joint", motion.names)
    kind = np.array(model.geom_contype, dtype=np.int64)
    tips = {tip: ids("geom", names) for tip, names in shapes.items()}
    for foot in motion.feet:
        kind[tips[foot]] = ROBOT
    return Scene(
        model=model,
        qpos=np.array(model.jnt_qposadr[joints], dtype=np.int64),
        dof=np.array(model.jnt_dofadr[joints], dtype=np.int64),
        act=ids("actuator", motion.names),
        root=int(model.jnt_bodyid[0]),
        foot_geoms=tuple(tips[foot] for foot in motion.feet),
        foot_bodies=ids("body", motion.feet),
        pad_geoms={pad: tips[pad] for span in motion.spans for pad in span.pads},
        push_geoms={frame: tips[frame] for frame in motion.pushing},
        objects={
            name: (model.body(name).id, int(model.jnt_qposadr[model.joint(name).id]))
            for name in motion.objects
            if mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, name) >= 0
        },
        kind=kind,
        pins=ids("equality", pins),
        welds=dict(zip(welds, (int(e) for e in ids("equality", [f"{w}_weld" for w in welds])), strict=True)),
        floor=floor,
    )  # fmt: skip
