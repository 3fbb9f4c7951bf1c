"""Feet through the air, tracks of the body, and footholds on uneven ground."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb
from wbplan.gaits import (
    CosineSwing,
    QuinticSwing,
    Track,
    Walker,
    arc,
    firm,
    gait_for,
    on_the_spot,
    over,
    schedule,
    straight,
    through,
)
from wbplan.gaits.schedule import beats_of
from wbplan.sampling import sample

METRES = st.floats(-1.0, 1.0)
POINTS = st.tuples(METRES, METRES, METRES).map(np.array)


@given(
    start=POINTS, goal=POINTS, height=st.floats(0.0, 0.5), early=st.floats(0.0, 0.3), lift=st.floats(0.0, 1.0)
)
def test_swings_go_from_end_to_end_over_their_apex(
    start: np.ndarray, goal: np.ndarray, height: float, early: float, lift: float
) -> None:
    times = np.linspace(0.0, 2.0, 401)
    for path in (
        QuinticSwing(start, goal, height, 2.0, early),
        CosineSwing(start, goal, height, 2.0, lift * height),
        CosineSwing(start, goal, height, 2.0, lift * height, 0.3, smooth=True),
    ):
        points = path.points(times)
        assert points[0] == pytest.approx(start, abs=1e-12)
        assert points[-1] == pytest.approx(goal, abs=1e-12)
        assert points[:, 2].max() == pytest.approx(max(start[2], goal[2]) + height, abs=1e-9)
        assert np.abs(np.diff(points, axis=0)).max() < 0.12  # continuous: at most 8 m/s here
        assert np.array([path.at(t) for t in times[::40]]) == pytest.approx(points[::40])
        assert sample(path, times)[0] == pytest.approx(points)


def test_the_smooth_swings_begin_and_end_at_rest() -> None:
    step = 1e-4
    ends = np.array([0.0, step, 1.0 - step, 1.0])
    start, goal = np.zeros(3), np.array([0.4, 0.1, 0.05])
    for path in (QuinticSwing(start, goal, 0.1, 1.0), CosineSwing(start, goal, 0.1, 1.0, 0.03, smooth=True)):
        points = path.points(ends)
        assert np.abs(points[[1, 3]] - points[[0, 2]]).max() / step < 1e-4
    jumps = CosineSwing(start, goal, 0.1, 1.0, 0.03).points(ends)
    assert np.abs(jumps[[1, 3]] - jumps[[0, 2]]).max() / step > 0.1


@pytest.mark.parametrize(
    "make",
    [
        lambda: QuinticSwing(np.zeros(3), np.ones(3), -0.1, 1.0),
        lambda: QuinticSwing(np.zeros(3), np.ones(3), 0.1, 1.0, 0.5),
        lambda: QuinticSwing(np.zeros(2), np.ones(3), 0.1, 1.0),
        lambda: CosineSwing(np.zeros(3), np.ones(3), 0.1, 1.0, 0.2),
        lambda: CosineSwing(np.zeros(3), np.ones(3), 0.1, 1.0, 0.0, 0.5),
        lambda: CosineSwing(np.zeros(3), np.array([0.0, np.nan, 0.0]), 0.1, 1.0),
        lambda: straight(0.0),
        lambda: arc(1.0, float("inf")),
        lambda: on_the_spot(0.0, 1.0),
        lambda: through([[0.0, 0.0]]),
        lambda: through([1.0, 2.0]),
        lambda: Track(1.0, lambda way: (way, 0.0)),  # type: ignore[arg-type, return-value]
    ],
)
def test_what_is_no_swing_or_track_is_refused(make: object) -> None:
    with pytest.raises(wb.SpecError):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    "track",
    [straight(1.3, 0.7, 0.4), arc(1.3, 1.9, 0.2), through([[0.5, 0.2], [1.0, 0.0], [1.2, -0.6]])],
)
def test_tracks_go_their_length(track: Track) -> None:
    places = np.array([track.place(way) for way in np.linspace(0.0, track.length, 2001)])
    gone = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
    assert gone.sum() == pytest.approx(track.length, rel=1e-4)
    assert gone == pytest.approx(np.full(2000, track.length / 2000), rel=0.02)
    assert track.pose(0.0).translation == pytest.approx(np.zeros(3))


def test_an_arc_turns_the_body_with_the_way() -> None:
    track = arc(2.0, 1.0)
    a, b = track.place(1.0), track.place(1.001)
    assert np.arctan2(*(b - a)[1::-1]) == pytest.approx(a[2], abs=1e-3)
    spot = on_the_spot(-0.5, 0.8)
    assert spot.length == pytest.approx(0.4)
    assert spot.place(0.4) == pytest.approx([0.0, 0.0, -0.5])


def test_footholds_keep_off_edges() -> None:
    box = wb.Obstacle("step", wb.Box((0.4, 2.0, 0.1)), (1.0, 0.0, 0.05))
    ground = over(wb.Obstacles([wb.Obstacle("floor", wb.Ground()), box]).terrain)
    assert ground(1.0, 0.0) == pytest.approx(0.1)
    assert over(wb.Obstacles([box]).terrain)(5.0, 0.0) == 0.0
    place = firm(ground, 0.03, 0.1)
    assert place("leg", np.array([0.5, 0.0, 0.0])) == pytest.approx([0.5, 0.0, 0.0])
    for x in (0.79, 0.81, 1.19, 1.2):
        moved = place("leg", np.array([x, 0.0, 9.0]))
        assert abs(abs(moved[0] - 1.0) - 0.2) > 0.03 - 1e-9
        assert np.linalg.norm(moved[:2] - [x, 0.0]) <= 0.1 + 1e-12
        assert moved[2] == pytest.approx(ground(*moved[:2]))
    with pytest.raises(wb.GaitError, match=r"'leg': no firm foothold within 0\.010 m of \(0\.800, 0\.000\)"):
        firm(ground, 0.03, 0.01)("leg", np.array([0.8, 0.0, 0.0]))


def test_feet_land_where_they_work_evenly() -> None:
    walker = Walker(wb.load_robot("heavy_hexapod"))
    stance = walker.stance()
    gait = gait_for(walker, "pentagon", stance, 0.0, 0.2)
    made = schedule(beats_of(gait, 18), stance, straight(0.6), 1.0)
    course = made.course
    for leg, foot in stance.feet.items():
        lands = [(step.end, step.swing[leg][1]) for step in made.steps if leg in step.swing]
        for (landed, place), (again, _) in pairwise(lands):
            ahead = place[0] - foot[0] - course.gone(landed)
            behind = course.gone(again - 1.0) - (place[0] - foot[0])
            assert ahead == pytest.approx(behind, abs=1e-6)
        assert lands[-1][1][:2] == pytest.approx(foot + [0.6, 0.0], abs=1e-9)
        assert made.feet[leg] == pytest.approx(lands[-1][1])
