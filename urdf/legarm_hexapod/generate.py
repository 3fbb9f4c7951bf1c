"""Writes `legarm_hexapod.urdf` and `legarm_hexapod.srdf` from one table of dimensions and masses.

    python urdf/legarm_hexapod/generate.py

Source: Zheng et al., "Different manipulation mode analysis of a radial symmetrical hexapod robot with leg-arm
integration", Frontiers of Mechanical Engineering, 2022 (Tables 1 to 3).

Every limb lies straight along +x of its frame {O_i} at zero; axes z, +y, +y, +y, z: a positive pitch
bends down.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from itertools import pairwise
from math import cos, pi, radians, sin
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent):  # this robot's modules, and the helpers that all robots share
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from legarm_links import PAD, RUBBER, arm1, arm2, body, hip, jaw, shank, shank1, slide, thigh  # noqa: E402
from legarm_table import ARMS, LEGS, LIMBS, MATERIALS, NAME, NOTE, T  # noqa: E402
from servos import DRS_0101, DRS_0401  # noqa: E402
from shapes import ORIGIN  # noqa: E402
from writer import Joint, Link, Semantics, rewrite, srdf, urdf  # noqa: E402


def structure_masses(total: float, servos: float, lengths: Mapping[str, float]) -> dict[str, float]:
    """What remains of a limb's mass without its servos, shared among its links by their lengths."""
    whole = sum(lengths.values())
    return {link: (total - servos) * length / whole for link, length in lengths.items()}


def leg(limb: str) -> tuple[list[Link], list[Joint]]:
    """Legs 3 to 6: three joints."""
    share = structure_masses(
        T.normal_limb, 3 * DRS_0401.mass, {"hip": T.hip, "thigh": T.thigh, "shank": T.shank}
    )
    links = [
        hip(limb, share["hip"]),
        thigh(limb, share["thigh"]),
        shank(limb, share["shank"]),
        Link(f"{limb}_foot"),
    ]
    joints = [*root_joints(limb, f"{limb}_shank"), fixed(f"{limb}_foot", f"{limb}_shank", T.shank)]
    return links, joints


def arm(limb: str) -> tuple[list[Link], list[Joint]]:
    """Limbs 1 and 2: five joints, shank 2 and the two fingers."""
    lengths = {"hip": T.hip, "thigh": T.thigh, "shank1": T.shank1, "slide": T.shank2}
    lengths |= {"arm1": T.arm1, "arm2": T.arm2, "jaws": T.finger}
    share = structure_masses(T.integrated_limb, 3 * DRS_0401.mass + 3 * DRS_0101.mass, lengths)
    links = [
        hip(limb, share["hip"]),
        thigh(limb, share["thigh"]),
        shank1(limb, share["shank1"]),
        slide(limb, share["slide"]),
        arm1(limb, share["arm1"]),
        arm2(limb, share["arm2"]),
        jaw(limb, "a", share["jaws"] / 2),
        jaw(limb, "b", share["jaws"] / 2),
        Link(f"{limb}_foot"),
        Link(f"{limb}_tip"),
    ]
    fifth = T.theta5 if limb == "limb2" else (-T.theta5[1], -T.theta5[0])
    down, up = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    small = DRS_0101
    joints = [
        *root_joints(limb, f"{limb}_shank1"),
        Joint(
            f"{limb}_joint4",
            "revolute",
            f"{limb}_shank1",
            f"{limb}_arm1",
            (T.shank1, 0.0, 0.0),
            ORIGIN,
            down,
            small.limits(T.theta4),
        ),
        Joint(
            f"{limb}_joint5",
            "revolute",
            f"{limb}_arm1",
            f"{limb}_arm2",
            (T.arm1, 0.0, 0.0),
            ORIGIN,
            up,
            small.limits(fifth),
        ),
        Joint(
            f"{limb}_shank2",
            "prismatic",
            f"{limb}_shank1",
            f"{limb}_slide",
            (T.shank1, 0.0, 0.0),
            ORIGIN,
            (1.0, 0.0, 0.0),
            (0.0, T.shank2, T.slide_effort, T.slide_speed),
        ),
    ]
    apart = 0.009 if limb == "limb1" else 0.0  # fingers hinge side by side, blades on one pin
    for letter, side in (("a", 1.0), ("b", -1.0)):
        joints.append(
            Joint(
                f"{limb}_finger_{letter}",
                "revolute",
                f"{limb}_arm2",
                f"{limb}_jaw_{letter}",
                (T.arm2 - T.hinge, side * apart, 0.0),
                ORIGIN,
                (0.0, 0.0, side),
                small.limits((0.0, 90.0)),
            )
        )
    joints += [fixed(f"{limb}_foot", f"{limb}_slide", 0.0), fixed(f"{limb}_tip", f"{limb}_arm2", T.arm2)]
    if limb == "limb1":  # the middle of each finger's rubber face: what it holds things with
        links += [Link(f"{limb}_pad_{letter}") for letter in "ab"]
        joints += [
            fixed(f"{limb}_pad_{letter}", f"{limb}_jaw_{letter}", PAD, -side * RUBBER)
            for letter, side in (("a", 1.0), ("b", -1.0))
        ]
    return links, joints


