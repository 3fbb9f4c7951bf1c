"""Objects that a robot carries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.paths import AS_IS, POINT, POSE, AsIs, checked, kind_of, name_of, number
from wbplan.robot import Robot
from wbplan.state import State, find_frame

#: How far [m or rad] from where it stands a body may be taken up.
JUMP = 5e-5


@final
@dataclass(frozen=True)
class Body:
    """A rigid object.

    Args:
        name: also the name of its frame in tasks while it is carried.
        mass: [kg].
        size: edge lengths of its bounding box [m], along its own axes.
        pose: `pin.SE3` in the world at the start of the script, if it stands somewhere.
        com: centre of mass [m] in its own frame, whose origin is the centre of the bounding box.
    """

    name: str
    mass: float
    size: tuple[float, float, float] = (0.1, 0.1, 0.1)
    pose: Any = field(default=None, compare=False)
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        at = f"Body '{name_of(self.name, 'Body.name')}'"
        mass = number(self.mass, f"{at}.mass", "kilograms of 0 or more", least=0.0)
        object.__setattr__(self, "mass", mass)
        for name in ("size", "com"):
            value = checked(getattr(self, name), f"{at}.{name}")
            if kind_of(value) != POINT:
                raise SpecError(f"{at}.{name}: expected three numbers [m], got {value}")
            object.__setattr__(self, name, tuple(float(x) for x in value))
        if min(self.size) <= 0.0:
            raise SpecError(f"{at}.size: expected positive lengths [m], got {self.size}")
        if self.pose is not None:
            object.__setattr__(self, "pose", _pose(self.pose, f"{at}.pose"))

    def same_as(self, other: Body) -> bool:
        """Whether the two are alike in every field, the pose too."""
        if self.pose is None or other.pose is None:
            return self == other and self.pose is other.pose
        return self == other and bool(self.pose.isApprox(other.pose, 1e-12))


def _pose(value: object, what: str) -> Any:
    pose = checked(value, what)
    if kind_of(pose) != POSE:
        raise SpecError(f"{what}: expected {POSE}, got {value!r}")
    return pose


@final
@dataclass(frozen=True)
class Grip:
    """A second frame that clamps a carried body against its holder, by friction: two soft fingers.

    The phase holds both frames together by a hard `RelativePoseTask`. The plan then says how hard they have
    to squeeze, and no plan is made if friction or servos do not suffice.

    Args:
        by: the other frame; it and the holder press where their origins are.
        friction: between finger and body [-].
        patch: [m], torsion that a finger bears per newton of friction: the mean radius of where it touches.
        safety: factor on the smallest squeeze that holds the body along its path.
    """

    by: str
    friction: float = 0.7
    patch: float = 0.01
    safety: float = 2.0

    def __post_init__(self) -> None:
        at = f"Grip '{name_of(self.by, 'Grip.by')}'"
        for name, least in (("friction", 0.0), ("patch", 0.0), ("safety", 0.0)):
            value = number(getattr(self, name), f"{at}.{name}", "a finite positive number", above=least)
            object.__setattr__(self, name, value)
        if self.safety < 1.0:
            raise SpecError(f"{at}.safety: expected a factor of 1 or more, got {self.safety}")


@final
@dataclass(frozen=True)
class Carried:
    """A body held fast by a frame of the robot for the length of a phase; its weight counts.

    Args:
        body: the object.
        by: the frame that holds it.
        pose: `pin.SE3`, the body in that frame; `AS_IS`: as the two stand when the phase begins. A body
            that stands nowhere yet (no `Body.pose`, not carried before) is then put at the frame itself.
        grip: a second frame that clamps it.
        pads: frames that press on it, as a gripper's fingers do, by whose friction a simulation holds it;
            where not given, the holder and whatever forms a closed loop with it.
        squeeze: force [N] with which each pad presses in a simulation; by default what friction needs to
            hold the weight, and some more.
    """

    body: Body
    by: str
    pose: Any = field(default=AS_IS, compare=False)
    pads: tuple[str, ...] = ()
    squeeze: float | None = None
    grip: Grip | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.body, Body):
            raise SpecError(f"Carried.body: expected a wb.Body, got {self.body!r}")
        name_of(self.by, f"Carried '{self.body.name}'.by")
        if self.grip is not None and not isinstance(self.grip, Grip):
            raise SpecError(f"Carried '{self.body.name}'.grip: expected a wb.Grip, got {self.grip!r}")
        given: Any = self.pads
        if isinstance(given, str) or not isinstance(given, Iterable):
            raise SpecError(f"Carried '{self.body.name}'.pads: expected a list of frames, got {given!r}")
        pads = tuple(name_of(pad, f"Carried '{self.body.name}'.pads") for pad in given)
        object.__setattr__(self, "pads", pads)
        if self.squeeze is not None:
            at = f"Carried '{self.body.name}'.squeeze"
            object.__setattr__(self, "squeeze", number(self.squeeze, at, "newtons of 0 or more", least=0.0))
        if not isinstance(self.pose, AsIs):
            object.__setattr__(self, "pose", _pose(self.pose, f"Carried '{self.body.name}'.pose"))


@final
@dataclass(frozen=True, eq=False)
class Held:
    """A carried body: its pose in the holder, its own frame's number in the phase's model, its grip."""

    body: Body
    holder: str
    T_holder_body: Any
    frame: int
    pads: tuple[str, ...] = ()
    squeeze: float | None = None
    grip: Grip | None = None


def frame_number(model: pin.Model, name: str, what: str) -> int:
    """A frame's number in the model; `what` names the field in the `SpecError` where there is none."""
    try:
        return find_frame(model, name)
    except SpecError as error:
        raise SpecError(f"{what}: {error}") from None


