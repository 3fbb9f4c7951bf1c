"""Writes `hiphant.urdf` and `hiphant.srdf` from one table of dimensions and masses.

    python urdf/hiphant/generate.py

HIphanT: the quadruped HIboT with the six-joint arm HIT-Armc. At zero the legs hang straight down and the
arm lies straight ahead. Legs turn about x, y, y; the arm about z, y, y, x, y, x: a positive pitch takes
a leg back and the arm down.
"""

from __future__ import annotations

import sys
from itertools import combinations
from math import radians
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent):  # this robot's modules, and the helpers that all robots share
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from hiphant_arm import base, fore, hand, roll, shoulder, upper, wrist  # noqa: E402
from hiphant_legs import body, hip, shank, thigh  # noqa: E402
from hiphant_table import FRONT, LEFT, LEGS, MATERIALS, NAME, NOTE, Drive, Span, T  # noqa: E402
from shapes import ORIGIN, Triple  # noqa: E402
from writer import Joint, Link, Semantics, rewrite, srdf, urdf  # noqa: E402

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ARM = tuple(f"arm_joint{k}" for k in range(1, 7))


def limits(span: Span, drive: Drive) -> tuple[float, float, float, float]:
    """Joint limits from a span in degrees and the drive."""
    return (radians(span[0]), radians(span[1]), drive.effort, drive.speed)


def leg_joints(leg: str) -> list[Joint]:
    """Abduction, hip pitch, knee, and the foot's frame."""
    hip_at = (FRONT[leg] * T.hip_x, LEFT[leg] * T.hip_y, 0.0)
    links = ("body", f"{leg}_hip", f"{leg}_thigh", f"{leg}_shank")
    places = (hip_at, (0.0, LEFT[leg] * T.offset, 0.0), (0.0, 0.0, -T.thigh))
    made = [
        Joint(f"{leg}_joint{k + 1}", "revolute", links[k], links[k + 1], places[k], ORIGIN, axis, reach)
        for k, (axis, reach) in enumerate(
            zip((X, Y, Y), (limits(s, T.leg_drive) for s in (T.abduction, T.pitch, T.knee)), strict=True)
        )
    ]
    return [*made, Joint(f"{leg}_foot_fixed", "fixed", links[3], f"{leg}_foot", (0.0, 0.0, -T.shank))]


def arm_joints() -> list[Joint]:
    """The arm's foot on the deck, its six joints, and the tip's frame."""
    places: tuple[Triple, ...] = (
        (0.0, 0.0, T.shoulder),
        ORIGIN,
        (T.upper, 0.0, 0.0),
        (T.fore, 0.0, 0.0),
        ORIGIN,
        ORIGIN,
    )
    axes, drives = (Z, Y, Y, X, Y, X), (T.big,) * 3 + (T.small,) * 3
    made = [Joint("arm_base_fixed", "fixed", "body", "arm_base", T.mount)]
    parent = "arm_base"
    for k, (name, place, axis, drive) in enumerate(zip(ARM, places, axes, drives, strict=True)):
        child = f"arm_link{k + 1}"
        span = limits(T.arm_spans[k], drive)
        made.append(Joint(name, "revolute", parent, child, place, ORIGIN, axis, span))
        parent = child
    return [*made, Joint("arm_tip_fixed", "fixed", parent, "arm_tip", (T.hand, 0.0, 0.0))]


def arm_links() -> list[Link]:
    """Base, six links, tip."""
    made = [
        make(m)
        for make, m in zip((base, shoulder, upper, fore, roll, wrist, hand), T.arm_masses, strict=True)
    ]
    return [*made, Link("arm_tip")]


def legs_at(thigh_angle: float, knee: float) -> dict[str, float]:
    """All legs alike, knees behind; degrees."""
    angles = (0.0, thigh_angle, knee)
    return {f"{leg}_joint{k}": radians(a) for leg in LEGS for k, a in enumerate(angles, start=1)}


def arm_at(*angles: float) -> dict[str, float]:
    """The arm's joints in degrees."""
    return {joint: radians(angle) for joint, angle in zip(ARM, angles, strict=True)}


def poses() -> dict[str, dict[str, float]]:
    """The named whole-body poses; the README says why these angles."""
    stand = legs_at(T.crouch, -2 * T.crouch)
    return {
        "stand": stand | arm_at(0.0, -165.0, 145.0, 0.0, 20.0, 0.0),
        "ready": stand | arm_at(0.0, -105.0, 115.0, 0.0, 50.0, 0.0),
        "crouch": legs_at(58.0, -116.0) | arm_at(0.0, -165.0, 145.0, 0.0, 20.0, 0.0),
    }


ACROSS = (("rf", "lf"), ("rr", "lr"))  # neighbours whose knees can meet below the torso
REAR = ("rr", "lr")


def never() -> list[tuple[str, str]]:
    """Pairs that the joints' ranges keep apart, found by sampling; a test samples them again."""
    pairs = [(f"{leg}_hip", f"{leg}_shank") for leg in LEGS]  # the shank turns in a plane of its own
    for one, other in combinations(LEGS, 2):
        pairs += [(f"{one}_hip", f"{other}_{link}") for link in ("hip", "thigh", "shank")]
        pairs += [(f"{one}_{link}", f"{other}_hip") for link in ("thigh", "shank")]
        if (one, other) not in ACROSS:
            pairs.append((f"{one}_thigh", f"{other}_thigh"))
    pairs += [(f"{leg}_hip", link) for leg in LEGS for link in ("arm_base", "arm_link1")]
    pairs += [(f"{leg}_thigh", link) for leg in REAR for link in ("arm_base", "arm_link1")]
    pairs += [(f"{leg}_hip", link) for leg in REAR for link in ("arm_link2", "arm_link3")]
    pairs += [("body", "arm_link1"), ("arm_link1", "arm_link3")]
    return [*pairs, ("arm_link3", "arm_link5"), ("arm_link3", "arm_link6")]


def unchecked(joints: list[Joint]) -> list[tuple[str, str, str]]:
    """Link pairs that need no collision check, with the reason."""
    frames = {"arm_tip", *(f"{leg}_foot" for leg in LEGS)}
    adjacent = [(j.parent, j.child, "Adjacent") for j in joints if j.child not in frames]
    return [*adjacent, *((one, other, "Never") for one, other in never())]


def generate() -> dict[str, str]:
    """The texts of both files, by file name."""
    links = [body()]
    for leg in LEGS:
        links += [hip(leg), thigh(leg), shank(leg), Link(f"{leg}_foot")]
    links += arm_links()
    joints = [*(joint for leg in LEGS for joint in leg_joints(leg)), *arm_joints()]
    limbs = {leg: [f"{leg}_joint{k}" for k in (1, 2, 3)] for leg in LEGS} | {"arm": list(ARM)}
    meaning = Semantics(
        root="body",
        limbs=limbs,
        feet={leg: f"{leg}_foot" for leg in LEGS},
        hands={"arm": "arm_tip"},
        poses=poses(),
        disabled=unchecked(joints),
    )
    return {
        f"{NAME}.urdf": urdf(NAME, NOTE, MATERIALS, links, joints),
        f"{NAME}.srdf": srdf(NAME, NOTE, meaning),
    }


if __name__ == "__main__":
    rewrite(HERE, generate())