def root_joints(limb: str, third: str) -> list[Joint]:
    """Joints 1 to 3; {O_i} is parallel to {COB} in limbs 1, 2, and in legs 3 to 6 has its y axis outward."""
    azimuth = T.azimuths[LIMBS.index(limb)]
    at = (T.body_radius * cos(radians(azimuth)), T.body_radius * sin(radians(azimuth)), 0.0)
    yaw = 0.0 if limb in ARMS else radians(azimuth - 90.0)
    down = (0.0, 1.0, 0.0)
    big = DRS_0401
    return [
        Joint(
            f"{limb}_joint1",
            "revolute",
            "body",
            f"{limb}_hip",
            at,
            (0.0, 0.0, yaw),
            (0.0, 0.0, 1.0),
            big.limits(T.theta1),
        ),
        Joint(
            f"{limb}_joint2",
            "revolute",
            f"{limb}_hip",
            f"{limb}_thigh",
            (T.hip, 0.0, 0.0),
            ORIGIN,
            down,
            big.limits(T.theta2),
        ),
        Joint(
            f"{limb}_joint3",
            "revolute",
            f"{limb}_thigh",
            third,
            (T.thigh, 0.0, 0.0),
            ORIGIN,
            down,
            big.limits(T.theta3),
        ),
    ]


def fixed(frame: str, parent: str, x: float, y: float = 0.0) -> Joint:
    """The joint that holds a tip's frame."""
    return Joint(f"{frame}_fixed", "fixed", parent, frame, (x, y, 0.0))


ROLES: Mapping[str, Mapping[str, float]] = {
    "leg": {"joint4": pi, "joint5": 0.0, "shank2": T.shank2, "finger_a": 0.0, "finger_b": 0.0},
    "arm": {"shank2": 0.0, "finger_a": pi / 2, "finger_b": pi / 2},
}


def role(limb: str, name: str) -> dict[str, float]:
    """The joints that a role holds, by their full names."""
    return {f"{limb}_{joint}": value for joint, value in ROLES[name].items()}


def walking(limb: str, turn: float, second: float, third: float) -> dict[str, float]:
    """A limb as a leg, `turn` degrees from radial."""
    first = 90.0 if limb in LEGS else T.azimuths[LIMBS.index(limb)]
    values = {f"{limb}_joint{k}": radians(v) for k, v in enumerate((first + turn, second, third), start=1)}
    return values | (role(limb, "leg") if limb in ARMS else {})


def reaching(limb: str, azimuth: float, second: float, third: float) -> dict[str, float]:
    """A limb as an arm: level (theta4 = -theta2 - theta3), its tool along +x (limb 1) or -x (limb 2)."""
    first, fifth = (180.0 - azimuth, azimuth - 180.0) if limb == "limb1" else (azimuth, 180.0 - azimuth)
    pose = (first, second, third, -second - third, fifth)
    return {f"{limb}_joint{k}": radians(v) for k, v in enumerate(pose, start=1)} | role(limb, "arm")


def poses() -> dict[str, dict[str, float]]:
    """The named whole-body poses; the README says why these angles."""
    stand = {limb: walking(limb, 0.0, 5.0, 55.0) for limb in LIMBS}
    folded = {limb: walking(limb, 0.0, 55.0, 55.0) for limb in LIMBS}
    forward = {"leg3": 40.0, "leg6": -40.0}
    work = {limb: reaching(limb, 67.5, 20.0, -25.0) for limb in ARMS}
    work |= {limb: walking(limb, forward.get(limb, 0.0), 5.0, 55.0) for limb in LEGS}
    whole = {"stand": stand, "manipulate": work, "folded": folded}
    return {name: {j: v for limb in LIMBS for j, v in pose[limb].items()} for name, pose in whole.items()}


