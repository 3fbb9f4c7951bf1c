"""Writes `hexpiderix.urdf` and `hexpiderix.srdf` from one table of dimensions and masses.

    python urdf/hexpiderix/generate.py

Source: Sandoval-Castro, Garcia-Murillo, Perez-Resendiz, Castillo-Castaneda, "Kinematics of Hex-Piderix - a
six-legged robot - using screw theory", International Journal of Advanced Robotic Systems, 2013 (Table 1
and section 5).

Every leg lies straight outward at zero; the frames of coxa, femur and tibia are those of the paper's
Denavit-Hartenberg table, so that its matrices (7) to (9) are the URDF's.
"""

from __future__ import annotations

import sys
from itertools import combinations
from math import pi, radians
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent):  # this robot's modules, and the helpers that all robots share
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from hexpiderix_links import coxa_link, femur, thorax, tibia  # noqa: E402
from hexpiderix_table import LEGS, MATERIALS, NAME, NOTE, T, coxa, example_angles  # noqa: E402
from servos import AX_12A  # noqa: E402
from shapes import Triple  # noqa: E402
from writer import Joint, Link, Semantics, rewrite, srdf, urdf  # noqa: E402

UPPER = ("coxa", "femur")
CORNERS = ("leg2", "leg3", "leg5", "leg6")


def leg(name: str) -> tuple[list[Link], list[Joint]]:
    """A leg's links and joints."""
    links = [coxa_link(name), femur(name), tibia(name), Link(f"{name}_foot")]
    coxa_, femur_, tibia_, foot_ = (link.name for link in links)
    place, azimuth = coxa(name)
    turn, twist = (0.0, 0.0, azimuth), (pi / 2, 0.0, 0.0)
    ranges = [AX_12A.limits(span) for span in (T.joint1, T.joint2, T.joint3)]
    joints = [
        Joint(f"{name}_joint1", "revolute", "thorax", coxa_, place, turn, limits=ranges[0]),
        Joint(f"{name}_joint2", "revolute", coxa_, femur_, (T.d1, 0.0, 0.0), twist, limits=ranges[1]),
        Joint(f"{name}_joint3", "revolute", femur_, tibia_, (T.d2, 0.0, 0.0), limits=ranges[2]),
        Joint(f"{name}_foot_fixed", "fixed", tibia_, foot_, (T.d3, 0.0, T.h)),
    ]
    return links, joints


def poses() -> dict[str, dict[str, float]]:
    """The named whole-body poses; the README says why these angles."""
    upright = {"stand": 10.0, "low": 40.0}  # femur up by so much, tibia upright: cups flat on the ground
    angles: dict[str, dict[str, Triple]] = {
        name: dict.fromkeys(LEGS, (0.0, radians(up), radians(-90.0 - up))) for name, up in upright.items()
    }
    angles["example"] = example_angles()
    return {
        name: {f"{leg}_joint{k}": value for leg in LEGS for k, value in enumerate(pose[leg], start=1)}
        for name, pose in angles.items()
    }


def unchecked(joints: list[Joint]) -> list[tuple[str, str, str]]:
    """Link pairs that need no collision check, with the reason."""
    pairs = [(j.parent, j.child, "Adjacent") for j in joints if j.kind == "revolute"]
    # Kept apart by the joints' ranges: sampled with their ends, at least 22 mm from the thorax and 48 mm
    # between legs; a test samples them again.
    pairs += [("thorax", f"{name}_femur", "Never") for name in CORNERS]
    for (i, one), (k, other) in combinations(enumerate(LEGS), 2):
        if k - i not in (1, 5):  # not neighbours
            pairs += [(f"{one}_{a}", f"{other}_{b}", "Never") for a in UPPER for b in UPPER]
    for one, other in (("leg2", "leg5"), ("leg3", "leg6")):  # at opposite corners
        for a in UPPER:
            pairs += [(f"{one}_{a}", f"{other}_tibia", "Never"), (f"{one}_tibia", f"{other}_{a}", "Never")]
        pairs.append((f"{one}_tibia", f"{other}_tibia", "Never"))
    return pairs


def generate() -> dict[str, str]:
    """The texts of both files, by file name."""
    built = {name: leg(name) for name in LEGS}
    links = [thorax(), *(link for made, _ in built.values() for link in made), Link("centroid")]
    joints = [joint for _, made in built.values() for joint in made]
    meaning = Semantics(
        root="thorax",
        limbs={name: [f"{name}_joint{k}" for k in (1, 2, 3)] for name in LEGS},
        feet={name: f"{name}_foot" for name in LEGS},
        hands={},
        poses=poses(),
        disabled=unchecked(joints),
    )
    joints.append(Joint("centroid_fixed", "fixed", "thorax", "centroid", T.centroid))
    return {
        f"{NAME}.urdf": urdf(NAME, NOTE, MATERIALS, links, joints),
        f"{NAME}.srdf": srdf(NAME, NOTE, meaning),
    }


if __name__ == "__main__":
    rewrite(HERE, generate())
