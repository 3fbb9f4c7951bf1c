"""Gaits by name, for any legs given in their order round the body."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import permutations, product
from types import MappingProxyType

from wbplan.errors import SpecError, listing
from wbplan.gaits.gait import Gait

Legs = Sequence[str]


def tripod(legs: Legs) -> Gait:
    """Every other leg, then the rest; 3+3 of a hexapod.

    Args:
        legs: six or another even number of legs, in their order round the body.
    """
    _count(legs, "tripod", range(6, 40, 2), "an even number of legs, six or more")
    return Gait("tripod", (tuple(legs[0::2]), tuple(legs[1::2])), tuple(legs))


def wave(legs: Legs, by: int = 1) -> Gait:
    """One leg at a time: Zhuang's pentagon gait of six legs, Zheng's 4+1 of five.

    Args:
        legs: four or more, in their order round the body.
        by: the next leg to swing is that many places further round.
    """
    count = len(legs)
    if count < 4:
        raise SpecError(f"gait 'wave': expected four legs or more, got {listing(legs)}")
    order = [(k * by) % count for k in range(count)]
    if len(set(order)) != count:
        raise SpecError(f"gait 'wave': going round {count} legs by {by} leaves some out")
    return Gait("wave", tuple((legs[k],) for k in order), tuple(legs))


def pentagon(legs: Legs) -> Gait:
    """Zhuang's: five of six legs stand, the next one round swings."""
    _count(legs, "pentagon", [6], "six legs")
    return wave(legs).renamed("pentagon")


def quadrangular(legs: Legs) -> tuple[Gait, ...]:
    """All of Zhuang's Table 2, by its rule: four of six legs stand, in 18 orders.

    Three disjoint pairs swing in turn. A pair has (i) one leg of the first three and one of the last three,
    so that two stand ahead and two behind for travel along the line that parts them, and (ii) is not of
    neighbours, or the body's centre would be on the support's edge.

    Args:
        legs: six, in their order round the body; the first three are those on one side of the line across
            travel.
    """
    _count(legs, "quadrangular", [6], "six legs")
    pairs = [(a, b) for a, b in product(range(3), range(3, 6)) if (b - a) % 6 not in (1, 5)]
    found: list[Gait] = []
    for triple in permutations(pairs, 3):
        if len({k for pair in triple for k in pair}) == 6:
            steps = tuple((legs[a], legs[b]) for a, b in triple)
            found.append(Gait(f"quadrangular-{len(found) + 1}", steps, tuple(legs)))
    return tuple(found)


def crawls(legs: Legs, pause: float = 0.5) -> tuple[Gait, ...]:
    """The six orders in which four legs can step one by one, each with a pause after every step.

    Two legs at the ends of a diagonal that swing one after the other share no more than that diagonal as
    support; the body crosses it in the pause. `possible` (see `wbplan.gaits.margins`) tells which orders hold
    for a stance and a direction.

    Args:
        legs: four, in their order round the body.
        pause: time of a pause against a swing; 0 leaves pauses out.
    """
    _count(legs, "crawl", [4], "four legs")
    found = []
    for k, order in enumerate(permutations(legs[1:])):
        gait = Gait(f"crawl-{k + 1}", tuple((leg,) for leg in (legs[0], *order)), tuple(legs))
        found.append(gait.paused(pause) if pause else gait)
    return tuple(found)


def pentapod(legs: Legs) -> Mapping[str, Gait]:
    """Zheng's gaits of the five legs that are left when one limb of a hexapod is an arm.

    '4+1' lifts one leg at a time, '3+2' two, each leg twice in five steps, and 'mixture' two, two and one.
    Legs that swing together or one after the other are never neighbours, but across the arm's gap.

    Args:
        legs: five, in their order round the body, the first one next to the arm.
    """
    _count(legs, "pentapod", [5], "five legs")
    a, b, c, d, e = legs
    gaits = (
        Gait("4+1", ((a,), (c,), (e,), (b,), (d,)), tuple(legs)),
        Gait("3+2", ((a, c), (b, d), (c, e), (d, a), (e, b)), tuple(legs)),
        Gait("mixture", ((a, d), (b, e), (c,)), tuple(legs)),
    )
    return MappingProxyType({gait.name: gait for gait in gaits})


def gaits_of(legs: Legs) -> Mapping[str, Gait]:
    """Every built-in gait of so many legs, by name.

    Args:
        legs: in their order round the body; of six the first three on one side of the line across travel.
    """
    makers: dict[int, list[Callable[[], Sequence[Gait]]]] = {
        4: [lambda: crawls(legs)],
        5: [lambda: list(pentapod(legs).values())],
        6: [
            lambda: [tripod(legs), tripod(legs).renamed("3+3"), pentagon(legs), wave(legs, 5)],
            lambda: quadrangular(legs),
            lambda: [quadrangular(legs)[0].renamed("quadrangular")],
        ],
    }
    made = [gait for make in makers.get(len(legs), [lambda: [wave(legs)]]) for gait in make()]
    return MappingProxyType({gait.name: gait for gait in made})


def distinct(gaits: Mapping[str, Gait]) -> tuple[str, ...]:
    """Names of gaits, each only under the first of its names."""
    first: dict[object, str] = {}
    for name, gait in gaits.items():
        first.setdefault((gait.steps, gait.lasting, gait.advance), name)
    return tuple(first.values())


def gait_named(name: str, legs: Legs) -> Gait:
    """A built-in gait by its name.

    Raises:
        SpecError: so many legs have no such gait; the message lists those that they have.
    """
    known = gaits_of(legs)
    if name not in known:
        raise SpecError(f"{len(legs)} legs have no gait '{name}'; they have: {listing(list(known), most=40)}")
    return known[name]


def _count(legs: Legs, name: str, counts: Sequence[int], expected: str) -> None:
    if isinstance(legs, str) or len(legs) not in counts or len(set(legs)) != len(legs):
        raise SpecError(f"gait '{name}': expected {expected}, all different, got {legs!r}")