LEG_LINKS = ("hip", "thigh", "shank")
ARM_LINKS = ("hip", "thigh", "shank1", "slide", "arm1", "arm2", "jaw_a", "jaw_b")
JAWS = ("jaw_a", "jaw_b")
OPPOSITE = (("leg4", "limb1"), ("leg5", "limb2"))
TWO_APART = (("leg3", "leg5"), ("leg4", "leg6"))
BEHIND = (("leg4", "limb2"), ("leg5", "limb1"))
BESIDE = (("leg3", "limb1"), ("leg6", "limb2"))
NEXT = (("leg3", "limb2"), ("leg6", "limb1"))

# (limb, its links, other limb, its links): pairs that the joints' ranges keep apart. Found by sampling the
# whole range, ends included (at least 35 mm in 35 000 configurations); a test samples them again.
NEVER: tuple[tuple[str, tuple[str, ...], str, tuple[str, ...]], ...] = (
    *((limb, ("hip",), limb, ("shank",)) for limb in LEGS),
    *((limb, ("hip",), limb, ARM_LINKS[2:]) for limb in ARMS),
    *((limb, ("arm1",), limb, ("thigh", *JAWS)) for limb in ARMS),
    ("leg3", LEG_LINKS, "leg6", LEG_LINKS),
    *((leg, ("hip", "thigh"), limb, ARM_LINKS) for leg, limb in OPPOSITE),
    *((leg, ("shank",), limb, ARM_LINKS[:5]) for leg, limb in OPPOSITE),
    *((leg, ("hip", "thigh"), other, LEG_LINKS) for leg, other in TWO_APART),
    *((leg, ("shank",), other, ("hip", "thigh")) for leg, other in TWO_APART),
    *((leg, ("hip", "thigh"), limb, ARM_LINKS) for leg, limb in BEHIND),
    *((leg, ("hip",), limb, ARM_LINKS[:5]) for leg, limb in BESIDE),
    *((leg, ("thigh", "shank"), limb, ("hip", "thigh")) for leg, limb in BESIDE),
    *((leg, ("hip",), other, ("hip",)) for leg, other in pairwise(LEGS)),
    *((leg, ("hip",), limb, ARM_LINKS) for leg, limb in NEXT),
)


def unchecked(joints: list[Joint]) -> list[tuple[str, str, str]]:
    """Link pairs that need no collision check, with the reason."""
    frames = {f"{limb}_{tip}" for limb in LIMBS for tip in ("foot", "tip", "pad_a", "pad_b")}
    pairs = [(j.parent, j.child, "Adjacent") for j in joints if j.child not in frames]
    pairs += [(f"{limb}_jaw_a", f"{limb}_jaw_b", "Default") for limb in ARMS]  # they close on each other
    for one, mine, other, theirs in NEVER:
        pairs += [(f"{one}_{a}", f"{other}_{b}", "Never") for a in mine for b in theirs]
    pairs += [("body", f"{limb}_shank", "Never") for limb in LEGS]
    pairs += [("body", f"{limb}_arm1", "Never") for limb in ARMS]
    return pairs


def generate() -> dict[str, str]:
    """The texts of both files, by file name."""
    built = [(arm if limb in ARMS else leg)(limb) for limb in LIMBS]
    links = [body(), *(link for made, _ in built for link in made)]
    joints = [joint for _, made in built for joint in made]
    limbs = {
        limb: [j.name for j in made if j.kind != "fixed"]
        for limb, (_, made) in zip(LIMBS, built, strict=True)
    }
    meaning = Semantics(
        root="body",
        limbs=limbs,
        feet={limb: f"{limb}_foot" for limb in LIMBS},
        hands={limb: f"{limb}_tip" for limb in ARMS},
        poses=poses(),
        roles={limb: {name: role(limb, name) for name in ROLES} for limb in ARMS},
        disabled=unchecked(joints),
    )
    return {
        f"{NAME}.urdf": urdf(NAME, NOTE, MATERIALS, links, joints),
        f"{NAME}.srdf": srdf(NAME, NOTE, meaning),
    }


if __name__ == "__main__":
    rewrite(HERE, generate())
