"""MANA (a quadruped as a 4-SRRR parallel manipulator): tables 1 to 4, and the stance they are about."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from functools import lru_cache, partial

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.mechanism import Platform, ThreeJointLeg, actuated_sets, rank, reciprocal
from wbplan.mechanism.rates import point_leg
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

Array = NDArray[np.float64]

row = partial(Row, "MANA")
LEGS = ("leg1", "leg2", "leg3", "leg4")
JOINTS = ("hip1", "hip2", "knee")
#: Table 4 and Table 6 [rad], legs 1 to 4; Table 5: roll, pitch, yaw [rad] and translation [m].
TABLE_4 = ((0.0, 0.94, -1.6143), (0.0, -0.94, 1.6143), (0.0, 0.94, -1.6143), (0.0, -0.94, 1.6143))
TABLE_6 = (
    (-0.61946, 1.12860, -2.1264),
    (0.59703, -1.39350, 1.8965),
    (0.16013, 0.87966, -1.7571),
    (-0.18813, -0.99065, 1.4017),
)
TABLE_5 = (15.0, 10.0, 15.0, 20.0, 20.0, -20.0)
#: Table 3, joints of legs 1 to 4; "x" stands for "3(2)".
TABLE_3 = (
    ("123", "x", "", "1x"),
    ("123", "23", "", "x"),
    ("123", "x", "x", "1"),
    ("1x", "23", "", "1x"),
    ("23", "23", "", "1x"),
    ("23", "23", "1", "x"),
    ("23", "1x", "1", "x"),
)


@lru_cache(maxsize=1)
def stance() -> tuple[Platform, Mapping[str, float]]:
    """MANA on its four feet in the pose of Table 4, feet at (+-105, +-80) mm on z = 0, and its joints."""
    robot = load_robot("mana")
    joints = {
        f"{leg}_{joint}": v
        for leg, row in zip(LEGS, TABLE_4, strict=True)
        for joint, v in zip(JOINTS, row, strict=True)
    }
    q = pin.neutral(robot.model)
    for name, value in joints.items():
        q[robot.joint_index(name)[0]] = value
    standing = Platform.of_robot(robot, robot.state(q))
    feet = {
        leg: np.array([x, y, 0.0])
        for leg, (x, y) in zip(
            LEGS, ((0.105, 0.08), (0.105, -0.08), (-0.105, -0.08), (-0.105, 0.08)), strict=True
        )
    }
    return Platform(standing.chains, feet), joints


def pose(numbers: ArrayLike, base: ArrayLike = (0.0, 0.0, 0.15)) -> pin.SE3:
    """The paper's six numbers (roll, pitch, yaw in degrees, x, y, z in mm) as T_world_body; R = Rz Ry Rx."""
    n = np.asarray(numbers, dtype=np.float64)
    return pin.SE3(pin.rpy.rpyToMatrix(*np.radians(n[:3])), np.asarray(base) + n[3:] / 1e3)


def numbers(body: pin.SE3) -> Array:
    """Roll, pitch, yaw [deg] and x, y, z [mm] of T_world_body."""
    return np.concatenate([np.degrees(pin.rpy.matrixToRpy(body.rotation)), body.translation * 1e3])


def named(rows: tuple[tuple[float, ...], ...]) -> dict[str, float]:
    """A table of joint angles, as joint -> angle."""
    return {
        f"{leg}_{j}": v for leg, row in zip(LEGS, rows, strict=True) for j, v in zip(JOINTS, row, strict=True)
    }


def _geometry(d: float, l1: float, l3: float, hip_y: float, turned: bool = True) -> dict[str, ThreeJointLeg]:
    """The legs with lengths to try; right legs turned about z by half a turn, or not (as printed)."""
    legs = {}
    upright = np.column_stack([[0, 0, -1], [0, 1, 0], [1, 0, 0]]).astype(np.float64)
    for name, (sx, sy) in zip(LEGS, ((1, 1), (1, -1), (-1, -1), (-1, 1)), strict=True):
        side = np.diag([-1.0, -1.0, 1.0]) if sy < 0 and turned else np.eye(3)
        place = pin.SE3(side @ upright, np.array([0.105 * sx, hip_y * sy, 0.0]))
        legs[name] = ThreeJointLeg(l1, 0.075, l3, d, -1.0, place)
    return legs


