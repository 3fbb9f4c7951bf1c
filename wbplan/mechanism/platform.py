"""A robot standing on its feet as a parallel mechanism: legs from a body to fixed points of the ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError, listing
from wbplan.mechanism.leg import ThreeJointLeg
from wbplan.mechanism.poe import Chain, chain_to, positions
from wbplan.mechanism.screws import skew
from wbplan.mechanism.solutions import LimbSolutions
from wbplan.robot import Robot
from wbplan.state import State

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Platform:
    """Legs whose feet stay at points of the world; feet turn freely about them.

    Attributes:
        chains: leg -> chain from the body to its foot.
        feet: leg -> where the foot stands (3,) [m], world.
    """

    chains: Mapping[str, Chain]
    feet: Mapping[str, Array]

    def __post_init__(self) -> None:
        if set(self.chains) != set(self.feet) or not self.chains:
            raise SpecError(
                f"platform: legs {listing(list(self.chains))} and feet {listing(list(self.feet))} have to be "
                "the same, and at least one"
            )
        seen: set[str] = set()
        for name, chain in self.chains.items():
            twice = seen & set(chain.joints)
            if twice:
                raise SpecError(f"platform: joint '{min(twice)}' belongs to leg '{name}' and to another leg")
            seen |= set(chain.joints)
        frozen = {name: np.array(self.feet[name], dtype=np.float64) for name in self.chains}
        for name, foot in frozen.items():
            if foot.shape != (3,) or not np.isfinite(foot).all():
                raise SpecError(
                    f"platform: foot of '{name}': expected three finite numbers [m], found {foot}"
                )
        object.__setattr__(self, "chains", MappingProxyType(dict(self.chains)))
        object.__setattr__(self, "feet", MappingProxyType(frozen))

    @classmethod
    def of_legs(cls, legs: Mapping[str, ThreeJointLeg], feet: Mapping[str, ArrayLike]) -> Platform:
        """A platform of three-joint legs given by their lengths; joints become `<leg>_joint1` and so on.

        Args:
            legs: leg -> geometry.
            feet: leg -> (3,) [m], world.
        """
        chains = {}
        for name, leg in legs.items():
            c = leg.chain()
            joints = tuple(f"{name}_joint{k}" for k in (1, 2, 3))
            chains[name] = Chain(joints, c.screws, c.home, c.lower, c.upper)
        return cls(chains, {name: np.asarray(foot, dtype=np.float64) for name, foot in feet.items()})

    @classmethod
    def of_robot(cls, robot: Robot, state: State, limbs: Sequence[str] | None = None) -> Platform:
        """The platform of a robot in a state, on the feet as they are there.

        Joints that a limb's role as a leg holds (a folded arm, say) are held where they are.

        Args:
            robot: a loaded robot.
            state: where its feet stand.
            limbs: the stance legs; all whose feet exist in the state where not given.

        Raises:
            SpecError: a limb does not exist or has no foot.
        """
        standing = set(robot.standing_feet(state.q))
        chosen = list(limbs) if limbs is not None else [k for k, f in robot.feet.items() if f in standing]
        chains, feet = {}, {}
        for limb in chosen:
            if limb not in robot.feet:
                raise SpecError(
                    f"robot '{robot.name}': limb {limb!r} has no foot; those that have: "
                    f"{listing(list(robot.feet))}"
                )
            chain = chain_to(robot, robot.feet[limb])
            role = robot.role_of(limb, state.q)
            held = robot.roles[limb][role] if role is not None else {}
            names = [j for j in chain.joints if j in held]
            chains[limb] = chain.hold(dict(zip(names, positions(robot, names, state.q), strict=True)))
            feet[limb] = state.pose(robot.feet[limb]).translation
        return cls(chains, feet)

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints, leg by leg."""
        return tuple(name for chain in self.chains.values() for name in chain.joints)

    @cached_property
    def legs(self) -> Mapping[str, ThreeJointLeg]:
        """Closed forms of those legs that have three joints of the usual shape."""
        found = {}
        for name, chain in self.chains.items():
            try:
                found[name] = ThreeJointLeg.of(chain)
            except SpecError:
                continue
        return MappingProxyType(found)

    def inverse(self, body: pin.SE3) -> Mapping[str, LimbSolutions]:
        """Body inverse displacement: all joint positions of every leg for one pose of the body.

        Args:
            body: T_world_body.

        Raises:
            SpecError: a leg has no closed form (not three joints of the usual shape).
        """
        without = [name for name in self.chains if name not in self.legs]
        if without:
            raise SpecError(
                f"platform: leg '{without[0]}' with joints {', '.join(self.chains[without[0]].joints)} has "
                "no "
                "closed form; expected three joints, the last two parallel and square to the first"
            )
        return {name: leg.solve(body.actInv(self.feet[name])) for name, leg in self.legs.items()}

    def nearest_joints(self, body: pin.SE3, near: Mapping[str, float]) -> dict[str, float]:
        """One set of joint positions within limits for a pose of the body, each leg's closest to given ones.

        Args:
            body: T_world_body.
            near: joint -> position [rad].

        Raises:
            SolveError: a leg cannot: the message says why.
            SpecError: a leg has no closed form.
        """
        found: dict[str, float] = {}
        for name, solutions in self.inverse(body).items():
            joints = self.chains[name].joints
            chosen = solutions.nearest([near[j] for j in joints])
            found.update(zip(joints, chosen.joints.tolist(), strict=True))
        return found

    def pose_of(self, joints: Mapping[str, float]) -> pin.SE3:
        """T_world_body that fits all foot points best (least squares) at given joint positions.

        Raises:
            SpecError: fewer than three feet, or a joint is missing.
        """
        if len(self.chains) < 3:
            raise SpecError(f"platform: a pose needs three feet, found {len(self.chains)}")
        here = np.array([c.pose(self._values(c, joints)).translation for c in self.chains.values()])
        there = np.array(list(self.feet.values()))
        return fit(here, there)

    def rates_map(self, joints: Mapping[str, float]) -> Array:
        """(joints, 6) G with joint rates = G (v; omega): what each joint does for a twist of the body.

        Body twist in the body's frame, linear first. For each leg -J^-1 [I, -[f]x], f its foot in that frame;
        the least-squares rates where a leg has more than three joints.

        Args:
            joints: joint -> position [rad or m].

        Raises:
            SpecError: a joint is missing.
        """
        rows = []
        for chain in self.chains.values():
            q = self._values(chain, joints)
            foot = chain.pose(q).translation
            carried = np.hstack([np.eye(3), -skew(foot)])
            rows.append(-np.linalg.pinv(chain.point_jacobian(q), rcond=1e-12) @ carried)
        return np.vstack(rows)

    def _values(self, chain: Chain, joints: Mapping[str, float]) -> Array:
        missing = [j for j in chain.joints if j not in joints]
        if missing:
            raise SpecError(f"platform: no position given for joint '{missing[0]}'")
        return np.array([joints[j] for j in chain.joints], dtype=np.float64)


def fit(here: Array, there: Array) -> pin.SE3:
    """The pose T that takes points (P, 3) [m] closest to others: least squares, by an SVD."""
    a, b = here.mean(axis=0), there.mean(axis=0)
    u, _, vt = np.linalg.svd((here - a).T @ (there - b))
    turn = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    return pin.SE3(turn, b - turn @ a)
