"""Gaits as data: what they are made of, what follows from it, and what is refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import wbplan as wb
from wbplan.gaits import Gait, crawls, gait_named, gaits_of, pentagon, pentapod, quadrangular, tripod, wave

SIX = tuple("123456")
FIVE = tuple("23456")
FOUR = tuple("abcd")
#: Zhuang, Table 2: the three pairs of each of the 18 sequences.
TABLE_2 = [
    order
    for parts in (("25", "36", "14"), ("24", "36", "15"), ("14", "26", "35"))
    for order in itertools.permutations(parts)
]


def test_table_2_of_zhuang_is_found_by_its_rule() -> None:
    found = [tuple("".join(sorted(pair)) for pair in gait.steps) for gait in quadrangular(SIX)]
    assert len(found) == len(set(found)) == 18
    assert set(found) == {tuple("".join(sorted(p)) for p in order) for order in TABLE_2}


@pytest.mark.parametrize(
    ("gait", "duty", "factor"),
    [(tripod(SIX), 1 / 2, 2.0), (quadrangular(SIX)[0], 2 / 3, 1.5), (pentagon(SIX), 5 / 6, 1.2)],
)
def test_speeds_of_zhuang(gait: Gait, duty: float, factor: float) -> None:
    """v = s n / (T u): 2 s/T, 3 s/(2 T), 6 s/(5 T)."""
    assert gait.duty_factor == pytest.approx(duty)
    assert gait.speed(0.3, 1.7) == pytest.approx(factor * 0.3 / 1.7)
    standing = np.mean([len(gait.support(k)) for k in range(gait.step_count)])
    assert gait.speed(0.3, 1.7) == pytest.approx(0.3 * 6 / (1.7 * standing))


@pytest.mark.parametrize(
    ("name", "duty", "steps", "mean", "longest"),
    [("4+1", 4 / 5, 5, 1 / 4, 1 / 4), ("3+2", 3 / 5, 5, 1 / 1.5, 1 / 2), ("mixture", 2 / 3, 3, 1 / 2, 1 / 2)],
)
def test_speeds_of_zheng(name: str, duty: float, steps: int, mean: float, longest: float) -> None:
    """Strokes s and swings of tau: v = s/4 tau, s/1.5 tau (mean stroke; s/2 tau by the longest), s/2 tau."""
    gait, s, tau = pentapod(FIVE)[name], 0.08, 0.4
    assert gait.duty_factor == pytest.approx(duty)
    assert gait.step_count == steps
    assert gait.speed(s, steps * tau) == pytest.approx(mean * s / tau)
    assert gait.speed(s, steps * tau, longest=True) == pytest.approx(longest * s / tau)


def test_pentapod_gaits_never_lift_neighbours_together() -> None:
    ring = {frozenset((a, b)) for a, b in itertools.pairwise((*FIVE, FIVE[0]))}
    for gait in pentapod(FIVE).values():
        assert not any(frozenset(step) in ring for step in gait.steps if len(step) == 2)


def test_crawls_are_all_orders_of_four_legs() -> None:
    orders = {tuple(leg for step in gait.steps for leg in step) for gait in crawls(FOUR)}
    assert orders == {("a", *rest) for rest in itertools.permutations("bcd")}
    assert all(gait.step_count == 8 for gait in crawls(FOUR))
    assert all(gait.step_count == 4 for gait in crawls(FOUR, pause=0.0))


@pytest.mark.parametrize("legs", [FOUR, FIVE, SIX, tuple("abcdefgh")])
def test_every_leg_stands_as_long_as_its_duty_says(legs: tuple[str, ...]) -> None:
    for name, gait in gaits_of(legs).items():
        assert gait_named(name, legs) == gait
        for leg in legs:
            mine = [stand for stand in gait.stands if stand.leg == leg]
            assert sum(stand.stroke for stand in mine) == pytest.approx(gait.duty(leg))
            assert len(mine) == sum(leg in step for step in gait.steps)


def test_a_new_gait_takes_a_line() -> None:
    gait = Gait("ripple of eight", (("a", "e"), ("c", "g"), ("b", "f"), ("d", "h")))
    assert gait.legs == tuple("aecgbfdh")
    assert gait.duty_factor == 0.75
    assert wave(tuple("abcdefg"), by=3).steps[1] == ("d",)


def test_steps_may_last_and_go_differently() -> None:
    gait = Gait("odd", (("a",), (), ("b",), ("c",), ("d",)), lasting=(1, 2, 1, 1, 1), advance=(0, 1, 0, 0, 0))
    assert gait.duty("a") == pytest.approx(5 / 6)
    assert gait.mean_stroke == gait.longest_stroke == 1.0


def test_too_few_feet_are_refused_with_the_step() -> None:
    with pytest.raises(wb.GaitError, match=r"gait 'trot'.*step 2: b, d swing and a, c is left") as error:
        Gait("trot", (("a",), ("b", "d"), ("c",)))
    assert error.value.step == 1


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"steps": ()}, "no leg swings"),
        ({"steps": (("a", "a"),)}, "named more than once: a"),
        ({"steps": ("ab",)}, "expected a list of legs"),
        ({"steps": (("a",), ("b",)), "legs": tuple("abcde")}, "c, d, e never swings"),
        ({"steps": (("a",), ("x",)), "legs": tuple("abcd")}, "x swings but is none of its legs"),
        ({"steps": (("a",), ("b",), ("b",), ("c",), ("d",))}, "b swings in step 2 and in step 3"),
        ({"steps": (("a",), ("b",), ("c",), ("d",)), "lasting": (1, 1)}, "expected 4 numbers"),
        ({"steps": (("a",), ("b",), ("c",), ("d",)), "lasting": (1, 0, 1, 1)}, "a positive number"),
        ({"steps": (("a",), ("b",), ("c",), ("d",)), "advance": (1, -1, 1, 1)}, "0 or more"),
        ({"steps": (("a",), ("b",), ("c",), ("d",)), "advance": (float("nan"),) * 4}, "0 or more"),
    ],
)
def test_what_is_no_gait_is_refused(fields: dict[str, object], says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        Gait("mine", **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "make", [lambda: tripod(FIVE), lambda: quadrangular(FOUR), lambda: pentapod(SIX), lambda: crawls(SIX)]
)
def test_gaits_of_other_robots_are_refused(make: object) -> None:
    with pytest.raises(wb.SpecError, match=r"legs, all different|legs, six or more"):
        make()  # type: ignore[operator]
    with pytest.raises(wb.SpecError, match=r"6 legs have no gait 'trot'; they have: .*tripod"):
        gait_named("trot", SIX)
