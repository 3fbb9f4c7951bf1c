"""The squeeze of the clamps of a plan, and what it asks of the limbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SolveError
from wbplan.problem.bodies import Grip, Held
from wbplan.problem.script import Phase
from wbplan.statics.grip import Squeeze, box_normal, force_closure, smallest_squeeze

Array = NDArray[np.float64]
Motion = tuple[Phase, Any, tuple[Held, ...], Array, Array, Array]


@final
@dataclass(frozen=True, eq=False)
class Clamp:
    """A clamp over the K samples of one phase.

    Attributes:
        name: of the object.
        holder, other: the two frames that press.
        grip: as specified.
        squeeze: [N] planned; needed: [N] the smallest one, over the whole time that it is carried; zheng: [N]
            what equation 1 asks for.
        force, moment: (K, 3) [N], [N m], world, of the other finger on the object, at its frame.
        holder_frame, other_frame: numbers.
        arm: (K, 3) [m], world, from the holder's origin to the other's.
    """

    name: str
    holder: str
    other: str
    grip: Grip
    squeeze: float
    needed: float
    zheng: float
    force: Array
    moment: Array
    holder_frame: int
    other_frame: int
    arm: Array

    def to_record(self) -> dict[str, float | str]:
        """What plan.json says of it, with the object."""
        return {
            "grip": self.other,
            "friction": self.grip.friction,
            "patch": self.grip.patch,
            "squeeze": self.squeeze,
            "squeeze_needed": self.needed,
            "squeeze_zheng": self.zheng,
        }

    def loads(self) -> list[tuple[int, Array]]:
        """Frames, and wrenches (K, 6) on the robot there: the object hangs on the holder in the model."""
        back = np.hstack([self.force, self.moment + np.cross(self.arm, self.force)])
        return [(self.holder_frame, back), (self.other_frame, -np.hstack([self.force, self.moment]))]


@dataclass(frozen=True, eq=False)
class _Asked:
    """One clamped object in one phase: what it needs, and what torques it costs, plain and per newton."""

    phase: str
    held: Held
    grip: Grip
    frames: tuple[int, int]
    squeeze: Squeeze
    arm: Array
    torque: Array
    per_newton: Array
    names: tuple[str, ...]
    most: Array


def clamps_of(motions: Sequence[Motion]) -> list[tuple[Clamp, ...]]:
    """The clamps of every phase; a squeeze is one number from taking an object up to putting it down.

    Args:
        motions: of each phase its specification, model, what is held, and q, v, a at its samples.

    Raises:
        SolveError: the fingers do not close on an object, or the servos cannot squeeze enough.
    """
    asked = [
        [_ask(phase, model, q, v, a, held, held.grip) for held in carried if held.grip is not None]
        for phase, model, carried, q, v, a in motions
    ]
    found: list[tuple[Clamp, ...]] = [() for _ in motions]
    for first, items in enumerate(asked):
        for item in items:
            if any(_same(item, old) for old in (asked[first - 1] if first else [])):
                continue  # goes on from the phase before
            span = [(first, item)]
            for later in range(first + 1, len(asked)):
                more = [other for other in asked[later] if _same(item, other)]
                if not more:
                    break
                span.append((later, more[0]))
            needed = max(float(one.squeeze.need.max()) for _, one in span)
            zheng = max(float(one.squeeze.zheng.max()) for _, one in span)
            for k, one in span:
                _strong_enough(one, needed)
                found[k] = (*found[k], _clamp(one, needed, zheng))
    return found


def _same(a: _Asked, b: _Asked) -> bool:
    return (a.held.body.name, a.held.holder, a.grip) == (b.held.body.name, b.held.holder, b.grip)


def _clamp(one: _Asked, needed: float, zheng: float) -> Clamp:
    squeeze = one.grip.safety * needed
    return Clamp(
        one.held.body.name, one.held.holder, one.grip.by, one.grip, squeeze, needed, zheng,
        one.squeeze.second(squeeze), one.squeeze.torsion[:, None] * one.squeeze.line, *one.frames, one.arm,
    )  # fmt: skip


def _ask(phase: Phase, model: Any, q: Array, v: Array, a: Array, held: Held, grip: Grip) -> _Asked:
    """What a clamped object needs over one phase."""
    data, count = model.createData(), len(q)
    one, two = model.getFrameId(held.holder), model.getFrameId(grip.by)
    p1, p2, force, moment = np.zeros((4, count, 3))
    bare, jacobians = np.zeros((count, model.nv)), np.zeros((count, 2, 6, model.nv))
    body = held.body
    inertia = pin.Inertia.FromBox(body.mass, *body.size) if body.mass > 0 else pin.Inertia.Zero()
    gravity = np.array(model.gravity.linear)
    for k in range(count):
        bare[k] = pin.rnea(model, data, q[k], v[k], a[k])
        pin.forwardKinematics(model, data, q[k], v[k], a[k])
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobians(model, data, q[k])
        for side, frame in enumerate((one, two)):
            jacobians[k, side] = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        p1[k], p2[k] = data.oMf[one].translation, data.oMf[two].translation
        pose = data.oMf[held.frame]
        twist = pin.getFrameVelocity(model, data, held.frame, pin.LOCAL_WORLD_ALIGNED)
        change = pin.getFrameClassicalAcceleration(model, data, held.frame, pin.LOCAL_WORLD_ALIGNED)
        lever, w, dw = pose.rotation @ np.array(body.com), twist.angular, change.angular
        force[k] = body.mass * (
            change.linear + np.cross(dw, lever) + np.cross(w, np.cross(w, lever)) - gravity
        )
        about_com = pose.rotation @ inertia.inertia @ pose.rotation.T
        moment[k] = about_com @ dw + np.cross(w, about_com @ w)
        moment[k] += np.cross(pose.translation + lever - p1[k], force[k])
    friction = _friction(phase, held, grip, p1[0], p2[0], model, q[0])
    squeeze = smallest_squeeze(p1, p2, force, moment, friction, grip.patch)
    arm = p2 - p1
    zero, unit = squeeze.second(0.0), -squeeze.line
    twist2 = squeeze.torsion[:, None] * squeeze.line
    torque = bare - _lever(jacobians, zero, twist2, arm)
    joints = sorted({j for f in (one, two) for j in model.supports[model.frames[f].parentJoint] if j > 1})
    chain = [int(model.joints[j].idx_v) for j in joints]
    per_newton = -_lever(jacobians, unit, np.zeros_like(unit), arm)
    return _Asked(
        phase=phase.name,
        held=held,
        grip=grip,
        frames=(one, two),
        squeeze=squeeze,
        arm=arm,
        torque=torque[:, chain],
        per_newton=per_newton[:, chain],
        names=tuple(model.names[j] for j in joints),
        most=np.asarray(model.effortLimit, dtype=np.float64)[chain],
    )


def _lever(jacobians: Array, force: Array, moment: Array, arm: Array) -> Array:
    """(K, nv) generalised forces of the second finger on the object, and of the object on the finger."""
    on_object = np.hstack([force, moment + np.cross(arm, force)])
    on_finger = -np.hstack([force, moment])
    made: Array = np.einsum("ksij,ksi->kj", jacobians, np.stack([on_object, on_finger], axis=1))
    return made


def _friction(phase: Phase, held: Held, grip: Grip, p1: Array, p2: Array, model: Any, q: Array) -> float:
    """Friction along the line through both fingers: less than on the faces, by the angle between."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    pose = data.oMf[held.frame]
    inside = [pose.actInv(p) for p in (p1, p2)]
    n1, n2 = (pose.rotation @ box_normal(p, held.body.size) for p in inside)
    if not force_closure(p1, n1, p2, n2, grip.friction):
        raise SolveError(
            f"phase '{phase.name}': '{held.holder}' and '{grip.by}' do not close on '{held.body.name}': the "
            f"line through them leaves the friction cones ({grip.friction:g}) of the faces that they press on"
        )
    u = (p2 - p1) / np.linalg.norm(p2 - p1)
    off = max(float(np.arccos(np.clip(u @ n1, -1.0, 1.0))), float(np.arccos(np.clip(-u @ n2, -1.0, 1.0))))
    return float(np.tan(np.arctan(grip.friction) - off))


def _strong_enough(one: _Asked, needed: float) -> None:
    """The servos of both limbs give the squeeze beside all else that they hold."""
    wanted = one.grip.safety * needed
    most = np.where(np.isfinite(one.most) & (one.most > 0.0), one.most, np.inf)
    rate = np.where(np.abs(one.per_newton) > 1e-9, one.per_newton, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        room = np.where(rate > 0.0, (most - one.torque) / rate, (-most - one.torque) / rate)
    room = np.where(np.isnan(room), np.inf, room)
    k, j = np.unravel_index(int(room.argmin()), room.shape)
    if not wanted <= room[k, j]:
        gives = max(float(room[k, j]), 0.0)
        raise SolveError(
            f"phase '{one.phase}': the clamp of '{one.held.body.name}' needs a squeeze of {wanted:.1f} N "
            f"({needed:.1f} N times {one.grip.safety:g}), {one.names[int(j)]} gives {gives:.1f} N: "
            f"{wanted - gives:.1f} N are missing"
        )
