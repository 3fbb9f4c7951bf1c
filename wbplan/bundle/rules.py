"""What a bundle has to be, field by field; whether its promises hold is for the checks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.bundle.urdf import require_readable
from wbplan.errors import BundleError, SpecError, listing
from wbplan.obstacles import Obstacle, from_record

if TYPE_CHECKING:
    from wbplan.bundle.data import Trajectory

Array = NDArray[np.float64]

SCHEMA = 1  #: version of the bundle's format
NO_MARGIN = -1e9  #: `margin` of a phase that promises none [m]

NUMBERS = ("time", "q", "v", "com", "margin")
OPTIONAL = ("torque", "push")
#: prefix in the file -> field
GROUPS = {
    "body": "bodies",
    "target": "targets",
    "error": "errors",
    "measure": "measures",
    "force": "forces",
    "moment": "moments",
}
BASE = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")

MOST = 1e12  #: no length, time, mass or speed of a plan comes near this; squares of larger numbers overflow
EDGE = 1e-9  #: [s], two times nearer than this are one
END = 1e-6  #: [s], how far the last phase may end from the last sample


# ------------------------------------------------------------------------------------------ robot.urdf


def model_of(urdf: str, where: str) -> Any:
    """The free-flyer model of a URDF's text.

    Raises:
        BundleError: Pinocchio cannot build it.
    """
    require_readable(urdf, where)
    try:
        return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError, TypeError) as error:
        raise BundleError(f"{where}: is no URDF that Pinocchio can build: {error}") from error


def check_urdf(model: Any, where: str) -> None:
    """Refuse a robot that a trajectory of one column a joint cannot describe."""
    for index in range(2, model.njoints):
        if model.joints[index].nv != 1:
            raise BundleError(
                f"{where}: joint {model.names[index]} has {model.joints[index].nv} axes; expected 1"
            )
    placed = [joint.translation for joint in model.jointPlacements] + [
        f.placement.translation for f in model.frames
    ]
    weighed = [[i.mass, *i.lever, *i.inertia.ravel()] for i in model.inertias]
    for what, numbers in (("origin", np.array(placed)), ("inertial", np.array(weighed))):
        if not (np.abs(numbers) <= MOST).all():
            raise BundleError(f"{where}: a number of an {what} is not finite, or beyond {MOST:g}")
    if not pin.computeTotalMass(model) > 0.0:
        raise BundleError(f"{where}: the robot has no mass: {pin.computeTotalMass(model)} kg")


def joint_values(model: Any, name: str, q: Array) -> Array:
    """Values (N,) [rad or m] of one joint; a continuous one, stored as (cos, sin), as its angle."""
    joint = model.joints[model.getJointId(name)]
    if joint.nq == 1:
        return q[:, joint.idx_q]
    angle: Array = np.arctan2(q[:, joint.idx_q + 1], q[:, joint.idx_q])
    return angle


# ------------------------------------------------------------------------------------------- trajectory


def as_numbers(values: NDArray[Any], where: str) -> Array:
    """The array as float64; refuses text, complex and other things."""
    if values.dtype.kind not in "fiu":
        raise BundleError(f"{where}: expected numbers, found {values.dtype}")
    return values.astype(np.float64)


def check_arrays(motion: Trajectory, model: Any, where: str, *, values: bool) -> None:
    """Refuse wrong shapes, unknown joints and (with `values`) numbers that are not finite."""
    names = list(model.names)[2:]
    if list(motion.joint_names) != names:
        raise BundleError(f"{where}: joint_names: {_difference(list(motion.joint_names), names)}")
    samples = len(np.atleast_1d(motion.time))
    if samples < 2:
        raise BundleError(f"{where}: time: expected at least 2 samples, found {samples}")
    shapes: dict[str, tuple[int, ...]] = {
        "time": (samples,),
        "q": (samples, model.nq),
        "v": (samples, model.nv),
        "phase": (samples,),
        "com": (samples, 3),
        "margin": (samples,),
        **{f"body_{name}": (samples, 7) for name in motion.bodies},
        **{f"target_{name}": (samples, 7) for name in motion.targets},
        **{f"error_{name}": (samples,) for name in motion.errors},
        **{f"force_{name}": (samples, 3) for name in motion.forces},
        **{f"moment_{name}": (samples, 3) for name in motion.moments},
        **({} if motion.torque is None else {"torque": (samples, model.nv - 6)}),
        **({} if motion.push is None else {"push": (samples,)}),
        **{f"measure_{name}": (samples,) for name in motion.measures},
    }
    for key, shape in shapes.items():
        array = _array(motion, key)
        if array.shape != shape:
            raise BundleError(f"{where}: {key}: expected shape {shape}, found {array.shape}")
        if key == "phase" and array.dtype.kind not in "iu":
            raise BundleError(f"{where}: phase: expected whole numbers, found {array.dtype}")
        # A margin, object, target, error or measure may be absent at a sample; all else is there or broken.
        if values and key in ("time", "q", "v", "com") and not (np.abs(array) <= MOST).all():
            at = tuple(int(i) for i in np.argwhere(~(np.abs(array) <= MOST))[0])
            raise BundleError(f"{where}: {key}: expected finite numbers, found {array[at]} at index {at}")


def _array(motion: Trajectory, key: str) -> NDArray[Any]:
    kind, _, name = key.partition("_")
    return np.asarray(getattr(motion, GROUPS[kind])[name] if name else getattr(motion, key))


def _difference(found: Sequence[str], expected: Sequence[str]) -> str:
    """How a list of joint names differs from the URDF's."""
    extra = [name for name in found if name not in expected]
    missing = [name for name in expected if name not in found]
    if extra or missing:
        return f"not in the URDF: {listing(extra)}; missing: {listing(missing)}"
    return f"expected the URDF's joints in Pinocchio's order {list(expected)}, found {list(found)}"


