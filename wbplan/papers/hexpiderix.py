"""Hex-Piderix: thorax pose, leg kinematics, and velocity and acceleration by reciprocal screws."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache, partial

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.mechanism import (
    Chain,
    Platform,
    StanceLeg,
    ThreeJointLeg,
    body_acceleration,
    body_twist,
    cup_leg,
    rank,
    swap,
    wrench_matrix,
)
from wbplan.papers import constraint
from wbplan.papers.rows import Row
from wbplan.robot import Robot, load_robot

Array = NDArray[np.float64]

row = partial(Row, "Hex-Piderix")
#: Section 5 [mm], world with y up.
P = np.array([[163.838, 218.372, 192.622], [116.497, 218.769, 70.298], [30.387, 218.769, 196.766]])
S = np.array([[124.61, 30.166, -39.261], [-68.822, 30.166, 243.952], [253.766, 30.166, 253.893]])
Q = np.array([116.803, 216.711, 160.772])
D = (57.61, 64.54, 11.41)
A, B = 153.0, 131.203
#: The example corrected: P1 so that the triangle is isosceles, feet in the order that the legs reach, d3.
P1, FEET, D3 = np.array([161.549919, 218.769, 193.523252]), S[[2, 0, 1]], 141.1
STANCE = ("leg1", "leg3", "leg5")
#: Moments are divided by this length [m] where singular values are compared with those of directions.
LENGTH = 0.2


@lru_cache(maxsize=1)
def robot() -> Robot:
    """The shipped robot."""
    return load_robot("hexpiderix")


def thorax(corners: Array, centre: Array) -> tuple[Array, float]:
    """Equations 1 to 4: axes as columns, and X . Y, which has to be zero."""
    x = (corners[0] - centre) / np.linalg.norm(corners[0] - centre)
    y = (corners[1] - corners[2]) / np.linalg.norm(corners[1] - corners[2])
    return np.column_stack([x, y, np.cross(x, y)]), float(x @ y)


def corrected() -> tuple[Platform, pin.SE3]:
    """The corrected example as a platform in the paper's world (y up) [m], and the thorax's pose."""
    corners = np.vstack([P1, P[1:]])
    turn, _ = thorax(corners, corners.mean(axis=0))
    chains = Platform.of_robot(robot(), robot().state("example"), STANCE).chains
    legs = [ThreeJointLeg.of(c).placement.translation for c in chains.values()]
    body = pin.SE3(turn, corners[0] / 1e3 - turn @ legs[0])
    return Platform(chains, dict(zip(STANCE, FEET / 1e3, strict=True))), body


def example() -> list[Row]:
    """Section 5: which of its numbers agree with each other."""
    sides = [float(np.linalg.norm(P[i] - P[j])) for i, j in ((1, 2), (0, 1), (0, 2))]
    labelled = [float(np.linalg.norm(p - s)) for p, s in zip(P, S, strict=True)]
    paired = [float(np.linalg.norm(p - s)) for p, s in zip(P, FEET, strict=True)]
    best = min(
        itertools.permutations(range(3)), key=lambda o: float(np.ptp(np.linalg.norm(P - S[list(o)], axis=1)))
    )
    lowest = max(
        math.hypot(math.hypot(*(p - s)[[0, 2]]) - D[0], (p - s)[1]) - D[1]
        for p, s in zip(np.vstack([P1, P[1:]]), FEET, strict=True)
    )
    _, dot = thorax(P, Q)
    _, fixed = thorax(np.vstack([P1, P[1:]]), np.vstack([P1, P[1:]]).mean(axis=0))
    return [
        row("section 5", "a = |P2 P3|", A, sides[0], 5e-4, "mm"),
        row("section 5", "b = |P1 P2|", B, sides[1], 5e-3, "mm", "not isosceles: P1 is off", True),
        row("section 5", "b = |P1 P3|", B, sides[2], 5e-3, "mm", "not isosceles: P1 is off", True),
        row(
            "section 5",
            "Q from the centroid",
            0.0,
            float(np.linalg.norm(Q - P.mean(axis=0))),
            0.01,
            "mm",
            "not the centroid, as section 3.1 says",
            True,
        ),
        row("eqs 1, 2", "X . Y as given", 0.0, dot, 1e-6, "", "P1 and Q are off", True),
        row("eqs 1, 2", "X . Y corrected", 0.0, fixed, 1e-6),
        row(
            "section 5",
            "longest leg d1 + d2 + d3 against least |P S|",
            sum(D),
            min(labelled),
            1.0,
            "mm",
            "no leg reaches its foot",
            True,
        ),
        row(
            "section 5",
            "feet of P1, P2, P3 (lengths alike)",
            "S1, S2, S3",
            ", ".join(f"S{k + 1}" for k in best),
            why="feet are mislabelled",
            misprint=True,
        ),
        row("section 5", "spread of |P S| then", None, float(np.ptp(paired)), unit="mm"),
        row(
            "section 5",
            "tibia d3 (least that reaches)",
            D[2],
            lowest,
            1.0,
            "mm",
            "141.1 works: a digit lost",
            True,
        ),
    ]


def inverse() -> list[Row]:
    """Equations 11 to 14: leg kinematics, with the branch pairing, and the corrected example."""
    leg = ThreeJointLeg(0.05761, 0.06454, 0.1411, -0.012)
    random = np.random.default_rng(5)
    right = wrong = paired = crossed = 0
    count = 300
    for _ in range(count):
        q = np.array(
            [
                random.uniform(-0.9, 0.9),
                random.uniform(-1.2, 0.9),
                random.uniform(-2.3, -0.1) * random.choice([-1, 1]),
            ]
        )
        x, y, z = leg.foot(q)
        h, d1, d2, d3 = -leg.offset, leg.l1, leg.l2, leg.l3
        rho = math.sqrt(x * x + y * y - h * h)
        if d1 + d2 * math.cos(q[1]) + d3 * math.cos(q[1] + q[2]) < 0.0:
            rho = -rho
        first = math.atan2(y, x) + math.atan2(h, rho)
        right += abs(math.remainder(first - q[0], 2 * math.pi)) < 1e-9
        wrong += abs(math.remainder(math.atan(x / y) - q[0], 2 * math.pi)) < 1e-9
        a, b = 2 * d2 * (rho - d1), 2 * d2 * z
        c = (rho - d1) ** 2 + z * z + d2 * d2 - d3 * d3
        root = math.sqrt(max(a * a + b * b - c * c, 0.0))
        second = [math.atan2(c, sign * root) - math.atan2(a, b) for sign in (1.0, -1.0)]
        hit = [abs(math.remainder(s - q[1], 2 * math.pi)) < 1e-8 for s in second]
        paired += hit[0] if q[2] > 0 else hit[1]
        crossed += hit[1] if q[2] > 0 else hit[0]
    platform, body = corrected()
    rows = [
        row(
            "eq 12",
            "coxa angles solved by arctan(x / y)",
            float(count),
            float(wrong),
            why="atan2(y, x) + atan2(h, rho)",
            misprint=True,
        ),
        row("eq 12", "by atan2(y, x) + atan2(h, rho)", float(count), float(right)),
        row("eqs 13, 14", "femur solved, + with q3 > 0", float(count), float(paired)),
        row(
            "eqs 13, 14",
            "femur solved, + with q3 < 0",
            float(count),
            float(crossed),
            why="signs belong together",
            misprint=True,
        ),
    ]
    for name, solutions in platform.inverse(body).items():
        q = np.degrees(next(s for s in (*solutions.within, *solutions.beyond) if s.joints[2] < 0.0).joints)
        rows += [
            row("corrected", f"{name} {part}", None, float(v), unit="deg")
            for part, v in zip(("coxa", "femur", "tibia"), q, strict=True)
        ]
    angles = platform.nearest_joints(body, dict.fromkeys(platform.joints, 0.0))
    found = platform.pose_of(angles)
    chain = platform.chains["leg1"]
    q1 = [angles[j] for j in chain.joints]
    fk = ThreeJointLeg.of(chain)
    coxa = fk.placement.actInv(chain.pose(q1).translation)
    printed = body.translation + body.rotation @ coxa
    rows += [
        row(
            "eq 11",
            "thorax from angles and feet, error",
            0.0,
            float(np.linalg.norm(found.translation - body.translation)) * 1e3,
            1e-5,
            "mm",
        ),
        row(
            "eq 11",
            "printed components against the thorax",
            0.0,
            float(np.linalg.norm(printed - body.translation)) * 1e3,
            1.0,
            "mm",
            "they are a foot whose coxa is at the centroid",
            True,
        ),
    ]
    return rows


def legs(
    slide: str = "tibia", torsion: bool = True, q: Array | None = None
) -> tuple[list[StanceLeg], list[str], Array]:
    """The three stance legs on cups that give along the tibia or along the wall's normal; joints; q."""
    own = robot()
    at = np.array(own.state("example").q) if q is None else q
    state = own.state(at)
    platform = Platform.of_robot(own, state, STANCE)
    body = pin.XYZQUATToSE3(at[:7])
    out: list[StanceLeg] = []
    names: list[str] = []
    for name, chain in platform.chains.items():
        angles = np.array([at[own.joint_index(j)[0]] for j in chain.joints])
        out.append(cup_leg(chain, angles, body, direction(name, slide, at), torsion))
        names += chain.joints
    return out, names, at


