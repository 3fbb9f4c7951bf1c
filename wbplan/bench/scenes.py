"""The stacks that are timed: one description each, from which every solver is set up.

- `clamp`: the leg-arm hexapod holds a box between two limbs and takes it along a path of six degrees of
  freedom. Hard: four point feet, the loop through the box (6 rows), the CoM polygon with its margin, joint
  positions and speeds. Soft: the box's pose, both tips' poses, posture.
- `stand`: six point feet, the body along a path, posture; no polygon, so that Pink is asked the same.

Both paths start and end at rest and come back to where they began; longer runs go round again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.compiled.phase import CompiledPhase, compile_phase
from wbplan.paths import Path, Waypoints
from wbplan.problem.bodies import Body, Carried
from wbplan.problem.contacts import Contact
from wbplan.problem.limits import JointLimits, SupportPolygon
from wbplan.problem.script import Phase
from wbplan.problem.tasks import PoseTask, PostureTask, RelativePoseTask, Task
from wbplan.robot import Robot, load_robot
from wbplan.state import State

Array = NDArray[np.float64]

DT = 0.01
TIPS = ("limb1_tip", "limb2_tip")
POSTURE_WEIGHT, POSTURE_GAIN = 0.1, 2.0

#: The clamped posture, as the clamp task has it when the box is up: the body's place [m] and tilt about x
#: [deg], and every limb's joints [deg].
CLAMPED_BODY, CLAMPED_TILT = (0.0, -0.072, 0.180), -25.4
CLAMPED = {
    "limb1": (113.6, -21.7, -29.0, 51.8, -113.6),
    "limb2": (66.4, -21.7, -29.0, 51.8, 113.6),
    "leg3": (141.1, -18.8, 35.2),
    "leg4": (120.3, 27.4, 59.0),
    "leg5": (59.7, 27.4, 59.0),
    "leg6": (38.9, -18.8, 35.2),
}

#: Corners of a lap: seconds, and where from the path's start, as ((x, y, z) [m], rotation vector [deg]).
LAP = (
    (2.0, (0.018, 0.000, 0.018), (2.4, 0.0, 3.6)),
    (4.0, (0.000, 0.012, 0.012), (1.2, 3.6, 0.0)),
    (6.0, (-0.018, 0.000, 0.018), (2.4, 0.0, -3.6)),
    (8.0, (0.000, 0.000, 0.000), (0.0, 0.0, 0.0)),
)


@final
@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame that follows a path.

    Attributes:
        frame: its name.
        poses: where it should be at every sample, the start included.
        position_weight: [1/m]; rotation_weight: [1/rad].
    """

    frame: str
    poses: tuple[Any, ...]
    position_weight: float
    rotation_weight: float


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """A stack in terms that every solver has words for.

    Attributes:
        name: the stack's.
        robot, phase, q, placed: what `Loop` takes; the posture task wants the joints of q (nq,) too.
        compiled: the phase with its names looked up; its model has the box on it.
        dt: length of a tick [s]; ticks: how many the paths are sampled for.
        feet: frames whose origins stay; loop: (root, frame) whose relative pose stays.
        tracked: frames that follow paths; the first one is what counts.
        margin: of the CoM in the polygon [m], if that is a limit.
        held: joints that do not move.
    """

    name: str
    robot: Robot
    phase: Phase
    q: Array
    placed: Mapping[str, Any]
    compiled: CompiledPhase
    dt: float
    ticks: int
    feet: tuple[str, ...]
    loop: tuple[str, str] | None
    tracked: tuple[Tracked, ...]
    margin: float | None
    held: tuple[str, ...]

    @property
    def speed(self) -> float:
        """Fraction of the joints' speed limits that may be used."""
        limits = self.phase.joint_limits
        return 1.0 if limits is None else limits.speed


