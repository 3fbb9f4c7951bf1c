"""What a phase asks for: errors that should go to zero, as frozen specifications.

One sign everywhere: an error is target minus actual. A task in a phase's `hard` list is met at every
tick, in full; one in `soft` costs half the sum of (weight * row residual)^2 and removes the fraction
1 - exp(-gain dt) of its error per tick, beside following its target's own motion.

A weight has a unit, so that its rows are pure numbers: [1/m] for positions, [1/rad] for rotations. A
weight of zero on an axis leaves that row out, hard or soft.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError, listing
from wbplan.paths import AS_IS, NUMBER, POINT, POSE, ROTATION, AsIs, Path, as_path, name_of, number, numeric
from wbplan.state import State

Array = NDArray[np.float64]

#: Squares of larger weights, times squares of errors, overflow.
MOST = 1e12

#: Default gain of soft tasks [1/s]: an error decays with a time constant of 50 ms.
GAIN = 20.0


def _weights(value: object, count: int, what: str) -> Array:
    """Read-only (count,) weights from one number or `count` of them."""
    expected = f"a finite number from 0 to {MOST:g}" + (f", or {count} of them" if count > 1 else "")
    given = numeric(value)
    if given is None or given.shape not in ((), (count,)) or not ((given >= 0.0) & (given <= MOST)).all():
        raise SpecError(f"{what}: expected {expected}, got {value!r}")
    weights = np.array(np.broadcast_to(given, (count,)))
    weights.setflags(write=False)
    return weights


def _weight(value: object, what: str) -> float:
    weight = number(value, what, "a finite number of 0 or more", least=0.0)
    if weight > MOST:
        raise SpecError(f"{what}: expected a weight of at most {MOST:g}, got {weight:g}")
    return weight


def _pose_weights(value: Any, what: str) -> tuple[Array, Array]:
    """A pose's weight as (3,) and (3,): from one number, a pair (each a number or three), or six."""
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) and len(value) == 2:
        return _weights(value[0], 3, f"{what}[0]"), _weights(value[1], 3, f"{what}[1]")
    both = _weights(value, 6, what)
    return both[:3], both[3:]


def check_kind(kind: str | None, what: str, takes: tuple[str, ...]) -> None:
    """Refuse a target that is not of a kind that its task takes."""
    if kind not in takes:
        raise SpecError(f"{what}: expected {' or '.join(takes)}, got {kind or 'AS_IS'}")


def _target(target: Any, what: str, takes: tuple[str, ...]) -> Path:
    """The target as a path, of a kind that its task takes as far as is known yet."""
    path = as_path(target, what)
    if path.kind is not None:
        check_kind(path.kind, what, takes)
    return path


def _by_joint(given: Mapping[str, Any], what: str, convert: Callable[[Any, str], Any]) -> Mapping[str, Any]:
    """A read-only copy with its values checked: joint -> value."""
    if not given:
        raise SpecError(f"{what}: expected one joint or more, got none")
    names = [name_of(joint, f"{what}: joint") for joint in given]
    return MappingProxyType({name: convert(given[name], f"{what}['{name}']") for name in names})


class Task(abc.ABC):
    """A specification with a `label` for reports and a `gain` [1/s]."""

    gain: float
    name: str | None

    @property
    @abc.abstractmethod
    def label(self) -> str:
        """The task's name in reports and errors: as given, else made of its kind and frame."""

    def _check(self) -> None:
        """Refuse a name or gain that is none."""
        if self.name is not None:
            name_of(self.name, f"{type(self).__name__}.name")
        gain = number(self.gain, f"{self.label}.gain", "a finite positive rate [1/s]", above=0.0)
        object.__setattr__(self, "gain", gain)


class FrameTask(Task):
    """A task on a frame's pose in a root frame, or in the world.

    Errors, both along the root frame's axes: e_p = p_target - p [m] and e_R = log(R_target R^T) [rad].

    Attributes:
        frame: the frame.
        root: the frame that the target is given in; `None` is the world.
        kind: first word of the label.
        takes: kinds of targets.
    """

    frame: str
    root: str | None = None
    target: Any
    weight: Any
    kind: ClassVar[str]
    takes: ClassVar[tuple[str, ...]] = (POSE,)

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

    def _check(self) -> None:
        name_of(self.frame, f"{type(self).__name__}.frame")
        super()._check()
        object.__setattr__(self, "target", _target(self.target, f"{self.label}.target", self.takes))


