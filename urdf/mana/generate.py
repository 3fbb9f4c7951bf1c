"""Writes `mana.urdf` and `mana.srdf` from one table of dimensions and masses.

    python urdf/mana/generate.py

Source: Yu, Lu, Zhang, Pei, "Motion capability analysis of a quadruped robot as a parallel manipulator",
Frontiers of Mechanical Engineering, 2014 (Tables 1 and 4, section 5.1).

Every leg hangs straight down at zero; axes +x, +y, +y in the leg's frame, which is the body's in legs 1
and 4 (left) and turned by 180 degrees about z in legs 2 and 3 (right).
"""

from __future__ import annotations

import sys
from itertools import combinations
from math import pi
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent):  # this robot's modules, and the helpers that all robots share
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from mana_links import body, hip, shank, thigh  # noqa: E402
from mana_table import LEGS, MATERIALS, NAME, NOTE, SIDES, T  # noqa: E402
from servos import AX_12A  # noqa: E402
from writer import Joint, Link, Semantics, rewrite, srdf, urdf  # noqa: E402

JOINTS = ("hip1", "hip2", "knee")


def leg(name: str) -> tuple[list[Link], list[Joint]]:
    """A leg's links and joints."""
    front, left = SIDES[name]
    links = [hip(name, -front * left), thigh(name), shank(name), Link(f"{name}_foot")]
    base, (hip_, thigh_, shank_, foot_) = "body", (link.name for link in links)
    root = (front * T.length / 2, left * T.hip_y, 0.0)
    turned = (0.0, 0.0, 0.0 if left > 0 else pi)
    roll, pitch = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    ranges = [AX_12A.limits(span) for span in (T.hip1, T.hip2, T.knee)]
    joints = [
        Joint(f"{name}_hip1", "revolute", base, hip_, root, turned, roll, ranges[0]),
        Joint(f"{name}_hip2", "revolute", hip_, thigh_, (0.0, T.d, -T.l1), axis=pitch, limits=ranges[1]),
        Joint(f"{name}_knee", "revolute", thigh_, shank_, (0.0, 0.0, -T.l2), axis=pitch, limits=ranges[2]),
        Joint(f"{name}_foot_fixed", "fixed", shank_, foot_, (0.0, 0.0, -T.l3)),
    ]
    return links, joints


def poses() -> dict[str, dict[str, float]]:
    """The named whole-body poses: Table 4, and the legs' zero."""
    stand, straight = {}, {}
    for number, name in enumerate(LEGS):
        sign = 1.0 if number % 2 == 0 else -1.0
        for joint, value in zip(JOINTS, T.stand, strict=True):
            stand[f"{name}_{joint}"] = sign * value
            straight[f"{name}_{joint}"] = 0.0
    return {"stand": stand, "straight": straight}


def unchecked(joints: list[Joint]) -> list[tuple[str, str, str]]:
    """Link pairs that need no collision check, with the reason."""
    pairs = [(j.parent, j.child, "Adjacent") for j in joints if j.kind == "revolute"]
    # Kept apart by the joints' ranges: at least 27 mm in 12 000 configurations, ends included; a test
    # samples them again.
    pairs += [(f"{one}_hip", f"{other}_hip", "Never") for one, other in combinations(LEGS, 2)]
    for one, other in combinations(LEGS, 2):
        if SIDES[one][0] != SIDES[other][0]:  # one in front, one behind
            upper = (("hip", "thigh"), ("thigh", "hip"), ("thigh", "thigh"))
            pairs += [(f"{one}_{a}", f"{other}_{b}", "Never") for a, b in upper]
    return pairs


def generate() -> dict[str, str]:
    """The texts of both files, by file name."""
    built = {name: leg(name) for name in LEGS}
    links = [body(), *(link for made, _ in built.values() for link in made)]
    joints = [joint for _, made in built.values() for joint in made]
    meaning = Semantics(
        root="body",
        limbs={name: [f"{name}_{joint}" for joint in JOINTS] for name in LEGS},
        feet={name: f"{name}_foot" for name in LEGS},
        hands={},
        poses=poses(),
        disabled=unchecked(joints),
    )
    return {
        f"{NAME}.urdf": urdf(NAME, NOTE, MATERIALS, links, joints),
        f"{NAME}.srdf": srdf(NAME, NOTE, meaning),
    }


if __name__ == "__main__":
    rewrite(HERE, generate())
