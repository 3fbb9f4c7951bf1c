"""Shapes that all robots are built of: volume and inertia against a sum over small cells."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def shapes(run_script):
    return run_script("shapes.py")


def in_hexagon(x, y, radius):
    edges = np.deg2rad(30 + 60 * np.arange(6))
    return np.all(
        [x * np.cos(a) + y * np.sin(a) <= radius * np.cos(np.pi / 6) for a in edges],
        axis=0,
    )


INSIDE = {
    "box": ((0.3, 0.2, 0.1), lambda x, y, z: (abs(x) <= 0.15) & (abs(y) <= 0.1) & (abs(z) <= 0.05)),
    "cylinder": ((0.1, 0.3), lambda x, y, z: (x**2 + y**2 <= 0.01) & (abs(z) <= 0.15)),
    "sphere": ((0.15,), lambda x, y, z: x**2 + y**2 + z**2 <= 0.0225),
    "capsule": ((0.08, 0.2), lambda x, y, z: x**2 + y**2 + np.maximum(abs(z) - 0.1, 0) ** 2 <= 0.0064),
    "hexagon": ((0.2, 0.05), lambda x, y, z: in_hexagon(x, y, 0.2) & (abs(z) <= 0.025)),
}


@pytest.mark.parametrize("name", INSIDE)
def test_volume_and_moments_are_those_of_the_solid(shapes, name):
    arguments, inside = INSIDE[name]
    edge = np.linspace(-0.2, 0.2, 161)
    cells = np.array(np.meshgrid(*[(edge[1:] + edge[:-1]) / 2] * 3))
    x, y, z = cells[:, inside(*cells)]
    moments = np.array([np.mean(y**2 + z**2), np.mean(x**2 + z**2), np.mean(x**2 + y**2)])

    shape = getattr(shapes, name)(*arguments)

    assert shape.volume == pytest.approx(len(x) * (0.4 / 160) ** 3, rel=0.02)
    np.testing.assert_allclose(shape.moments, moments, rtol=0.02)


def test_a_divided_box_weighs_and_turns_as_the_whole(shapes):
    # Turned and shifted, so that rotation and parallel axes both count.
    turn, place = (0.3, -0.5, 1.1), np.array([0.1, -0.2, 0.3])
    axes = shapes.rotation(turn)
    whole = shapes.inertia_of([shapes.Part(shapes.box(0.4, 0.2, 0.1), tuple(place), turn, mass=3.0)])
    parts = [
        shapes.Part(shapes.box(length, 0.2, 0.1), tuple(place + axes @ [x, 0, 0]), turn)
        for length, x in ((0.1, -0.15), (0.3, 0.05))
    ]

    divided = shapes.inertia_of(parts, structure=3.0)

    assert divided.mass == pytest.approx(3.0)
    np.testing.assert_allclose(divided.com, whole.com, atol=1e-12)
    np.testing.assert_allclose(divided.about_com, whole.about_com, atol=1e-12)


def test_structure_without_a_part_to_carry_it_is_refused(shapes):
    weighed = shapes.Part(shapes.sphere(0.1), mass=1.0)
    with pytest.raises(ValueError, match=r"structure of 0\.5 kg"):
        shapes.inertia_of([weighed], structure=0.5)
    with pytest.raises(ValueError, match="without own mass"):
        shapes.inertia_of([shapes.Part(shapes.sphere(0.1))])


@pytest.mark.parametrize(
    "turn", [(0.1, 0.2, 0.3), (-2.0, 1.0, 3.0), (0.0, np.pi / 2, 0.7), (0.0, -np.pi / 2, 0.7)]
)
def test_angles_undo_rotation(shapes, turn):
    matrix = shapes.rotation(turn)
    np.testing.assert_allclose(shapes.rotation(shapes.angles(matrix)), matrix, atol=1e-12)


def test_a_rod_runs_from_its_start_to_its_end(shapes):
    start, end = (0.1, -0.2, 0.3), (-0.2, 0.1, 0.7)
    part = shapes.rod(start, end, 0.01)
    half = np.linalg.norm(np.subtract(end, start)) / 2
    ends = [np.asarray(part.xyz) + s * half * shapes.rotation(part.rpy)[:, 2] for s in (-1, 1)]
    np.testing.assert_allclose(ends, [start, end], atol=1e-12)