def _misses(legs: Mapping[str, ThreeJointLeg]) -> float:
    """Largest error [rad] of Table 6 from Tables 4 and 5 with these legs: each leg's closest solution."""
    start = pose([0.0] * 6)
    target = pose(TABLE_5)
    worst = 0.0
    for (_, leg), before, after in zip(legs.items(), TABLE_4, TABLE_6, strict=True):
        foot = start.act(leg.foot(before))
        every = leg.solve(target.actInv(foot))
        errors = [float(np.abs(s.joints - after).max()) for s in (*every.within, *every.beyond)]
        worst = max(worst, min(errors, default=math.inf))
    return worst


def table_1() -> list[Row]:
    """Which lengths reproduce the paper's own results: not the printed ones."""
    printed = _misses(_geometry(0.030, 0.040, 0.105, 0.080))
    swapped = _misses(_geometry(0.040, 0.030, 0.097, 0.040))
    untwisted = _misses(_geometry(0.040, 0.030, 0.097, 0.040, turned=False))
    legs = stance()[0].legs
    leg, angles = legs["leg1"], np.array(TABLE_4[0])
    return [
        row("Table 1", "pelvis width d", 30.0, leg.offset * 1e3, 0.5, "mm", "d and l1 are swapped", True),
        row("Table 1", "pelvis length l1", 40.0, leg.l1 * 1e3, 0.5, "mm", "d and l1 are swapped", True),
        row(
            "Table 1", "knee to contact l3", 105.0, leg.l3 * 1e3, 0.5, "mm", "to the foot ball's centre", True
        ),
        row("Table 1", "H = l1 + l2 + 105", 210.0, (leg.l1 + leg.l2) * 1e3 + 105.0, 1e-9, "mm"),
        row("Table 1", "worst angle of Table 6, as printed", 0.0, printed, 1e-3, "rad", "lengths", True),
        row("Table 1", "worst angle of Table 6, ours", 0.0, swapped, 2e-4, "rad"),
        row(
            "eq 16",
            "worst angle, right legs only translated",
            0.0,
            untwisted,
            1e-3,
            "rad",
            "right legs are turned by half a turn",
            True,
        ),
        row("Table 4", "height of the body", 150.0, -float(leg.foot(angles)[2]) * 1e3, 0.01, "mm"),
    ]


def table_2() -> list[Row]:
    """Constraint lines that a leg puts on the body, for each set of its joints that is locked."""
    platform, joints = stance()
    chain = platform.chains["leg1"]
    q = np.array([joints[j] for j in chain.joints]) + [0.1, 0.1, 0.0]
    leg = point_leg(chain, q, pin.SE3.Identity())
    foot = chain.pose(q).translation
    rows = []
    for count in (3, 2, 1):
        for locked in itertools.combinations(range(3), count):
            free = [j for j in range(3) if j not in locked]
            wrenches = reciprocal(np.vstack([leg.passive, leg.active[free]]))
            through = max(float(np.linalg.norm(w[3:] - np.cross(foot, w[:3]))) for w in wrenches)
            lines = len(wrenches) if through < 1e-9 else -1
            name = " and ".join(str(j + 1) for j in locked)
            rows.append(
                row(
                    "Table 2",
                    f"lines through the foot, joints {name} locked",
                    float(count),
                    float(lines),
                )
            )
    return rows


def expanded_table_3() -> Iterator[tuple[str, ...]]:
    """The sets of Table 3 with joint 3 or 2 wherever it says 3(2)."""
    for row in TABLE_3:
        places = [leg.replace("x", "?") for leg in row]
        wild = sum(p.count("?") for p in places)
        for choice in itertools.product("32", repeat=wild):
            left = iter(choice)
            legs = ["".join(next(left) if c == "?" else c for c in p) for p in places]
            yield tuple(f"leg{i}_{JOINTS[int(c) - 1]}" for i, leg in enumerate(legs, 1) for c in sorted(leg))


