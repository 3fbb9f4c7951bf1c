"""A small four-legged robot with a tray, and plans for it made by plain inverse kinematics.

`build()` gives a plan that keeps every promise: the body shifts, one leg steps, the tray takes a box and
carries it, and leaves it. Its arguments bend one thing at a time, and all that follows from it is
recomputed, so that only the promise in question is broken.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from wbplan.bundle import Bundle, Trajectory
from wbplan.geometry import support_polygon

DT = 0.02
FEET = ("leg1_foot", "leg2_foot", "leg3_foot", "leg4_foot")
CORNERS = ((0.2, 0.12), (-0.2, 0.12), (-0.2, -0.12), (0.2, -0.12))
HEIGHT = 0.22
BOX_IN_TRAY = (0.02, 0.0, 0.03, 0.0, 0.0, np.sin(0.1), np.cos(0.1))

Path = Callable[[float], np.ndarray]


def _link(name: str, mass: float, at: tuple[float, float, float] = (0, 0, 0), size: float = 0.05) -> str:
    i = mass * size**2 / 6
    return (
        f'<link name="{name}"><inertial><origin xyz="{at[0]} {at[1]} {at[2]}"/><mass value="{mass}"/>'
        f'<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, speed: float) -> str:
    limit = "" if kind == "fixed" else f'<axis xyz="{axis}"/>'
    if kind == "revolute":
        limit += f'<limit lower="-1.8" upper="1.8" effort="10" velocity="{speed}"/>'
    if kind == "continuous":
        limit += f'<limit effort="10" velocity="{speed}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/>{limit}</joint>'
    )


@cache
def urdf(*, tray: str = "revolute", speed: float = 8.0) -> str:
    parts = ['<robot name="quad">', _link("base", 4.0, size=0.3)]
    for i, (x, y) in enumerate(CORNERS, 1):
        parts += [
            _link(f"leg{i}_hip", 0.1),
            _link(f"leg{i}_thigh", 0.2, (0, 0, -0.07)),
            _link(f"leg{i}_shank", 0.1, (0, 0, -0.07)),
            f'<link name="leg{i}_foot"/>',
            _joint(f"leg{i}_joint1", "revolute", "base", f"leg{i}_hip", f"{x} {y} 0", "1 0 0", speed),
            _joint(f"leg{i}_joint2", "revolute", f"leg{i}_hip", f"leg{i}_thigh", "0 0 0", "0 1 0", speed),
            _joint(
                f"leg{i}_joint3", "revolute", f"leg{i}_thigh", f"leg{i}_shank", "0 0 -0.15", "0 1 0", speed
            ),
            _joint(f"leg{i}_sole", "fixed", f"leg{i}_shank", f"leg{i}_foot", "0 0 -0.15", "0 0 1", speed),
        ]
    parts += [
        _link("tray", 0.2),
        '<link name="tray_tip"/>',
        _joint("tray_joint", tray, "base", "tray", "0 0 0.08", "0 0 1", speed),
        _joint("tray_end", "fixed", "tray", "tray_tip", "0.5 0 0", "0 0 1", speed),
        "</robot>",
    ]
    return "\n".join(parts)


def blend(x: float) -> float:
    """0 to 1 with velocity and acceleration zero at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def base_path(t: float) -> np.ndarray:
    """The body moves back and away from leg 1, then returns, turning a little."""
    away = blend(t / 0.4) - blend((t - 0.8) / 0.4)
    turned = blend((t - 0.8) / 0.4)
    return np.array([-0.07 * away, -0.05 * away, HEIGHT + 0.01 * turned, 0.1 * turned])


def foot_path(t: float) -> np.ndarray:
    """Leg 1's foot steps ahead between 0.4 and 0.8 s."""
    done = blend((t - 0.4) / 0.4)
    return np.array([CORNERS[0][0] + 0.03 * done, CORNERS[0][1], 16 * 0.03 * done**2 * (1 - done) ** 2])


def phases(edges: tuple[float, ...] = (0.0, 0.4, 0.8, 1.2, 1.4)) -> list[dict[str, Any]]:
    def phase(index: int, name: str, feet: tuple[str, ...], **more: Any) -> dict[str, Any]:
        return {
            "name": name,
            "start": edges[index],
            "end": edges[index + 1],
            "contacts": [{"frame": foot, "friction": 0.7} for foot in feet],
            "margin": 0.01,
            "closures": [],
            "carried": [],
            "tasks": [{"name": "base", "hard": False, "position": 1e-6, "orientation": None}],
            **more,
        }

    box = {"name": "box", "frame": "tray", "pose": list(BOX_IN_TRAY), "mass": 0.8, "com": [0.0, 0.01, 0.0]}
    loop = {"frame_a": "base", "frame_b": "tray_tip"}
    return [
        phase(0, "shift", FEET),
        phase(1, "swing", FEET[1:]),
        phase(2, "carry", FEET, carried=[box], closures=[loop]),
        phase(3, "rest", FEET),
    ]


def _solve(model: Any, q: np.ndarray, feet: np.ndarray, ids: list[int]) -> np.ndarray:
    """Newton's method for the twelve leg joints; the base and the tray stay."""
    data = model.createData()
    legs = [model.joints[i].idx_v for i in range(2, model.njoints) if "leg" in model.names[i]]
    for _ in range(20):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        error = (feet - [data.oMf[i].translation for i in ids]).ravel()
        if np.abs(error).max() < 1e-13:
            break
        jacobian = np.vstack(
            [pin.getFrameJacobian(model, data, i, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3] for i in ids]
        )
        step = np.zeros(model.nv)
        step[legs] = np.linalg.solve(jacobian[:, legs], error)
        q = pin.integrate(model, q, step)
    return q


