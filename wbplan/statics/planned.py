"""The forces of a whole plan: what each contact and joint gives at every sample, and what they spare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SolveError, SpecError
from wbplan.problem.bodies import Held
from wbplan.problem.limits import Forces
from wbplan.problem.script import Phase
from wbplan.statics.clamp import Clamp, clamps_of
from wbplan.statics.cones import friction_use
from wbplan.statics.forces import ForceQP, effort, least_effort, within
from wbplan.statics.motion import Demand, demand, rates
from wbplan.statics.robust import WrenchCone, tilt

Array = NDArray[np.float64]

SIDES = 8  #: of the pyramids
STIFF = 1e4  #: weight of the wrench's residual, per share of the weight squared
MISSING = (
    1e-3  #: share of the weight that may be missing: forces that are off by more do not carry the motion
)


@final
@dataclass(frozen=True, eq=False)
class Stance:
    """A phase as it was planned.

    Attributes:
        phase: its specification.
        model: with what is carried.
        points: (C, 3) [m] of its contacts.
        held: what is carried.
    """

    phase: Phase
    model: Any
    points: Array
    held: tuple[Held, ...] = ()


@final
@dataclass(frozen=True, eq=False)
class Found:
    """The forces of one phase at its K samples.

    Attributes:
        samples: (K,) which of the plan's.
        force: (K, C, 3) [N], world, on the robot.
        torque: (K, J) [N m, N] of the joints.
        missing: (K,) share of the weight that no forces were found for.
        friction: (K, C) share of friction used; servo: (K, J) share of the joints' effort.
        normal: (K, C) [N].
        push: (K,) [N], the largest push on the CoM that the contacts bear in every horizontal direction.
        weight: [N].
        clamps: what clamps the carried objects.
    """

    samples: NDArray[np.int64]
    force: Array
    torque: Array
    missing: Array
    friction: Array
    servo: Array
    normal: Array
    push: Array
    weight: float
    clamps: tuple[Clamp, ...] = ()

    def figures(self) -> dict[str, float]:
        """Worst values: shares, push [N], tilt [deg], lowest normal force [N]."""
        push = float(self.push.min(initial=np.inf))
        return {
            "friction_use": float(self.friction.max(initial=0.0)),
            "torque_use": float(self.servo.max(initial=0.0)),
            "missing": float(self.missing.max(initial=0.0)),
            "push": push,
            "tilt": float(np.degrees(tilt(push, self.weight))),
            "normal": float(self.normal.min(initial=np.inf)),
        }


@final
@dataclass(frozen=True, eq=False)
class PlanForces:
    """All phases' forces on the plan's N samples.

    Attributes:
        phases: one by one.
        forces: frame -> (N, 3) [N], world, on the robot; zero where it does not touch.
        moments: frame of a clamp -> (N, 3) [N m], likewise.
        torque: (N, J) [N m, N].
        push: (N,) [N].
    """

    phases: tuple[Found, ...]
    forces: Mapping[str, Array] = field(default_factory=dict)
    moments: Mapping[str, Array] = field(default_factory=dict)
    torque: Array = field(default_factory=lambda: np.zeros((0, 0)))
    push: Array = field(default_factory=lambda: np.zeros(0))


def plan_forces(stances: Sequence[Stance], q: Array, index: NDArray[np.int64], dt: float) -> PlanForces:
    """Forces at every sample of a plan.

    Args:
        stances: the phases.
        q: (N, nq).
        index: (N,) each sample's phase.
        dt: [s].

    Raises:
        SolveError: a clamp cannot hold its object.
    """
    motions = []
    for number, stance in enumerate(stances):
        samples = np.flatnonzero(index == number)
        motions.append((samples, *rates(stance.model, q, dt, samples)))
    clamps = clamps_of(
        [(s.phase, s.model, s.held, q[k], v, a) for s, (k, v, a) in zip(stances, motions, strict=True)]
    )
    phases = tuple(
        _phase(stance, samples, q[samples], v, a, own)
        for stance, (samples, v, a), own in zip(stances, motions, clamps, strict=True)
    )
    forces: dict[str, Array] = {}
    moments: dict[str, Array] = {}
    torque, push = np.zeros((len(q), stances[0].model.nv - 6)), np.full(len(q), np.nan)
    for stance, found in zip(stances, phases, strict=True):
        torque[found.samples], push[found.samples] = found.torque, found.push
        for i, contact in enumerate(stance.phase.contacts):
            forces.setdefault(contact.frame, np.zeros((len(q), 3)))[found.samples] = found.force[:, i]
        for p in stance.phase.pushes:
            forces.setdefault(p.frame, np.zeros((len(q), 3)))[found.samples] -= p.force
        for clamp in found.clamps:
            forces.setdefault(clamp.other, np.zeros((len(q), 3)))[found.samples] = -clamp.force
            moments.setdefault(clamp.other, np.zeros((len(q), 3)))[found.samples] = -clamp.moment
    return PlanForces(phases, forces, moments, torque, push)


def promised(stance: Stance, found: Found) -> tuple[dict[str, Any], str]:
    """What plan.json says of a phase's forces, and a warning where they promise nothing.

    Raises:
        SolveError: the phase has the limit `Forces`, and they do not keep it.
    """
    phase, bound = stance.phase, stance.phase.forces or Forces()
    if not phase.contacts:
        return {}, ""
    figures = found.figures()
    said: dict[str, Any] = {"forces": figures}
    faults = []
    carried = figures["missing"] <= MISSING
    if not carried:
        at = int(found.missing.argmax())
        short = f"{found.missing[at] * found.weight:.3g} N missing"
        faults.append((at, f"no forces in the friction cones carry the motion, {short}"))
    elif figures["friction_use"] <= bound.friction + 1e-6:
        said["friction_use"] = bound.friction
    else:
        k, i = np.unravel_index(int(found.friction.argmax()), found.friction.shape)
        faults.append((int(k), f"{phase.contacts[i].frame} uses {found.friction[k, i]:.2f} of its friction"))
    if carried and figures["torque_use"] <= bound.torque + 1e-6:
        said["torque_use"] = bound.torque
    elif carried:
        k, j = np.unravel_index(int(found.servo.argmax()), found.servo.shape)
        faults.append(
            (int(k), f"{stance.model.names[2 + int(j)]} uses {found.servo[k, j]:.2f} of its torque")
        )
    if not faults:
        return said, ""
    text = f"phase '{phase.name}': " + "; ".join(f"{what} (sample {found.samples[k]})" for k, what in faults)
    if phase.forces is not None:
        raise SolveError(
            f"{text}; it may use {bound.friction:g} of friction and {bound.torque:g} of torque (Forces)"
        )
    return said, f"{text}; not promised"


def _phase(
    stance: Stance, samples: NDArray[np.int64], q: Array, v: Array, a: Array, clamps: tuple[Clamp, ...]
) -> Found:
    phase, model = stance.phase, stance.model
    feet = [model.getFrameId(c.frame) for c in phase.contacts]
    loads = [load for clamp in clamps for load in clamp.loads()]
    for push in phase.pushes:
        wrench = np.concatenate([-np.array(push.force), np.zeros(3)])
        loads.append((model.getFrameId(push.frame), np.broadcast_to(wrench, (len(q), 6))))
    asked = demand(model, q, v, a, feet, loads)
    most = np.asarray(model.effortLimit[6:], dtype=np.float64)
    normals = np.array([c.normal for c in phase.contacts]).reshape(-1, 3)
    friction = np.array([c.friction for c in phase.contacts])
    bound = phase.forces or Forces()
    force = _distribute(asked, normals, friction * bound.friction, most, bound.torque)
    torque = _torque(asked, force)
    by_foot = force.reshape(len(q), -1, 3)
    return Found(
        samples,
        by_foot,
        torque,
        _missing(asked, force, stance.points),
        friction_use(by_foot, normals, friction),
        _share(torque, most),
        np.sum(by_foot * normals, axis=2),
        _push(stance, normals, friction, asked),
        asked.weight,
        clamps,
    )


def _distribute(asked: Demand, normals: Array, friction: Array, most: Array, torque: float) -> Array:
    """(K, 3 C) forces: by the equations alone; outside the cones by the program; then with torques."""
    if not len(normals):
        return np.zeros((len(asked.torque), 0))
    base = asked.torque[:, :6]
    H, g = effort(asked.joints, asked.torque[:, 6:], most, normals, friction, asked.weight)
    force = least_effort(asked.base, base, H, g)
    program = ForceQP(normals, friction, sides=SIDES)
    stiff = np.full(6, STIFF / asked.weight**2) * H.shape[1]
    for k in np.flatnonzero(~within(force, program.G, program.upper)):
        force[k] = program.solve(asked.base[k], base[k], H[k], g[k], stiff)
    # Only legs can be relieved; what else is over its limit stays so whatever the feet do.
    legs = np.flatnonzero(np.abs(asked.joints).max(axis=(0, 1)) > 1e-9)
    legs = legs[np.isfinite(most[legs]) & (most[legs] > 0.0)]
    over = (_share(_torque(asked, force), most)[:, legs] > torque).any(axis=1)
    if over.any():
        strong = ForceQP(normals, friction, sides=SIDES, joints=len(legs))
        for k in np.flatnonzero(over):
            bias, room = asked.torque[k, 6 + legs] / most[legs], 0.999 * torque
            rows = (asked.joints[k][:, legs] / most[legs]).T
            found = strong.solve(asked.base[k], base[k], H[k], g[k], stiff, (rows, bias - room, bias + room))
            if np.abs(asked.base[k] @ found - base[k]).max() < 0.1 * MISSING * asked.weight:
                force[k] = found
    return force


def _torque(asked: Demand, force: Array) -> Array:
    left: Array = asked.torque[:, 6:] - np.einsum("nij,ni->nj", asked.joints, force)
    return left


def _share(torque: Array, most: Array) -> Array:
    share: Array = np.abs(torque) / np.where(np.isfinite(most) & (most > 0.0), most, np.inf)
    return share


def _missing(asked: Demand, force: Array, points: Array) -> Array:
    """(K,) of the weight, forces; and moments, over the stance's extent."""
    left = asked.torque[:, :6] - np.einsum("nij,nj->ni", asked.base, force)
    extent = max(float(np.ptp(points, axis=0).max()) if len(points) else 0.0, 1e-2)
    size: Array = np.maximum(
        np.linalg.norm(left[:, :3], axis=1), np.linalg.norm(left[:, 3:], axis=1) / extent
    )
    return size / asked.weight


def _push(stance: Stance, normals: Array, friction: Array, asked: Demand) -> Array:
    try:
        return WrenchCone(stance.points, normals, friction).room(asked.wrench, asked.com)
    except SpecError:  # too few contacts to bear a push from everywhere, or some that oppose each other
        return np.full(len(asked.com), np.nan)
