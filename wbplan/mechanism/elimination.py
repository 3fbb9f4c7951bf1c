"""Forward displacement by elimination: all roots of one polynomial for each place of the second foot."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.mechanism.leg import ThreeJointLeg
from wbplan.mechanism.platform import Platform
from wbplan.mechanism.poe import Chain
from wbplan.mechanism.stance import foot_plane

Array = NDArray[np.float64]

SAMPLES = 16
"""Points on the unit circle; more than twice the degree, so the Laurent coefficients are exact."""
ON_CIRCLE = 1e-6
"""How far a root may be from the unit circle, by rounding, for its angle to be real."""


def eliminate(platform: Platform, known: Mapping[str, float]) -> tuple[list[pin.SE3], int] | None:
    """All real poses of the body and the number of complex roots; None where elimination does not apply.

    Args:
        platform: legs and feet.
        known: joint -> position [rad or m].
    """
    picked = _pattern(platform, known)
    if picked is None:
        return None
    first, second, third = picked
    b1 = platform.chains[first].pose(_values(platform.chains[first], known)).translation
    world = [platform.feet[n] for n in (first, second, third)]
    leg = platform.legs[third]
    k, value = next((k, known[j]) for k, j in enumerate(leg.joints) if j in known)
    equation = _equation(leg, k, value)
    height = 1 if k == 0 else 2
    poses: list[pin.SE3] = []
    degree = 0
    for b2 in _circle_meets_sphere(
        platform.chains[second], known, b1, float(np.linalg.norm(world[1] - world[0]))
    ):
        degree += 2 * height
        place = _third_foot(b1, b2, world)
        for phi in _real_angles(equation, place, height):
            body = foot_plane(b1, b2, place(np.array([phi]))[0])
            poses.append(foot_plane(*world) * body.inverse())
    return poses, degree


def _pattern(platform: Platform, known: Mapping[str, float]) -> tuple[str, str, str] | None:
    """The legs known whole, but for one joint, and in one joint only; None where the set is another."""
    count = {n: sum(j in known for j in c.joints) for n, c in platform.chains.items()}
    used = {n: c for n, c in count.items() if c}
    if len(used) != 3 or sum(used.values()) != len(known):
        return None
    for first, second, third in _orders(list(used)):
        a, b = platform.chains[first], platform.chains[second]
        if (
            used[first] == len(a.joints)
            and used[second] == len(b.joints) - 1
            and used[third] == 1
            and third in platform.legs
            and _passive_turns(b, known)
        ):
            return first, second, third
    return None


def _orders(names: list[str]) -> list[tuple[str, str, str]]:
    a, b, c = names
    return [(a, b, c), (a, c, b), (b, a, c), (b, c, a), (c, a, b), (c, b, a)]


def _passive_turns(chain: Chain, known: Mapping[str, float]) -> bool:
    index = next(k for k, j in enumerate(chain.joints) if j not in known)
    return bool(np.linalg.norm(chain.screws[index, :3]) > 0.5)


def _values(chain: Chain, known: Mapping[str, float]) -> Array:
    return np.array([known[j] for j in chain.joints], dtype=np.float64)


def _circle_meets_sphere(
    chain: Chain, known: Mapping[str, float], centre: Array, radius: float
) -> list[Array]:
    """Where the foot of a leg with one unknown turn is at a distance from a point: two places at most."""
    rest = chain.hold({j: v for j, v in known.items() if j in chain.joints})
    axis, moment = rest.screws[0, :3], rest.screws[0, 3:]
    foot = rest.home.translation
    on_axis = np.cross(axis, moment)
    middle = on_axis + axis * float(axis @ (foot - on_axis))
    x = foot - middle
    y = np.cross(axis, x)
    # |middle + x cos t + y sin t - centre|^2 = radius^2  ->  A cos t + B sin t = C
    away = middle - centre
    a, b = 2.0 * float(away @ x), 2.0 * float(away @ y)
    c = radius**2 - float(away @ away) - float(x @ x)
    size = float(np.hypot(a, b))
    if size == 0.0 or abs(c) > size * (1.0 + 1e-12):
        return []
    base, spread = np.arctan2(b, a), np.arccos(np.clip(c / size, -1.0, 1.0))
    angles = [base + spread] if spread == 0.0 else [base + spread, base - spread]
    return [middle + x * np.cos(t) + y * np.sin(t) for t in angles]


def _third_foot(b1: Array, b2: Array, world: list[Array]) -> Callable[[Array], Array]:
    """Angles phi (S,) -> third foot (S, 3) in the body, going round the line through the first two."""
    along = (world[1] - world[0]) / np.linalg.norm(world[1] - world[0])
    span = world[2] - world[0]
    axial = float(along @ span)
    radial = float(np.linalg.norm(span - axial * along))
    u = (b2 - b1) / np.linalg.norm(b2 - b1)
    e = np.cross(u, np.eye(3)[int(np.argmin(np.abs(u)))])
    e /= np.linalg.norm(e)
    f = np.cross(u, e)

    def place(phi: Array) -> Array:
        round_ = np.outer(np.cos(phi), e) + np.outer(np.sin(phi), f)
        return np.asarray(b1 + axial * u + radial * round_)

    return place


def _equation(leg: ThreeJointLeg, joint: int, value: float) -> Callable[[Array], Array]:
    """Feet (S, 3) in the body -> (S,), zero where the leg's one known joint has its value, for either rho.

    With (x, y, z) the foot in the leg, h = up z, rho^2 = x^2 + y^2 - offset^2 and G = rho^2 + h^2 ...:
    joint 1: y cos q1 - x sin q1 = offset; joint 2: (rho - l1 - l2 c2)^2 + (h - l2 s2)^2 = l3^2;
    joint 3: (rho - l1)^2 + h^2 = l2^2 + l3^2 + 2 l2 l3 c3. The last two are G - k rho = 0, taken as
    G^2 - k^2 rho^2 = 0.
    """
    angle = leg.signs[joint] * value + leg.zeros[joint]
    c, s = np.cos(angle), np.sin(angle)

    def equation(feet: Array) -> Array:
        x, y, z = ((feet - leg.placement.translation) @ leg.placement.rotation).T
        h = leg.up * z
        if joint == 0:
            return np.asarray(y * c - x * s - leg.offset)
        square = x**2 + y**2 - leg.offset**2
        if joint == 1:
            reach, drop, least = leg.l1 + leg.l2 * c, leg.l2 * s, leg.l3**2
        else:
            reach, drop, least = leg.l1, 0.0, leg.l2**2 + leg.l3**2 + 2.0 * leg.l2 * leg.l3 * c
        g = square + h**2 - 2.0 * h * drop + reach**2 + drop**2 - least
        return np.asarray(g**2 - 4.0 * reach**2 * square)

    return equation


def _real_angles(
    equation: Callable[[Array], Array], place: Callable[[Array], Array], height: int
) -> list[float]:
    """Real zeros of a trigonometric polynomial of a known degree: roots in e^(i phi) on the unit circle."""

    def function(angle: Array) -> Array:
        return equation(place(angle))

    phi = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    laurent = np.fft.fft(function(phi)) / SAMPLES
    coefficients = np.concatenate([laurent[height:0:-1], laurent[:1], laurent[: -height - 1 : -1]])
    # laurent[k] multiplies e^(i k phi); np.roots takes the highest power first.
    roots = np.roots(coefficients)
    return [_polished(function, float(np.angle(z))) for z in roots if abs(abs(z) - 1.0) < ON_CIRCLE]


def _polished(function: Callable[[Array], Array], phi: float) -> float:
    """Two Newton steps with a central difference: takes rounding of the roots away."""
    step = 1e-5
    for _ in range(2):
        before, at, after = function(np.array([phi - step, phi, phi + step]))
        slope = (after - before) / (2.0 * step)
        if slope == 0.0 or abs(at / slope) > 1e-3:
            break
        phi -= at / slope
    return phi
