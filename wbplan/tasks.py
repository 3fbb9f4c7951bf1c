"""What a phase asks for: errors that should go to zero, as frozen specifications.

One sign everywhere: an error is target minus actual. A task in a phase's `hard` list is met at every
tick, in full; one in `soft` costs half the sum of (weight * row residual)^2 and removes the fraction
1 - exp(-gain dt) of its error per tick, beside following its target's own motion.

A weight has a unit, so that its rows are pure numbers: [1/m] for positions, [1/rad] for rotations. A
weight of zero on an axis leaves that row out, hard or soft.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.paths import AS_IS, AsIs, Path, as_path
from wbplan.state import State

Array = NDArray[np.float64]

#: Default gain of soft tasks [1/s]: an error decays with a time constant of 50 ms.
GAIN = 20.0


def _weights(value: object, shape: tuple[int, ...], what: str) -> Array:
    try:
        weights = np.array(np.broadcast_to(np.asarray(value, dtype=float), shape))
    except (TypeError, ValueError):
        raise SpecError(f"{what}: expected a number or {shape[0]} numbers, got {value!r}") from None
    if not np.isfinite(weights).all() or (weights < 0.0).any():
        raise SpecError(f"{what}: expected finite numbers of 0 or more, got {value!r}")
    weights.setflags(write=False)
    return weights


def _gain(value: float, what: str) -> None:
    if not value > 0.0:
        raise SpecError(f"{what}: expected a positive rate [1/s], got {value}")


class Task(abc.ABC):
    """A specification with a `label` for reports and a `gain` [1/s]."""

    gain: float
    name: str | None

    @property
    @abc.abstractmethod
    def label(self) -> str:
        """The task's name in reports and errors: as given, else made of its kind and frame."""


class FrameTask(Task):
    """A task on a frame's pose in a root frame, or in the world.

    Errors, both along the root frame's axes: e_p = p_target - p [m] and e_R = log(R_target R^T) [rad].

    Attributes:
        frame: the frame.
        root: the frame that the target is given in; `None` is the world.
    """

    frame: str
    root: str | None = None
    target: Any
    kind: ClassVar[str]

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or f"{self.kind}({self.frame})"

    @property
    def position_weight(self) -> Array:
        """Weights (3,) [1/m] along the root's axes."""
        return np.zeros(3)

    @property
    def rotation_weight(self) -> Array:
        """Weights (3,) [1/rad] about the root's axes."""
        return np.zeros(3)

    @property
    def path(self) -> Path:
        """The target as a path."""
        return as_path(self.target, f"{self.label}.target")

    def _check_target(self, vector: tuple[int, ...] | None) -> None:
        path = self.path
        if path.constant and not isinstance(path.at(0.0), AsIs):
            shape = getattr(path.at(0.0), "shape", None)
            if shape is not None and shape != vector:
                wanted = "pin.SE3" if vector is None else f"pin.SE3 or an array of shape {vector}"
                raise SpecError(f"{self.label}.target: expected {wanted}, got an array of shape {shape}")
        object.__setattr__(self, "target", path)


def _pose_weights(value: object, what: str) -> tuple[Array, Array]:
    """A pose's weight as (3,) and (3,): from one number, a pair (each a number or three), or six."""
    if isinstance(value, Sequence) and len(value) == 2:
        return _weights(value[0], (3,), f"{what}[0]"), _weights(value[1], (3,), f"{what}[1]")
    both = _weights(value, (6,), what)
    return both[:3], both[3:]


@final
@dataclass(frozen=True, eq=False)
class PoseTask(FrameTask):
    """A frame's position and orientation in the world.

    Args:
        frame: of the robot, or the name of a carried body.
        target: `pin.SE3`, a path of them, or `AS_IS`.
        weight: (position [1/m], rotation [1/rad]), each one number or one an axis; or one for all.
        gain: [1/s], see the module.
        name: for reports.
    """

    frame: str
    target: Any = AS_IS
    weight: Any = (1.0, 1.0)
    gain: float = GAIN
    name: str | None = None
    kind: ClassVar[str] = "pose"

    def __post_init__(self) -> None:
        _pose_weights(self.weight, f"{self.label}.weight")
        _gain(self.gain, f"{self.label}.gain")
        self._check_target(None)

    @property
    def position_weight(self) -> Array:
        """See `FrameTask.position_weight`."""
        return _pose_weights(self.weight, "weight")[0]

    @property
    def rotation_weight(self) -> Array:
        """See `FrameTask.rotation_weight`."""
        return _pose_weights(self.weight, "weight")[1]


@final
@dataclass(frozen=True, eq=False)
class RelativePoseTask(FrameTask):
    """A frame's pose in another frame, `root`: T_root_frame.

    A hard one with a target that does not move is a closed loop, as when two limbs clamp one object.

    Args:
        frame: the frame.
        root: the frame that the target is given in, and along whose axes errors are measured.
        target: `pin.SE3`, a path of them, or `AS_IS`.
        weight: as `PoseTask`.
        gain: [1/s].
        name: for reports.
    """

    frame: str
    root: str = field(kw_only=True)
    target: Any = AS_IS
    weight: Any = (1.0, 1.0)
    gain: float = GAIN
    name: str | None = None
    kind: ClassVar[str] = "relative"

    def __post_init__(self) -> None:
        if self.frame == self.root:
            raise SpecError(f"{self.label}: frame and root are the same, '{self.root}'")
        _pose_weights(self.weight, f"{self.label}.weight")
        _gain(self.gain, f"{self.label}.gain")
        self._check_target(None)

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or f"{self.kind}({self.frame} in {self.root})"

    @property
    def position_weight(self) -> Array:
        """See `FrameTask.position_weight`."""
        return _pose_weights(self.weight, "weight")[0]

    @property
    def rotation_weight(self) -> Array:
        """See `FrameTask.rotation_weight`."""
        return _pose_weights(self.weight, "weight")[1]


