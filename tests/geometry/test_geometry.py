"""Convex polygons: hull, half-planes, margins, inset, largest circle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes, support_polygon

SQUARE = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0), (1.0, 1.0)]
coordinates = st.floats(-3.0, 3.0, allow_nan=False).map(lambda x: round(x, 6))
point_sets = st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=12)


def polygon_or_skip(points: list[tuple[float, float]]) -> HalfPlanes:
    array = np.array(points)
    spread = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
    assume(spread[1] > 1e-3)
    return support_polygon(points)


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_square_has_four_outward_edges_that_name_their_points() -> None:
    square = support_polygon(SQUARE)
    assert set(square.edges) == {(0, 2), (2, 1), (1, 3), (3, 0)}
    assert_allclose(square.vertices, [(0, 0), (2, 0), (2, 2), (0, 2)])
    assert_allclose(square.normals, [(0, -1), (1, 0), (0, 1), (-1, 0)])
    assert_allclose(square.offsets, [0, 2, 2, 0])


@pytest.mark.parametrize(
    ("point", "expected"),
    [((1.0, 1.0), 1.0), ((0.25, 1.0), 0.25), ((2.0, 1.0), 0.0), ((3.0, 1.0), -1.0), ((3.0, 5.0), -3.0)],
)
def test_margin_is_signed_distance_to_the_nearest_edge_line(
    point: tuple[float, float], expected: float
) -> None:
    square = support_polygon(SQUARE)
    assert square.margin(point) == pytest.approx(expected)
    assert_allclose(square.margins([point, point]), [expected, expected])


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        support_polygon(SQUARE).offsets[0] = 1.0


@given(point_sets)
def test_every_point_is_inside_and_every_edge_holds_its_two_points(points: list[tuple[float, float]]) -> None:
    polygon = polygon_or_skip(points)
    array = np.array(points)
    assert polygon.margins(array).min() >= -1e-8
    assert_allclose(np.linalg.norm(polygon.normals, axis=1), 1.0)
    for (i, j), normal, offset in zip(polygon.edges, polygon.normals, polygon.offsets, strict=True):
        assert_allclose(array[[i, j]] @ normal, offset, atol=1e-12)
    assert area(polygon.vertices) > 0.0
    assert_allclose(polygon.vertices, array[[i for i, _ in polygon.edges]])


@given(point_sets, st.randoms(use_true_random=False))
def test_order_of_the_points_does_not_matter(points: list[tuple[float, float]], random) -> None:
    polygon = polygon_or_skip(points)
    shuffled = list(points)
    random.shuffle(shuffled)
    again = support_polygon(shuffled)
    query = np.array([[0.1, -0.2], [4.0, 4.0], *points])
    assert_allclose(again.margins(query), polygon.margins(query), atol=1e-8)


@given(point_sets, st.tuples(coordinates, coordinates), st.floats(0.0, 6.3))
def test_margin_moves_with_the_polygon(points, shift, angle) -> None:
    polygon = polygon_or_skip(points)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = support_polygon(np.array(points) @ turn.T + shift)
    query = np.array([[0.0, 0.0], [1.0, -2.0]])
    assert_allclose(moved.margins(query @ turn.T + shift), polygon.margins(query), atol=1e-7)


@given(point_sets, st.floats(0.0, 1.0))
def test_inset_corners_have_the_margin_and_lose_no_area(points, share) -> None:
    polygon = polygon_or_skip(points)
    center, radius = polygon.chebyshev()
    margin = 0.95 * share * radius
    corners = polygon.inset(margin)
    assert len(corners) >= 3
    assert_allclose(polygon.margins(corners), margin, atol=1e-8)
    # Every corner of the inset lies on two edges: nothing more was cut off than the margin.
    slack = polygon.offsets - corners @ polygon.normals.T - margin
    assert (np.sum(np.abs(slack) < 1e-7, axis=1) >= 2).all()
    assert support_polygon(corners).margin(center) == pytest.approx(radius - margin, abs=1e-7)


@given(point_sets)
def test_no_inset_is_left_beyond_the_largest_circle(points) -> None:
    polygon = polygon_or_skip(points)
    center, radius = polygon.chebyshev()
    assert polygon.margin(center) == pytest.approx(radius, abs=1e-8)
    assert polygon.inset(radius * 1.001 + 1e-6).shape == (0, 2)
    grid = np.random.default_rng(0).uniform(-3, 3, (200, 2))
    assert polygon.margins(grid).max() <= radius + 1e-8


def test_the_middle_of_the_best_places_does_not_jump() -> None:
    """Of a rectangle it is the middle, also with a corner off by a hair; of a triangle nearly its centre."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    rectangle = np.array([[0.4, 0.28], [-0.4, 0.28], [0.4, -0.28], [-0.4, -0.28]])
    random = np.random.default_rng(0)
    for rotation in (np.eye(2), turn, np.array([[0.0, -1.0], [1.0, 0.0]])):
        corners = rectangle @ rotation.T + [1.0, 2.0]
        np.testing.assert_allclose(support_polygon(corners).middle(), [1.0, 2.0], atol=1e-9)
        shaken = support_polygon(corners + random.normal(scale=1e-6, size=corners.shape))
        np.testing.assert_allclose(shaken.middle(), [1.0, 2.0], atol=3e-4)
        assert shaken.margin(shaken.middle()) > 0.99 * 0.28 - 1e-5
    triangle = support_polygon([(0.0, 0.0), (0.6, 0.0), (0.1, 0.4)])
    centre, radius = triangle.chebyshev()
    np.testing.assert_allclose(triangle.middle(), centre, atol=0.02 * radius)


def test_inset_refuses_a_negative_margin() -> None:
    with pytest.raises(SpecError, match="margin"):
        support_polygon(SQUARE).inset(-0.1)


@pytest.mark.parametrize(
    "points",
    [
        [],
        [(0.0, 0.0)],
        [(0.0, 0.0), (1.0, 2.5)],
        [(0.0, 0.0), (1.0, 2.5), (1.0, 2.5)],
        [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (0.5, 0.5)],
        [(1.0, 1.0)] * 4,
        [(1e12, 0.0), (1e12, 1e-4), (1e12 + 1e-4, 0.0)],
    ],
)
def test_points_without_area_are_refused_by_name(points: list[tuple[float, float]]) -> None:
    with pytest.raises(SpecError) as caught:
        support_polygon(np.array(points).reshape(-1, 2))
    message = str(caught.value)
    assert f"found {len(points)}" in message
    if points:
        assert f"({points[-1][0]:g}, {points[-1][1]:g})" in message


@pytest.mark.parametrize(
    "points",
    [
        [(0.0, 0.0), (1.0, np.nan), (0.0, 1.0)],
        [(0.0, 0.0), (1e308, 0.0), (0.0, 1.0)],
        [(0.0, 0.0, 0.0)] * 3,
        [1.0, 2.0, 3.0],
    ],
)
def test_points_that_are_no_points_are_refused(points) -> None:
    with pytest.raises(SpecError, match="support polygon"):
        support_polygon(points)
