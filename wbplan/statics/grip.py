"""Two soft fingers that clamp an object: do they close, and how hard must they squeeze.

Finger i presses with its force f_i at p_i and a torsion t_i about its normal; it holds within

    sqrt(|f_t|^2 + (t / patch)^2) <= friction f_n.

The line through both, u, with w = |p2 - p1|. From the wrench (F, M about p1) that the object needs:

    f2 across u  = (M x u) / w,      f1 across u = F across u - f2,      t1 + t2 = M . u,
    f1 . u = s + F . u / 2,          f2 . u = -s + F . u / 2,

s is the squeeze, and it and the way that the torsion is shared are all that is free.

Zheng's condition (equation 1) takes half of F across u at each finger and no torsion: the same while the
object's CoM is midway on the line and it does not turn; less than what is needed otherwise.

Source: Zheng et al. 2022, section 3.1; soft fingers as in Murray, Li, Sastry, "A mathematical introduction to
robotic manipulation", 1994, section 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def force_closure(p1: ArrayLike, n1: ArrayLike, p2: ArrayLike, n2: ArrayLike, friction: float) -> bool:
    """Whether two soft fingers resist every wrench: the line through them lies in both friction cones.

    Args:
        p1: (3,) [m] where the first presses.
        n1: (3,) unit normal of the object there, inward.
        p2: (3,) [m] where the second presses.
        n2: (3,) likewise.
        friction: [-].
    """
    u = np.asarray(p2, dtype=np.float64) - np.asarray(p1, dtype=np.float64)
    length = float(np.linalg.norm(u))
    if length < 1e-9:
        return False
    most = np.arctan(friction)
    cosines = np.array([u @ np.asarray(n1), -u @ np.asarray(n2)]) / length
    return bool(np.arccos(np.clip(cosines, -1.0, 1.0)).max() < most)


@final
@dataclass(frozen=True, eq=False)
class Squeeze:
    """What a clamp needs at N samples.

    Attributes:
        need: (N,) [N] the smallest squeeze that holds, exact; infinite where none does.
        zheng: (N,) [N] what equation 1 asks for.
        across: (N, 3) [N] the second finger's force on the object across the line.
        axial: (N,) [N] half of what the object needs along the line.
        torsion: (N,) [N m] of the second finger about the line.
        line: (N, 3) unit, from the first finger to the second.
    """

    need: Array
    zheng: Array
    across: Array
    axial: Array
    torsion: Array
    line: Array

    def second(self, squeeze: float) -> Array:
        """(N, 3) [N] force of the second finger on the object."""
        along: Array = (self.axial - squeeze)[:, None] * self.line
        return self.across + along


def smallest_squeeze(
    p1: Array, p2: Array, force: Array, moment: Array, friction: float, patch: float, *, rounds: int = 60
) -> Squeeze:
    """The smallest squeeze at each sample.

    Args:
        p1: (N, 3) [m], world, the first finger.
        p2: (N, 3) [m], the second.
        force: (N, 3) [N] that the object needs from both: m (a - g).
        moment: (N, 3) [N m] likewise, about p1.
        friction: [-], between finger and object, along the line.
        patch: [m], torsion that a finger bears per newton of friction.
        rounds: of the search for the torsion's shares.
    """
    u = p2 - p1
    width = np.linalg.norm(u, axis=1)
    u = u / np.maximum(width, 1e-9)[:, None]
    axial = 0.5 * np.sum(force * u, axis=1)
    across = force - 2.0 * axial[:, None] * u
    second = np.cross(moment, u) / np.maximum(width, 1e-9)[:, None]
    first = across - second
    twist = np.sum(moment * u, axis=1)
    f1, f2 = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    zheng = 0.5 * np.linalg.norm(across, axis=1) / friction + np.abs(axial)

    def most(t2: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            turn1 = np.where(np.abs(twist - t2) > 0.0, (twist - t2) / patch, 0.0)
            turn2 = np.where(np.abs(t2) > 0.0, t2 / patch, 0.0)
        need1 = np.hypot(f1, turn1) / friction - axial
        need2 = np.hypot(f2, turn2) / friction + axial
        worse: Array = np.maximum(need1, need2)
        return worse

    # Convex in t2, and best between all of the torsion at one finger and all at the other.
    low, high = np.minimum(0.0, twist), np.maximum(0.0, twist)
    for _ in range(rounds):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        left = most(a) <= most(b)
        low, high = np.where(left, low, a), np.where(left, b, high)
    torsion = 0.5 * (low + high)
    need = np.maximum(most(torsion), np.abs(axial))
    return Squeeze(need, zheng, second, axial, torsion, u)


def box_normal(point: Array, size: ArrayLike) -> Array:
    """(3,) inward normal of a box's face that a point, in the box's frame, lies on or nearest to."""
    half = 0.5 * np.asarray(size, dtype=np.float64)
    gap = np.abs(point) - half
    axis = int(np.argmax(gap))
    normal = np.zeros(3)
    normal[axis] = -np.sign(point[axis]) or 1.0
    return normal
