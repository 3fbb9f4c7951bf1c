"""The live kinematics of one model: updated in place, read through views taken once.

Pinocchio keeps its results where they are: `data.oMf[i].translation` is a view of memory that every
update writes again. Taking the views once spares two Python objects a frame and tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]


@final
class Kinematics:
    """Frame poses, CoM and Jacobians of a model at its current `q`.

    Args:
        model: a model with a free-flyer root.
        frames: numbers of the frames that are read; their poses stand in `translations` and `rotations`
            in this order, and the world's (zero, identity) after the last.

    Attributes:
        q: (nq,), a view; write it through `update` only.
        translations: (F + 1, 3) [m]; rotations: (F + 1, 3, 3).
        jacobian: (6, nv), Pinocchio's: spatial velocity at the world's origin, linear rows first.
        com: (3,) [m]; com_jacobian: (3, nv), once `differentiate` was called.
    """

    def __init__(self, model: Any, frames: Sequence[int]) -> None:
        self.model = model
        self.data = model.createData()
        self.q = pin.neutral(model)
        count = len(frames)
        self.translations = np.zeros((count + 1, 3))
        self.rotations = np.tile(np.eye(3), (count + 1, 1, 1))
        self._sources = [
            (self.data.oMf[i].translation, self.data.oMf[i].rotation, self.translations[k], self.rotations[k])
            for k, i in enumerate(frames)
        ]
        self.jacobian: Array = self.data.J
        self.com: Array = self.data.com[0]
        self.com_jacobian: Array = self.data.Jcom

    def update(self, q: Array) -> None:
        """Poses and CoM at `q`; Jacobians are then out of date until `differentiate`."""
        self.q[:] = q
        pin.centerOfMass(self.model, self.data, self.q, False)
        pin.updateFramePlacements(self.model, self.data)
        for translation, rotation, into_translation, into_rotation in self._sources:
            into_translation[:] = translation
            into_rotation[:] = rotation

    def differentiate(self) -> None:
        """Jacobians at the current `q`."""
        pin.computeJointJacobians(self.model, self.data)
        pin.jacobianCenterOfMass(self.model, self.data, False)
