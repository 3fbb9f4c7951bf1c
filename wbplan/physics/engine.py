"""The one place that knows MuJoCo is optional, and where its versions differ."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

import numpy as np

from wbplan.errors import PhysicsError


@cache
def mujoco() -> Any:
    """The module `mujoco`.

    Raises:
        PhysicsError: it is not installed.
    """
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise PhysicsError(
            f"simulating needs MuJoCo, which is not installed ({error}); install it with: "
            "pip install 'wbplan[physics]'"
        ) from error


def compiled(spec: Any) -> Any:
    """The `MjModel` of a spec.

    Raises:
        PhysicsError: MuJoCo refuses it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split())
        raise PhysicsError(f"MuJoCo cannot simulate this robot or these objects: {said}") from error


def version() -> str:
    """MuJoCo's version."""
    return str(mujoco().__version__)


def add_damping(joint: Any, value: float) -> None:
    """Adds to a spec joint's damping: three numbers from MuJoCo 4 on, one before."""
    try:
        joint.damping[0] += value
    except TypeError:
        joint.damping += value


def keep_movable(body: Any) -> None:
    """Lets a spec body's centre of mass be moved in the compiled model, where it is now at the origin."""
    if hasattr(body, "simple"):
        body.simple = 0
    if not any(body.ipos):
        body.ipos = [0.0, 0.0, 1e-9]  # before MuJoCo 4 this alone keeps it apart from the body's frame


def full_mass_matrix(model: Any, data: Any) -> Any:
    """(nv, nv) joint-space mass matrix with the armature; MuJoCo 4 takes its arguments in another order."""
    full = np.zeros((model.nv, model.nv))
    try:
        mujoco().mj_fullM(model, data, full)
    except TypeError:
        mujoco().mj_fullM(model, full, data.qM)
    return full
