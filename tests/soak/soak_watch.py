"""Every hard promise of a phase, recomputed at each tick from q alone, with Pinocchio and this file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from soak_distances import Distances

import wbplan as wb

CLOSED, TURNED = 1e-4, 1e-3  #: [m], [rad]
ROUNDING = 1e-9
NEARER = 1e-5  #: [m], what two libraries' distances may differ by


class Watch:
    """What a phase promised when it began, against what its ticks do.

    Args:
        region: normals and offsets of a polygon that is not the contacts' hull.
        acceleration: (n,) of every joint, where the phase names none [rad/s^2, m/s^2].
        velocity: (nv,) before the first tick; at rest.
        changed: (nv,) acceleration before the first tick; none.

    Attributes:
        worst: promise -> the largest share of its bound that was used; above 1 it is broken.
    """

    def __init__(
        self, robot: wb.Robot, phase: wb.Phase, q: Any, dt: float, held: dict[str, Any], region: Any = None,
        acceleration: Any = None, velocity: Any = None, changed: Any = None,
    ) -> None:  # fmt: skip
        self.model = pin.buildModelFromXML(robot.urdf_text, pin.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.phase, self.dt, self.held = phase, dt, held
        self.q = np.array(q)
        self.worst: dict[str, float] = {}
        self.low, self.high = self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:]
        share = phase.joint_limits.speed if phase.joint_limits else np.inf
        self.reach = share * self.model.velocityLimit[6:] * dt
        given = {*phase.driven, *(j for limb in robot.roles for js in robot.roles[limb].values() for j in js)}
        for name in given:  # a given motion may use all of the URDF's speed
            k = robot.joint_index(name)[1] - 6
            self.reach[k] = self.model.velocityLimit[6 + k] * dt * 1.001
        self._accelerations(robot, phase, given, acceleration, velocity)
        self._jerks(robot, phase, given, changed)
        self.distances, self.bound = None, 0.0
        if phase.self_collision is not None:
            self.distances, self.bound = Distances(robot, self.model), phase.self_collision.distance
            self.apart = self.distances.at(self.q, self.bound)
        self._place(self.q)
        self.anchors = {c.frame: self._pose(c.frame).translation.copy() for c in phase.contacts}
        self.loops = {pair: self._between(*pair) for pair in phase.closures}
        # The hull of contacts that are in no one plane means nothing; their region is not recomputed here.
        if phase.support is None:
            self.edges = None
        else:
            self.edges = region or _edges(np.array([p[:2] for p in self.anchors.values()]))
        self.before = self._margin()

    def _accelerations(
        self, robot: wb.Robot, phase: wb.Phase, given: set[str], bound: Any, velocity: Any
    ) -> None:
        """(n,) by how much each joint's step may differ from the last; what is given has no bound."""
        self.step = np.zeros(self.model.nv - 6) if velocity is None else np.array(velocity[6:]) * self.dt
        self.change = np.full(self.model.nv - 6, np.inf)
        limits = phase.joint_limits
        if limits is None:
            return
        if bound is not None:
            self.change[:] = np.array(bound) * self.dt**2
        if isinstance(limits.acceleration, Mapping):
            for name, value in limits.acceleration.items():
                self.change[robot.joint_index(name)[1] - 6] = value * self.dt**2
        elif limits.acceleration is not None:
            self.change[:] = limits.acceleration * self.dt**2
        for name in (*given, *phase.locked):
            self.change[robot.joint_index(name)[1] - 6] = np.inf

    def _jerks(self, robot: wb.Robot, phase: wb.Phase, given: set[str], changed: Any) -> None:
        """(n,) by how much each joint's change of step may differ from the last change."""
        self.changed = np.zeros(self.model.nv - 6) if changed is None else np.array(changed[6:]) * self.dt**2
        jerk = phase.joint_limits.jerk if phase.joint_limits else None
        self.twist = np.full(self.model.nv - 6, np.inf if jerk is None else jerk * self.dt**3)
        for name in (*given, *phase.locked):
            self.twist[robot.joint_index(name)[1] - 6] = np.inf

    def _place(self, q: Any) -> None:
        pin.framesForwardKinematics(self.model, self.data, q)
        pin.centerOfMass(self.model, self.data, q)

    def _pose(self, frame: str) -> Any:
        for item in self.phase.carried:
            if item.body.name == frame:
                return self._pose(item.by) * self.held[frame]
        body = self.model.getFrameId(frame, pin.FrameType.BODY)
        return self.data.oMf[body if body < self.model.nframes else self.model.getFrameId(frame)]

    def _between(self, a: str, b: str) -> Any:
        return self._pose(a).actInv(self._pose(b))

    def com(self) -> Any:
        mass = pin.computeTotalMass(self.model)
        moment = mass * self.data.com[0]
        for item in self.phase.carried:
            moment = moment + item.body.mass * self._pose(item.body.name).act(np.array(item.body.com))
            mass += item.body.mass
        return moment / mass

    def _margin(self) -> float:
        if self.edges is None:
            return np.inf
        normals, offsets = self.edges
        return float((offsets - normals @ self.com()[:2]).min())

    def see(self, tick: wb.Tick) -> list[str]:
        """Take in a tick; what it broke."""
        q, v = np.asarray(tick.q), np.asarray(tick.v)
        if not (np.isfinite(q).all() and np.isfinite(v).all() and np.isfinite(tick.com).all()):
            return [f"a number that is not finite came out: q {q}, v {v}"]
        self._place(q)
        shares = {"quaternion": abs(np.linalg.norm(q[3:7]) - 1.0) / 1e-9}
        off = pin.difference(self.model, pin.integrate(self.model, self.q, v * self.dt), q)
        # Rounding grows with the way from the origin, and with the step of a base that nothing holds.
        shares["velocity"] = float(np.abs(off).max()) / (
            1e-9 * (1.0 + np.abs(q).max() + np.abs(v).max() * self.dt)
        )
        if self.phase.joint_limits is not None:
            over = np.maximum(self.low - q[7:], q[7:] - self.high)
            was = np.maximum(np.maximum(self.low - self.q[7:], self.q[7:] - self.high), 0.0)
            shares["position"] = float(((over - was + ROUNDING) / ROUNDING).max())
            step = v[6:] * self.dt
            # A joint that comes into the phase too fast slows down as its acceleration lets it, and is named.
            told = "speed not yet" in tick.warning
            reach = np.maximum(self.reach, np.abs(self.step)) if told else self.reach
            shares["speed"] = float((np.abs(step) / (reach + 1e-12)).max()) / (1.0 + 1e-6)
            over = (np.abs(step - self.step) - 1e-12) / self.change
            shares["acceleration"] = float(over.max()) / (1.0 + 1e-6)
            # What comes in with more acceleration than the phase has loses it at once.
            changed = step - self.step
            over = np.abs(changed - np.clip(self.changed, -self.change, self.change)) - 1e-12
            shares["jerk"] = float((over / self.twist).max()) / (1.0 + 1e-6)
            self.step, self.changed = step, changed
        if self.distances is not None:
            apart = self.distances.at(q, self.bound)
            short = np.minimum(self.apart, self.bound) - apart
            shares["clearance"] = max(float(short.max(initial=0.0)), 0.0) / NEARER
            self.apart = apart
        moved = [float(np.linalg.norm(self._pose(f).translation - at)) for f, at in self.anchors.items()]
        shares["slip"] = max(moved, default=0.0) / CLOSED
        for pair, closed in self.loops.items():
            gap = pin.log6(closed.actInv(self._between(*pair)))
            opened = float(np.linalg.norm(gap.linear)) / CLOSED, float(np.linalg.norm(gap.angular)) / TURNED
            shares["closure"] = max(shares.get("closure", 0.0), *opened)
        shares["hard task"] = max((self._off(task, tick.t) for task in self.phase.hard), default=0.0) / CLOSED
        margin = self._margin()
        if self.edges is not None and self.phase.margin is not None:
            rounding = 2e-9 * (1.0 + np.abs(q[:3]).max())
            shares["margin"] = max(min(self.phase.margin, self.before) - margin, 0.0) / rounding
            shares["margin told"] = abs(margin - tick.margin) / rounding
        shares["com told"] = float(np.abs(self.com() - tick.com).max()) / (1e-8 * (1.0 + np.abs(q[:3]).max()))
        self.q, self.before = q, margin
        for promise, share in shares.items():
            self.worst[promise] = max(share, self.worst.get(promise, -np.inf))
        return [
            f"{promise}: {share:.3g} times what it may be"
            for promise, share in shares.items()
            if not share <= 1.0
        ]

    def _off(self, task: Any, t: float) -> float:
        """How far a hard task's frame is from its path [m or rad]; AS_IS ones are for the closures."""
        if isinstance(task, wb.ComTask):
            goal = None if task.path.kind is None else task.path
            return (
                0.0
                if goal is None or _unbound(goal)
                else _most(goal.at(t) - self.com(), task.position_weight)
            )
        if not hasattr(task, "frame") or task.path.kind is None or _unbound(task.path):
            return 0.0
        root = self._pose(task.root) if task.root else pin.SE3.Identity()
        pose, goal = root.actInv(self._pose(task.frame)), task.path.at(t)
        worst = 0.0
        point = goal.translation if isinstance(goal, pin.SE3) else goal if np.shape(goal) == (3,) else None
        turn = goal.rotation if isinstance(goal, pin.SE3) else goal if np.shape(goal) == (3, 3) else None
        if point is not None:
            worst = _most(point - pose.translation, task.position_weight)
        if turn is not None:
            worst = max(worst, _most(pin.log3(turn @ pose.rotation.T), task.rotation_weight))
        return worst


def _unbound(path: Any) -> bool:
    return any(getattr(path, end, None) is wb.AS_IS for end in ("start", "goal", "value"))


def _most(error: Any, weight: Any) -> float:
    return float(np.abs(np.where(np.asarray(weight) > 0, error, 0.0)).max())


def _edges(points: Any) -> tuple[Any, Any]:
    """Outward normals and offsets of the hull's edges: those lines that have all points on one side."""
    normals, offsets = [], []
    for i, a in enumerate(points):
        for b in np.delete(points, i, axis=0):
            along = b - a
            if (length := float(np.linalg.norm(along))) < 1e-9:
                continue
            normal = np.array([along[1], -along[0]]) / length
            if (points @ normal <= a @ normal + 1e-12).all():
                normals.append(normal)
                offsets.append(a @ normal)
    return np.array(normals), np.array(offsets)