def direction(leg: str, slide: str, q: Array) -> Array:
    """Direction in which a foot's cup gives, world."""
    if slide == "normal":
        return np.array([0.0, 0.0, 1.0])
    state = robot().state(q)
    knee, foot = (state.pose(f"{leg}_{n}").translation for n in ("tibia", "foot"))
    return np.asarray((foot - knee) / np.linalg.norm(foot - knee))


def moved(seed: int) -> tuple[Array, Array, Array]:
    """A random configuration near the example, and random joint rates and accelerations (9,)."""
    random = np.random.default_rng(seed)
    q = np.array(robot().state("example").q)
    q[7:] += random.uniform(-0.15, 0.15, len(q) - 7)
    turned = pin.SE3(pin.exp3(random.uniform(-0.4, 0.4, 3)), random.uniform(-0.1, 0.1, 3))
    q[:7] = pin.SE3ToXYZQUAT(turned * pin.XYZQUATToSE3(q[:7]))
    return q, random.uniform(-1, 1, 9), random.uniform(-1, 1, 9)


def drifted(
    q: Array, twist: Array, speed: Array, rise: Array, seconds: float
) -> tuple[list[StanceLeg], list[Array]]:
    """The legs a moment later: body moved by its twist, joints by their rates; feet where the cups hold them.

    Args:
        q: (nq,) configuration.
        twist: (6,) of the body.
        speed: (9,) rates of the stance legs' joints.
        rise: (9,) their accelerations.
        seconds: how much later.
    """
    own, (_, names, _) = robot(), legs(q=q)
    later = np.array(q)
    body = pin.XYZQUATToSE3(q[:7])
    later[:7] = pin.SE3ToXYZQUAT(pin.exp6(pin.Motion(swap(twist) * seconds)) * body)
    for k, name in enumerate(names):
        later[own.joint_index(name)[0]] += speed[k] * seconds + 0.5 * rise[k] * seconds**2
    state, moved_body = own.state(later), pin.XYZQUATToSE3(later[:7])
    chains = Platform.of_robot(own, state, STANCE).chains
    held = Platform.of_robot(own, own.state(q), STANCE).feet
    out = []
    for name, chain in chains.items():
        angles = np.array([later[own.joint_index(j)[0]] for j in chain.joints])
        # The cup holds the wall where it did: its point there, not the tibia's tip, is on the screws' axes.
        fixed = moved_body.actInv(held[name])
        cup = Chain(chain.joints, chain.screws, _tip_at(chain, angles, fixed), chain.lower, chain.upper)
        out.append(cup_leg(cup, angles, moved_body, direction(name, "tibia", later)))
    return out, list((speed + rise * seconds).reshape(3, 3))


