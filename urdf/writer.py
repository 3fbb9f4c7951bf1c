"""Links and joints as data, and the URDF and SRDF text made of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np
from shapes import ORIGIN, Part, Triple, inertia_of, number

Rgba = tuple[float, float, float, float]


@final
@dataclass(frozen=True)
class Link:
    """A link; without parts it is a massless frame.

    Attributes:
        name: unique among links and joints.
        parts: what it is made of.
        structure: mass shared by the parts that have none of their own [kg].
        collisions: collision shapes; parts with `solid=True` count as well.
    """

    name: str
    parts: tuple[Part, ...] = ()
    structure: float = 0.0
    collisions: tuple[Part, ...] = ()


@final
@dataclass(frozen=True)
class Joint:
    """A joint from `parent` to `child`.

    Attributes:
        limits: lower, upper [rad or m]; effort [N m or N]; speed [rad/s or m/s]; None for a fixed joint.
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Triple = ORIGIN
    rpy: Triple = ORIGIN
    axis: Triple = (0.0, 0.0, 1.0)
    limits: tuple[float, float, float, float] | None = None


def urdf(
    robot: str, note: str, materials: Mapping[str, Rgba], links: Iterable[Link], joints: Iterable[Joint]
) -> str:
    """The URDF's text: materials first, then links, then joints, in the order given."""
    lines = ['<?xml version="1.0" encoding="utf-8"?>', f"<!-- {note} -->", f'<robot name="{robot}">']
    for name, rgba in materials.items():
        lines.append(f'  <material name="{name}"><color rgba="{_numbers(rgba)}"/></material>')
    for link in links:
        lines += _link(link)
    for joint in joints:
        lines += _joint(joint)
    return "\n".join([*lines, "</robot>", ""])


def _origin(xyz: Triple, rpy: Triple) -> str:
    turn = f' rpy="{_numbers(rpy)}"' if any(abs(a) > 1e-12 for a in rpy) else ""
    return f'<origin xyz="{_numbers(xyz)}"{turn}/>'


def _numbers(values: Iterable[float]) -> str:
    return " ".join(number(v) for v in values)


def _link(link: Link) -> list[str]:
    if not link.parts:
        return [f'  <link name="{link.name}"/>']
    body = inertia_of(link.parts, link.structure)
    names, (rows, columns) = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), np.triu_indices(3)
    moments = zip(names, body.about_com[rows, columns], strict=True)
    inertia = " ".join(f'{name}="{number(round(float(value), 12), 7)}"' for name, value in moments)
    lines = [
        f'  <link name="{link.name}">',
        "    <inertial>",
        f'      <origin xyz="{_numbers(round(float(c), 9) for c in body.com)}"/>',
        f'      <mass value="{number(body.mass)}"/>',
        f"      <inertia {inertia}/>",
        "    </inertial>",
    ]
    for part in link.parts:
        if part.visible:
            lines += _shape("visual", part)
    for part in (*(p for p in link.parts if p.solid), *link.collisions):
        lines += _shape("collision", part)
    return [*lines, "  </link>"]


def _shape(element: str, part: Part) -> list[str]:
    material = f'<material name="{part.material}"/>' if element == "visual" else ""
    lines = []
    for kind, attributes, xyz, rpy in part.placed():
        geometry = f"<geometry><{kind} {attributes}/></geometry>"
        lines.append(f"    <{element}>{_origin(xyz, rpy)}{geometry}{material}</{element}>")
    return lines


def _joint(joint: Joint) -> list[str]:
    lines = [
        f'  <joint name="{joint.name}" type="{joint.kind}">',
        f'    <parent link="{joint.parent}"/><child link="{joint.child}"/>',
        f"    {_origin(joint.xyz, joint.rpy)}",
    ]
    if joint.limits is not None:
        lower, upper, effort, speed = joint.limits
        lines.append(f'    <axis xyz="{_numbers(joint.axis)}"/>')
        lines.append(
            f'    <limit lower="{number(lower)}" upper="{number(upper)}"'
            f' effort="{number(effort)}" velocity="{number(speed)}"/>'
        )
    return [*lines, "  </joint>"]


@final
@dataclass(frozen=True)
class Semantics:
    """What an SRDF says about a robot.

    Attributes:
        root: the link that floats.
        limbs: limb -> its joints in order.
        feet, hands: limb -> tip link.
        poses: whole-body poses, joint -> value [rad or m].
        roles: limb -> role -> the joints that the role holds, and where.
        disabled: (link, link, reason) that are not checked for collision.
    """

    root: str
    limbs: Mapping[str, Sequence[str]]
    feet: Mapping[str, str]
    hands: Mapping[str, str]
    poses: Mapping[str, Mapping[str, float]]
    roles: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    disabled: Sequence[tuple[str, str, str]] = ()


def srdf(robot: str, note: str, meaning: Semantics) -> str:
    """The SRDF's text: groups, tips, poses, roles, collision pairs."""
    lines = ['<?xml version="1.0" encoding="utf-8"?>', f"<!-- {note} -->", f'<robot name="{robot}">']
    floats = 'name="root_joint" type="floating" parent_frame="world"'
    lines.append(f'  <virtual_joint {floats} child_link="{meaning.root}"/>')
    for limb, joints in meaning.limbs.items():
        lines += _group(limb, (f'<joint name="{j}"/>' for j in joints))
    lines += _group("all", (f'<group name="{limb}"/>' for limb in meaning.limbs))
    tips = {group: frames for group, frames in (("feet", meaning.feet), ("hands", meaning.hands)) if frames}
    for group, frames in tips.items():
        lines += _group(group, (f'<link name="{frame}"/>' for frame in frames.values()))
    for group, frames in tips.items():
        for limb, frame in frames.items():
            place = f'parent_link="{frame}" group="{group}" parent_group="{limb}"'
            lines.append(f'  <end_effector name="{frame}" {place}/>')
    for pose, values in meaning.poses.items():
        lines += _state(pose, "all", values)
    for limb, roles in meaning.roles.items():
        for role, values in roles.items():
            lines += _state(role, limb, values)
    for one, other, reason in meaning.disabled:
        lines.append(f'  <disable_collisions link1="{one}" link2="{other}" reason="{reason}"/>')
    return "\n".join([*lines, "</robot>", ""])


def _group(name: str, members: Iterable[str]) -> list[str]:
    return [f'  <group name="{name}">', *(f"    {m}" for m in members), "  </group>"]


def _state(name: str, group: str, values: Mapping[str, float]) -> list[str]:
    joints = (f'    <joint name="{joint}" value="{number(value)}"/>' for joint, value in values.items())
    return [f'  <group_state name="{name}" group="{group}">', *joints, "  </group_state>"]


def rewrite(folder: Path, files: Mapping[str, str]) -> None:
    """Writes a robot's generated files (name -> text) into its folder, and says which."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
        print(f"wrote {folder / name}")
