"""Body forward displacement: from some of the stance joints to every pose the body can have.

Two ways. **Elimination**, where one leg's joints are all known, a second's all but one, and a third's one:
the first fixes its foot in the body, the second's foot is where a circle meets a sphere, and the third's goes
round the line through both; its one known joint is a polynomial of degree 4 (joint 1: 2) in e^(i phi).
All roots of it are found, so the list of poses is complete. **Multi-start**, for every other set: Newton's
method on the loop equations from many random starts; each pose comes with how often it was hit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SolveError, SpecError, listing
from wbplan.mechanism.elimination import eliminate
from wbplan.mechanism.kernels import close_from_many, close_loops, loop_equations
from wbplan.mechanism.leg import ThreeJointLeg
from wbplan.mechanism.platform import Platform
from wbplan.mechanism.solutions import LimbSolution, wrapped

Array = NDArray[np.float64]

CLOSED = 1e-11
"""Gap [m] of the loops below which Newton's method has arrived."""
SAME = 1e-6
"""Poses closer than this [m, or rad times the size of the stance] are one."""
STARTS = 100
"""Random starts of a round of the multi-start; rounds are added while they find anything new."""
ROUNDS = 12
DAMPING = 0.3


@dataclass(frozen=True, eq=False)
class BodySolution:
    """One pose that the body can have.

    Attributes:
        pose: T_world_body.
        joints: joint -> position [rad or m], as far as they are determined: those of legs of which a joint is
            known, and of other legs where they reach their feet.
        admissible: every leg reaches its foot within its joint limits; legs without a closed form are not
            judged.
        reason: why it is not admissible, or "".
        distance: from the given state [m]: |p - p'| and the angle between them times the size of the stance.
        hits: how many starts led there; 0 where it was found by elimination.
    """

    pose: pin.SE3
    joints: Mapping[str, float]
    admissible: bool
    reason: str
    distance: float
    hits: int = 0


@dataclass(frozen=True, eq=False)
class ForwardSolutions:
    """Every pose that was found, the closest to the given state first.

    Attributes:
        solutions: without repetition.
        method: "elimination" or "multi-start".
        complete: whether the list is proven complete: elimination looks at all roots.
        degree: number of complex roots, for elimination; 0 otherwise.
        starts: number of starts, for multi-start; 0 otherwise.
    """

    solutions: tuple[BodySolution, ...]
    method: str
    complete: bool
    degree: int
    starts: int

    @property
    def admissible(self) -> tuple[BodySolution, ...]:
        """Those in which every leg reaches its foot within its limits."""
        return tuple(s for s in self.solutions if s.admissible)


def forward(
    platform: Platform,
    known: Mapping[str, float],
    near: pin.SE3,
    *,
    method: str | None = None,
    seed: int = 0,
) -> ForwardSolutions:
    """All poses of the body for given positions of some stance joints.

    Args:
        platform: legs and feet.
        known: joint -> position [rad or m]; they have to determine the body, six of them usually.
        near: T_world_body of a known state; solutions are sorted by closeness to it.
        method: "elimination" or "multi-start"; the first where it applies, if not given.
        seed: of the multi-start's random numbers.

    Raises:
        SpecError: a joint does not exist, the method does not apply, or so few joints are known that the body
            can move.
    """
    unknown = [name for name in known if name not in platform.joints]
    if unknown:
        raise SpecError(f"forward: no joint {unknown[0]!r}; stance joints: {listing(platform.joints, 24)}")
    if method not in (None, "elimination", "multi-start"):
        raise SpecError(f"forward: method {method!r}, expected 'elimination' or 'multi-start'")
    eliminated = eliminate(platform, known) if method != "multi-start" else None
    if eliminated is not None:
        poses, degree = eliminated
        found = [_annotated(platform, known, pose, near, 0) for pose in _unique(platform, poses)]
        kept = [s for s in found if s is not None]
        return ForwardSolutions(tuple(sorted(kept, key=lambda s: s.distance)), "elimination", True, degree, 0)
    if method == "elimination":
        raise SpecError(
            "forward: elimination needs one leg known whole, one with a single unknown joint and one with a "
            "single known joint, six known joints in all"
        )
    return _multi_start(platform, known, near, seed)


def size_of(platform: Platform) -> float:
    """Mean distance [m] of the feet from their centre: what turns an angle into a length."""
    feet = np.array(list(platform.feet.values()))
    return float(np.mean(np.linalg.norm(feet - feet.mean(axis=0), axis=1)))


