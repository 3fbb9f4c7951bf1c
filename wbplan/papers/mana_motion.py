"""MANA: inverse and forward displacement (tables 6 to 9) and the motions of section 5.3."""

from __future__ import annotations

import math
import time
from functools import partial

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SolveError
from wbplan.mechanism import Follower, Platform, forward
from wbplan.papers.mana import JOINTS, LEGS, TABLE_5, TABLE_6, named, numbers, pose, stance
from wbplan.papers.rows import Row
from wbplan.paths import Waypoints
from wbplan.planner import plan
from wbplan.problem.contacts import Contact
from wbplan.problem.limits import JointLimits
from wbplan.problem.script import Phase, Script
from wbplan.problem.tasks import PoseTask
from wbplan.robot import load_robot

Array = NDArray[np.float64]
row = partial(Row, "MANA")

TABLE_7 = (15.030, 10.354, 15.068, 20.071, 19.774, -19.830)
#: Table 8, solutions 1 to 4 (5 to 8 are the same ones): degrees and mm, world.
TABLE_8 = (
    (-8.6092, -53.5960, 25.437, -48.030, 20.001, -26.594),
    (-13.7780, -59.0860, 29.745, -44.272, 20.001, -42.933),
    (10.7380, -6.0426, 14.854, -13.585, 20.001, 100.314),
    (15.0020, 10.0010, 15.003, 20.005, 20.001, 130.004),
)
TABLE_8_PAIRS = ((1, 8), (2, 5), (3, 6), (4, 7))
#: How often the step of the search for a limit of the workspace is halved.
HALVINGS = 40


def table_6() -> list[Row]:
    """Inverse displacement of Table 5's pose from Table 4's."""
    platform, home = stance()
    start = pose([0.0] * 6)
    feet = {name: start.act(leg.foot([home[j] for j in leg.joints])) for name, leg in platform.legs.items()}
    joints = Platform(platform.chains, feet).nearest_joints(pose(TABLE_5), home)
    return [
        row("Table 6", name.replace("_", " "), printed, joints[name], 5e-5, "rad")
        for name, printed in named(TABLE_6).items()
    ]


def table_7() -> list[Row]:
    """The pose that all twelve angles of Table 6 give (the paper's is from ADAMS)."""
    platform, _ = stance()
    ours = numbers(platform.pose_of(named(TABLE_6)))
    ours[5] -= 150.0
    labels = ("roll", "pitch", "yaw", "x", "y", "z")
    return [
        row(
            "Table 7",
            label,
            printed,
            float(mine),
            0.4 if k < 3 else 0.25,
            "deg" if k < 3 else "mm",
            "ADAMS",
        )
        for k, (label, printed, mine) in enumerate(zip(labels, TABLE_7, ours, strict=True))
    ]


def table_8_known() -> dict[str, float]:
    """The six angles of section 4.3.2: leg 1 all, leg 2 hip 2 and knee, leg 4 knee, from Table 6."""
    every = named(TABLE_6)
    return {j: every[j] for j in (*(f"leg1_{j}" for j in JOINTS), "leg2_hip2", "leg2_knee", "leg4_knee")}


def table_8() -> list[Row]:
    """Forward displacement: every pose for six angles."""
    platform, home = stance()
    known, near = table_8_known(), pose([0.0] * 6)
    forward(platform, known, near)
    begun = time.perf_counter()
    found = forward(platform, known, near, method="elimination")
    seconds = time.perf_counter() - begun
    by_start = forward(platform, known, near, method="multi-start")
    rows = [
        row(
            "Table 8",
            "distinct real solutions",
            8.0,
            float(len(found.solutions)),
            why="eight are four, each twice",
            misprint=True,
        ),
        row("Table 8", "distinct real ones among the eight", 4.0, float(len(found.solutions))),
        row("Table 8", "the same from random starts", None, float(len(by_start.solutions))),
        row(
            "Table 8",
            "solutions within all limits",
            None,
            float(len(found.admissible)),
            why="4 = 7, Table 5's pose",
        ),
        row("section 5.1", "seconds for all poses", 90.0, seconds, 0.0, "s", "printed: over 90", time=True),
    ]
    for (first, second), printed in zip(TABLE_8_PAIRS, TABLE_8, strict=True):
        gaps = [np.abs(numbers(s.pose) - printed) for s in found.solutions]
        best = min(gaps, key=lambda g: float(g.max()))
        label = f"no. {first} = {second}: "
        rows.append(
            row("Table 8", label + "worst angle from print", 0.0, float(best[:3].max()), 0.0055, "deg")
        )
        rows.append(
            row("Table 8", label + "worst shift from print", 0.0, float(best[3:].max()), 0.0025, "mm")
        )
    names = list(known)
    follower = Follower(platform, home, names)
    spans = []
    for part in range(1, 101):
        joints = platform.nearest_joints(pose(np.array(TABLE_5) * part / 100.0), home)
        begun = time.perf_counter()
        follower.step([joints[n] for n in names])
        spans.append(time.perf_counter() - begun)
    rows.append(
        row(
            "section 4.2",
            "one step along a path (median)",
            None,
            float(np.median(spans)) * 1e6,
            0.0,
            "us",
        )
    )
    return rows