def _laps(start: Any, seconds: float, offset: Any = None) -> Waypoints:
    """Laps around `start`, for at least that long; of what is fixed to it at `offset`, if given."""
    times, points = [0.0], [pin.SE3(start)]
    while times[-1] < seconds:
        begun = times[-1]
        for t, move, turn in LAP:
            times.append(begun + t)
            rotation = pin.exp3(np.radians(turn)) @ start.rotation
            points.append(pin.SE3(rotation, start.translation + np.array(move)))
    return Waypoints(tuple(times), tuple(point if offset is None else point * offset for point in points))


def clamp(ticks: int, dt: float = DT) -> Scene:
    """A box of 0.8 kg between the palms of two arms, on four feet."""
    robot = load_robot("legarm_hexapod")
    q = np.array(robot.state("manipulate").q)  # fingers open, shanks withdrawn
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(np.radians((CLAMPED_TILT, 0.0, 0.0))), np.array(CLAMPED_BODY)))
    for limb, degrees in CLAMPED.items():
        for number, angle in enumerate(degrees, start=1):
            q[robot.joint_index(f"{limb}_joint{number}")[0]] = np.radians(angle)
    state = robot.state(q)
    left, right = (state.pose(tip) for tip in TIPS)
    start = pin.SE3(np.eye(3), (left.translation + right.translation) / 2)
    width = float(np.linalg.norm(left.translation - right.translation))
    phase = Phase(
        "clamp",
        contacts=tuple(Contact(foot) for limb, foot in robot.feet.items() if limb not in ("limb1", "limb2")),
        carried=(Carried(Body("box", mass=0.8, size=(width, 0.15, 0.12), pose=start), by=TIPS[0]),),
        hard=(RelativePoseTask(TIPS[1], root=TIPS[0]),),
        limits=(JointLimits(speed=0.8), SupportPolygon(margin=0.04)),
    )
    seconds = (ticks + 1) * dt
    paths: dict[str, tuple[Path, float, float]] = {"box": (_laps(start, seconds), 100.0, 50.0)}
    for tip in TIPS:
        paths[tip] = (_laps(start, seconds, start.actInv(state.pose(tip))), 20.0, 10.0)
    return _scene("clamp", state, robot, phase, {"box": start}, paths, ticks, dt)


def stand(ticks: int, dt: float = DT) -> Scene:
    """Six-legged stance, the body moving."""
    robot = load_robot("legarm_hexapod")
    state = robot.state("stand")
    phase = Phase(
        "stand",
        contacts=tuple(Contact(foot) for foot in robot.feet.values()),
        limits=(JointLimits(speed=0.8),),
    )
    paths: dict[str, tuple[Path, float, float]] = {
        "body": (_laps(state.pose("body"), (ticks + 1) * dt), 100.0, 50.0)
    }
    return _scene("stand", state, robot, phase, {}, paths, ticks, dt)


def _scene(
    name: str,
    state: State,
    robot: Robot,
    phase: Phase,
    placed: Mapping[str, Any],
    paths: Mapping[str, tuple[Path, float, float]],
    ticks: int,
    dt: float,
) -> Scene:
    soft: tuple[Task, ...] = (
        *(PoseTask(frame, path, weight=(place, turn)) for frame, (path, place, turn) in paths.items()),
        PostureTask(state, weight=POSTURE_WEIGHT, gain=POSTURE_GAIN),
    )
    phase = replace(phase, soft=soft, duration=(ticks + 1) * dt)
    compiled = compile_phase(robot, phase, state.q, placed)
    tracked = tuple(
        Tracked(frame, tuple(pin.SE3(path.at(k * dt)) for k in range(ticks + 1)), place, turn)
        for frame, (path, place, turn) in paths.items()
    )
    return Scene(
        name, robot, phase, state.q, placed, compiled, dt, ticks,
        feet=tuple(contact.frame for contact in phase.contacts),
        loop=phase.closures[0] if phase.closures else None,
        tracked=tracked,
        margin=phase.margin,
        held=tuple(robot.joint_names[d.joint] for d in compiled.driven),
    )  # fmt: skip


#: Every stack, by name: `SCENES["clamp"](ticks)`.
SCENES: Mapping[str, Callable[[int], Scene]] = {"clamp": clamp, "stand": stand}
