"""What no path takes, what it copies, and that it cannot be changed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

ZERO, ONE = np.zeros(3), np.ones(3)

MAKERS: dict[str, Callable[[Any], wb.Path]] = {
    "Hold": wb.Hold,
    "Live": wb.Live,
    "MinJerk.start": lambda v: wb.MinJerk(v, ONE, 1.0),
    "MinJerk.goal": lambda v: wb.MinJerk(ONE, v, 1.0),
    "Line.goal": lambda v: wb.Line(wb.AS_IS, v, 1.0),
    "Swing.start": lambda v: wb.Swing(v, ONE, 0.1, 1.0),
    "Swing.goal": lambda v: wb.Swing(wb.AS_IS, v, 0.1, 1.0),
    "Waypoints.points[1]": lambda v: wb.Waypoints((0.0, 1.0, 2.0), (ZERO, v, ONE)),
}


def with_nan() -> pin.SE3:
    pose = pin.SE3.Identity()
    pose.translation = np.array([0.0, np.nan, 0.0])
    return pose


BAD_VALUES = {
    "nan": np.array([0.0, np.nan, 0.0]),
    "infinite": [0.0, 0.0, np.inf],
    "minus infinite": [0.0, 0.0, -np.inf],
    "text": "limb1_tip",
    "number as text": "1.0",
    "none": None,
    "ragged": [[1.0], [1.0, 2.0]],
    "complex": 1.0 + 2.0j,
    "huge": 10**400,
    "pose with nan": with_nan(),
    "no rotation": pin.SE3(2.0 * np.eye(3), ZERO),
    "mirror": np.diag([1.0, 1.0, -1.0]),
}


@pytest.mark.parametrize("where", MAKERS)
@pytest.mark.parametrize("value", BAD_VALUES.values(), ids=BAD_VALUES)
def test_a_value_that_is_none_is_refused_by_its_field(where: str, value: Any) -> None:
    with pytest.raises(wb.SpecError) as caught:
        MAKERS[where](value)
    assert str(caught.value).startswith(f"{where}:")


BAD_TIMES = {
    "zero": 0.0,
    "negative": -1.0,
    "nan": np.nan,
    "infinite": np.inf,
    "text": "1",
    "none": None,
    "list": [1.0],
}


@pytest.mark.parametrize("kind", [wb.MinJerk, wb.Line, wb.Swing])
@pytest.mark.parametrize("duration", BAD_TIMES.values(), ids=BAD_TIMES)
def test_a_duration_has_to_be_finite_and_positive(kind: type, duration: Any) -> None:
    bump = (0.1,) if kind is wb.Swing else ()
    with pytest.raises(wb.SpecError, match=rf"{kind.__name__}\.duration: expected a finite positive time"):
        kind(ZERO, ONE, *bump, duration)


@pytest.mark.parametrize("height", [-0.01, np.nan, np.inf, "0.1", None])
def test_a_swing_is_of_a_finite_height(height: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"Swing\.height: expected a height in metres of 0 or more"):
        wb.Swing(ZERO, ONE, height, 1.0)


@pytest.mark.parametrize("value", [0.3, [0.1, 0.2], np.eye(3)], ids=["number", "plane", "rotation"])
def test_a_swing_goes_between_points_or_poses(value: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"Swing: expected pin\.SE3 or"):
        wb.Swing(wb.AS_IS, value, 0.1, 1.0)


@pytest.mark.parametrize(
    ("times", "points", "says"),
    [
        ((0.0, 1.0), (ZERO,), "2 times for 1 points"),
        ((0.0,), (ZERO,), "two or more"),
        ((), (), "two or more"),
        ((0.0, 1.0, 1.0), (ZERO, ONE, ZERO), "growing"),
        ((0.0, 2.0, 1.0), (ZERO, ONE, ZERO), "growing"),
        ((0.5, 1.0), (ZERO, ONE), "0 first"),
        ((0.0, np.nan), (ZERO, ONE), r"times\[1\]"),
        ((0.0, np.inf), (ZERO, ONE), r"times\[1\]"),
        ((0.0, "1"), (ZERO, ONE), r"times\[1\]"),
        (1.0, (ZERO, ONE), "times: expected a list"),
        ((0.0, 1.0), 7, "points: expected a list"),
    ],
)
def test_waypoints_have_one_growing_time_each(times: Any, points: Any, says: str) -> None:
    with pytest.raises(wb.SpecError, match=f"Waypoints.*{says}"):
        wb.Waypoints(times, points)


@pytest.mark.parametrize(
    "make",
    [
        lambda: wb.MinJerk(ZERO, pin.SE3.Identity(), 1.0),
        lambda: wb.Line(ZERO, 1.0, 1.0),
        lambda: wb.Swing(pin.SE3.Identity(), ZERO, 0.1, 1.0),
        lambda: wb.Waypoints((0.0, 1.0, 2.0), (wb.AS_IS, ZERO, np.zeros(2))),
        lambda: wb.MinJerk(wb.AS_IS, ZERO, 1.0).bind(pin.SE3.Identity()),
    ],
)
def test_one_path_is_of_one_kind(make: Callable[[], wb.Path]) -> None:
    with pytest.raises(wb.SpecError, match=r"different kinds: .*, "):
        make()


@pytest.mark.parametrize("where", MAKERS)
def test_a_path_keeps_a_copy_of_what_it_was_given(where: str) -> None:
    given = np.array([1.0, 2.0, 3.0])
    here = np.zeros(3)
    path = MAKERS[where](given).bind(here)
    before = [np.array(path.at(t)) for t in (0.0, 0.6, 1.0, 2.0)]
    given[:] = np.nan
    here[:] = np.nan
    np.testing.assert_array_equal([path.at(t) for t in (0.0, 0.6, 1.0, 2.0)], before)


@pytest.mark.parametrize("kind", [wb.Hold, wb.Live])
def test_a_pose_that_is_handed_out_is_a_copy(kind: type) -> None:
    given = pin.SE3.Identity()
    path = kind(given)
    given.translation = ONE
    path.at(0.0).translation = ONE
    assert path.at(0.0) == pin.SE3.Identity()


def test_lists_of_waypoints_are_copied() -> None:
    times, points = [0.0, 1.0], [np.zeros(3), np.ones(3)]
    path = wb.Waypoints(times, points)
    times[1], points[1] = 5.0, np.full(3, np.nan)
    points[0][:] = 7.0
    np.testing.assert_array_equal(path.at(0.0), ZERO)
    np.testing.assert_allclose(path.at(1.0), ONE)


@pytest.mark.parametrize(
    ("path", "field"),
    [
        (wb.Hold(ZERO), "value"),
        (wb.MinJerk(ZERO, ONE, 1.0), "goal"),
        (wb.Line(ZERO, ONE, 1.0), "duration"),
        (wb.Swing(ZERO, ONE, 0.1, 1.0), "height"),
        (wb.Waypoints((0.0, 1.0), (ZERO, ONE)), "times"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_path_cannot_be_assigned_to(path: wb.Path, field: str) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(path, field, getattr(path, field))


@pytest.mark.parametrize("value", [wb.Hold([1.0, 2.0, 3.0]).value, wb.MinJerk(ZERO, ONE, 1.0).goal])
def test_an_array_of_a_path_is_read_only(value: np.ndarray) -> None:
    with pytest.raises(ValueError, match="read-only"):
        value[0] = 5.0