def _tip_at(chain: Chain, angles: Array, point: Array) -> pin.SE3:
    """The home pose of a chain whose tip would be at a point (3,) of the body at these joint angles."""
    moved = chain.pose(angles) * chain.home.inverse()
    return pin.SE3(np.eye(3), moved.actInv(point))


def rates(count: int = 5) -> list[Row]:
    """Equations 20 to 27 against Pinocchio's constraint Jacobian; ranks of the printed limb."""
    velocity = acceleration = without = 0.0
    for seed in range(count):
        q, speed, rise = moved(seed)
        stance, names, _ = legs(q=q)
        split, bent = speed.reshape(3, 3), rise.reshape(3, 3)
        slides = {f"{leg}_foot": direction(leg, "tibia", q) for leg in STANCE}
        right = constraint.solve(
            robot(),
            q,
            list(slides),
            dict(zip(names, speed, strict=True)),
            dict(zip(names, rise, strict=True)),
            slides,
        )
        twist = body_twist(stance, list(split))
        velocity = max(velocity, _relative(twist, right.twist))
        acceleration = max(
            acceleration, _relative(body_acceleration(stance, list(split), list(bent)), right.acceleration)
        )
        ignored = [
            leg.active.T @ b + leg.lie_terms(np.zeros(len(leg.passive)), s)
            for leg, s, b in zip(stance, split, bent, strict=True)
        ]
        matrix = swap(wrench_matrix(stance).T)
        side = np.concatenate([swap(leg.wrenches) @ v for leg, v in zip(stance, ignored, strict=True)])
        without = max(without, _relative(np.linalg.solve(matrix, side), right.acceleration))
    printed, full = legs(torsion=False)[0][0], legs()[0][0]
    scale = np.diag([1.0, 1.0, 1.0, 1 / LENGTH, 1 / LENGTH, 1 / LENGTH])
    along, across = (
        np.linalg.svd(scale @ wrench_matrix(_centred(s)), compute_uv=False) for s in ("tibia", "normal")
    )
    return [
        row("eq 24", "velocity against the constraint Jacobian", 0.0, velocity, 1e-9),
        row("eq 27", "acceleration, passive rates recovered", 0.0, acceleration, 1e-9),
        row(
            "eq 27",
            "acceleration, passive rates left out",
            0.0,
            without,
            1e-3,
            "",
            "L needs them, against section 4.3",
            True,
        ),
        row(
            "eq 21",
            "rank of the printed six-screw limb",
            6.0,
            float(rank(np.vstack([printed.passive, printed.active]) @ scale)),
            0.0,
            "",
            "cup's k, slide, tibia, femur: planar",
            True,
        ),
        row(
            "eq 21",
            "rank with torsion added, seven screws",
            None,
            float(rank(np.vstack([full.passive, full.active]) @ scale)),
        ),
        row("eq 24", "rank of M, cups giving along the tibia", 6.0, float(np.sum(along > 1e-9 * along[0]))),
        row("eq 24", "largest singular value of M", None, float(along[0])),
        row("eq 24", "least singular value of M", None, float(along[-1])),
        row(
            "eq 24",
            "rank of M, cups giving along the wall's normal",
            6.0,
            float(np.sum(across > 1e-9 * across[0])),
            0.0,
            "",
            "six lines in one plane: heave and tilt are free",
            True,
        ),
    ]


def _centred(slide: str) -> list[StanceLeg]:
    """The legs, with screws counted from under the body's centre on the wall."""
    return legs(slide)[0]


def _relative(found: Array, right: Array) -> float:
    return float(np.abs(found - right).max() / np.abs(right).max())


TABLES = (example, inverse, rates)