# --------------------------------------------------------------------------------------------- plan.json


def _sayable(text: str) -> bool:
    """Whether a text can be written: JSON also takes halves of characters."""
    try:
        return bool(text.encode("utf-8")) or not text
    except UnicodeEncodeError:
        return False


@dataclass(frozen=True)
class _Field:
    """A JSON value and where it stands; its methods return it as what it has to be, or refuse it."""

    value: Any
    where: str

    def fail(self, expected: str) -> BundleError:
        found = repr(self.value)
        return BundleError(
            f"{self.where}: expected {expected}, found {found[:80] + (' ...' if len(found) > 80 else '')}"
        )

    def __getitem__(self, key: str) -> _Field:
        if not isinstance(self.value, Mapping):
            raise self.fail("an object")
        if key not in self.value:
            raise BundleError(f"{self.where}: missing {key}; found {listing([str(k) for k in self.value])}")
        # Between a file's name and its first key there is a colon, further keys follow a dot.
        return _Field(self.value[key], f"{self.where}{'.' if ': ' in self.where else ': '}{key}")

    def __contains__(self, key: str) -> bool:
        return isinstance(self.value, Mapping) and key in self.value

    def items(self, least: int = 0) -> Iterator[_Field]:
        if not isinstance(self.value, list | tuple) or len(self.value) < least:
            raise self.fail(f"a list of at least {least}" if least else "a list")
        return (_Field(item, f"{self.where}[{i}]") for i, item in enumerate(self.value))

    def text(self) -> str:
        if not isinstance(self.value, str) or not _sayable(self.value):
            raise self.fail("text")
        return self.value

    def number(self, least: float = -math.inf) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, int | float | np.number):
            raise self.fail("a number")
        try:
            value = float(self.value)
        except (OverflowError, TypeError):  # a whole number of hundreds of digits; a complex number
            value = math.nan
        if not (abs(value) <= MOST and value >= least):
            raise self.fail("a finite number" + (f" of at least {least:g}" if least > -math.inf else ""))
        return value

    def vector(self, length: int | None = None) -> Array:
        items = [item.number() for item in self.items()]
        if length is not None and len(items) != length:
            raise self.fail(f"{length} numbers")
        return np.array(items)

    def frame(self, model: Any) -> str:
        name = self.text()
        if not model.existFrame(name):
            frames = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
            raise BundleError(f"{self.where}: no frame {name!r} in the URDF; links are {listing(frames, 40)}")
        return name


def check_plan(plan: Mapping[str, Any], model: Any, where: str) -> None:
    """Refuse a plan.json with missing or misshapen fields, or frames that the URDF lacks."""
    root = _Field(plan, where)
    schema = root["schema"]
    if isinstance(schema.value, bool) or not isinstance(schema.value, int) or schema.value < 1:
        raise schema.fail("a whole number from 1")
    if schema.value > SCHEMA:
        raise BundleError(
            f"{schema.where}: {schema.value} is newer than this wbplan knows ({SCHEMA}); update wbplan"
        )
    for key in ("wbplan", "task", "robot", "backend"):
        root[key].text()
    if not root["dt"].number() > 0.0:
        raise root["dt"].fail("a number above 0")
    if not isinstance(root["report"].value, Mapping):
        raise root["report"].fail("an object")
    for pair in root["ignored_pairs"].items() if "ignored_pairs" in root else ():
        _check_pair(pair)
    for foot in root["feet"].items() if "feet" in root else ():
        foot.frame(model)
    for note in root["why"].items() if "why" in root else ():
        if not isinstance(note.value, Mapping):
            raise note.fail("an object")
        note["time"].number(), note["until"].number(), note["text"].text()
    standing = {item.name for item in obstacles_of(plan, where)}
    for phase in root["phases"].items(least=1):
        _check_phase(phase, model)
        for name in phase["obstacles"].items() if "obstacles" in phase else ():
            if name.text() not in standing:
                raise name.fail(f"one of the plan's obstacles, {listing(sorted(standing))}")
    if "joint_acceleration" in root and (root["joint_acceleration"].vector(model.nv - 6) < 0.0).any():
        raise root["joint_acceleration"].fail("bounds of at least 0")
    for body in root["bodies"].items() if "bodies" in root else ():
        body["name"].text()
        if not (body["size"].vector(3) > 0.0).all():
            raise body["size"].fail("three lengths above 0")
        body["mass"].number(0.0)


