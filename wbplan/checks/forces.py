"""Promises about forces: those recorded carry the motion, within friction, and within what the servos give.

Newton and Euler by the momentum of the whole robot, differenced over a tenth of a second; torques by the mass
matrix. A plan records forces as a proof that there are some: here it is gone through.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.checks.replay import Array, Poses, Replay, Window
from wbplan.checks.report import Row, Tolerances, Worst

HALF = 0.05  #: [s]; accelerations are second differences over twice of it
BALANCE = 0.01  #: share of the weight; two ways of differencing the same motion differ by less
AGREE = 1e-3  #: share of a joint's effort


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Balance, friction use, torque use, `torque` as recorded, and clamps."""
    del bounds
    carry, friction = Worst("forces carry the motion", "of the weight"), Worst("friction use", "", slack=1e-4)
    servo, record = Worst("torque use", "", slack=1e-3), Worst("torque agrees with q", "of the effort")
    grip = Worst("grip friction use", "", slack=1e-3)
    for window in replay.windows:
        promises = window.promises
        samples = window.samples[replay.record.phase[window.samples] == window.index]
        times = replay.times(samples)
        if not len(samples) or not {"friction_use", "torque_use"} & set(promises):
            continue
        forces = _recorded(replay, window, samples)
        model = _loaded(replay, window)
        off = _imbalance(replay, window, model, samples, forces)
        carry.see(off, BALANCE, times, window.name, [", ".join(window.feet)])
        if "friction_use" in promises:
            friction.see(_friction(window, forces), promises["friction_use"], times, window.name, window.feet)
        if "torque_use" in promises:
            own = _torques(replay, window, model, samples, forces)
            most = np.asarray(model.effortLimit[6:], dtype=np.float64)
            most = np.where(np.isfinite(most) & (most > 0.0), most, np.inf)
            names = replay.record.joint_names
            servo.see(np.abs(own) / most, promises["torque_use"], times, window.name, names)
            told = replay.record.torque
            gap = np.full(own.shape, np.nan) if told is None else np.abs(told[samples] - own) / most
            record.see(gap, AGREE, times, window.name, names)
        for item in promises["carried"]:
            if "squeeze" in item:
                use = _grip(replay, window, item, samples)
                where = [f"{item['frame']}, {item['name']}", f"{item['grip']}, {item['name']}"]
                grip.see(use, 1.0, times, window.name, where)
    found = (carry, friction, servo, record, grip)
    return [row for worst in found for row in worst.rows()]


def _recorded(replay: Replay, window: Window, samples: NDArray[np.int64]) -> dict[str, Array]:
    """Forces (K, 3) [N] on the robot from outside, by frame; nan where not recorded, pushes as promised."""
    missing = np.full((len(samples), 3), np.nan)
    known = replay.record.forces
    found = {foot: known[foot][samples] if foot in known else missing for foot in window.feet}
    for push in window.promises.get("pushes", ()):
        back = -np.array(push["force"], dtype=np.float64)
        found[push["frame"]] = found.get(push["frame"], np.zeros((len(samples), 3))) + back
    return found


def _friction(window: Window, forces: Mapping[str, Array]) -> Array:
    """(K, C) |f_t| / (friction f_n); infinite for a foot that pulls."""
    use = []
    pushed = {push["frame"]: -np.array(push["force"]) for push in window.promises.get("pushes", ())}
    for contact, normal in zip(window.promises["contacts"], window.normals, strict=True):
        force = forces[contact["frame"]] - pushed.get(contact["frame"], np.zeros(3))
        along = force @ normal
        across = np.linalg.norm(force - along[:, None] * normal, axis=1)
        share = np.where(along > 0.0, across / (contact["friction"] * along), np.inf)
        use.append(np.where(np.linalg.norm(force, axis=1) < 1e-6, 0.0, share))
    return np.column_stack(use)


def _loaded(replay: Replay, window: Window) -> Any:
    """The robot with the objects that it carries."""
    model = pin.Model(replay.model)
    sizes = {body["name"]: body["size"] for body in replay.plan.get("bodies", ())}
    for item in window.promises["carried"]:
        frame = model.frames[model.getFrameId(item["frame"])]
        mass, size = float(item["mass"]), sizes.get(item["name"], (0.0, 0.0, 0.0))
        if mass <= 0.0:
            continue
        inertia = pin.Inertia.FromBox(mass, *(float(x) for x in size))
        inertia.lever = np.array(item.get("com", (0.0, 0.0, 0.0)), dtype=np.float64)
        pose = pin.XYZQUATToSE3(np.array(item["pose"], dtype=np.float64))
        model.appendBodyToJoint(frame.parentJoint, inertia, frame.placement * pose)
    return model


def _imbalance(
    replay: Replay, window: Window, model: Any, samples: NDArray[np.int64], forces: Mapping[str, Array]
) -> Array:
    """(K,) |change of momentum - forces| over the weight; moments over the stance's extent."""
    q, data = _unit(replay.record.q), model.createData()
    m, h, last = _stencil(replay)
    mass = float(pin.computeTotalMass(model))
    gravity = np.array(model.gravity.linear)
    change = np.zeros((len(samples), 6))
    com = np.zeros((len(samples), 3))
    for row, k in enumerate(samples):
        momenta = []
        for a, b in ((k, min(k + m, last)), (max(k - m, 0), k)):
            between = pin.interpolate(model, q[a], q[b], 0.5)
            pin.computeCentroidalMomentum(model, data, between, pin.difference(model, q[a], q[b]) / h)
            linear, angular = np.array(data.hg.linear), np.array(data.hg.angular)
            momenta.append(np.concatenate([linear, angular + np.cross(data.com[0], linear)]))
        change[row] = (momenta[0] - momenta[1]) / h
        com[row] = pin.centerOfMass(model, data, q[k])
    given = np.hstack([np.tile(mass * gravity, (len(samples), 1)), np.cross(com, mass * gravity)])
    places = []
    for frame, force in forces.items():
        place = replay.frames[frame].position[samples]
        places.append(place[0])
        given += np.hstack([force, np.cross(place, force)])
    # Moments about the CoM, so that where the world's origin is does not matter.
    off = change - given
    off[:, 3:] -= np.cross(com, off[:, :3])
    extent = max(float(np.ptp(places, axis=0).max()), 1e-2)
    weight = mass * float(np.linalg.norm(gravity))
    worse: Array = np.maximum(np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:], axis=1) / extent)
    return worse / weight