def table_3(poses: int = 20) -> list[Row]:
    """Which sets of six joints determine the body: the listed ones, and all 924."""
    platform, home = stance()
    listed = list(expanded_table_3())
    random = np.random.default_rng(3)
    ranks, census, bad, signs = [], [], [], set()
    index = {name: k for k, name in enumerate(platform.joints)}
    both = [index[f"{leg}_{j}"] for leg in ("leg1", "leg2") for j in JOINTS]
    for k in range(poses):
        spread = 0.0 if k == 0 else 1.0
        body = pose(np.concatenate([random.uniform(-8, 8, 3), random.uniform(-15, 15, 3)]) * spread)
        joints = platform.nearest_joints(body, home)
        g = platform.rates_map(joints) @ np.diag([0.1, 0.1, 0.1, 1.0, 1.0, 1.0])
        ranks.append([rank(g[[index[j] for j in s]]) for s in listed])
        signs.add(tuple(np.sign([np.linalg.det(g[[index[j] for j in s]]) for s in listed])))
        bad.append(rank(g[both]))
        if k < 2:
            census.append(sum(s.regular for s in actuated_sets(platform, joints)))
    third = sum(len(leg) > 0 for leg in TABLE_3[0])
    return [
        row(
            "Table 3",
            f"listed sets of rank 6 at home (of {len(listed)})",
            float(len(listed)),
            float(sum(r == 6 for r in ranks[0])),
        ),
        row("Table 3", f"least rank of them, {poses} poses", 6.0, float(min(map(min, ranks)))),
        row("Table 3", "their determinants keep their signs", "yes", "yes" if len(signs) == 1 else "no"),
        row(
            "Table 3",
            "3+3+0+0: largest rank (no feasible one)",
            "5",
            str(max(bad)),
            why="turn about the line of two feet",
        ),
        row(
            "Table 3",
            "first row: joints of legs 1 to 4",
            "3+2+0+1",
            "+".join(str(len(leg)) for leg in TABLE_3[0]),
            why="the row lists other joints than its label",
            misprint=True,
        ),
        row("Table 3", "legs used by its first row", 3.0, float(third)),
        row("Table 3", "regular sets of 924 at home", None, float(census[0])),
        row("Table 3", "regular sets of 924, generic pose", None, float(census[1]), why="all but 3+3+0+0"),
        row(
            "Principle II",
            "rank depends on the configuration",
            "no",
            "yes" if census[0] != census[1] else "no",
            why="424 sets at home, 918 elsewhere",
            misprint=True,
        ),
    ]


def equations() -> list[Row]:
    """Equations 25 to 31: which of them are satisfied, and what is left of eq. 26 at hip 1 = 0."""
    d, l1, l2, l3 = 40.0, 30.0, 75.0, 97.0
    leg = _geometry(0.040, 0.030, 0.097, 0.040)["leg1"]
    left, worst = [], 0.0
    for one in (0.0, 0.3):
        q = np.array([one, 0.94, -1.6143])
        x, y, z = leg.local(leg.foot(q))[[2, 1, 0]] * np.array([1e3, 1e3, -1e3])
        k = l2**2 + l3**2 + 2 * l2 * l3 * math.cos(q[2])
        s, c = math.sin(one), math.cos(one)
        m3, m4, m5 = d * c + l1 * s, s * s, k * s * s
        worst = max(worst, abs((y - m3) ** 2 + m4 * x**2 - m5))
        gradient = np.array([2 * m4 * x, 2 * (y - m3), 0.0])
        left.append(rank(np.array([[0.0, c, s, 0, 0, 0], [*(gradient / 1e3), 0, 0, 0]])))
        rho = y * s - z * c
        plus = x * x + y * y + z * z + 2 * l1 * rho - (k + d * d - l1 * l1)
        minus = x * x + y * y + z * z - 2 * l1 * rho - (k + d * d - l1 * l1)
    return [
        row("eq 26", "its residual at hip 1 = 0 and 0.3 rad", 0.0, worst, 1e-8, "mm^2"),
        row("eqs 25, 26", "independent equations at hip 1 = 0.3 rad", 2.0, float(left[1])),
        row(
            "eqs 25, 26",
            "independent equations at hip 1 = 0",
            2.0,
            float(left[0]),
            why="eq 26 is 0 = 0 there",
            misprint=True,
        ),
        row("eq 31", "residual with the lower sign", 0.0, minus, 1e-8, "mm^2", "the leg below its hip"),
        row(
            "eq 31",
            "residual with the upper sign",
            0.0,
            plus,
            1.0,
            "mm^2",
            "the leg above its hip only",
            True,
        ),
    ]


TABLES = (table_1, table_2, equations, table_3)
