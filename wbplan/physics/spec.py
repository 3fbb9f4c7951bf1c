"""A URDF as an `MjSpec`: free root, meshes found, servos with the URDF's limits."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from wbplan.errors import PhysicsError, listing
from wbplan.physics.engine import add_damping, keep_movable, mujoco
from wbplan.physics.options import Servo
from wbplan.robot.reading import is_file
from wbplan.robot.urdf_links import mesh_places

FLOOR, ROBOT, OBJECT, STAND, NOTHING = 1, 2, 4, 8, 16
"""Collision bits; a stand is what an object stands on. (What has no bit at all is left out of the model.)"""

ROOT = "wbplan_root"

_STRICT = 'strippath="false" fusestatic="false" discardvisual="true"'
_MENDED = f'{_STRICT} balanceinertia="true" boundmass="1e-6" boundinertia="1e-9"'
_READ_BY_MUJOCO = (".stl", ".obj", ".msh")


def robot_spec(urdf_text: str, servo: Servo, *, folders: Sequence[Path] = ()) -> Any:
    """The robot alone, with a free root and a position servo for every joint.

    Args:
        urdf_text: the URDF.
        servo: the servos.
        folders: where the meshes' names count from.

    Raises:
        PhysicsError: MuJoCo refuses the URDF, or a mesh of a collision shape is missing.
    """
    mj = mujoco()
    try:
        ElementTree.fromstring(urdf_text.encode())
    except ElementTree.ParseError as error:  # Pinocchio's parser is less strict
        raise PhysicsError(f"robot.urdf: not well-formed XML: {error}") from None
    text, assets = _with_meshes(urdf_text, folders)
    spec = _read(text, assets, _STRICT)
    try:
        spec.compile()
        spec = _read(text, assets, _STRICT)  # compiling fills in what may still be changed below
    except ValueError:  # links without mass that move, inertias that no solid has
        spec = _read(text, assets, _MENDED)
    root = spec.worldbody.first_body()
    if root is None:
        raise PhysicsError("robot.urdf: has no link that could be simulated")
    if not any(joint.type == mj.mjtJoint.mjJNT_FREE for joint in spec.joints):
        root.add_freejoint(name=ROOT)
    keep_movable(root)
    efforts = _limits(urdf_text)
    for joint in spec.joints:
        if joint.type == mj.mjtJoint.mjJNT_FREE:
            continue
        effort, speed = efforts.get(joint.name, (0.0, 0.0))
        if effort <= 0.0:
            raise PhysicsError(
                f"robot.urdf: joint '{joint.name}': <limit effort> is {effort:g}; "
                "a servo without force cannot be simulated"
            )
        sliding = joint.type == mj.mjtJoint.mjJNT_SLIDE
        stiffness = effort / (servo.travel if sliding else servo.error)
        joint.armature = servo.inertia * effort
        add_damping(joint, effort / speed if speed > 0.0 else 0.0)
        actuator = spec.add_actuator(name=joint.name, trntype=mj.mjtTrn.mjTRN_JOINT, target=joint.name)
        actuator.set_to_position(kp=stiffness, kv=stiffness * servo.lag)
        actuator.forcelimited = True
        actuator.forcerange = [-effort, effort]
    for body in spec.bodies:
        for k, geom in enumerate(body.geoms):
            geom.name = f"{body.name}#{k}"
            geom.condim = 3
            geom.contype, geom.conaffinity = ROBOT, FLOOR | ROBOT | OBJECT
    return spec


def _read(text: str, assets: dict[str, bytes], compiler: str) -> Any:
    tag = f"<mujoco><compiler {compiler}/></mujoco>"
    with_tag = re.sub(r"<robot\b[^>]*>", lambda found: found[0] + tag, text, count=1)
    try:
        return mujoco().MjSpec.from_string(with_tag, assets=assets)
    except ValueError as error:
        raise PhysicsError(f"robot.urdf: MuJoCo cannot read it: {error}") from error


def _limits(urdf_text: str) -> dict[str, tuple[float, float]]:
    """Effort and speed limit of every joint that has them."""
    found = {}
    for joint in ElementTree.fromstring(urdf_text.encode()).iter("joint"):
        limit = joint.find("limit")
        if limit is not None:
            try:
                effort, speed = float(limit.get("effort", "0")), float(limit.get("velocity", "0"))
            except ValueError as error:
                raise PhysicsError(f"robot.urdf: joint '{joint.get('name')}': its <limit>: {error}") from None
            found[joint.get("name", "")] = effort, speed
    return found


def _with_meshes(urdf_text: str, folders: Sequence[Path]) -> tuple[str, dict[str, bytes]]:
    """The URDF with plain mesh names, and the meshes' bytes by these names; what is only seen is left out."""
    root = ElementTree.fromstring(urdf_text.encode())
    assets: dict[str, bytes] = {}
    names: dict[str, str] = {}
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for mesh in root.iter("mesh"):
        given = mesh.get("filename", "")
        if given not in names:
            path = _found(given, folders)
            names[given] = f"mesh{len(names)}{path.suffix.lower()}"
            if path.suffix.lower() in _READ_BY_MUJOCO:
                assets[names[given]] = path.read_bytes()
            else:
                names[given] = f"mesh{len(names)}.stl"
                assets[names[given]] = _as_stl(path)
        mesh.set("filename", names[given])
    return ElementTree.tostring(root, encoding="unicode"), assets


def _found(name: str, folders: Sequence[Path]) -> Path:
    places = [place for folder in folders for place in mesh_places(name, folder, folders)]
    for place in places:
        if is_file(place):
            return place
    looked = listing([str(place) for place in places])
    raise PhysicsError(f"robot.urdf: mesh '{name}' does not exist; looked at {looked}")


def _as_stl(path: Path) -> bytes:
    import trimesh

    mesh = trimesh.load(path, force="mesh")
    data: bytes = mesh.export(file_type="stl")
    return data
