"""What a simulation assumes beside the plan: servos, feet, grip, times and limits of the verdict."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, final

import numpy as np

from wbplan.errors import PhysicsError

Feet = Literal["ball", "joint"]


@final
@dataclass(frozen=True)
class Servo:
    """Position servos, all alike but for their effort and speed, which the URDF tells.

    A servo pushes with kp (target - position) - kv speed, at most with its effort. Its motor loses torque
    with speed, in a straight line down to none at the URDF's speed limit: a damping of effort / speed.

    Attributes:
        error: position error [rad] at which a turning joint's full effort is reached; kp = effort / error.
        travel: likewise of a sliding joint [m].
        lag: kv / kp [s]; at a steady speed the joint follows that much later.
        inertia: of the motor behind its gear, as a share of the effort [kg m^2 / N m]; the armature.
    """

    error: float = 0.05
    travel: float = 0.002
    lag: float = 0.02
    inertia: float = 0.002


@final
@dataclass(frozen=True)
class Bounds:
    """Where a verdict changes.

    Attributes:
        tilt: [rad], base against the plan; beyond it the robot has fallen.
        sink: [m], base against the plan; likewise.
        slip: [m], a foot's sliding within one stance.
        drift: [m], an object against the plan while it is carried, and at the end.
        turn: [rad], likewise.
    """

    tilt: float = 0.15
    sink: float = 0.05
    slip: float = 0.02
    drift: float = 0.04
    turn: float = 0.5


@final
@dataclass(frozen=True)
class Options:
    """What a simulation assumes.

    Attributes:
        dt: the simulator's step [s].
        settle: seconds in the first pose before the plan starts.
        rest: seconds in the last pose after it has ended.
        servo: the position servos.
        feet: "ball": feet as the URDF shapes them, they roll and slip; "joint": a foot in contact is a ball
            joint at its frame.
        grip: friction of pads on objects; None takes the largest that the plan's contacts have.
        patch: mean radius [m] of the patch in which a pad touches: its friction about its own normal, per
            newton, is grip * patch.
        lead: the servos' targets lead the plan by what a servo gives way under the plan's static load,
            torque / kp; without it the robot sags.
        reserve: share of the feet's friction that the static load may use.
        ground: friction of objects on the ground and on what they stand on.
        squeeze: force [N] with which each pad presses while something is carried; None takes the plan's, or
            where it has none `safety` times what friction needs to hold the weight.
        safety: see `squeeze`.
        ramp: seconds over which the squeeze comes before the carrying starts, and goes after it has ended.
        weld: carried objects are fastened to their holders instead of held by friction.
        bounds: of the verdict.
    """

    dt: float = 0.002
    settle: float = 0.5
    rest: float = 0.5
    servo: Servo = field(default_factory=Servo)
    feet: Feet = "ball"
    grip: float | None = None
    patch: float = 0.01
    lead: bool = True
    reserve: float = 0.6
    ground: float = 0.5
    squeeze: float | None = None
    safety: float = 2.0
    ramp: float = 0.5
    weld: bool = False
    bounds: Bounds = field(default_factory=Bounds)

    def __post_init__(self) -> None:
        _positive(
            self, "dt", "servo.error", "servo.travel", "servo.inertia", "safety", "ramp", "ground", "reserve"
        )
        _positive(self, *(f"bounds.{item.name}" for item in fields(Bounds)))
        _positive(self, "settle", "rest", "servo.lag", "squeeze", "grip", "patch", zero=True)
        if self.dt > 0.01:
            raise PhysicsError(f"Options.dt: expected a step of 0.01 s or less, got {self.dt}")
        if self.feet not in ("ball", "joint"):
            raise PhysicsError(f"Options.feet: expected 'ball' or 'joint', got {self.feet!r}")


def _positive(options: Options, *names: str, zero: bool = False) -> None:
    for name in names:
        value: Any = options
        for part in name.split("."):
            value = getattr(value, part)
        if value is None and name in ("squeeze", "grip"):
            continue
        good = isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
        if not good or value < 0.0 or (value == 0.0 and not zero):
            kind = "a finite number of 0 or more" if zero else "a finite number above 0"
            raise PhysicsError(f"Options.{name}: expected {kind}, got {value!r}")