def distance_between(first: pin.SE3, second: pin.SE3, size: float) -> float:
    """sqrt(|p - p'|^2 + (size * angle)^2) [m]."""
    angle = float(np.linalg.norm(pin.log3(first.rotation.T @ second.rotation)))
    return float(np.hypot(np.linalg.norm(first.translation - second.translation), size * angle))


class Loops:
    """The loop equations of the legs of which a joint is known, as arrays for the kernels.

    Args:
        platform: legs and feet.
        known: names of the joints whose positions are given.
    """

    def __init__(self, platform: Platform, known: Sequence[str]) -> None:
        chosen = {n: c for n, c in platform.chains.items() if any(j in known for j in c.joints)}
        if not chosen:
            raise SpecError("forward: no joint is known")
        self.names = tuple(chosen)
        self.joints = tuple(c.joints for c in chosen.values())
        most = max(len(c.joints) for c in chosen.values())
        self.screws = np.zeros((len(chosen), most, 6))
        self.counts = np.array([len(c.joints) for c in chosen.values()])
        self.tips = np.array([c.home.translation for c in chosen.values()])
        self.feet = np.array([platform.feet[n] for n in chosen])
        self.columns = np.full((len(chosen), most), -1)
        self.place = {}
        passive = 0
        for i, chain in enumerate(chosen.values()):
            self.screws[i, : self.counts[i]] = chain.screws
            for j, name in enumerate(chain.joints):
                self.place[name] = (i, j)
                if name not in known:
                    self.columns[i, j] = passive
                    passive += 1
        self.passive = passive

    def values(self, known: Mapping[str, float]) -> Array:
        """(L, n) with the known positions, zero elsewhere."""
        q = np.zeros(self.columns.shape)
        for name, value in known.items():
            q[self.place[name]] = value
        return q

    def free(self, q: Array, rotation: Array, position: Array) -> bool:
        """Whether the unknowns can move, at first order, with the loops closed."""
        residual, jacobian = np.empty(3 * len(self.names)), np.empty((3 * len(self.names), 6 + self.passive))
        loop_equations(
            self.screws,
            self.counts,
            self.tips,
            self.feet,
            self.columns,
            q,
            rotation,
            position,
            residual,
            jacobian,
        )
        values = np.linalg.svd(jacobian, compute_uv=False)
        return bool(values[-1] < 1e-7 * values[0])


class Follower:
    """One branch of the forward displacement, followed along a path of the known joints.

    Args:
        platform: legs and feet.
        start: joint -> position [rad or m] of all stance joints, where the path begins.
        known: names of the joints that will be given.

    Attributes:
        pose: T_world_body at the last step.

    Raises:
        SpecError: the known joints do not exist.
        SolveError: the start does not close the loops.
    """

    def __init__(self, platform: Platform, start: Mapping[str, float], known: Sequence[str]) -> None:
        wrong = [name for name in known if name not in platform.joints]
        if wrong:
            raise SpecError(f"follow: no joint {wrong[0]!r}; stance joints: {listing(platform.joints, 24)}")
        self._loops = Loops(platform, known)
        self._known = [self._loops.place[name] for name in known]
        self._q = self._loops.values({n: start[n] for names in self._loops.joints for n in names})
        pose = platform.pose_of(start)
        self._rotation, self._position = pose.rotation.copy(), pose.translation.copy()
        self.step([start[name] for name in known])

    @property
    def pose(self) -> pin.SE3:
        """T_world_body at the last step; a copy."""
        return pin.SE3(self._rotation.copy(), self._position.copy())

    @property
    def joints(self) -> dict[str, float]:
        """Joint -> position [rad or m] of all legs of which a joint is known, at the last step."""
        return {name: float(self._q[place]) for name, place in self._loops.place.items()}

    def step(self, values: Sequence[float]) -> pin.SE3:
        """Moves the known joints to new positions, close to the last ones.

        Args:
            values: positions [rad or m], in the order of `known`.

        Raises:
            SolveError: the loops cannot be closed from here: out of reach, or through a singular pose. The
                follower stays where it was.
        """
        q, rotation, position = self._q.copy(), self._rotation.copy(), self._position.copy()
        for place, value in zip(self._known, values, strict=True):
            q[place] = value
        k = self._loops
        gap, _ = close_loops(
            k.screws,
            k.counts,
            k.tips,
            k.feet,
            k.columns,
            k.passive,
            q,
            rotation,
            position,
            30,
            1e-12,
            DAMPING,
        )
        if not gap < CLOSED:
            raise SolveError(
                f"follow: the loops stay open by {gap:.3g} m: out of reach, or through a singular pose"
            )
        self._q, self._rotation, self._position = q, rotation, position
        return self.pose


