"""Zheng's radial hexapod with leg-arm integration: FK, IK with compensation, mobility, stability radii."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.geometry import support_polygon
from wbplan.mechanism import ClampLoop, FiveJointLimb, limb_chain, rank
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

Array = NDArray[np.float64]

row = partial(Row, "Zheng")
EXAMPLE = np.radians([60.0, -10.0, 30.0, 40.0, 50.0])
#: The clamp as drawn (Fig. 8): both limbs parallel to the y-z plane, arms level, tools facing each other.
DRAWN = np.array([np.pi / 2, 0.3, -0.5, 0.2, -np.pi / 2, np.pi / 2, 0.3, -0.5, 0.2, np.pi / 2])


def limb() -> FiveJointLimb:
    """The leg-arm limb of Table 1 with the ranges of Table 3, placed at its own origin."""
    own = FiveJointLimb.of(limb_chain(load_robot("legarm_hexapod"), "limb2", "limb2_tip"))
    return FiveJointLimb(own.l1, own.l2, own.l31, own.l4, own.l5, lower=own.lower, upper=own.upper)


def clamp() -> ClampLoop:
    """Both limbs of the robot, holding an object as drawn."""
    robot = load_robot("legarm_hexapod")
    return ClampLoop(limb_chain(robot, "limb1", "limb1_tip"), limb_chain(robot, "limb2", "limb2_tip"), DRAWN)


def _random_targets(count: int, seed: int = 1) -> list[tuple[Array, pin.SE3, float, float]]:
    """Joints, target with the body shifted back, travel, shift."""
    arm, random = limb(), np.random.default_rng(seed)
    out = []
    for _ in range(count):
        q = random.uniform(arm.lower, arm.upper)
        travel, shift = random.uniform(-np.pi, np.pi), random.uniform(-0.06, 0.06)
        target = arm.pose(q)
        target.translation = target.translation + shift * np.array([np.sin(travel), -np.cos(travel), 0.0])
        out.append((q, target, travel, shift))
    return out


def equation_20() -> list[Row]:
    """Forward kinematics: the product of exponentials against the printed closed form."""
    arm = limb()
    chain = arm.chain()
    random = np.random.default_rng(0)
    right, wrong, rotation = 0.0, 0.0, 0.0
    for _ in range(500):
        q = random.uniform(arm.lower, arm.upper)
        exact = chain.pose(q)
        _, b, printed = _printed_fk(arm, q)
        rotation = max(rotation, float(np.abs(printed - exact.rotation).max()))
        right = max(right, abs(-b + arm.l5 * printed[2, 0] - exact.translation[2]))
        wrong = max(wrong, abs(b + arm.l5 * printed[2, 0] - exact.translation[2]))
    p = arm.pose(EXAMPLE).translation * 1e3
    return [
        row("eq 20", "rotation against eq 19, worst of 500", 0.0, rotation, 1e-12),
        row("eq 20", "z = +b + l5 r31 against eq 19, worst", 0.0, wrong * 1e3, 1e-9, "mm", "sign of b", True),
        row("eq 20", "z = -b + l5 r31 against eq 19, worst", 0.0, right * 1e3, 1e-9, "mm"),
        *(
            row("eq 20", f"{axis} at (60, -10, 30, 40, 50) deg", None, float(v), unit="mm")
            for axis, v in zip("xyz", p, strict=True)
        ),
    ]


def _printed_fk(arm: FiveJointLimb, q: Array) -> tuple[float, float, Array]:
    """a, b and R of eq. 20 as printed."""
    one, two, three, four, five = q
    x = two + three + four
    a = arm.l1 + arm.l2 * math.cos(two) + arm.l31 * math.cos(two + three) + arm.l4 * math.cos(x)
    b = arm.l2 * math.sin(two) + arm.l31 * math.sin(two + three) + arm.l4 * math.sin(x)
    c1, s1, cx, sx, c5, s5 = (f(t) for t in (one, x, five) for f in (math.cos, math.sin))
    rotation = np.array(
        [
            [c1 * cx * c5 - s1 * s5, -c1 * cx * s5 - s1 * c5, c1 * sx],
            [s1 * cx * c5 + c1 * s5, -s1 * cx * s5 + c1 * c5, s1 * sx],
            [-sx * c5, sx * s5, cx],
        ]
    )
    return a, b, rotation


def mobility_rows() -> list[Row]:
    """Equations 2 to 7: five freedoms at the drawn configuration, four at others, five only instantaneous."""
    loop = clamp()
    drawn = loop.mobility(DRAWN)
    near = [loop.mobility(q).mobility for q in loop.nearby(DRAWN, 0.2, 200)]
    robot = load_robot("legarm_hexapod")
    couple = drawn.wrenches[0][0] * np.sign(drawn.wrenches[0][0][4])
    off = float(np.abs(couple - np.array([0, 0, 0, 0, 1.0, 0])).max())
    return [
        row("eq 3", "rank of each branch", "5, 5", ", ".join(map(str, drawn.ranks))),
        row("eq 3", "constraint is the couple (000; 010), off by", 0.0, off, 1e-9),
        row("eq 4", "redundant constraints", 1.0, float(drawn.redundant)),
        row("eq 5", "common constraints", 1.0, float(drawn.common)),
        row("eq 6", "virtual constraints", 0.0, float(drawn.virtual)),
        row("eq 7", "mobility, modified Gruebler, as drawn", 5.0, float(drawn.grubler)),
        row("eq 7", "mobility, rank of the loop, as drawn", 5.0, float(drawn.mobility)),
        row("eq 7", "mobility, rank of Pinocchio's Jacobian", 5.0, float(10 - _pinocchio_rank(robot, DRAWN))),
        row(
            "eq 7",
            f"mobility, {len(near)} closed configurations near it",
            5.0,
            float(max(near)),
            misprint=True,
            why="five is instantaneous; four are finite",
        ),
        *(
            row("eq 7", f"departure of a rate {name}, per step", None, ratio, why=why)
            for name, ratio, why in departures(loop)
        ),
    ]


def departures(loop: ClampLoop, step: float = 0.01) -> list[tuple[str, float, str]]:
    """Which of the five rates begin a finite motion: distance to the closed set over the step."""
    tangents = loop.tangents(DRAWN)
    moved = loop.first.screws_at(DRAWN[:5]).T @ tangents[:5]
    turn = moved[:3]
    # A rate that tilts, yaws and shifts the object alike.
    rest = np.linalg.pinv(moved) @ np.array([1.0, 0.0, 1.0, 0.2, 0.1, -0.1])
    out = []
    for name, rows, why in (
        ("without tilt", turn[:1], "sheet A: followed"),
        ("without yaw", turn[2:], "sheet B: followed"),
        ("with both", turn[:0], "allowed by rates, not by any motion"),
    ):
        keep = rest - (np.linalg.pinv(rows) @ rows @ rest if len(rows) else 0.0)
        out.append((name, loop.departure(DRAWN, tangents @ keep, step), why))
    return out


def _pinocchio_rank(robot: object, joints: Array) -> int:
    """Rank of the clamp's six closure rows, from Pinocchio's frame Jacobians."""
    model = robot.model  # type: ignore[attr-defined]
    q, names = pin.neutral(model), [f"limb{i}_joint{k}" for i in (1, 2) for k in range(1, 6)]
    for name, value in zip(names, joints, strict=True):
        q[robot.joint_index(name)[0]] = value  # type: ignore[attr-defined]
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    columns = [robot.joint_index(name)[1] for name in names]  # type: ignore[attr-defined]
    # Spatial velocities of both tips at one point: the object is rigid in both hands.
    held = [data.J[:, columns] * np.array([(i < 5) == first for i in range(10)]) for first in (True, False)]
    return rank((held[0] - held[1]).T)


def inverse_rows(count: int = 300) -> list[Row]:
    """Equations 23 to 31: each corrected form against targets made with known joints and shifts."""
    arm, targets = limb(), _random_targets(count)
    tries: dict[str, Callable[[Array, pin.SE3, float, float], bool]] = {
        "28": lambda q, t, travel, shift: _close(
            _orientation(t.rotation, False), (q[0], q[1] + q[2] + q[3], q[4])
        ),
        "28 printed": lambda q, t, travel, shift: _close(
            _orientation(t.rotation, True), (q[0], q[1] + q[2] + q[3], q[4])
        ),
        "29": lambda q, t, travel, shift: any(
            np.abs(s.joints - q).max() < 1e-8 and abs(s.shift - shift) < 1e-9
            for s in arm.solve(t, travel).within
        ),
        "23": lambda q, t, travel, shift: _lands(arm, q, t, travel, -shift),
        "23 printed": lambda q, t, travel, shift: _lands(arm, q, t, travel, shift),
    }
    share = {name: float(sum(f(*t) for t in targets)) / count for name, f in tries.items()}
    one_four, three = _case_one(arm)
    return [
        row(
            "eq 28",
            "orientations solved, arguments as printed",
            1.0,
            share["28 printed"],
            1e-9,
            "",
            "atan2 arguments swapped",
            True,
        ),
        row("eq 28", "orientations solved, arguments (y, x)", 1.0, share["28"], 1e-9),
        row(
            "eq 23",
            "targets met with P + dl n",
            1.0,
            share["23 printed"],
            1e-9,
            "",
            "sign: P - dl n, as in eqs 27, 29",
            True,
        ),
        row("eq 23", "targets met with P - dl n", 1.0, share["23"], 1e-9),
        row("eqs 29, 31", "joints and shift recovered (case 2.3)", 1.0, share["29"], 1e-9),
        row("eq 26", "recovered without shift (case 1.4)", 1.0, one_four, 1e-9),
        row(
            "eq 27",
            "least shift brings into reach (case 1.3)",
            1.0,
            three,
            1e-9,
            "",
            "root of the smaller |dl|",
        ),
    ]


def _orientation(r: Array, swapped: bool) -> tuple[float, float, float]:
    """Eq. 28: theta1, thetax, theta5; as printed, or with atan2's arguments in its usual order."""

    def arctan(first: float, second: float) -> float:
        return math.atan2(first, second) if swapped else math.atan2(second, first)

    one = arctan(r[0, 2], r[1, 2])
    x = arctan(r[2, 2], r[0, 2] * math.cos(one) + r[1, 2] * math.sin(one))
    return one, x, arctan(-r[2, 0], r[2, 1])


