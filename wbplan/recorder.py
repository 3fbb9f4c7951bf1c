"""What a plan was, sample by sample, collected while it is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle import SCHEMA, Bundle, Trajectory
from wbplan.compiled.phase import CompiledPhase
from wbplan.obstacles import to_record
from wbplan.problem.script import Phase, Script
from wbplan.reasons import Notes
from wbplan.robot import Robot
from wbplan.statics import Stance, plan_forces, promised
from wbplan.tick import Loop, Tick
from wbplan.version import VERSION

Array = NDArray[np.float64]

#: `margin` in plan.json of a phase that promises none.
NO_MARGIN = -1e9


@final
class Recorder:
    """Collects samples; one at an edge belongs to the phase that starts there, the last to the last phase."""

    def __init__(self, robot: Robot, script: Script, dt: float) -> None:
        self._robot, self._script, self._dt = robot, script, dt
        self._q: list[Array] = []
        self._v: list[Array] = []
        self._com: list[Array] = []
        self._margin: list[float] = []
        self._phase: list[int] = []
        self._errors: list[dict[str, float]] = []
        self._measures: list[dict[str, float]] = []
        self._worst: dict[str, float] = {}
        self._targets: list[dict[str, Array]] = []
        self._moments: list[float] = []
        self._bodies: list[dict[str, Array]] = []
        self._microseconds: list[float] = []
        self._warnings: list[str] = []
        self._phases: list[dict[str, Any]] = []
        self._placed: Mapping[str, Any] = {}
        self._stances: list[Stance] = []
        self._start = 0.0
        self._notes = Notes(script.duration)
        self._samples: tuple[list[Any], ...] = (
            self._q,
            self._com,
            self._margin,
            self._phase,
            self._errors,
            self._measures,
            self._targets,
            self._moments,
            self._bodies,
        )
        self._edge: list[Any] = []

    def begin(self, index: int, loop: Loop, placed: Mapping[str, Any], elapsed: float) -> None:
        """A phase starts: what was the last sample of the one before becomes the first of this one."""
        self._placed = {name: pin.SE3ToXYZQUAT(pose) for name, pose in placed.items()}
        self._start = elapsed
        self._edge = [samples.pop() for samples in self._samples if samples]
        self._sample(index, loop)
        self._index = index

    def cut(self, index: int, loop: Loop, elapsed: float) -> bool:
        """A phase breaks off at time `elapsed` [s]; False where nothing moved before that."""
        if not self._v:
            return False
        if self._phase.count(index) > 1:
            self.end(index, loop, elapsed)
        else:  # it never moved: the edge's sample goes back to the phase before
            for samples, last in zip(self._samples, self._edge, strict=True):
                samples[-1] = last
        return True

    def record(self, loop: Loop, tick: Tick) -> None:
        """One tick was made."""
        self._v.append(tick.v)
        self._microseconds.append(tick.microseconds)
        if tick.warning:
            self._warnings.append(f"{loop.compiled.phase.name}: {tick.warning}")
        self._sample(self._index, loop)
        self._notes.take(loop, tick, len(self._v) * self._dt)

    def _sample(self, index: int, loop: Loop) -> None:
        stack = loop.stack
        self._q.append(loop.q)
        self._com.append(stack.kinematics.com.copy())
        self._margin.append(stack.margin)
        self._phase.append(index)
        errors = stack.errors()
        self._errors.append(errors)
        self._measures.append(stack.keep_measures()())
        for name, error in errors.items():
            self._worst[name] = max(error, self._worst.get(name, 0.0))
        # What a path asks for that nothing but time changes is found at the phase's end, all at once.
        self._targets.append(loop.targets() if stack.live else {})
        self._moments.append(loop.t)
        self._bodies.append({**self._placed, **loop.bodies()})

    def end(self, index: int, loop: Loop, elapsed: float) -> None:
        """A phase is over: its entry in plan.json."""
        phase = loop.compiled.phase
        compiled = loop.compiled
        self._stances.append(Stance(phase, compiled.model, compiled.contact_points, compiled.held))
        first = self._phase.index(index)
        if not loop.stack.live:
            found = loop.targets_at(np.array(self._moments[first:]))
            self._targets[first:] = [
                {label: poses[k] for label, poses in found.items()} for k in range(len(self._phase) - first)
            ]
        errors = self._errors[first:]
        tasks = []
        level = {task: k for k, tasks in enumerate(phase.levels) for task in tasks}
        for task in phase.tasks:
            worst = {
                part: max(
                    (e[f"{task.label}.{part}"] for e in errors if f"{task.label}.{part}" in e), default=None
                )
                for part in ("position", "orientation", "joints")
            }
            tasks.append({"name": task.label, "hard": task in phase.hard, "level": level.get(task), **worst})
        self._phases.append(
            {
                "name": phase.name,
                "start": self._start,
                "end": elapsed,
                "contacts": [
                    {"frame": c.frame, "friction": c.friction, "normal": list(c.normal)}
                    for c in phase.contacts
                ],
                "margin": NO_MARGIN if phase.margin is None else phase.margin,
                "closures": [{"frame_a": a, "frame_b": b} for a, b in phase.closures],
                "carried": [
                    {
                        "name": h.body.name,
                        "frame": h.holder,
                        "pose": [float(x) for x in pin.SE3ToXYZQUAT(h.T_holder_body)],
                        "mass": h.body.mass,
                        "com": list(h.body.com),
                        **({"pads": list(h.pads)} if h.pads else {}),
                        **({"press": h.squeeze} if h.squeeze is not None else {}),
                    }
                    for h in loop.compiled.held
                ],
                "joint_acceleration": [float(a) for a in loop.compiled.acceleration],
                **_region(loop.compiled),
                **_kept_apart(phase),
                "obstacles": [item.name for item in phase.obstacles.shapes] if phase.obstacles else [],
                "roles": {limb: role for limb, role in loop.compiled.roles.items() if role is not None},
                "tasks": tasks,
            }
        )

    def bundle(
        self,
        task: str,
        backend: str,
        parameters: dict[str, Any],
        seconds: float,
        warnings: Sequence[str] = (),
    ) -> Bundle:
        """Everything recorded, as a bundle."""
        n = len(self._q)
        margin = np.array(self._margin)
        index = np.array(self._phase, dtype=np.int64)
        found = plan_forces(self._stances, np.array(self._q), index, self._dt)
        for entry, stance, forces in zip(self._phases, self._stances, found.phases, strict=True):
            promises, warning = promised(stance, forces)
            entry.update(promises)
            for clamp in forces.clamps:
                next(item for item in entry["carried"] if item["name"] == clamp.name).update(
                    clamp.to_record()
                )
            self._warnings += [warning] if warning else []
        trajectory = Trajectory(
            time=np.arange(n, dtype=np.float64) * self._dt,
            q=np.array(self._q),
            v=np.array([*self._v, np.zeros(self._robot.model.nv)]),
            phase=index,
            com=np.array(self._com),
            margin=np.where(np.isfinite(margin), margin, np.nan),
            joint_names=tuple(self._robot.joint_names),
            bodies=_columns(self._bodies, 7),
            targets=_columns(self._targets, 7),
            errors={name: column[:, 0] for name, column in _columns(self._errors, 1).items()},
            forces=found.forces,
            moments=found.moments,
            torque=found.torque,
            push=found.push,
            measures={name: column[:, 0] for name, column in _columns(self._measures, 1).items()},
        )
        microseconds = np.array(self._microseconds)
        report = {
            "seconds_planning": seconds,
            "seconds_motion": float(trajectory.time[-1]),
            "ticks": len(microseconds),
            "median_us": float(np.median(microseconds)),
            "p99_us": float(np.percentile(microseconds, 99)),
            "worst": dict(self._worst),
            "warnings": list(dict.fromkeys([*self._warnings, *warnings])),
        }
        plan = {
            "schema": SCHEMA,
            "wbplan": VERSION,
            "task": task,
            "robot": self._robot.name,
            "backend": backend,
            "dt": self._dt,
            "parameters": parameters,
            "bodies": [{"name": b.name, "size": list(b.size), "mass": b.mass} for b in self._script.bodies],
            "joint_acceleration": np.max([p["joint_acceleration"] for p in self._phases], axis=0).tolist(),
            "obstacles": [to_record(item) for item in self._script.obstacles],
            "ignored_pairs": sorted(sorted(pair) for pair in self._robot.ignored_collisions),
            "feet": list(self._robot.feet.values()),
            "phases": self._phases,
            "why": self._notes.found,
            "report": report,
        }
        return Bundle(plan, trajectory, self._robot.urdf_text)


def _region(compiled: CompiledPhase) -> dict[str, Any]:
    """What stands in plan.json only where it is: the region's corners, and forces on the surroundings."""
    found: dict[str, Any] = {}
    if compiled.region and compiled.polygon is not None:
        found["region"] = compiled.polygon.vertices.tolist()
    if compiled.phase.pushes:
        found["pushes"] = [{"frame": p.frame, "force": list(p.force)} for p in compiled.phase.pushes]
    return found


def _kept_apart(phase: Phase) -> dict[str, Any]:
    """What a phase promises of distances: `clearance` [m]; in `kept_apart`, from what and who may touch."""
    own, world = phase.self_collision, phase.obstacles
    if phase.clearance is None:
        return {}
    return {
        "clearance": phase.clearance,
        "kept_apart": {
            "self": own and own.distance,
            "obstacles": world and world.distance,
            "closer": [list(pair) for pair in own.except_for] if own else [],
            "may_touch": [item if isinstance(item, str) else list(item) for item in world.except_for]
            if world
            else [],
        },
    }


def _columns(samples: list[dict[str, Any]], width: int) -> dict[str, Array]:
    """Samples that name what they hold -> one array a name, nan where a sample does not have it."""
    names = dict.fromkeys(name for sample in samples for name in sample)
    columns = {name: np.full((len(samples), width), np.nan) for name in names}
    for k, sample in enumerate(samples):
        for name, value in sample.items():
            columns[name][k] = value
    return columns
