"""What legs can do: joints along a walk in closed form, and how long a stroke a stance has room for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import GaitError
from wbplan.gaits.schedule import Step
from wbplan.gaits.stance import Stance, Walker
from wbplan.gaits.swing import QuinticSwing

Array = NDArray[np.float64]

#: Moments looked at in a step.
MOMENTS = 7
#: Heights of the body that are tried, of the stance's own.
HEIGHTS = np.arange(0.8, 1.31, 0.05)


@final
@dataclass(frozen=True)
class Fastest:
    """The joint that comes nearest to its speed limit, or goes furthest beyond.

    Attributes:
        share: of its limit.
        joint: its name.
        step: where.
    """

    share: float
    joint: str
    step: str


def follow(
    walker: Walker,
    steps: Sequence[Step],
    swings: Sequence[Mapping[str, Any]],
    body: Callable[[Array], tuple[Array, Array]],
) -> Fastest:
    """Joints of all legs along a walk, by closed forms.

    Args:
        walker: the legs.
        steps: in order.
        swings: of each step, limb -> path of its foot.
        body: times (N,) [s] -> places of the body (N, 3) [m] and yaws (N,) [rad].

    Raises:
        GaitError: a leg cannot reach its foothold, or its place in the air.
    """
    model, worst = walker.robot.model, Fastest(0.0, "", "")
    last = {leg: _joints(walker, leg, walker.state.q) for leg in walker.closed}
    limits = {
        leg: np.array([model.velocityLimit[walker.robot.joint_index(j)[1]] for j in form.joints])
        for leg, form in walker.closed.items()
    }
    for k, (step, paths) in enumerate(zip(steps, swings, strict=True)):
        times = np.linspace(0.0, step.duration, MOMENTS)
        places, yaws = body(step.begin + times)
        flying = {limb: path.points(times) for limb, path in paths.items()}
        for m, (place, yaw) in enumerate(zip(places, yaws, strict=True)):
            c, s = np.cos(yaw), np.sin(yaw)
            turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            for leg, form in walker.closed.items():
                foot = flying[leg][m] if leg in flying else step.support.get(leg)
                if foot is None:
                    continue
                found = form.solve(turn @ (foot - place))
                if not found.within:
                    what = "its place in the air" if leg in flying and 0 < m < MOMENTS - 1 else "its foothold"
                    raise GaitError(
                        f"step '{step.name}', at {step.begin + times[m]:.2f} s: '{leg}' cannot reach {what}: "
                        f"{found.reason}",
                        step=max(k - 1, 0),
                    )
                joints = found.nearest(last[leg]).joints
                if m:
                    shares = np.abs(joints - last[leg]) / (times[1] * limits[leg])
                    fast = int(shares.argmax())
                    if shares[fast] > worst.share:
                        worst = Fastest(float(shares[fast]), form.joints[fast], step.name)
                last[leg] = joints
    return worst


def _joints(walker: Walker, leg: str, q: Array) -> Array:
    return np.array([q[walker.robot.joint_index(joint)[0]] for joint in walker.closed[leg].joints])


def room(
    walker: Walker, stance: Stance, lift: float, heading: float | None = None, wanted: float = 0.0
) -> float:
    """The longest stroke [m] that every leg can make about its stance, on the ground and lifted in between.

    Args:
        walker: the legs.
        stance: of the feet.
        lift: height of the swing [m].
        heading: of the stroke in the body [rad]; of any where not given.
        wanted: less than that [m] is told as 0, which is sooner found out.
    """
    headings = [heading] if heading is not None else list(np.arange(4) * np.pi / 4.0)
    least = 2.0 * stance.height
    for leg, foot in stance.feet.items():
        if leg not in walker.closed:
            continue
        for angle in headings:
            ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
            place = np.array([*foot, -stance.height])
            least = _stroke(walker.closed[leg], place, ahead, lift, least, min(wanted, least))
            if least <= 0.0:
                return 0.0
    return least


def _stroke(leg: Any, foot: Array, ahead: Array, lift: float, most: float, wanted: float) -> float:
    """The longest stroke of one leg in one direction, `most` [m] at most, by bisection; 0 below `wanted`."""
    times = np.linspace(0.0, 1.0, 17)

    def fits(stroke: float) -> bool:
        half = 0.5 * stroke * ahead
        # At duty factor 1/2 the foot goes two strokes while the body goes one: it first falls behind.
        air = QuinticSwing(foot - half, foot + 3.0 * half, lift, 1.0).points(times)
        air -= 2.0 * times[:, None] * half
        ground = foot + np.linspace(-1.0, 1.0, 3)[:, None] * half
        return all(leg.reachable(place) for place in (*ground, *air))

    if fits(most):
        return most
    if not fits(wanted):
        return 0.0
    low, high = wanted, most
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def roomiest(walker: Walker, stance: Stance, lift: float, heading: float | None = None) -> Stance:
    """The stance at the body height, from 0.8 to 1.3 of its own, that leaves most room for strokes.

    Args:
        walker: the legs.
        stance: of the feet.
        lift: height of the swing [m].
        heading: of the stroke in the body [rad]; of any where not given.
    """
    best, most = stance, 0.0
    for height in stance.height * HEIGHTS:
        tried = Stance(stance.feet, float(height))
        stroke = room(walker, tried, lift, heading, most)
        if stroke > most:
            best, most = tried, stroke
    return best


def comfortable(
    walker: Walker, stance: Stance, lift: float, *, adjust: bool = True, heading: float | None = None
) -> tuple[Stance, float]:
    """A stance and a stroke [m] that legs make with ease.

    The stroke is six tenths of the room that there is in any direction (in the one given, where there is none
    in others), and half the body's height at most.

    Args:
        walker: the legs.
        stance: of the feet.
        lift: height of the swing [m].
        adjust: the body may be higher or lower where legs have next to no room at the stance.
        heading: of travel in the body [rad].

    Raises:
        GaitError: legs have no room for any stroke; says why the first of them has none.
    """

    def best(towards: float | None) -> tuple[Stance, float]:
        stroke, found = room(walker, stance, lift, towards), stance
        if adjust and stroke < 0.1 * stance.height:
            found = roomiest(walker, stance, lift, towards)
            stroke = room(walker, found, lift, towards)
        return found, min(0.6 * stroke, 0.5 * stance.height)

    found, stroke = best(None)
    if stroke <= 0.0 and heading is not None:
        found, stroke = best(heading)
    if stroke <= 0.0:
        raise GaitError(
            f"stance: no leg may make the least stroke: {_hindered(walker, stance, lift, heading)}"
        )
    return found, stroke


def _hindered(walker: Walker, stance: Stance, lift: float, heading: float | None) -> str:
    """Why the first leg without room has none, at the height at which fewest legs have none."""
    ahead = 1e-3 * np.array([np.cos(heading or 0.0), np.sin(heading or 0.0), 0.0])
    up = np.array([0.0, 0.0, lift])
    reasons = []
    for height in stance.height * HEIGHTS:
        here = []
        for leg, form in walker.closed.items():
            foot = np.array([*stance.feet[leg], -height])
            found = [form.solve(place) for place in (foot, foot + up, foot - ahead, foot + ahead)]
            here += [f"'{leg}', {each.reason}" for each in found if not each.within][:1]
        reasons.append(here or ["there is less than a few millimetres of room"])
    return min(reasons, key=len)[0]


def shares(walker: Walker, stance: Stance, heading: float) -> dict[str, Array]:
    """What each joint of a standing leg does for the body's speed, at the middle of the stance.

    Of the joint rates that move the foot straight back, the speed back that each makes by itself; 1 in all.

    Args:
        walker: the legs.
        stance: of the feet.
        heading: of travel in the body [rad].

    Returns:
        Leg -> share of each joint, from the body outward.
    """
    back = -np.array([np.cos(heading), np.sin(heading), 0.0])
    state = walker.stand(stance)
    found = {}
    for leg, form in walker.closed.items():
        jacobian = form.chain().point_jacobian(_joints(walker, leg, state.q))
        found[leg] = (jacobian * np.linalg.solve(jacobian, back)).T @ back
    return found
