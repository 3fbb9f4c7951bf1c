"""Paths read at many times at once are the paths read one time after the other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb
from wbplan.sampling import sample

lengths = st.floats(-5.0, 5.0)
points = st.tuples(lengths, lengths, lengths).map(np.array)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
poses = st.builds(lambda w, p: pin.SE3(pin.exp3(w), p), turns, points)
rotations = turns.map(lambda w: pin.exp3(w))
times = st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20).map(np.array)

MAKERS = {
    "hold": lambda a, b, c: wb.Hold(a),
    "live": lambda a, b, c: wb.Live(a),
    "min jerk": lambda a, b, c: wb.MinJerk(a, b, 2.0),
    "line": lambda a, b, c: wb.Line(a, b, 3.0),
    "waypoints": lambda a, b, c: wb.Waypoints((0.0, 1.0, 2.5), (a, b, c)),
    "there and back": lambda a, b, c: wb.Waypoints((0.0, 1.0, 2.5, 4.0), (a, b, c, a)),
}


def agree(path: wb.Path, when: np.ndarray) -> None:
    places, turned = sample(path, when)
    assert places.shape == (len(when), 3)
    assert turned.shape == (len(when), 3, 3)
    for k, t in enumerate(when):
        value = path.at(float(t))
        wanted: tuple[Any, Any] = (np.zeros(3), np.eye(3))
        if isinstance(value, pin.SE3):
            wanted = (value.translation, value.rotation)
        elif value.shape == (3, 3):
            wanted = (np.zeros(3), value)
        else:
            wanted = (value, np.eye(3))
        np.testing.assert_allclose(places[k], wanted[0], atol=1e-12)
        np.testing.assert_allclose(turned[k], wanted[1], atol=1e-8)


@pytest.mark.parametrize("kind", MAKERS)
@given(
    st.one_of(st.tuples(*[points] * 3), st.tuples(*[poses] * 3), st.tuples(*[rotations] * 3)),
    times,
    st.booleans(),
)
def test_a_stretch_of_times_is_one_time_after_the_other(
    kind: str, values: tuple[Any, Any, Any], when: np.ndarray, still: bool
) -> None:
    agree(MAKERS[kind](*(values[:1] * 3 if still else values)), when)


@given(st.one_of(st.tuples(points, points), st.tuples(poses, poses)), st.floats(0.0, 0.5), times)
def test_a_stretch_of_a_swing(values: tuple[Any, Any], height: float, when: np.ndarray) -> None:
    agree(wb.Swing(*values, height, 1.5), when)


def test_a_stretch_of_full_turns() -> None:
    through = [pin.exp3(np.array([0.0, 0.0, a])) for a in np.radians([0.0, 150.0, 300.0, 450.0])]
    when = np.linspace(0.0, 3.5, 50)
    agree(wb.Waypoints(range(4), through), when)
    agree(wb.Waypoints(range(4), [pin.SE3(turn, np.ones(3)) for turn in through]), when)