def _refuse_jump(pose: Any, as_it_is: Any, what: str) -> None:
    """An object that stands somewhere is taken where it stands."""
    if as_it_is is None:
        return
    off = pin.log6(as_it_is.actInv(pose))
    gap, turn = (
        float(np.linalg.norm(as_it_is.translation - pose.translation)),
        float(np.linalg.norm(off.angular)),
    )
    if gap > JUMP or turn > JUMP:
        raise SpecError(
            f"{what}: {gap:.4g} m and {turn:.4g} rad from where the body is when the phase begins; "
            "bring its holder there first, or take it as it is (wb.AS_IS)"
        )


def with_carried(
    robot: Robot, carried: Sequence[Carried], q: NDArray[np.float64], placed: Mapping[str, Any], what: str
) -> tuple[pin.Model, tuple[Held, ...]]:
    """The robot's model with each carried body added as a frame and a mass of its holder.

    Args:
        robot: the robot; its model is copied before it is changed.
        carried: what is carried.
        q: (nq,) configuration at the phase's start.
        placed: pose in the world of every body that stands somewhere, by name.
        what: the field, for messages.

    Raises:
        SpecError: a holder does not exist, a body has a frame's name, or would jump into its holder.
    """
    if not carried:
        return robot.model, ()
    model = pin.Model(robot.model)
    state = State(robot.model, q)
    held = []
    for item in carried:
        body = item.body
        by = frame_number(robot.model, item.by, f"{what}: body '{body.name}'.by")
        for pad in item.pads:
            frame_number(robot.model, pad, f"{what}: body '{body.name}'.pads")
        holder = model.frames[by]
        if model.existFrame(body.name):
            raise SpecError(f"{what}: body '{body.name}' has the name of a frame of {robot.name}")
        as_it_is = state.pose(item.by).actInv(placed[body.name]) if body.name in placed else None
        if item.pose is AS_IS:
            pose = pin.SE3.Identity() if as_it_is is None else as_it_is
        else:
            pose = item.pose
            _refuse_jump(pose, as_it_is, f"{what}: body '{body.name}'.pose")
        placement = holder.placement * pose
        x, y, z = body.size
        inertia = pin.Inertia.FromBox(body.mass, x, y, z) if body.mass > 0 else pin.Inertia.Zero()
        inertia.lever = np.array(body.com)
        frame = pin.Frame(body.name, holder.parentJoint, by, placement, pin.FrameType.BODY)
        held.append(Held(body, item.by, pose, model.addFrame(frame), item.pads, item.squeeze, item.grip))
        model.appendBodyToJoint(holder.parentJoint, inertia, placement)
    return model, tuple(held)


def standing(
    carried: Sequence[Carried], placed: Mapping[str, Any], bodies: Sequence[Body]
) -> tuple[tuple[Body, Any], ...]:
    """The bodies that stand somewhere and are not carried, each with its pose in the world."""
    held = {item.body.name for item in carried}
    return tuple((b, placed[b.name]) for b in bodies if b.name in placed and b.name not in held)
