"""What every path keeps: it passes its points, is continuous, rests at its ends, and turns about one axis."""

from __future__ import annotations

import copy
import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

import wbplan as wb

lengths = st.floats(-5.0, 5.0)
seconds = st.floats(0.05, 10.0)
shares = st.floats(0.0, 1.0)
points = st.tuples(lengths, lengths, lengths).map(np.array)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)  # rotation vectors well below half a turn
poses = st.builds(lambda w, p: pin.SE3(pin.exp3(w), p), turns, points)
rotations = turns.map(lambda w: pin.exp3(w))  # a Boost function by itself has no name to print
numbers = lengths.map(np.array)
ends = st.one_of(*(st.tuples(kind, kind) for kind in (points, poses, rotations, numbers)))
places = st.one_of(st.tuples(points, points), st.tuples(poses, poses))


def distance(a: Any, b: Any) -> float:
    """Between two values of a path: metres and radians together."""
    if isinstance(a, pin.SE3):
        return float(np.linalg.norm(a.translation - b.translation) + distance(a.rotation, b.rotation))
    if np.shape(a) == (3, 3):
        return float(np.linalg.norm(pin.log3(a.T @ b)))
    return float(np.linalg.norm(np.asarray(a) - np.asarray(b)))


def finite(value: Any) -> bool:
    array = value.homogeneous if isinstance(value, pin.SE3) else value
    rotation = array[:3, :3] if np.shape(array) in ((4, 4), (3, 3)) else np.eye(3)
    return bool(np.isfinite(array).all()) and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)


@st.composite
def waypoints(draw: st.DrawFn) -> wb.Waypoints:
    kind = draw(st.sampled_from([points, poses, rotations, numbers]))
    steps = draw(st.lists(st.floats(0.2, 3.0), min_size=1, max_size=5))
    return wb.Waypoints(
        np.concatenate([[0.0], np.cumsum(steps)]), [draw(kind) for _ in range(len(steps) + 1)]
    )


@st.composite
def smooth_paths(draw: st.DrawFn) -> tuple[Any, float, float]:
    """A path, its duration, and a bound of its speed."""
    choice = draw(st.sampled_from(["min jerk", "swing", "waypoints"]))
    duration = draw(seconds)
    if choice == "waypoints":
        path = draw(waypoints())
        gaps = [distance(a, b) for a, b in pairwise(path.points)]
        # Far above what a clamped spline does, far below what a jump does.
        return path, path.times[-1], 100.0 * (1e-3 + max(gaps)) / min(np.diff(path.times))
    if choice == "min jerk":
        start, goal = draw(ends)
        return wb.MinJerk(start, goal, duration), duration, 1.9 * distance(start, goal) / duration
    start, goal = draw(places)
    height = draw(st.floats(0.0, 0.5))
    bound = (1.9 * distance(start, goal) + 3.5 * height) / duration
    return wb.Swing(start, goal, height, duration), duration, bound


@given(smooth_paths(), shares)
def test_a_path_is_finite_and_continuous(made: tuple[Any, float, float], share: float) -> None:
    path, duration, speed = made
    for t in (share * duration, *getattr(path, "times", ()), duration, 1.5 * duration):
        here, there = path.at(t), path.at(t + 1e-6 * duration)
        assert finite(here)
        assert distance(here, there) <= 1.01 * speed * 1e-6 * duration + 1e-7
        assert distance(path.at(max(t - 1e-6 * duration, 0.0)), here) <= 1.01 * speed * 1e-6 * duration + 1e-7


@given(smooth_paths())
def test_a_path_starts_at_its_start_and_rests_at_its_goal(made: tuple[Any, float, float]) -> None:
    path, duration, _ = made
    first, last = (path.points[0], path.points[-1]) if hasattr(path, "points") else (path.start, path.goal)
    assert distance(path.at(0.0), first) < 1e-7
    for late in (0.0, 1e-9, 1.0, 1e6):
        assert distance(path.at(duration + late), last) < 1e-7
    step = 1e-4 * duration
    speed = max(distance(path.at(t), path.at(t + step)) for t in np.linspace(0.0, duration, 101)) / step
    # At rest: what is covered goes with the square of the time, so next to nothing of it at full speed.
    assert distance(path.at(step), path.at(0.0)) <= 0.05 * speed * step + 1e-8
    assert distance(path.at(duration - step), path.at(duration)) <= 0.05 * speed * step + 1e-8