@final
@dataclass(frozen=True, eq=False)
class PositionTask(FrameTask):
    """A frame's origin in the world; its orientation is free.

    Args:
        frame: of the robot, or the name of a carried body.
        target: (3,) [m], a pose of which the origin counts, a path of either, or `AS_IS`.
        weight: [1/m], one number or three, along the world's axes.
        gain: [1/s].
        name: for reports.
    """

    frame: str
    target: Any = AS_IS
    weight: Any = 1.0
    gain: float = GAIN
    name: str | None = None
    kind: ClassVar[str] = "position"

    def __post_init__(self) -> None:
        _weights(self.weight, (3,), f"{self.label}.weight")
        _gain(self.gain, f"{self.label}.gain")
        self._check_target((3,))

    @property
    def position_weight(self) -> Array:
        """See `FrameTask.position_weight`."""
        return _weights(self.weight, (3,), "weight")


@final
@dataclass(frozen=True, eq=False)
class OrientationTask(FrameTask):
    """A frame's orientation in the world; its position is free.

    Args:
        frame: of the robot, or the name of a carried body.
        target: (3, 3) rotation, a pose of which the rotation counts, a path of either, or `AS_IS`.
        weight: [1/rad], one number or three, about the world's axes.
        gain: [1/s].
        name: for reports.
    """

    frame: str
    target: Any = AS_IS
    weight: Any = 1.0
    gain: float = GAIN
    name: str | None = None
    kind: ClassVar[str] = "orientation"

    def __post_init__(self) -> None:
        _weights(self.weight, (3,), f"{self.label}.weight")
        _gain(self.gain, f"{self.label}.gain")
        self._check_target((3, 3))

    @property
    def rotation_weight(self) -> Array:
        """See `FrameTask.rotation_weight`."""
        return _weights(self.weight, (3,), "weight")


@final
@dataclass(frozen=True, eq=False)
class ComTask(Task):
    """The centre of mass of the robot and of what it carries, in the world.

    Args:
        target: (3,) [m], a path of such, or `AS_IS`.
        weight: [1/m], one number or three; (1, 1, 0) leaves the height free.
        gain: [1/s].
        name: for reports.
    """

    target: Any = AS_IS
    weight: Any = 1.0
    gain: float = GAIN
    name: str | None = None

    def __post_init__(self) -> None:
        _weights(self.weight, (3,), f"{self.label}.weight")
        _gain(self.gain, f"{self.label}.gain")
        path = as_path(self.target, f"{self.label}.target")
        if path.constant and path.at(0.0) is not AS_IS and np.shape(path.at(0.0)) != (3,):
            raise SpecError(f"{self.label}.target: expected three numbers [m], got {path.at(0.0)}")
        object.__setattr__(self, "target", path)

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "com"

    @property
    def position_weight(self) -> Array:
        """Weights (3,) [1/m] along the world's axes."""
        return _weights(self.weight, (3,), "weight")

    @property
    def path(self) -> Path:
        """The target as a path."""
        return as_path(self.target, f"{self.label}.target")


@final
@dataclass(frozen=True, eq=False)
class PostureTask(Task):
    """Joint positions: e = target - q of the actuated joints [rad, or m for sliding joints].

    Args:
        target: joint name -> value or path; a `State` whose joints count; or `AS_IS`, the joints when the
            phase begins.
        weight: [1/rad], for every joint, or joint name -> weight (others 0).
        gain: [1/s].
        joints: only these; `None` is all that the phase leaves free.
        name: for reports.
    """

    target: Any = AS_IS
    weight: float | Mapping[str, float] = 0.1
    gain: float = 2.0
    joints: tuple[str, ...] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        _gain(self.gain, f"{self.label}.gain")
        if isinstance(self.weight, Mapping):
            for joint, weight in self.weight.items():
                _weights(weight, (1,), f"{self.label}.weight['{joint}']")
        else:
            _weights(self.weight, (1,), f"{self.label}.weight")
        if isinstance(self.target, Mapping):
            paths = {j: as_path(value, f"{self.label}.target['{j}']") for j, value in self.target.items()}
            object.__setattr__(self, "target", MappingProxyType(paths))
        elif not isinstance(self.target, State | AsIs):
            raise SpecError(f"{self.label}.target: expected joint values by name, a State or AS_IS, got {self.target!r}")
        if self.joints is not None:
            object.__setattr__(self, "joints", tuple(self.joints))

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "posture"


@final
@dataclass(frozen=True, eq=False)
class DampingTask(Task):
    """Small steps: costs half of (weight * step)^2, joints and base alike.

    Args:
        weight: [1/rad] (and [1/m] for the base's translation).
        name: for reports.
    """

    weight: float = 0.01
    name: str | None = None
    gain: float = GAIN

    def __post_init__(self) -> None:
        _weights(self.weight, (1,), f"{self.label}.weight")

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "damping"

