"""Margins along gaits: the papers' radii, and what a body can be held with."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.gaits import (
    Gait,
    best_margin,
    crawls,
    cycle_margins,
    pentagon,
    pentapod,
    possible,
    quadrangular,
    regular_stance,
    require,
    step_margins,
    tripod,
)

SIX, FIVE, FOUR = tuple("123456"), tuple("23456"), ("rf", "lf", "lr", "rr")
HEXAGON = regular_stance(SIX)
PENTAGON = regular_stance(FIVE, first=np.radians(36.0))
OBLONG = {"rf": (1.0, -0.6), "lf": (1.0, 0.6), "lr": (-1.0, 0.6), "rr": (-1.0, -0.6)}
HEADINGS = np.linspace(0.0, 2.0 * np.pi, 73)


def test_centre_margins_of_hexapod_gaits() -> None:
    """0.5 CR for the tripod, every pair of Table 2 and the pentagon."""
    for gait in (tripod(SIX), *quadrangular(SIX), pentagon(SIX)):
        assert [step.centre for step in step_margins(gait, HEXAGON)] == pytest.approx([0.5] * gait.step_count)


def test_neighbours_leave_no_margin() -> None:
    """Why Table 2 leaves out the pairs {1, 6} and {3, 4}."""
    gait = Gait("pairs", (("1", "6"), ("3", "4"), ("2", "5")), SIX)
    assert [round(step.centre, 12) for step in step_margins(gait, HEXAGON)] == [0.0, 0.0, 0.5]


@pytest.mark.parametrize(("name", "best"), [("4+1", [0.559] * 5), ("3+2", [0.4271] * 5)])
def test_margins_of_pentapod_gaits(name: str, best: list[float]) -> None:
    """0.309 CR at the centre, 0.427 CR at best on three feet: 0.118 CR is what is gained."""
    steps = step_margins(pentapod(FIVE)[name], PENTAGON)
    assert [step.centre for step in steps] == pytest.approx([0.3090] * 5, abs=5e-5)
    assert [step.best for step in steps] == pytest.approx(best, abs=5e-5)


def test_margins_of_the_mixture_gait() -> None:
    steps = step_margins(pentapod(FIVE)["mixture"], PENTAGON)
    assert [step.support for step in steps] == [("3", "4", "6"), ("2", "4", "5"), ("2", "3", "5", "6")]
    assert [step.centre for step in steps] == pytest.approx([0.3090] * 3, abs=5e-5)
    three = steps[0]
    assert three.best - three.centre == pytest.approx(0.118, abs=5e-4)
    assert np.linalg.norm(three.place) == pytest.approx(0.382, abs=5e-4)


@pytest.mark.parametrize(
    ("name", "worst"), [("4+1", (0.284, 0.259)), ("3+2", (0.272, 0.234)), ("mixture", (0.259, 0.209))]
)
def test_worst_margin_while_the_body_moves(name: str, worst: tuple[float, float]) -> None:
    """By v tau / CR = 0.05 and 0.10, whatever the heading."""
    gait = pentapod(FIVE)[name]
    for pace, expected in zip((0.05, 0.10), worst, strict=True):
        found = []
        for heading in HEADINGS:
            travel = gait.step_count * pace * np.array([np.cos(heading), np.sin(heading)])
            found.append(cycle_margins(gait, PENTAGON, travel)[1].min())
        assert min(found) == pytest.approx(expected, abs=1e-3)


def test_a_moving_body_may_do_better_than_a_straight_one() -> None:
    for gait in (tripod(SIX), *quadrangular(SIX)):
        straight = best_margin(gait, HEXAGON, (0.3, 0.1), straight=True)
        assert straight == pytest.approx(cycle_margins(gait, HEXAGON, (0.3, 0.1))[1].min())
        assert best_margin(gait, HEXAGON, (0.3, 0.1)) >= straight - 1e-9


def test_which_crawls_are_possible() -> None:
    """Without sway only the regular crawl, rear then front foot of a side; with it and pauses all six."""
    straight = [gait for gait in crawls(FOUR, 0.5) if possible(gait, OBLONG, (0.6, 0.0), straight=True)]
    assert [[leg for step in gait.steps for leg in step] for gait in straight] == [["rf", "lr", "lf", "rr"]]
    assert all(possible(gait, OBLONG, (0.6, 0.0)) for gait in crawls(FOUR, 0.5))
    unpaused = [possible(gait, OBLONG, (0.6, 0.0)) for gait in crawls(FOUR, 0.0)]
    assert unpaused == [True, False, False, False, False, True]


def test_a_gait_that_cannot_be_held_says_where_and_what_would() -> None:
    pairs = Gait("pairs", (("1", "6"), ("3", "4"), ("2", "5")), SIX)
    with pytest.raises(
        wb.GaitError, match=r"step 1 \(1, 6 swing.*largest margin there is 0.4.*times as wide"
    ):
        require(pairs, HEXAGON, 0.6)
    with pytest.raises(wb.GaitError, match=r"margin of 0\.3500 m.*a stride of 0\.6\d+ m would hold") as error:
        require(tripod(SIX), HEXAGON, 0.35, (1.0, 0.0))
    assert error.value.stride is not None
    held = error.value.stride * np.array([1.0, 0.0])
    require(tripod(SIX), HEXAGON, 0.35, held)
    with pytest.raises(wb.GaitError, match=r"not even a stride of 0.*pause"):
        require(crawls(FOUR, 0.0)[1], OBLONG, 0.1, (0.2, 0.0))


def test_a_step_on_a_line_of_feet_is_refused() -> None:
    feet = {leg: (float(leg), 0.0) for leg in "123"} | {"4": (0.0, 1.0)}
    with pytest.raises(wb.GaitError, match=r"cannot be held in step 4 \(4 swing\).*on one line"):
        step_margins(Gait("line", (("1",), ("2",), ("3",), ("4",))), feet)
    with pytest.raises(wb.SpecError, match="no foot for 2"):
        step_margins(tripod(SIX), {leg: foot for leg, foot in HEXAGON.items() if leg != "2"})