def within(body: pin.SE3) -> bool:
    """Whether every leg reaches its foot within the limits of section 5.1, hip 1 below the hip."""
    platform, _ = stance()
    return all(s.within for s in platform.inverse(body).values())


def farthest(direction: ArrayLike) -> float:
    """How far along six numbers (degrees, mm) the body goes from (0, 0, 150) before a leg cannot."""
    along = np.asarray(direction, dtype=np.float64)
    low, step = 0.0, 1.0
    while within(pose(along * (low + step))):
        low += step
    for _ in range(HALVINGS):
        step /= 2.0
        if within(pose(along * (low + step))):
            low += step
    return low


def table_9() -> list[Row]:
    """Rotation about each axis alone, and translation, from (0, 0, 150)."""
    rows = []
    for k, (axis, printed) in enumerate(zip("XYZ", (52.0, 27.0, 49.0), strict=True)):
        for sign in (-1.0, 1.0):
            ours = farthest(sign * np.eye(6)[k])
            what = f"{'largest' if sign > 0 else 'smallest'} rotation about {axis} (printed: whole degrees)"
            rows.append(
                row(
                    "Table 9",
                    what,
                    sign * printed,
                    sign * math.floor(ours),
                    0.0,
                    "deg",
                    f"exactly {sign * ours:.4f}",
                )
            )
    for label, index, sign in (("x", 3, 1.0), ("y", 4, 1.0), ("up", 5, 1.0), ("down", 5, -1.0)):
        rows.append(
            row(
                "section 5.1",
                f"translation {label} from home",
                None,
                farthest(sign * np.eye(6)[index]),
                unit="mm",
            )
        )
    return rows