def test_a_line_does_not_rest_at_its_ends() -> None:
    """The counterpart of the test above: its measure tells rest from motion."""
    line = wb.Line(np.zeros(3), np.array([1.0, 0.0, 0.0]), 2.0)
    np.testing.assert_allclose(line.at(1e-4) / 1e-4, [0.5, 0.0, 0.0])
    np.testing.assert_allclose(line.at(0.5), [0.25, 0.0, 0.0])
    np.testing.assert_array_equal(line.at(3.0), [1.0, 0.0, 0.0])


@given(waypoints())
def test_waypoints_are_passed_when_they_say(path: wb.Waypoints) -> None:
    for t, point in zip(path.times, path.points, strict=True):
        assert distance(path.at(t), point) < 1e-7


@given(
    st.lists(points, min_size=2, max_size=6), st.lists(st.floats(0.1, 3.0), min_size=5, max_size=5), shares
)
def test_waypoints_are_the_clamped_cubic_spline(
    through: list[np.ndarray], steps: list[float], share: float
) -> None:
    times = np.concatenate([[0.0], np.cumsum(steps)])[: len(through)]
    expected = CubicSpline(times, np.array(through), bc_type="clamped")
    path = wb.Waypoints(times, through)
    for t in (share * times[-1], *(0.5 * (times[1:] + times[:-1]))):
        np.testing.assert_allclose(path.at(t), expected(t), atol=1e-9)


@given(poses, turns, points, seconds, shares, st.sampled_from([wb.MinJerk, wb.Line, wb.Swing]))
def test_a_pose_turns_about_one_axis_while_its_origin_goes_straight(
    start: pin.SE3, turn: np.ndarray, goal: np.ndarray, duration: float, share: float, kind: type
) -> None:
    end = pin.SE3(start.rotation @ pin.exp3(turn), goal)
    bump = (0.0,) if kind is wb.Swing else ()
    value = kind(start, end, *bump, duration).at(share * duration)
    turned = pin.log3(start.rotation.T @ value.rotation)
    done = share if kind is wb.Line else share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    np.testing.assert_allclose(turned, done * turn, atol=1e-7)
    np.testing.assert_allclose(
        value.translation, start.translation + done * (goal - start.translation), atol=1e-9
    )


@given(points, points, st.floats(0.01, 0.3), seconds, shares)
def test_a_swing_is_a_min_jerk_path_with_a_bump_of_its_height(
    start: np.ndarray, goal: np.ndarray, height: float, duration: float, share: float
) -> None:
    swing, flat = wb.Swing(start, goal, height, duration), wb.MinJerk(start, goal, duration)
    lifted = swing.at(share * duration) - flat.at(share * duration)
    np.testing.assert_allclose(lifted[:2], 0.0, atol=1e-12)
    assert -1e-12 <= lifted[2] <= height + 1e-12
    top = swing.at(0.5 * duration) - flat.at(0.5 * duration)
    assert top[2] == pytest.approx(height)


def test_a_swing_between_poses_lifts_as_one_between_points() -> None:
    goal = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.5])), np.array([0.2, 0.1, 0.0]))
    pose = wb.Swing(pin.SE3.Identity(), goal, 0.05, 2.0).at(0.7)
    point = wb.Swing(np.zeros(3), goal.translation, 0.05, 2.0).at(0.7)
    np.testing.assert_allclose(pose.translation, point, atol=1e-15)
    assert pose.translation[2] > 0.02


def test_waypoints_may_turn_on_past_half_a_turn() -> None:
    """Full turns about one axis do not come back the short way."""
    angles = np.radians([0.0, 150.0, 300.0, 450.0, 720.0 - 150.0])
    through = [pin.SE3(pin.exp3(np.array([0.0, 0.0, a])), np.zeros(3)) for a in angles]
    path = wb.Waypoints(np.arange(5.0), through)
    samples = [path.at(t).rotation for t in np.linspace(0.0, 4.0, 401)]
    steps = np.array([pin.log3(a.T @ b) for a, b in pairwise(samples)])
    assert np.abs(steps[:, :2]).max() < 1e-9
    assert steps[:, 2].min() > -1e-9
    assert steps[:, 2].sum() == pytest.approx(angles[-1])