def _close(found: tuple[float, float, float], right: tuple[float, float, float]) -> bool:
    """Equal modulo a turn, or in the other branch (both ends turned round, pitch reversed)."""
    one, x, five = found
    branches = ((one, x, five), (one + math.pi, -x, five + math.pi))
    return any(
        max(abs(math.remainder(a - b, 2 * math.pi)) for a, b in zip(f, right, strict=True)) < 1e-8
        for f in branches
    )


def _lands(arm: FiveJointLimb, q: Array, target: pin.SE3, travel: float, shift: float) -> bool:
    """Whether the limb's own pose is the target moved by a shift along n."""
    moved = target.translation + shift * np.array([math.sin(travel), -math.cos(travel), 0.0])
    return bool(np.abs(arm.pose(q).translation - moved).max() < 1e-9)


def _case_one(arm: FiveJointLimb, count: int = 60) -> tuple[float, float]:
    """Shares solved of targets with joint 5 vertical: within reach, and pushed out of it."""
    random = np.random.default_rng(2)
    plain = pushed = tried = 0
    for _ in range(count):
        q = random.uniform(arm.lower, arm.upper)
        q[3] = -q[1] - q[2]  # thetax = 0
        if not arm.lower[3] <= q[3] <= arm.upper[3]:
            continue
        tried += 1
        target = arm.pose(q)
        travel = q[0]  # the shift is then across the limb
        found = arm.solve(target, travel)
        plain += found.case == "1.4" and any(np.abs(s.joints - q).max() < 1e-7 for s in found.within)
        n = np.array([math.sin(travel), -math.cos(travel), 0.0])
        target.translation = target.translation + 0.35 * n
        least = arm.solve(target, travel)
        pushed += least.case == "1.3" and all(
            np.abs(arm.pose(s.joints).translation + s.shift * n - target.translation).max() < 1e-9
            and s.shift < 0.35
            for s in least.within
        )
    return plain / tried, pushed / tried