def helix(count: int = 400) -> list[Array]:
    """Section 5.3.1: body positions [mm]: to (50,0,150), three turns of radius 50 and pitch 10, back."""
    turns = np.linspace(0.0, 3.0, count)
    out = [np.array([50.0 * s, 0.0, 150.0]) for s in np.linspace(0, 1, count // 4)]
    winding = [
        np.array([50.0 * math.cos(2 * math.pi * t), 50.0 * math.sin(2 * math.pi * t), 150.0 + 10.0 * t])
        for t in turns
    ]
    back = [np.array([50.0 * (1 - s), 0.0, 180.0]) for s in np.linspace(0, 1, count // 4)]
    return [*out, *winding, *back]


def section_5_3() -> list[Row]:
    """The helix and the combined motion: inside the limits, and how far the latter goes as printed."""
    platform, home = stance()
    near = dict(home)
    largest = dict.fromkeys(JOINTS, 0.0)
    lowest, gap = "inside", 0.0
    for position in helix():
        body = pin.SE3(np.eye(3), position / 1e3)
        try:
            near = platform.nearest_joints(body, near)
        except SolveError as error:
            lowest = str(error)
            break
        gap = max(gap, float(np.abs(platform.pose_of(near).translation - body.translation).max()))
        for j in JOINTS:
            largest[j] = max(largest[j], *(abs(near[f"{leg}_{j}"]) for leg in LEGS))
    return [
        row("section 5.3.1", "helix within limits", "inside", lowest),
        *(
            row("section 5.3.1", f"largest {j} on the helix", None, math.degrees(largest[j]), unit="deg")
            for j in JOINTS
        ),
        row("Fig 8", "pose from the planned angles", 0.0, gap * 1e3, 1e-6, "mm"),
        row(
            "section 5.3.2",
            "share of (40,30,30) mm and (20,20,20) deg in reach",
            1.0,
            min(1.0, farthest([20.0, 20.0, 20.0, 40.0, 30.0, 30.0])),
            1e-3,
            "",
            "out of reach at once; one after the other",
            True,
        ),
        row(
            "section 5.3.2",
            "share of (20,20,20) deg alone",
            1.0,
            min(1.0, farthest([20.0, 20.0, 20.0, 0, 0, 0])),
            1e-3,
            "",
            "out of reach; each rotation alone is feasible",
            True,
        ),
        row(
            "section 5.3.2",
            "(40,30,30) mm, and 20 deg about each axis alone",
            "yes",
            "yes"
            if all(
                farthest(d) >= 1.0 for d in ([0, 0, 0, 40, 30, 30], *(20 * np.eye(6)[k] for k in range(3)))
            )
            else "no",
        ),
    ]


def _combined(count: int = 40) -> list[pin.SE3]:
    """Section 5.3.2, feasible reading: half-sines out and back, the translation, then each turn alone."""
    moves = [np.array([0.0, 0.0, 0.0, 40.0, 30.0, 30.0]), *(20.0 * np.eye(6)[k] for k in range(3))]
    share = [math.sin(math.pi * k / count) for k in range(count)]
    return [pose(move * part) for move in moves for part in share] + [pose([0.0] * 6)]


def _planned(path: list[pin.SE3], seconds: float, dt: float, stride: int) -> tuple[float, float]:
    """A path planned as a hard task of the body: worst error of pose, and of joints from the closed form.

    Args:
        path: T_world_body at equal intervals.
        seconds: how long it takes.
        dt: of a tick [s]; the planner linearises each, so joints differ by the order of its square.
        stride: every so many ticks are compared.
    """
    robot = load_robot("mana")
    home = stance()[1]
    q = pin.neutral(robot.model)
    for name, value in home.items():
        q[robot.joint_index(name)[0]] = value
    q[:7] = pin.SE3ToXYZQUAT(path[0])
    start = robot.state(q)
    standing = Platform.of_robot(robot, start)
    times = np.linspace(0.0, seconds, len(path))
    way = Waypoints(tuple(times), tuple(path))
    phase = Phase(
        "body",
        contacts=tuple(Contact(foot, friction=0.7) for foot in robot.feet.values()),
        hard=(PoseTask("body", way),),
        limits=(JointLimits(),),
        duration=seconds,
    )
    motion = plan(robot, Script(phase), start=start, dt=dt).bundle.trajectory
    joints, body, near = 0.0, 0.0, dict(home)
    for t, at in zip(motion.time[::stride], motion.q[::stride], strict=True):
        asked = way.at(float(t))
        near = standing.nearest_joints(asked, near)
        planned = [at[robot.joint_index(j)[0]] for j in standing.joints]
        joints = max(joints, float(np.abs(np.array(planned) - list(near.values())).max()))
        body = max(body, float(np.abs(pin.log6(asked.actInv(pin.XYZQUATToSE3(at[:7]))).vector).max()))
    return body, joints


def figures_8_to_10() -> list[Row]:
    """Section 5.3, planned tick by tick as hard tasks, beside the closed form (spherical feet)."""
    turns = [pin.SE3(np.eye(3), p / 1e3) for p in helix(120)]
    rows = []
    for figure, name, path in (("Fig 8", "helix", turns), ("Figs 9, 10", "combined motion", _combined())):
        body, joints = _planned(path, 20.0, 0.001, 50)
        rows += [
            row(figure, f"{name} by the QP, worst of the pose", 0.0, body, 1e-6),
            row(figure, f"{name} by the QP, worst joint from the closed form", 0.0, joints, 1e-6, "rad"),
        ]
    return rows


TABLES = (table_6, table_7, table_8, table_9, section_5_3, figures_8_to_10)
