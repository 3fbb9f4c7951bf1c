"""The plane of the feet: the body's pose from three feet, and an arm's tip moved by the legs (HIphanT)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.mechanism.screws import skew

Array = NDArray[np.float64]


def foot_plane(origin: ArrayLike, ahead: ArrayLike, aside: ArrayLike) -> pin.SE3:
    """Frame of three feet: x from the first to the second, z normal to their plane, origin at the first.

    x = (b - a)/|b - a|, z = x x (c - a) normalised, y = z x x (HIphanT eqs 1 to 4: a, b, c are right rear,
    right front and left rear foot).

    Args:
        origin: (3,) [m], a.
        ahead: (3,) [m], b.
        aside: (3,) [m], c.

    Raises:
        SpecError: the three are on one line.
    """
    a, b, c = (np.asarray(p, dtype=np.float64) for p in (origin, ahead, aside))
    length = float(np.linalg.norm(b - a))
    normal = np.cross(b - a, c - a)
    if not float(np.linalg.norm(normal)) > 1e-12 * max(length, float(np.linalg.norm(c - a))) ** 2:
        raise SpecError(f"foot plane: the feet {a}, {b} and {c} are on one line")
    x, z = (b - a) / length, normal / np.linalg.norm(normal)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), a)


def body_pose(feet_world: ArrayLike, feet_body: ArrayLike) -> pin.SE3:
    """T_world_body from three feet, known in the world and, by the legs' angles, in the body.

    T_world_body = T_world_foot T_body_foot^-1 (HIphanT eqs 5 to 7); no state estimator is needed.

    Args:
        feet_world: (3, 3) [m], a foot a row.
        feet_body: (3, 3) [m], the same feet in the body's frame.

    Raises:
        SpecError: not three feet each, or they are on one line.
    """
    world, body = (np.asarray(p, dtype=np.float64) for p in (feet_world, feet_body))
    if world.shape != (3, 3) or body.shape != (3, 3):
        raise SpecError(f"body pose: expected three feet (3, 3) twice, found {world.shape} and {body.shape}")
    return foot_plane(*world) * foot_plane(*body).inverse()


def whole_body_jacobian(body: pin.SE3, tip: ArrayLike, arm: ArrayLike) -> Array:
    """(6, 6 + n) Jacobian of an arm's tip over body translation, rotation and arm joints (HIphanT eq. 34).

    J = [[I, -[r]x, R J_v], [0, I, R J_w]] with r = R tip, in the world's axes, linear rows first.

    Args:
        body: T_world_body.
        tip: (3,) [m], the tip's origin in the body's frame.
        arm: (6, n) Jacobian of the tip against the body, in the body's axes, linear rows first.
    """
    turn = body.rotation
    jacobian = np.asarray(arm, dtype=np.float64)
    r = turn @ np.asarray(tip, dtype=np.float64)
    top = np.hstack([np.eye(3), -skew(r), turn @ jacobian[:3]])
    return np.vstack([top, np.hstack([np.zeros((3, 3)), np.eye(3), turn @ jacobian[3:]])])