def test_waypoints_half_a_turn_apart_are_refused() -> None:
    through = [np.eye(3), pin.exp3(np.array([0.0, 0.0, np.pi])), np.eye(3)]
    with pytest.raises(wb.SpecError, match=r"Waypoints\.points\[1\].*half a turn"):
        wb.Waypoints((0.0, 1.0, 2.0), through)


@given(ends, seconds, shares)
def test_as_is_becomes_the_value_at_the_start(values: tuple[Any, Any], duration: float, share: float) -> None:
    here, goal = values
    open_path = wb.MinJerk(wb.AS_IS, goal, duration)
    bound = open_path.bind(here)
    assert distance(bound.at(share * duration), wb.MinJerk(here, goal, duration).at(share * duration)) < 1e-12
    assert bound.bind(goal) is bound  # what is bound stays so
    assert open_path.start is wb.AS_IS
    through = wb.Waypoints((0.0, 1.0, 2.0), (wb.AS_IS, goal, wb.AS_IS)).bind(here)
    assert distance(through.at(0.0), here) < 1e-7
    assert distance(through.at(2.0), here) < 1e-7
    assert distance(wb.Hold(wb.AS_IS).bind(here).at(3.0), here) < 1e-12


@given(points, points)
def test_a_swing_takes_as_is_at_either_end(here: np.ndarray, there: np.ndarray) -> None:
    np.testing.assert_array_equal(wb.Swing(wb.AS_IS, there, 0.1, 1.0).bind(here).at(0.0), here)
    np.testing.assert_allclose(wb.Swing(there, wb.AS_IS, 0.1, 1.0).bind(here).at(1.0), here, atol=1e-14)


@pytest.mark.parametrize(
    "path",
    [
        wb.MinJerk(wb.AS_IS, np.zeros(3), 1.0),
        wb.Line(np.zeros(3), wb.AS_IS, 1.0),
        wb.Swing(wb.AS_IS, np.zeros(3), 0.1, 1.0),
        wb.Waypoints((0.0, 1.0), (wb.AS_IS, np.zeros(3))),
    ],
    ids=lambda path: type(path).__name__,
)
def test_a_path_from_as_is_says_that_it_has_no_value_yet(path: wb.Path) -> None:
    with pytest.raises(wb.SpecError, match="AS_IS"):
        path.at(0.5)


def test_as_is_is_one_thing_however_it_is_copied() -> None:
    assert copy.deepcopy(wb.AS_IS) is wb.AS_IS
    assert copy.copy(wb.AS_IS) is wb.AS_IS
    assert pickle.loads(pickle.dumps(wb.AS_IS)) is wb.AS_IS
    assert repr(wb.AS_IS) == "AS_IS"


def test_a_live_target_is_what_was_set_last() -> None:
    live = wb.Live(np.zeros(3))
    assert live.live
    assert not live.constant
    live.set([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(live.at(0.0), [1.0, 2.0, 3.0])
    assert live.bind(np.ones(3)) is live
    np.testing.assert_array_equal(live.at(7.0), [1.0, 2.0, 3.0])


def test_a_live_target_from_as_is_starts_where_it_is() -> None:
    live = wb.Live(wb.AS_IS)
    assert live.bind(np.ones(3)) is live
    np.testing.assert_array_equal(live.at(0.0), np.ones(3))
    live.set((0.0, 0.0, 1.0))
    np.testing.assert_array_equal(live.at(0.0), [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    "bad", [[0.0, np.nan, 0.0], [np.inf, 0.0, 0.0], pin.SE3.Identity(), [1.0, 2.0], "up"]
)
def test_a_live_target_refuses_and_keeps_what_it_has(bad: Any) -> None:
    live = wb.Live(np.ones(3))
    with pytest.raises(wb.SpecError, match=r"Live\.set"):
        live.set(bad)
    np.testing.assert_array_equal(live.at(0.0), np.ones(3))
