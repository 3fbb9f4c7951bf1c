"""Obstacles are drawn as what they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wbplan as wb
from wbplan.view.terrain import is_grid, things, triangles

HILLS = wb.HeightField([0.0, 0.1, 0.2], [0.0, 0.1], [[0.0, 0.1], [0.05, 0.0], [0.1, 0.1]])


@pytest.mark.parametrize("shape", [wb.Cylinder(0.1, 0.4), HILLS, wb.Ground((0.2, 0.1, 1.0))])
def test_triangles_lie_on_the_surface_and_face_up_or_out(shape: Any) -> None:
    vertices, faces = triangles(shape)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = corners.mean(axis=1)
    if isinstance(shape, wb.Cylinder):
        assert (np.einsum("ij,ij->i", normals, middles) > 0).all()
        return
    assert (normals[:, 2] > 0).all()
    terrain = wb.Terrain([wb.Obstacle("x", shape)])
    assert terrain.height(middles[:, 0], middles[:, 1]) == pytest.approx(middles[:, 2], abs=1e-12)


def test_every_shape_has_something_to_draw() -> None:
    cube = wb.Mesh([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    for shape in (wb.Box((1, 1, 1)), wb.Sphere(1.0), wb.Cylinder(1.0, 1.0), cube, HILLS, wb.Ground()):
        assert "sides" in things(wb.Obstacle("x", shape))


def test_only_level_ground_at_zero_is_the_grid() -> None:
    assert is_grid(wb.Obstacle("x", wb.Ground()))
    assert not is_grid(wb.Obstacle("x", wb.Ground(), (0.0, 0.0, -0.5)))
    assert not is_grid(wb.Obstacle("x", wb.Ground((0.1, 0.0, 1.0))))
    assert not is_grid(wb.Obstacle("x", wb.Box((1.0, 1.0, 1.0))))
