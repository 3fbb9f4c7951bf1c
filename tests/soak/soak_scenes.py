"""Random phases: any contacts, tasks, limits and loads, and targets that nobody could reach."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

import wbplan as wb

DURATION = 1.0


@dataclass
class Scene:
    """A phase, and the live targets that somebody moves while it runs.

    Attributes:
        live: each with how far its values may jump [m].
    """

    phase: wb.Phase
    live: list[tuple[wb.Live, float]] = field(default_factory=list)


def turned(rng: random.Random, most: float) -> Any:
    return pin.exp3(np.array([rng.uniform(-most, most) for _ in range(3)]))


def moved(rng: random.Random, most: float) -> Any:
    return np.array([rng.uniform(-most, most) for _ in range(3)])


def start_of(rng: random.Random, robot: wb.Robot) -> wb.State:
    """A named pose, often with its joints a little off, rarely with some beyond their limits."""
    state = robot.state(rng.choice(robot.pose_names))
    q, off = np.array(state.q), rng.choice((0.0, 0.02, 0.2))
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    held = {joint for roles in robot.roles.values() for joints in roles.values() for joint in joints}
    for k, name in enumerate(robot.joint_names):
        if name not in held:
            q[7 + k] = np.clip(q[7 + k] + rng.uniform(-off, off), low[k], high[k])
            if rng.random() < 0.002:
                q[7 + k] = high[k] + 0.05
    q[:3] += moved(rng, 0.2)
    turn = pin.Quaternion(turned(rng, rng.choice((0.0, 0.05, 3.0))))
    q[3:7] = (turn * pin.Quaternion(q[3:7])).normalized().coeffs()
    return robot.state(q)


def scene(rng: random.Random, robot: wb.Robot, state: wb.State, name: str) -> Scene:
    """A phase that starts in a state; whether it is any good is for wbplan to say."""
    out = Scene(phase=None)  # type: ignore[arg-type]
    feet = list(robot.standing_feet(state.q))
    rng.shuffle(feet)
    stands = feet[: max(0, len(feet) - rng.choice((0, 0, 0, 1, 1, 2, 6)))]
    hands = [hand for hand in robot.hands.values() if hand not in stands]
    frames = ["body" if robot.name == "made" else _root(robot), *hands, *(f for f in feet if f not in stands)]
    soft: list[Any] = [wb.PostureTask(weight=rng.choice((0.01, 0.1, 1.0)))] if rng.random() < 0.8 else []
    hard: list[Any] = []
    for k in range(rng.choice((0, 1, 1, 2, 2, 3))):
        task = _task(rng, rng.choice(frames), state, f"task{k}", out)
        (hard if rng.random() < 0.12 else soft).append(task)
    if rng.random() < 0.4:
        goal = _point(rng, state.com, out)
        com = wb.ComTask(goal, weight=_weight(rng), gain=_gain(rng))
        (hard if rng.random() < 0.1 else soft).append(com)
    if len(hands) > 1 and rng.random() < 0.4:
        hard.append(wb.RelativePoseTask(hands[1], root=hands[0], target=wb.AS_IS))
    if rng.random() < 0.2:
        soft.append(wb.DampingTask(weight=rng.choice((1e-3, 0.1, 10.0))))
    limits: list[Any] = [_joint_limits(rng, robot)] if rng.random() < 0.97 else []
    if rng.random() < 0.3:
        nearest = rng.choice((0.0, 0.005, 0.02))
        limits.append(wb.SelfCollision(distance=nearest, influence=nearest + 0.04))
    if len(stands) > 2 and rng.random() < 0.8:
        limits.append(wb.SupportPolygon(margin=rng.choice((0.0, 0.01, 0.02, -0.05, 0.1))))
    out.phase = wb.Phase(
        name,
        contacts=[wb.Contact(foot) for foot in stands],
        carried=_load(rng, [*hands, frames[0]]),
        hard=hard,
        soft=_levels(rng, soft),
        limits=limits,
        duration=rng.choice((0.2, DURATION, 5.0)),
        **_given(rng, robot),
    )
    return out


def _joint_limits(rng: random.Random, robot: wb.Robot) -> wb.JointLimits:
    """Speeds, accelerations for all joints or for some, seldom a jerk."""
    named = rng.sample(robot.joint_names, min(3, len(robot.joint_names)))
    by_joint = {name: rng.choice((0.5, 20.0, 300.0)) for name in named}
    return wb.JointLimits(
        speed=rng.choice((1.0, 1.0, 0.5, 0.05)),
        acceleration=rng.choice((None, None, 1.0, 20.0, 1000.0, by_joint)),
        jerk=rng.choice((None,) * 9 + (500.0,)),
    )


def _levels(rng: random.Random, soft: list[Any]) -> list[Any]:
    """As they are, or, one time in four, in two or three levels, the order by chance."""
    if len(soft) < 2 or rng.random() > 0.25:
        return soft
    soft = rng.sample(soft, len(soft))
    cuts = sorted(rng.sample(range(1, len(soft)), min(len(soft) - 1, rng.choice((1, 2)))))
    return [soft[a:b] for a, b in zip([0, *cuts], [*cuts, len(soft)], strict=True)]


def _root(robot: wb.Robot) -> str:
    return next(f.name for f in robot.model.frames[2:] if f.type == pin.FrameType.BODY)


def _weight(rng: random.Random) -> Any:
    return rng.choice((0.01, 1.0, 1.0, 10.0, 10.0, 100.0, 1e4, (1.0, 0.0, 10.0)))


def _gain(rng: random.Random) -> float:
    return rng.choice((0.5, 5.0, 20.0, 20.0, 100.0, 1e4))


def _load(rng: random.Random, holders: list[str]) -> list[wb.Carried]:
    if rng.random() > 0.25:
        return []
    body = wb.Body("load", mass=rng.choice((0.0, 0.3, 2.0, 50.0)), size=(0.1, 0.2, 0.1), com=(0.0, 0.02, 0.0))
    pose = pin.SE3(turned(rng, 1.0), moved(rng, 0.1))
    return [wb.Carried(body, by=rng.choice(holders), pose=pose if rng.random() < 0.5 else wb.AS_IS)]


def _given(rng: random.Random, robot: wb.Robot) -> dict[str, Any]:
    """Joints that are locked or driven, limbs that change their role."""
    given: dict[str, Any] = {}
    held = {joint for roles in robot.roles.values() for joints in roles.values() for joint in joints}
    names = [name for name in robot.joint_names if name not in held]
    if rng.random() < 0.15:
        given["locked"] = rng.sample(names, rng.randint(1, 2))
    if rng.random() < 0.1:
        joint = rng.choice([name for name in names if name not in given.get("locked", ())])
        given["driven"] = {joint: rng.uniform(*robot.joint_limits(joint))}
    if robot.roles and rng.random() < 0.15:
        limb = rng.choice(list(robot.roles))
        given["roles"] = {limb: rng.choice(list(robot.roles[limb]))}
    return given


def _task(rng: random.Random, frame: str, state: wb.State, name: str, out: Scene) -> Any:
    here = state.pose(frame)
    weight, gain = _weight(rng), _gain(rng)
    kind = rng.randrange(4)
    if kind == 0:
        return wb.PositionTask(frame, _point(rng, here.translation, out), weight=weight, gain=gain, name=name)
    if kind == 1:
        return wb.OrientationTask(
            frame, turned(rng, 3.1) @ here.rotation, weight=weight, gain=gain, name=name
        )
    goal = pin.SE3(turned(rng, rng.choice((0.1, 3.1))) @ here.rotation, _far(rng, here.translation))
    path: Any = rng.choice((wb.AS_IS, goal, wb.MinJerk(wb.AS_IS, goal, rng.choice((0.05, DURATION)))))
    if rng.random() < 0.25:
        path = wb.Live(here)
        out.live.append((path, rng.choice((0.01, 0.3, 50.0))))
    elif rng.random() < 0.15:
        path = wb.Waypoints((0.0, 0.3, 0.9), (here, goal, here))
    return wb.PoseTask(frame, path, weight=(weight, 1.0), gain=gain, name=name)


def _far(rng: random.Random, here: Any) -> Any:
    """Near, out of reach, or absurdly far."""
    return here + moved(rng, rng.choice((0.02, 0.02, 0.1, 0.1, 0.5, 3.0, 1e3, 1e7)))


def _point(rng: random.Random, here: Any, out: Scene) -> Any:
    goal = _far(rng, here)
    kind = rng.randrange(5)
    if kind == 0:
        live = wb.Live(np.array(here))
        out.live.append((live, rng.choice((0.01, 0.3, 50.0))))
        return live
    if kind == 1:
        return wb.Swing(wb.AS_IS, goal, height=0.05, duration=DURATION)
    return rng.choice((wb.AS_IS, goal, wb.MinJerk(wb.AS_IS, goal, DURATION), wb.Line(wb.AS_IS, goal, 0.3)))


def jump(rng: random.Random, live: wb.Live, most: float) -> None:
    """Somebody moves a slider, or a broken device sends nonsense: that has to be refused."""
    value = live.at(0.0)
    if rng.random() < 0.2:
        nonsense = rng.choice((np.nan, np.inf, -np.inf))
        bad = pin.SE3(np.eye(3), np.full(3, nonsense)) if isinstance(value, pin.SE3) else np.full(3, nonsense)
        try:
            live.set(bad)
        except wb.SpecError:
            return
        raise AssertionError(f"a live target took {nonsense}")
    if isinstance(value, pin.SE3):
        live.set(pin.SE3(turned(rng, 0.5) @ value.rotation, value.translation + moved(rng, most)))
    else:
        live.set(value + moved(rng, most))