def _torques(
    replay: Replay, window: Window, model: Any, samples: NDArray[np.int64], forces: Mapping[str, Array]
) -> Array:
    """(K, J) M a + (Coriolis, gravity) - J' f, with what clamps press."""
    q, data = _unit(replay.record.q), model.createData()
    m, h, last = _stencil(replay)
    clamps = [item for item in window.promises["carried"] if "squeeze" in item]
    torque = np.zeros((len(samples), model.nv - 6))
    for row, k in enumerate(samples):
        ahead = pin.difference(model, q[k], q[min(k + m, last)])
        behind = pin.difference(model, q[k], q[max(k - m, 0)])
        inertia = pin.crba(model, data, q[k])
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        total = inertia @ ((ahead + behind) / h**2)
        total += pin.nonLinearEffects(model, data, q[k], (ahead - behind) / (2.0 * h))
        pin.computeJointJacobians(model, data, q[k])
        pin.updateFramePlacements(model, data)
        for frame, force in forces.items():
            total -= _lever(model, data, frame, np.concatenate([force[row], np.zeros(3)]))
        for item in clamps:
            wrench = _second(replay, item, k)
            arm = data.oMf[model.getFrameId(item["grip"])].translation
            arm = arm - data.oMf[model.getFrameId(item["frame"])].translation
            back = -wrench
            back[3:] += np.cross(arm, back[:3])
            total -= _lever(model, data, item["grip"], wrench) + _lever(model, data, item["frame"], back)
        torque[row] = total[6:]
    return torque


def _lever(model: Any, data: Any, frame: str, wrench: Array) -> Array:
    J = pin.getFrameJacobian(model, data, model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED)
    made: Array = J.T @ wrench
    return made


def _second(replay: Replay, item: Mapping[str, Any], sample: Any) -> Array:
    """Force and moment on the second finger of a clamp, world; nan where not recorded."""
    record, frame = replay.record, item["grip"]
    if frame not in record.forces or frame not in record.moments:
        return np.full((*np.shape(sample), 6), np.nan)
    return np.concatenate([record.forces[frame][sample], record.moments[frame][sample]], axis=-1)


def _grip(replay: Replay, window: Window, item: Mapping[str, Any], samples: NDArray[np.int64]) -> Array:
    """(K, 2) sqrt(|f_t|^2 + (t / patch)^2) / (friction f_n) of both fingers, about the line between."""
    m, h, last = _stencil(replay)
    pose = replay.held_pose(item, np.arange(last + 1))
    lever = np.array(item.get("com", (0.0, 0.0, 0.0)), dtype=np.float64)
    size = next(b["size"] for b in replay.plan["bodies"] if b["name"] == item["name"])
    inertia = np.diag(np.sum(np.square(size)) - np.square(size)) * float(item["mass"]) / 12.0
    center = pose.act(lever)
    ahead, behind = np.minimum(samples + m, last), np.maximum(samples - m, 0)
    gravity = np.array(replay.model.gravity.linear)
    need = item["mass"] * ((center[ahead] - 2.0 * center[samples] + center[behind]) / h**2 - gravity)
    spin = (_spin(pose, inertia, samples, ahead, h) - _spin(pose, inertia, behind, samples, h)) / h
    first, second = (replay.frames[item[key]].position[samples] for key in ("frame", "grip"))
    on_finger = _second(replay, item, samples)
    force2, twist2 = -on_finger[:, :3], -on_finger[:, 3:]
    force1 = need - force2
    moment = spin + np.cross(center[samples] - first, need)  # about the first finger
    twist1 = moment - np.cross(second - first, force2) - twist2
    line = second - first
    line /= np.linalg.norm(line, axis=1)[:, None]
    uses = []
    for force, twist, normal in ((force1, twist1, line), (force2, twist2, -line)):
        along = np.sum(force * normal, axis=1)
        across = np.linalg.norm(force - along[:, None] * normal, axis=1)
        held = np.hypot(across, np.linalg.norm(twist, axis=1) / item["patch"])
        uses.append(np.where(along > 0.0, held / (item["friction"] * along), np.inf))
    return np.column_stack(uses)


def _spin(pose: Poses, inertia: Array, a: Any, b: Any, h: float) -> Array:
    """(K, 3) angular momentum about its CoM of a body that turns from one sample to another."""
    made = np.zeros((len(a), 3))
    for row, (i, j) in enumerate(zip(a, b, strict=True)):
        turn = pin.log3(pose.rotation[i].T @ pose.rotation[j])
        made[row] = pose.rotation[i] @ pin.exp3(0.5 * turn) @ inertia @ turn / h
    return made


def _stencil(replay: Replay) -> tuple[int, float, int]:
    """Samples and seconds of half a tenth of a second, and the last sample."""
    dt = float(replay.plan["dt"])
    m = max(1, round(HALF / dt))
    return m, m * dt, len(replay.record) - 1


def _unit(q: Array) -> Array:
    out = np.array(q, dtype=np.float64)
    out[:, 3:7] /= np.linalg.norm(out[:, 3:7], axis=1)[:, None]
    return out
