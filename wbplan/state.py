"""A configuration of a robot and its kinematics, computed once."""

from __future__ import annotations

import difflib
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, listing
from wbplan.geometry import LARGEST

QUATERNION_TOLERANCE = 1e-6
"""How far a quaternion's norm may be from 1 to be taken for a rounding error and renormalised."""

# A name may belong to a link and to a joint; the link's frame is what a user means by it.
_PREFERENCE = (
    pin.FrameType.BODY,
    pin.FrameType.OP_FRAME,
    pin.FrameType.SENSOR,
    pin.FrameType.FIXED_JOINT,
    pin.FrameType.JOINT,
)
_RESERVED = ("universe", "root_joint")  # Pinocchio's own frames, in every model


def frame_names(model: pin.Model) -> tuple[str, ...]:
    """Names that frames of the robot go by (links and joints), in Pinocchio's order, each once."""
    return tuple(dict.fromkeys(frame.name for frame in model.frames if frame.name not in _RESERVED))


def find_frame(model: pin.Model, name: str) -> int:
    """Index of a frame in `model.frames`.

    A link's frame goes before a joint's where both have the name.

    Raises:
        SpecError: there is no such frame; the message lists the closest names.
    """
    if isinstance(name, str) and name not in _RESERVED:
        for kind in _PREFERENCE:
            if model.existFrame(name, kind):
                return int(model.getFrameId(name, kind))
    raise SpecError(f"robot '{model.name}': no frame {name!r}; {_suggest(name, frame_names(model))}")


def find_joint(model: pin.Model, name: str) -> int:
    """Index of an actuated joint in `model.joints` (the free-flyer root is not one).

    Raises:
        SpecError: there is no such joint; the message lists the closest names.
    """
    if isinstance(name, str) and name not in _RESERVED and model.existJointName(name):
        return int(model.getJointId(name))
    valid = [n for n in model.names if n not in _RESERVED]
    raise SpecError(f"robot '{model.name}': no joint {name!r}; {_suggest(name, valid)}")


def _suggest(name: object, valid: tuple[str, ...] | list[str]) -> str:
    """The names that are meant, perhaps; all of them where they are few."""
    close = difflib.get_close_matches(str(name), valid, n=6, cutoff=0.5)
    if len(valid) <= 12 or not close:
        return f"valid names: {listing(list(valid))}"
    return f"closest names: {', '.join(close)} (of {len(valid)})"


@final
class State:
    """One configuration `q` and the poses that follow from it; immutable.

    It keeps its own Pinocchio data, and hands out copies or read-only arrays, so that nothing a caller
    does to what it got, or to the `q` it gave, changes a state.

    Args:
        model: the robot's model; read, never written.
        q: (nq,) configuration in Pinocchio's order, for a free-flyer root x y z [m] qx qy qz qw then joints
            [m or rad]. A quaternion whose norm is within 1e-6 of 1 is normalised.

    Raises:
        SpecError: `q` has another size, a number that is not finite, or a quaternion that is not a rotation.
    """

    __slots__ = ("_data", "_model", "_q")

    _data: pin.Data
    _model: pin.Model
    _q: NDArray[np.float64]

    def __init__(self, model: pin.Model, q: ArrayLike) -> None:
        checked = _checked(model, q)
        data = model.createData()
        pin.framesForwardKinematics(model, data, checked)
        pin.centerOfMass(model, data, False)
        checked.flags.writeable = False
        object.__setattr__(self, "_model", model)
        object.__setattr__(self, "_data", data)
        object.__setattr__(self, "_q", checked)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a State is immutable: cannot set '{name}'; make a new State instead")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a State is immutable: cannot delete '{name}'")

    def __copy__(self) -> State:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> State:
        return self

    def __reduce__(self) -> tuple[type[State], tuple[pin.Model, NDArray[np.float64]]]:
        return State, (self._model, np.array(self._q))

    def __repr__(self) -> str:
        return f"State({self._model.name!r}, q={np.array2string(self._q, precision=4, separator=', ')})"

    @property
    def model(self) -> pin.Model:
        """The model this is a configuration of."""
        return self._model

    @property
    def q(self) -> NDArray[np.float64]:
        """The configuration, (nq,), read-only."""
        return self._q

    @property
    def com(self) -> NDArray[np.float64]:
        """Centre of mass of the robot, (3,) [m], world; a copy."""
        return np.array(self._data.com[0])

    def pose(self, frame: str) -> pin.SE3:
        """Pose of a frame in the world, T_world_frame; a copy.

        Args:
            frame: name of a link (preferred) or joint.

        Raises:
            SpecError: there is no such frame.
        """
        return self._data.oMf[find_frame(self._model, frame)].copy()

    def joint(self, name: str) -> float:
        """Position of one joint [rad, or m where it is prismatic].

        Raises:
            SpecError: there is no such joint, or it has more than one coordinate.
        """
        index = find_joint(self._model, name)
        if self._model.nqs[index] != 1:
            raise SpecError(f"joint '{name}' has {self._model.nqs[index]} coordinates; read them from q")
        return float(self._q[self._model.idx_qs[index]])


def _checked(model: pin.Model, q: ArrayLike) -> NDArray[np.float64]:
    """An own copy of `q`, of the right size, finite and with unit quaternions, or SpecError."""
    try:
        own = np.array(q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SpecError(f"q of robot '{model.name}': not an array of numbers ({error})") from error
    if own.shape != (model.nq,):
        raise SpecError(
            f"q of robot '{model.name}': shape {own.shape}, expected ({model.nq},), "
            "x y z qx qy qz qw and then the joints"
        )
    wrong = np.flatnonzero(~(np.abs(own) <= LARGEST))
    if wrong.size:
        raise SpecError(f"q[{wrong[0]}] of robot '{model.name}' is {own[wrong[0]]}, expected a finite number")
    if pin.isNormalized(model, own, 1e-12):
        return own
    if not pin.isNormalized(model, own, QUATERNION_TOLERANCE):
        hint = f": q[3:7] has norm {np.linalg.norm(own[3:7]):.8g}" if model.nq >= 7 else ""
        raise SpecError(f"q of robot '{model.name}': the quaternion has to have norm 1 (within 1e-6){hint}")
    return np.array(pin.normalize(model, own), dtype=np.float64)