def build(
    *,
    base: Path = base_path,
    foot: Path = foot_path,
    tray: Callable[[float], float] = lambda t: 0.0,
    promises: list[dict[str, Any]] | None = None,
    robot: str | None = None,
    **plan: Any,
) -> Bundle:
    """A plan whose records all follow from its motion and its phases.

    Args:
        base: time -> x, y, z, yaw of the body.
        foot: time -> leg 1's foot.
        tray: time -> angle of the tray's joint.
        promises: the phases.
        robot: URDF.
        plan: more entries of plan.json.
    """
    promises = phases() if promises is None else promises
    robot = urdf() if robot is None else robot
    model = pin.buildModelFromXML(robot, pin.JointModelFreeFlyer())
    ids = [model.getFrameId(name) for name in FEET]
    time = np.arange(round(promises[-1]["end"] / DT) + 1) * DT
    q = np.empty((len(time), model.nq))
    guess = pin.neutral(model)
    for i in range(1, 5):
        guess[model.joints[model.getJointId(f"leg{i}_joint2")].idx_q] = 0.75
        guess[model.joints[model.getJointId(f"leg{i}_joint3")].idx_q] = -1.5
    for k, t in enumerate(time):
        x, y, z, yaw = base(t)
        guess[:7] = x, y, z, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)
        _set_angle(model, guess, "tray_joint", tray(t))
        feet = np.array([foot(t), *[(*corner, 0.0) for corner in CORNERS[1:]]])
        q[k] = guess = _solve(model, guess.copy(), feet, ids)
    return assemble(model, robot, time, q, promises, plan)


def _set_angle(model: Any, q: np.ndarray, name: str, angle: float) -> None:
    joint = model.joints[model.getJointId(name)]
    q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]


def assemble(
    model: Any,
    robot: str,
    time: np.ndarray,
    q: np.ndarray,
    promises: list[dict[str, Any]],
    plan: dict[str, Any],
) -> Bundle:
    """Everything that is recorded beside q."""
    v = np.zeros((len(time), model.nv))
    for k in range(len(time) - 1):
        v[k] = pin.difference(model, q[k], q[k + 1]) / (time[k + 1] - time[k])
    starts = np.array([phase["start"] for phase in promises])
    phase_of = np.searchsorted(starts, time + 1e-9, side="right") - 1
    com, margin, box = np.empty((len(time), 3)), np.full(len(time), np.nan), np.empty((len(time), 7))
    data, anchors = model.createData(), {}
    for k, i in enumerate(phase_of):
        pin.framesForwardKinematics(model, data, q[k])
        phase = promises[i]
        masses, points = [pin.computeTotalMass(model)], [pin.centerOfMass(model, data, q[k]).copy()]
        for item in phase["carried"]:
            held = data.oMf[model.getFrameId(item["frame"])] * pin.XYZQUATToSE3(np.array(item["pose"]))
            masses.append(item["mass"])
            points.append(held.act(np.array(item["com"])))
            box[k] = pin.SE3ToXYZQUAT(held)
        com[k] = np.average(points, axis=0, weights=masses)
        feet = [data.oMf[model.getFrameId(c["frame"])].translation[:2].copy() for c in phase["contacts"]]
        if i not in anchors and len(np.unique(feet, axis=0)) > 2:
            anchors[i] = support_polygon(phase.get("region", feet))
        if i in anchors:
            margin[k] = anchors[i].margin(com[k, :2])
    carried = np.flatnonzero([bool(promises[i]["carried"]) for i in phase_of])
    if len(carried):  # before it is taken the box is where it will be, and after it where it was left
        box[: carried[0]] = box[carried[0]]
        item, last = promises[phase_of[carried[-1]]]["carried"][0], carried[-1] + 1
        pin.framesForwardKinematics(model, data, q[last])
        held = data.oMf[model.getFrameId(item["frame"])] * pin.XYZQUATToSE3(np.array(item["pose"]))
        box[last:] = pin.SE3ToXYZQUAT(held)
    target = np.tile([0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0, 1.0], (len(time), 1))
    target[:5] = np.nan
    error = 1e-4 * np.abs(np.sin(3.0 * time)) + 1e-7
    error[:5] = np.nan
    content = {
        "schema": 1,
        "wbplan": "0.1.0",
        "task": "step",
        "robot": "quad",
        "backend": "proxqp",
        "dt": DT,
        "parameters": {},
        "bodies": [{"name": "box", "size": [0.1, 0.1, 0.06], "mass": 0.8}],
        "phases": promises,
        "report": {"seconds_planning": 0.1, "seconds_motion": float(time[-1]), "ticks": len(time) - 1},
        **plan,
    }
    trajectory = Trajectory(
        time=time,
        q=q,
        v=v,
        phase=phase_of,
        com=com,
        margin=margin,
        joint_names=tuple(model.names)[2:],
        bodies={"box": box} if len(carried) else {},
        targets={"base": target},
        errors={"base.position": error, "base.orientation": 3.0 * error},
    )
    return Bundle(content, trajectory, robot)


def edited(bundle: Bundle, **arrays: Any) -> Bundle:
    """The same bundle with arrays of its trajectory replaced, and nothing recomputed."""
    return replace(bundle, trajectory=replace(bundle.trajectory, **arrays))


def planned(bundle: Bundle, **entries: Any) -> Bundle:
    """The same bundle with entries of plan.json replaced, and nothing recomputed."""
    return replace(bundle, plan={**copy.deepcopy(dict(bundle.plan)), **entries})


def changed(array: np.ndarray, index: Any, value: Any) -> np.ndarray:
    """A copy of an array with one element replaced."""
    array = np.array(array)
    array[index] = value
    return array