def obstacles_of(plan: Mapping[str, Any], where: str) -> tuple[Obstacle, ...]:
    """The obstacles of a plan.json, or a `BundleError`."""
    root = _Field(plan, where)
    found: list[Obstacle] = []
    for item in root["obstacles"].items() if "obstacles" in root else ():
        try:
            found.append(from_record(item.value))
        except SpecError as error:
            raise BundleError(f"{item.where}: {error}") from None
        if found[-1].name in {other.name for other in found[:-1]}:
            raise item["name"].fail("a name that no other obstacle has")
    return tuple(found)


def _check_phase(phase: _Field, model: Any) -> None:
    phase["name"].text()
    if not phase["start"].number() < phase["end"].number():
        raise phase["end"].fail(f"a time after the start {phase['start'].value}")
    phase["margin"].number()
    for contact in phase["contacts"].items():
        contact["frame"].frame(model)
        contact["friction"].number(0.0)
        if "normal" in contact and not np.linalg.norm(contact["normal"].vector(3)) > 1e-6:
            raise contact["normal"].fail("a direction")
    for loop in phase["closures"].items():
        loop["frame_a"].frame(model)
        loop["frame_b"].frame(model)
    for item in phase["carried"].items():
        item["name"].text()
        item["frame"].frame(model)
        item["mass"].number(0.0)
        if abs(float(np.linalg.norm(item["pose"].vector(7)[3:])) - 1.0) > 1e-6:
            raise item["pose"].fail("x y z and a quaternion qx qy qz qw of length 1")
        if "com" in item:
            item["com"].vector(3)
        for key in ("friction", "patch", "squeeze", "press"):
            if key in item:
                item[key].number(0.0)
        for pad in item["pads"].items() if "pads" in item else ():
            pad.frame(model)
    for task in phase["tasks"].items():
        task["name"].text()
    if "clearance" in phase:
        phase["clearance"].number()
    _check_kept_apart(phase)
    for push in phase["pushes"].items() if "pushes" in phase else ():
        push["frame"].frame(model)
        push["force"].vector(3)
    for key in ("friction_use", "torque_use"):
        if key in phase:
            phase[key].number(0.0)
    for corner in phase["region"].items(least=3) if "region" in phase else ():
        corner.vector(2)


def _check_kept_apart(phase: _Field) -> None:
    if "kept_apart" not in phase:
        return
    told = phase["kept_apart"]
    for key in ("self", "obstacles"):
        if told[key].value is not None:
            told[key].number(0.0)
    for pair in told["closer"].items():
        _check_pair(pair)
    for item in told["may_touch"].items():
        if isinstance(item.value, str):
            item.text()
        else:
            _check_pair(item)


def _check_pair(pair: _Field) -> None:
    if len([name.text() for name in pair.items()]) != 2:
        raise pair.fail("two names")


def check_cover(plan: Mapping[str, Any], motion: Trajectory, where: str) -> None:
    """Refuse phases that leave gaps, miss the trajectory's ends, hold no sample or disagree with `phase`."""
    phases = plan["phases"]
    for i, (before, after) in enumerate(pairwise(phases)):
        if abs(after["start"] - before["end"]) > EDGE:
            raise BundleError(
                f"{where}plan.json: phases[{i + 1}].start: expected {before['end']}, where "
                f"{before['name']!r} ends, found {after['start']}"
            )
    ends = (
        ("start", phases[0]["start"], motion.time[0], EDGE),
        ("end", phases[-1]["end"], motion.time[-1], END),
    )
    for key, found, expected, within in ends:
        if abs(found - expected) > within:  # a time that is nan is for the caller
            raise BundleError(
                f"{where}plan.json: phases: the {key} of all is {found} s, the trajectory's is {expected} s"
            )
    outside = (motion.phase < 0) | (motion.phase >= len(phases))
    if outside.any():
        k = int(np.argmax(outside))
        raise BundleError(
            f"{where}trajectory.npz: phase: expected 0 to {len(phases) - 1}, "
            f"found {motion.phase[k]} at index {k}"
        )
    starts = np.array([p["start"] for p in phases])[motion.phase]
    stops = np.array([p["end"] for p in phases])[motion.phase]
    stray = (motion.time < starts - EDGE) | (motion.time > stops + END)
    if stray.any():
        k = int(np.argmax(stray))
        raise BundleError(
            f"{where}trajectory.npz: phase: index {k} says {phases[motion.phase[k]]['name']!r}, "
            f"but its time {motion.time[k]:g} s is outside it"
        )
    for i, phase in enumerate(phases):
        if not ((motion.time >= phase["start"] - EDGE) & (motion.time <= phase["end"] + EDGE)).any():
            raise BundleError(f"{where}plan.json: phases[{i}]: no sample lies in {phase['name']!r}")
