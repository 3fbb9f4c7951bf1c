"""Robots to soak: all that ship, and generated ones of any number of legs."""

from __future__ import annotations

import math
import random
import tempfile
from functools import cache
from pathlib import Path

import wbplan as wb
from wbplan import catalog

#: So many robots are generated: PlaCo keeps the memory of every one that it was ever told of.
MADE = 24


@cache
def shipped(name: str) -> wb.Robot:
    return wb.load_robot(name)


def any_robot(rng: random.Random) -> wb.Robot:
    """A shipped robot, or one in four times a generated one."""
    if rng.random() < 0.25:
        return generated(rng.randrange(MADE))
    return shipped(rng.choice(list(catalog.robots())))


@cache
def generated(number: int) -> wb.Robot:
    """A body on three to six alike legs, often with an arm; sometimes with a joint that slides."""
    rng = random.Random(number)
    with tempfile.TemporaryDirectory(prefix="soak.") as folder:
        path = Path(folder) / "made.urdf"
        urdf, srdf = _texts(rng)
        path.write_text(urdf, encoding="utf-8")
        path.with_suffix(".srdf").write_text(srdf, encoding="utf-8")
        return wb.load_robot(path)


def _texts(rng: random.Random) -> tuple[str, str]:
    legs, radius = rng.randint(3, 6), rng.uniform(0.1, 0.3)
    thigh, shank = rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.3)
    speed, slides = rng.uniform(1.0, 10.0), rng.random() < 0.2
    bend = rng.uniform(0.2, 1.0)
    parts, groups, values = [_link("body", rng.uniform(2.0, 20.0))], [], []
    for k in range(1, legs + 1):
        angle = 2.0 * math.pi * (k - 0.5 + rng.uniform(-0.2, 0.2)) / legs
        place = f"{radius * math.cos(angle):.6f} {radius * math.sin(angle):.6f} 0"
        knee = ("prismatic", "0 0 -1", 0.0, 0.2) if slides else ("revolute", "0 1 0", -2.6, 2.6)
        names = [f"leg{k}_{part}" for part in ("hip", "thigh", "shank", "foot")]
        parts += [
            _link(name, rng.uniform(0.1, 0.5), -0.5 * (thigh if "thigh" in name else 0.0))
            for name in names[:3]
        ]
        parts += [
            f'<link name="{names[3]}"/>',
            _joint(f"leg{k}_yaw", "body", names[0], place, "0 0 1", -1.2, 1.2, speed, yaw=angle),
            _joint(f"leg{k}_pitch", names[0], names[1], "0 0 0", "0 1 0", -1.6, 1.6, speed),
            _joint(
                f"leg{k}_knee",
                names[1],
                names[2],
                f"0 0 {-thigh:.6f}",
                knee[1],
                knee[2],
                knee[3],
                speed,
                knee[0],
            ),
            f'<joint name="leg{k}_sole" type="fixed"><parent link="{names[2]}"/><child link="{names[3]}"/>'
            f'<origin xyz="0 0 {-shank:.6f}"/></joint>',
        ]
        groups.append(
            _group(f"leg{k}", [f"leg{k}_{joint}" for joint in ("yaw", "pitch", "knee")], names[3], "feet")
        )
        values += [(f"leg{k}_pitch", -bend), (f"leg{k}_knee", 0.1 if slides else 2.0 * bend)]
    feet = "".join(f'<link name="leg{k}_foot"/>' for k in range(1, legs + 1))
    everything = "".join(f'<group name="leg{k}"/>' for k in range(1, legs + 1))
    if rng.random() < 0.7:
        arm, group = _arm(rng, speed)
        parts.append(arm)
        groups.append(group)
        everything += '<group name="arm1"/>'
    states = "".join(f'<joint name="{joint}" value="{value:.6f}"/>' for joint, value in values)
    srdf = (
        f'<robot name="made"><group name="feet">{feet}</group><group name="hands"/>{"".join(groups)}'
        f'<group name="all">{everything}</group>'
        f'<group_state name="stand" group="all">{states}</group_state></robot>'
    )
    return f'<robot name="made">{"".join(parts)}</robot>', srdf


def _arm(rng: random.Random, speed: float) -> tuple[str, str]:
    joints, parts = rng.randint(2, 7), []
    for k in range(1, joints + 1):
        parent = "body" if k == 1 else f"arm{k - 1}"
        axis = rng.choice(("1 0 0", "0 1 0", "0 0 1"))
        parts += [
            _link(f"arm{k}", rng.uniform(0.1, 0.5)),
            _joint(
                f"arm_joint{k}",
                parent,
                f"arm{k}",
                f"0 0 {rng.uniform(0.05, 0.2):.6f}",
                axis,
                -2.0,
                2.0,
                speed,
            ),
        ]
    return "".join(parts), _group(
        "arm1", [f"arm_joint{k}" for k in range(1, joints + 1)], f"arm{joints}", "hands"
    )


def _link(name: str, mass: float, z: float = 0.0) -> str:
    i = f"{mass * 0.01:.6f}"
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {z:.6f}"/><mass value="{mass:.6f}"/>'
        f'<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<collision><origin xyz="0 0 {z:.6f}"/><geometry><sphere radius="0.02"/></geometry></collision>'
        "</link>"
    )


def _joint(
    name: str, parent: str, child: str, xyz: str, axis: str, lower: float, upper: float, speed: float,
    kind: str = "revolute", *, yaw: float = 0.0,
) -> str:  # fmt: skip
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="0 0 {yaw:.6f}"/><axis xyz="{axis}"/>'
        f'<limit lower="{lower}" upper="{upper}" effort="20" velocity="{speed:.6f}"/></joint>'
    )


def _group(limb: str, joints: list[str], tip: str, tips: str) -> str:
    listed = "".join(f'<joint name="{joint}"/>' for joint in joints)
    return (
        f'<group name="{limb}">{listed}</group>'
        f'<end_effector name="{limb}_tip" parent_link="{tip}" group="{tips}" parent_group="{limb}"/>'
    )
