"""What the servos are told and what is expected to touch what, sample by sample, from a bundle alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle import Bundle
from wbplan.errors import PhysicsError
from wbplan.physics.options import Options
from wbplan.physics.statics import faded, holding_torques, pressing_torques

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s^2], as in Pinocchio
START = 1e-9
EVERY = 0.05  #: [s]


@final
@dataclass(frozen=True, eq=False)
class Span:
    """A stretch of time in which an object is carried without a break.

    Attributes:
        name: of the object.
        start: [s].
        end: [s].
        pads: the frames that press on it; one where it is not clamped.
        friction: of the pads, where the plan says it.
        holder: the frame that the plan fastens it to.
        squeeze: force of each pad [N], where the plan says it.
        fingers: the plan names the pads.
    """

    name: str
    start: float
    end: float
    pads: tuple[str, ...]
    friction: float | None
    holder: str
    squeeze: float | None = None
    fingers: bool = False


@final
@dataclass(frozen=True, eq=False)
class Pressing:
    """A stretch of time in which a frame pushes on what is around, without a break.

    Attributes:
        frame: its name.
        force: (3,) [N], world, of the robot.
        start: [s].
        end: [s].
    """

    frame: str
    force: Array
    start: float
    end: float


@final
@dataclass(frozen=True, eq=False)
class Motion:
    """The plan as the simulator needs it; N samples, J joints in Pinocchio's order, C feet.

    Attributes:
        time: (N,) [s], from 0.
        base: (N, 7) x y z qx qy qz qw, planned.
        joints: (N, J) planned [rad, m].
        offsets: (N, J) what is added to `joints` for the servos, so that the pads press.
        names: the joints.
        feet: the frames that are ever in contact.
        places: (N, C, 3) [m], the planned places of `feet`.
        touching: (N, C), the contact schedule.
        friction: (N, C), 0 where not touching.
        normals: (N, C, 3), world.
        phase: (N,) and `phases`: their names.
        spans: when objects are carried.
        squeeze: force [N] of each pad, by object.
        pushing: frames that ever push on what is around.
        objects: name -> (N, 7) planned poses.
        margin: (N,) [m], planned.
    """

    time: Array
    base: Array
    joints: Array
    offsets: Array
    names: tuple[str, ...]
    feet: tuple[str, ...]
    places: Array
    touching: NDArray[np.bool_]
    friction: Array
    normals: Array
    phase: NDArray[np.int64]
    phases: tuple[str, ...]
    spans: tuple[Span, ...]
    squeeze: Mapping[str, float]
    pushing: tuple[str, ...]
    objects: Mapping[str, Array]
    margin: Array

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.time[-1])

    def sample(self, t: float) -> int:
        """The last sample not after `t` [s]."""
        found = int(self.time.searchsorted(t + START, side="right")) - 1
        return min(max(found, 0), len(self.time) - 1)


def motion_of(bundle: Bundle, options: Options) -> Motion:
    """Reads a bundle for the simulator.

    Raises:
        PhysicsError: a joint of a kind that has no servo, an object that stands nowhere, or no contacts.
    """
    record, model = bundle.trajectory, bundle.model
    time = record.time - record.time[0]
    feet = tuple(dict.fromkeys(c["frame"] for phase in bundle.phases for c in phase["contacts"]))
    if not feet:
        raise PhysicsError("plan.json: no phase has a contact; nothing would hold the robot up")
    frames = [model.getFrameId(foot) for foot in feet]
    places = np.empty((len(time), len(feet), 3))
    data = model.createData()
    for k, q in enumerate(record.q):
        pin.forwardKinematics(model, data, q)
        for i, frame in enumerate(frames):
            places[k, i] = pin.updateFramePlacement(model, data, frame).translation
    touching = np.zeros((len(time), len(feet)), dtype=bool)
    friction, normals = np.zeros(touching.shape), np.zeros((*touching.shape, 3))
    normals[:] = (0.0, 0.0, 1.0)
    for number, phase in enumerate(bundle.phases):
        now = record.phase == number
        for contact in phase["contacts"]:
            i = feet.index(contact["frame"])
            touching[now, i] = True
            friction[now, i] = contact["friction"]
            normals[now, i] = contact.get("normal") or (0.0, 0.0, 1.0)
    spans = _spans(bundle)
    held = {name: poses for name, poses in record.bodies.items() if np.isfinite(poses[0]).all()}
    for span in spans:
        if span.name not in held:
            raise PhysicsError(
                f"trajectory.npz: object '{span.name}' has no pose at the start; give its Body a pose"
            )
    joints = joint_values(model, record.q)
    squeeze = {span.name: _squeeze(bundle, span, friction, options) for span in spans}
    offsets = _offsets(bundle, spans, squeeze, options)
    return Motion(
        time=time, base=np.array(record.q[:, :7]), joints=joints, offsets=offsets,
        names=tuple(record.joint_names), feet=feet, places=places, touching=touching, friction=friction,
        normals=normals, phase=np.asarray(record.phase), phases=tuple(p["name"] for p in bundle.phases),
        spans=spans, squeeze=squeeze, pushing=tuple(dict.fromkeys(p.frame for p in _pressings(bundle))),
        objects=held, margin=np.asarray(record.margin),
    )  # fmt: skip


def joint_values(model: Any, q: Array) -> Array:
    """(N, J) positions of the joints behind the free flyer; a joint without limits counts its turns.

    Raises:
        PhysicsError: a joint with more than one axis.
    """
    columns = []
    for name, joint in zip(list(model.names)[2:], list(model.joints)[2:], strict=True):
        if joint.nv != 1:
            raise PhysicsError(f"robot.urdf: joint '{name}' has {joint.nv} axes; a servo drives one")
        own = q[:, joint.idx_q : joint.idx_q + joint.nq]
        columns.append(own[:, 0] if joint.nq == 1 else np.unwrap(np.arctan2(own[:, 1], own[:, 0])))
    return np.column_stack(columns) if columns else np.zeros((len(q), 0))


def _spans(bundle: Bundle) -> tuple[Span, ...]:
    """Phases that carry an object, one after the other, are one span."""
    spans: list[Span] = []
    origin = float(bundle.trajectory.time[0])
    for phase in bundle.phases:
        for item in phase["carried"]:
            ends = [(c["frame_a"], c["frame_b"]) for c in phase["closures"]]
            around = [pair for pair in ends if item["frame"] in pair]
            closed = dict.fromkeys([item["frame"], *(name for pair in around for name in pair)])
            pads = tuple(item.get("pads") or closed)
            start, end = float(phase["start"]) - origin, float(phase["end"]) - origin
            last = next((s for s in reversed(spans) if s.name == item["name"]), None)
            if last is not None and abs(last.end - start) < 1e-6 and set(last.pads) == set(pads):
                spans[spans.index(last)] = replace(last, end=end)
            else:
                friction, squeeze = item.get("friction"), item.get("squeeze", item.get("press"))
                fingers = bool(item.get("pads"))
                held = Span(item["name"], start, end, pads, friction, item["frame"], squeeze, fingers)
                spans.append(held)
    return tuple(spans)


def _pressings(bundle: Bundle) -> tuple[Pressing, ...]:
    """Phases that push alike, one after the other, push without a break."""
    found: list[Pressing] = []
    origin = float(bundle.trajectory.time[0])
    for phase in bundle.phases:
        for item in phase.get("pushes", ()):
            force = np.array(item["force"], dtype=np.float64)
            start, end = float(phase["start"]) - origin, float(phase["end"]) - origin
            last = next((p for p in reversed(found) if p.frame == item["frame"]), None)
            if last is not None and abs(last.end - start) < 1e-6 and np.array_equal(last.force, force):
                found[found.index(last)] = replace(last, end=end)
            else:
                found.append(Pressing(item["frame"], force, start, end))
    return tuple(found)


def grip_of(span: Span, friction: Array, options: Options) -> float:
    """Friction between an object and the pads that hold it."""
    if options.grip is not None:
        return options.grip
    return float(span.friction if span.friction is not None else friction.max())


def _squeeze(bundle: Bundle, span: Span, friction: Array, options: Options) -> float:
    """What the plan says; else `safety` times what holds a weight by friction alone: n mu F >= m g."""
    if len(span.pads) < 2 or options.weld:
        return 0.0
    if options.squeeze is not None:
        return options.squeeze
    if span.squeeze is not None:
        return span.squeeze
    grip = grip_of(span, friction, options)
    if grip <= 0.0:
        return 0.0
    return float(options.safety * _mass(bundle, span) * GRAVITY / (len(span.pads) * grip))


def _offsets(
    bundle: Bundle, spans: tuple[Span, ...], squeeze: Mapping[str, float], options: Options
) -> Array:
    """(N, J) torque / kp: what the servos need to press the pads, and to hold the robot where it is planned.

    Computed every `EVERY` seconds and at every change of phase, and joined by straight lines.
    """
    model, record = bundle.model, bundle.trajectory
    time = record.time - record.time[0]
    kept = np.floor(time / EVERY + 1e-6)
    edge = np.diff(record.phase, prepend=record.phase[:1]) != 0
    chosen = np.flatnonzero((np.diff(kept, prepend=-1.0) > 0) | edge | np.append(edge[1:], True))
    effort = np.asarray(model.effortLimit[6:], dtype=np.float64)
    if not (np.isfinite(effort) & (effort > 0.0)).all():
        weak = bundle.trajectory.joint_names[int(np.argmin(np.isfinite(effort) & (effort > 0.0)))]
        raise PhysicsError(
            f"robot.urdf: joint '{weak}': <limit effort> has to be above 0 for a servo to hold it"
        )
    torques = np.zeros((len(chosen), len(effort)))
    for row, k in enumerate(chosen):
        phase = bundle.phases[int(record.phase[k])]
        loads = [load for span in spans for load in _pad_loads(bundle, span, squeeze[span.name], k, options)]
        loads += [
            (model.getFrameId(p.frame), -_risen(float(time[k]), p, options.ramp) * p.force)
            for p in _pressings(bundle)
        ]
        feet = [model.getFrameId(c["frame"]) for c in phase["contacts"]]
        friction = options.reserve * np.array([c["friction"] for c in phase["contacts"]])
        if options.lead:
            torques[row] = holding_torques(model, record.q[k], feet, friction, loads, effort)
        else:
            pressing = [(frame, force * [1.0, 1.0, 0.0]) for frame, force in loads]
            torques[row] = pressing_torques(model, record.q[k], pressing)
    full = np.column_stack([np.interp(time, time[chosen], column) for column in torques.T])
    offsets: Array = faded(full, time) / _gains(model, options)
    return offsets


def _risen(t: float, pressing: Pressing, ramp: float) -> float:
    """Share of a push: it rises from its start on, and is gone at its end."""
    ramp = min(ramp, 0.5 * (pressing.end - pressing.start))
    knots = [pressing.start, pressing.start + ramp, pressing.end - ramp, pressing.end]
    share = float(np.interp(t, knots, [0.0, 1.0, 1.0, 0.0]))
    return share * share * (3.0 - 2.0 * share)


def _pad_loads(bundle: Bundle, span: Span, force: float, k: int, options: Options) -> list[tuple[int, Array]]:
    """Pads' frames, and what acts on the robot there: the object's weight, shared, and the squeeze."""
    model, record = bundle.model, bundle.trajectory
    t = float(record.time[k] - record.time[0])
    knots = [span.start - options.ramp, span.start, span.end, span.end + options.ramp]
    share = float(np.interp(t, knots, [0.0, 1.0, 1.0, 0.0]))
    if share <= 0.0:
        return []
    data = model.createData()
    pin.forwardKinematics(model, data, record.q[k])
    frames = [model.getFrameId(pad) for pad in span.pads]
    points = [np.array(pin.updateFramePlacement(model, data, frame).translation) for frame in frames]
    middle = np.mean(points, axis=0)
    weight = np.array([0.0, 0.0, -_mass(bundle, span) * GRAVITY / len(frames)])
    loads = []
    for frame, point in zip(frames, points, strict=True):
        outward = (point - middle) / max(float(np.linalg.norm(point - middle)), 1e-9)
        carried = weight if span.start <= t <= span.end else np.zeros(3)
        loads.append((frame, share * share * (3.0 - 2.0 * share) * force * outward + carried))
    return loads


def _mass(bundle: Bundle, span: Span) -> float:
    return next(float(i["mass"]) for p in bundle.phases for i in p["carried"] if i["name"] == span.name)


def _gains(model: Any, options: Options) -> Array:
    """(J,) stiffness of the servos [N m/rad, N/m]."""
    at = []
    for joint in list(model.joints)[2:]:
        sliding = joint.shortname().startswith("JointModelP")
        at.append(options.servo.travel if sliding else options.servo.error)
    gains: Array = np.asarray(model.effortLimit[6:], dtype=np.float64) / np.array(at)
    return gains