def _multi_start(
    platform: Platform, known: Mapping[str, float], near: pin.SE3, seed: int
) -> ForwardSolutions:
    loops = Loops(platform, list(known))
    rows, unknowns = 3 * len(loops.names), 6 + loops.passive
    if rows < unknowns:
        raise SpecError(
            f"forward: {len(known)} known joints leave the body free to move: {rows} loop equations for "
            f"{unknowns} unknowns"
        )
    random = np.random.default_rng(seed)
    size, centre = size_of(platform), np.mean(loops.feet, axis=0)
    reach = max(float(np.linalg.norm(loops.tips, axis=1).max()), size)
    given = loops.values(known)
    hits: list[tuple[pin.SE3, int]] = []
    starts = 0
    for _ in range(ROUNDS):
        q = np.where(loops.columns >= 0, random.uniform(-np.pi, np.pi, (STARTS, *given.shape)), given)
        rotations = np.array(
            [pin.Quaternion(_unit(v)).toRotationMatrix() for v in random.normal(size=(STARTS, 4))]
        )
        points = centre + random.uniform(-reach, reach, (STARTS, 3))
        gaps = close_from_many(
            loops.screws, loops.counts, loops.tips, loops.feet, loops.columns, loops.passive, q, rotations,
            points, 40, CLOSED, DAMPING,
        )  # fmt: skip
        starts += STARTS
        before = len(hits)
        closed = np.flatnonzero(gaps < CLOSED)
        if not hits and len(closed) and all(loops.free(q[s], rotations[s], points[s]) for s in closed):
            raise SpecError(
                f"forward: the {len(known)} known joints leave the body free to move: at each of the "
                f"{len(closed)} poses found first the loop equations are dependent"
            )
        for s in closed:
            pose = pin.SE3(rotations[s], points[s])
            for k, (other, count) in enumerate(hits):
                if distance_between(pose, other, size) < SAME:
                    hits[k] = (other, count + 1)
                    break
            else:
                hits.append((pose, 1))
        if len(hits) == before and all(count > 3 for _, count in hits):
            break
    found = [_annotated(platform, known, pose, near, count) for pose, count in hits]
    kept = [s for s in found if s is not None]
    return ForwardSolutions(tuple(sorted(kept, key=lambda s: s.distance)), "multi-start", False, 0, starts)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _unique(platform: Platform, poses: Sequence[pin.SE3]) -> list[pin.SE3]:
    size = size_of(platform)
    kept: list[pin.SE3] = []
    for pose in poses:
        if all(distance_between(pose, other, size) > SAME for other in kept):
            kept.append(pose)
    return kept


def _annotated(
    platform: Platform, known: Mapping[str, float], pose: pin.SE3, near: pin.SE3, hits: int
) -> BodySolution | None:
    """The pose with all joints; None where no branch of a leg has the known positions (a squared root)."""
    joints: dict[str, float] = {}
    reasons: list[str] = []
    for name, leg in platform.legs.items():
        every = leg.solve(pose.actInv(platform.feet[name]))
        given = [(k, known[j]) for k, j in enumerate(leg.joints) if j in known]
        candidates = [
            s
            for s in (*every.within, *every.beyond)
            if all(abs(wrapped(float(s.joints[k]) - value)) < 1e-5 for k, value in given)
        ]
        if given and not candidates:
            return None
        inside = [s for s in candidates if any(s is w for w in every.within)]
        if not inside:
            mine = _outside(leg, candidates) if given else every.reason
            reasons.append(f"leg '{name}': {mine}")
        if candidates:
            best = (inside or candidates)[0]
            joints.update(zip(leg.joints, best.joints.tolist(), strict=True))
    distance = distance_between(pose, near, size_of(platform))
    return BodySolution(pose, joints, not reasons, "; ".join(reasons), distance, hits)


def _outside(leg: ThreeJointLeg, candidates: Sequence[LimbSolution]) -> str:
    """Which joint is the farthest outside its limits, of the branch that is the nearest to them."""
    best = min(candidates, key=lambda s: float(np.maximum(leg.lower - s.joints, s.joints - leg.upper).max()))
    worst = int(np.argmax(np.maximum(leg.lower - best.joints, best.joints - leg.upper)))
    return (
        f"{leg.joints[worst]} would have to be at {best.joints[worst]:.4f} rad, its limits are "
        f"{leg.lower[worst]:.4f} and {leg.upper[worst]:.4f}"
    )
