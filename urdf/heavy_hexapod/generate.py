"""Writes `heavy_hexapod.urdf` and `heavy_hexapod.srdf` from one table of dimensions and masses.

    python urdf/heavy_hexapod/generate.py

Source: Zhuang, Gao, Deng, "Gait planning research for an electrically driven large-load-ratio six-legged
robot", Applied Sciences 7 (2017) 296.

Every leg lies straight along +x of its frame {0_i} at zero, and {0_i} is turned by Phi_i about z; axes z, -y,
-y: positive beta' and gamma lift the foot. Standing, the knee is up and gamma negative.
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

from heavy_links import at, body, coxa, shin, thigh  # noqa: E402
from heavy_table import LEGS, MATERIALS, NAME, NOTE, TO_X, Drive, T  # noqa: E402
from shapes import ORIGIN  # noqa: E402
from writer import Joint, Link, Semantics, rewrite, srdf, urdf  # noqa: E402

UP = (0.0, -1.0, 0.0)


def limits(span: tuple[float, float], drive: Drive) -> tuple[float, float, float, float]:
    """Joint limits from a span in degrees and the drive."""
    return (radians(span[0]), radians(span[1]), drive.effort, drive.speed)


def abductor_span(leg: str) -> tuple[float, float]:
    """From radial: the swing about every initial angle that the leg can be set to [degrees]."""
    ends = sorted((0.0, TO_X[leg] * T.initial))
    return (ends[0] - T.swing, ends[1] + T.swing)


def leg_links(leg: str) -> list[Link]:
    """Coxa, thigh, shin; the leg's structure is shared among them by length."""
    share = T.leg_structure / (T.coxa + T.thigh + T.shin)
    made = [coxa(leg, share * T.coxa), thigh(leg, share * T.thigh), shin(leg, share * T.shin)]
    return [*made, Link(f"{leg}_foot")]


def leg_joints(leg: str) -> list[Joint]:
    """Abductor, hip, knee, and the foot's frame."""
    azimuth = T.azimuths[LEGS.index(leg)]
    place, yaw = at(T.body_radius, azimuth, 0.0), (0.0, 0.0, radians(azimuth))
    turn, hip, knee = f"{leg}_abductor", f"{leg}_hip", f"{leg}_knee"
    a, b, c = f"{leg}_coxa", f"{leg}_thigh", f"{leg}_shin"
    upright = (0.0, 0.0, 1.0)
    span = limits(abductor_span(leg), T.abductor)
    lift, bend = limits(T.hip_range, T.hip), limits((-T.bend, 0.0), T.knee)
    return [
        Joint(turn, "revolute", "body", a, place, yaw, upright, span),
        Joint(hip, "revolute", a, b, (T.coxa, 0.0, 0.0), ORIGIN, UP, lift),
        Joint(knee, "revolute", b, c, (T.thigh, 0.0, 0.0), ORIGIN, UP, bend),
        Joint(f"{leg}_foot_fixed", "fixed", c, f"{leg}_foot", (T.shin, 0.0, 0.0)),
    ]


def posture(height: float, slope: float, initial: float) -> dict[str, float]:
    """All legs alike: body height [m], slope of the shins, initial angle of legs 1, 3, 4, 6 [degrees]."""
    hip, knee = T.bent(height, slope)
    values = {}
    for leg in LEGS:
        angles = (TO_X[leg] * (T.initial - initial), hip, knee)
        names = ("abductor", "hip", "knee")
        values |= {f"{leg}_{n}": radians(a) for n, a in zip(names, angles, strict=True)}
    return values


def poses() -> dict[str, dict[str, float]]:
    """The named whole-body poses; the README says why these angles."""
    return {
        "stand": posture(T.body_height, T.steep, 60.0),
        "crab": posture(T.body_height, T.steep, 0.0),
        "low": posture(T.low_height, T.steep, 60.0),
    }


LINKS = ("coxa", "thigh", "shin")
MIRROR = (("leg1", "leg6"), ("leg3", "leg4"))  # neighbours on either side of the y axis
BESIDE = (("leg1", "leg3"), ("leg4", "leg6"))  # on one side of it, with leg 2 or leg 5 between


def never() -> list[tuple[str, str]]:
    """Pairs that the joints' ranges keep apart, found by sampling; a test samples them again."""
    pairs = []
    for one, other in combinations(LEGS, 2):
        steps = (LEGS.index(other) - LEGS.index(one)) % 6
        near = (one, other) in (*MIRROR, *BESIDE)
        for a in LINKS:
            for b in LINKS:
                coxae = (a == "coxa") + (b == "coxa")
                shins = (a == "shin") + (b == "shin")
                apart = {3: True, 2: shins < 2, 4: shins < 2}.get(steps, coxae == 2)
                if (coxae > 0 if near else apart) or ((one, other) in MIRROR and a == b == "thigh"):
                    pairs.append((f"{one}_{a}", f"{other}_{b}"))
    return pairs


def unchecked(joints: list[Joint]) -> list[tuple[str, str, str]]:
    """Link pairs that need no collision check, with the reason."""
    frames = {f"{leg}_foot" for leg in LEGS}
    adjacent = [(j.parent, j.child, "Adjacent") for j in joints if j.child not in frames]
    return [*adjacent, *((one, other, "Never") for one, other in never())]


def generate() -> dict[str, str]:
    """The texts of both files, by file name."""
    links = [body(), Link("deck"), *(link for leg in LEGS for link in leg_links(leg))]
    joints = [joint for leg in LEGS for joint in leg_joints(leg)]
    deck = Joint("deck_fixed", "fixed", "body", "deck", (0.0, 0.0, T.deck_height))
    meaning = Semantics(
        root="body",
        limbs={leg: [f"{leg}_abductor", f"{leg}_hip", f"{leg}_knee"] for leg in LEGS},
        feet={leg: f"{leg}_foot" for leg in LEGS},
        hands={},
        poses=poses(),
        disabled=unchecked(joints),
    )
    return {
        f"{NAME}.urdf": urdf(NAME, NOTE, MATERIALS, links, [deck, *joints]),
        f"{NAME}.srdf": srdf(NAME, NOTE, meaning),
    }


if __name__ == "__main__":
    rewrite(HERE, generate())