class _WholePoseTask(FrameTask):
    """A frame task on position and orientation; `weight` becomes a pair of arrays (3,)."""

    def _check(self) -> None:
        super()._check()
        object.__setattr__(self, "weight", _pose_weights(self.weight, f"{self.label}.weight"))

    @property
    def position_weight(self) -> Array:
        """See `FrameTask.position_weight`."""
        return np.asarray(self.weight[0], dtype=np.float64)

    @property
    def rotation_weight(self) -> Array:
        """See `FrameTask.rotation_weight`."""
        return np.asarray(self.weight[1], dtype=np.float64)


@final
@dataclass(frozen=True, eq=False)
class PoseTask(_WholePoseTask):
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
        self._check()


@final
@dataclass(frozen=True, eq=False)
class RelativePoseTask(_WholePoseTask):
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
        name_of(self.root, f"{type(self).__name__}.root")
        if self.frame == self.root:
            raise SpecError(f"{self.label}: frame and root are the same, '{self.root}'")
        self._check()

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or f"{self.kind}({self.frame} in {self.root})"


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
    takes: ClassVar[tuple[str, ...]] = (POSE, POINT)

    def __post_init__(self) -> None:
        self._check()
        object.__setattr__(self, "weight", _weights(self.weight, 3, f"{self.label}.weight"))

    @property
    def position_weight(self) -> Array:
        """See `FrameTask.position_weight`."""
        return np.asarray(self.weight, dtype=np.float64)


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
    takes: ClassVar[tuple[str, ...]] = (POSE, ROTATION)

    def __post_init__(self) -> None:
        self._check()
        object.__setattr__(self, "weight", _weights(self.weight, 3, f"{self.label}.weight"))

    @property
    def rotation_weight(self) -> Array:
        """See `FrameTask.rotation_weight`."""
        return np.asarray(self.weight, dtype=np.float64)


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
    takes: ClassVar[tuple[str, ...]] = (POINT,)

    def __post_init__(self) -> None:
        self._check()
        object.__setattr__(self, "weight", _weights(self.weight, 3, f"{self.label}.weight"))
        object.__setattr__(self, "target", _target(self.target, f"{self.label}.target", self.takes))

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "com"

    @property
    def position_weight(self) -> Array:
        """Weights (3,) [1/m] along the world's axes."""
        return np.asarray(self.weight, dtype=np.float64)

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
        self._check()
        put = partial(object.__setattr__, self)
        at = f"{self.label}."
        if isinstance(self.weight, Mapping):
            put("weight", _by_joint(self.weight, f"{at}weight", _weight))
        else:
            put("weight", _weight(self.weight, f"{at}weight"))
        if isinstance(self.target, Mapping):
            put("target", _by_joint(self.target, f"{at}target", partial(_target, takes=(NUMBER,))))
        elif not isinstance(self.target, State | AsIs):
            raise SpecError(
                f"{at}target: expected joint values by name, a State or AS_IS, got {self.target!r}"
            )
        if self.joints is None:
            return
        given: Any = self.joints
        if isinstance(given, str) or not isinstance(given, Iterable) or not (joints := tuple(given)):
            raise SpecError(f"{at}joints: expected a list of one joint or more, got {given!r}")
        put("joints", tuple(name_of(joint, f"{at}joints") for joint in joints))
        left = [j for j in self.target if j not in self.joints] if isinstance(self.target, Mapping) else []
        if left:
            raise SpecError(f"{at}target: {listing(left)} not among its joints: {listing(self.joints)}")

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
    gain: float = field(default=GAIN, init=False, repr=False)  # every task has one; it has no error to remove

    def __post_init__(self) -> None:
        self._check()
        object.__setattr__(self, "weight", _weight(self.weight, f"{self.label}.weight"))

    @property
    def label(self) -> str:
        """See `Task.label`."""
        return self.name or "damping"