def figure_16() -> list[Row]:
    """Stability radii of regular stances, circle radius 1."""
    six, five = (
        [(math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n)) for k in range(n)] for n in (6, 5)
    )
    three = support_polygon([five[0], five[2], five[3]])  # two non-adjacent legs lifted: 1 and 4
    best, widest = three.chebyshev()
    gain = widest - three.margin([0.0, 0.0])
    away = float(np.linalg.norm(best))
    return [
        row("Fig 16", "six legs", math.sqrt(3) / 2, support_polygon(six).chebyshev()[1], 1e-9, "CR"),
        row("Fig 16", "three of six legs", 0.5, support_polygon(six[::2]).chebyshev()[1], 1e-9, "CR"),
        row("Fig 16", "five legs", 0.809, support_polygon(five).chebyshev()[1], 5e-4, "CR"),
        row("Fig 16", "three of five legs, best point", 0.427, widest, 5e-4, "CR"),
        row("Fig 16", "three of five legs, centre", 0.309, three.margin([0.0, 0.0]), 5e-4, "CR"),
        row(
            "Fig 16",
            "distance from the centre to the best point",
            0.118,
            away,
            5e-4,
            "CR",
            "0.118 is the margin's gain",
            True,
        ),
        row("Fig 16", "gain of margin at the best point", 0.118, gain, 5e-4, "CR"),
        row(
            "section 4.2",
            "four of five legs, centre",
            0.309,
            support_polygon(five[1:]).margin([0.0, 0.0]),
            5e-4,
            "CR",
        ),
        row(
            "section 4.2",
            "four of five legs, best point",
            None,
            support_polygon(five[1:]).chebyshev()[1],
            unit="CR",
        ),
    ]


TABLES = (equation_20, mobility_rows, inverse_rows, figure_16)
