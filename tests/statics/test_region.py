"""Where the CoM may be: equal to hulls, to what is worked out by hand, and to a linear program of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog

import wbplan as wb
from wbplan.geometry import support_polygon
from wbplan.statics import (
    TorqueLimits,
    equilibrium_region,
    hull_is_exact,
    rays,
    support_region,
)

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def reach(points: Array, normals: Array, friction: Array, d: Array, load: Array, sides: int = 16) -> float:
    """How far the CoM gets along d, by one linear program over the forces and the CoM, nothing eliminated."""
    columns = [
        np.concatenate([ray, np.cross(p, ray)])
        for p, n, mu in zip(points, normals, friction, strict=True)
        for ray in rays(n, mu, sides)
    ]
    by_com = np.zeros((6, 2))  # -(c x z), whose entries are -cy and cx
    by_com[3, 1], by_com[4, 0] = -1.0, 1.0
    balance = np.column_stack([*columns, by_com])
    found = linprog(
        np.concatenate([np.zeros(len(columns)), -d]),
        A_eq=balance,
        b_eq=np.concatenate([UP, np.zeros(3)]) - load,
        bounds=[(0, None)] * len(columns) + [(None, None)] * 2,
    )
    assert found.status == 0, found.message
    return float(-found.fun)


def stance(seed: int, tilt: float = 0.3, height: float = 0.15) -> tuple[Array, Array, Array]:
    """Six feet about a circle, at different heights, on different slopes."""
    rng = np.random.default_rng(seed)
    angle = np.arange(6) * np.pi / 3 + rng.uniform(-0.2, 0.2, 6)
    points = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), rng.uniform(-height, height, 6)])
    normals = rng.normal(size=(6, 3)) * tilt + UP
    return (
        points + rng.uniform(-1.0, 1.0, 3),
        normals / np.linalg.norm(normals, axis=1)[:, None],
        rng.uniform(0.4, 0.9, 6),
    )


@given(
    st.integers(3, 8).flatmap(
        lambda n: st.lists(
            st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=n, max_size=n, unique=True
        )
    ),
    st.floats(0.2, 2.0),
)
def test_on_flat_ground_it_is_the_hull(xy: list[tuple[float, float]], friction: float) -> None:
    flat = np.array(xy)
    try:
        hull = support_polygon(flat)
    except wb.SpecError:
        return
    if hull.chebyshev()[1] < 1e-3:  # thinner than a millimetre is no region at its tolerance
        return
    points = np.column_stack([flat, np.full(len(flat), 0.07)])
    normals, mu = np.tile(UP, (len(flat), 1)), np.full(len(flat), friction)
    assert hull_is_exact(points, normals, mu)
    region = equilibrium_region(points, normals, mu, tolerance=1e-9).polygon
    assert np.abs(hull.margins(region.vertices)).max() < 1e-8
    assert region.margins(hull.vertices).min() > -1e-8


def test_on_one_slope_it_is_the_hull_while_the_slope_can_be_stood_on() -> None:
    slope = pin.exp3(np.array([0.2, 0.35, 0.0]))
    points = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, -0.2, 0.0], [-0.25, 0.3, 0.0]]) @ slope.T
    normals, mu = np.tile(slope @ UP, (4, 1)), np.full(4, 0.7)
    assert hull_is_exact(points, normals, mu)
    region = equilibrium_region(points, normals, mu).polygon
    hull = support_polygon(points[:, :2])
    assert np.abs(hull.margins(region.vertices)).max() < 1e-8
    assert len(region.vertices) == 4
    slippery = np.full(4, 0.3)  # the slope is steeper: tan of 0.4 rad
    assert not hull_is_exact(points, normals, slippery)
    with pytest.raises(wb.SpecError, match="no forces within the cones"):
        equilibrium_region(points, normals, slippery)


@pytest.mark.parametrize(
    ("points", "normals"),
    [
        ([(0.3, 0, 0), (0, 0.3, 0), (-0.3, -0.3, 2e-4), (0.3, 0.3, 0.0)], [UP] * 4),
        ([(0.3, 0, 0), (0, 0.3, 0), (-0.3, -0.3, 0)], [UP, UP, (0.0, 0.1, 0.995)]),
        ([(0.3, 0, 0), (0, 0.3, 0), (-0.3, -0.3, 0)], [(0.0, 0.0, -1.0)] * 3),
    ],
)
def test_the_hull_is_not_taken_for_exact(points: Any, normals: Any) -> None:
    assert not hull_is_exact(points, normals, np.full(len(points), 0.7))


def test_two_feet_and_a_slippery_wall() -> None:
    """A ladder: the wall's push N at height h needs N of friction at the feet, and moves the CoM by N h / W.

    Yaw makes both feet give half of it, so that a foot carries at least N / (2 mu): the region is the
    triangle (0, b), (0, -b), (mu h, 0).
    """
    mu, h, b = 0.6, 0.8, 0.2
    points = np.array([(0.0, b, 0.0), (0.0, -b, 0.0), (0.5, 0.0, h)])
    normals = np.array([UP, UP, (-1.0, 0.0, 0.0)])
    friction = np.array([mu, mu, 0.0])
    for outer, share in ((False, np.cos(np.pi / 16)), (True, 1.0)):
        # Rays lie at odd multiples of 11.25 degrees: along x the inner pyramid gives cos of it.
        region = equilibrium_region(points, normals, friction, outer=outer).polygon
        corners = region.vertices[np.lexsort(region.vertices.round(6).T)]
        expected = np.array([(0.0, -b), (mu * h * share, 0.0), (0.0, b)])
        assert corners == pytest.approx(expected[np.lexsort(expected.round(6).T)], abs=1e-7)


def test_a_push_at_a_height_moves_it() -> None:
    """On level ground a horizontal force F at height h moves the region by -F h / W, friction permitting."""
    points = np.array([(0.3, 0.2, 0.0), (0.3, -0.2, 0.0), (-0.3, -0.2, 0.0), (-0.3, 0.2, 0.0)])
    normals, mu, h = np.tile(UP, (4, 1)), np.full(4, 0.8), 0.5
    force = np.array([-0.1, 0.05, 0.0])
    load = np.concatenate([force, np.cross([0.4, 0.1, h], force)])
    region = equilibrium_region(points, normals, mu, load=load).polygon
    com = np.array([0.02, -0.03])
    # By hand: the centre of pressure is c + h F / W, and must be in the hull.
    moved = support_polygon(points[:, :2] - h * force[:2])
    assert moved.margin(com) == pytest.approx(region.margin(com), abs=0.03)
    assert moved.margins(region.vertices).min() > -1e-7
    both = support_region(points, normals, mu, [np.zeros(6), load]).polygon
    hull = support_polygon(points[:, :2])
    assert min(hull.margins(both.vertices).min(), region.margins(both.vertices).min()) > -1e-3
    with pytest.raises(wb.SpecError, match="no forces"):
        equilibrium_region(points, normals, mu, load=9.0 * load)


@pytest.mark.parametrize("seed", range(6))
def test_it_reaches_as_far_as_a_linear_program_says(seed: int) -> None:
    points, normals, friction = stance(seed)
    load = np.concatenate([[0.03, -0.02, 0.05], [0.0, 0.02, 0.01]])
    found = equilibrium_region(points, normals, friction, load=load)
    assert found.error <= 1e-6
    for angle in np.linspace(0.1, 6.2, 7):
        d = np.array([np.cos(angle), np.sin(angle)])
        own = float((found.polygon.vertices @ d).max())
        assert own == pytest.approx(reach(points, normals, friction, d, load), abs=2e-6)


@given(st.integers(0, 10**6))
def test_the_inner_region_lies_in_the_outer_one(seed: int) -> None:
    points, normals, friction = stance(seed)
    inner = equilibrium_region(points, normals, friction, sides=6).polygon
    finer = equilibrium_region(points, normals, friction, sides=18).polygon  # has the edges of six
    outer = equilibrium_region(points, normals, friction, sides=16, outer=True).polygon
    assert finer.margins(inner.vertices).min() > -1e-5
    assert outer.margins(finer.vertices).min() > -1e-5


def test_torque_limits_cut_it(legarm: wb.Robot) -> None:
    state = legarm.state("stand")
    model = legarm.model
    data = model.createData()
    pin.computeJointJacobians(model, data, state.q)
    pin.updateFramePlacements(model, data)
    feet = list(legarm.feet.values())
    ids = [model.getFrameId(f) for f in feet]
    J = np.array([pin.getFrameJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED)[:3, 6:] for i in ids])
    points = np.array([data.oMf[i].translation for i in ids])
    bias = np.array(pin.computeGeneralizedGravity(model, data, state.q))[6:]
    weight = 9.81 * pin.computeTotalMass(model)
    normals, mu = np.tile(UP, (6, 1)), np.full(6, 0.7)
    areas = []
    for share in (100.0, 0.6, 0.4):
        limits = TorqueLimits(bias, J, share * np.asarray(model.effortLimit[6:]), weight)
        polygon = equilibrium_region(points, normals, mu, torques=limits).polygon
        (x, y), (x2, y2) = polygon.vertices.T, np.roll(polygon.vertices, -1, axis=0).T
        areas.append(0.5 * float((x * y2 - y * x2).sum()))
        assert support_polygon(points[:, :2]).margins(polygon.vertices).min() > -1e-7
    assert areas[0] == pytest.approx(0.5 * 3 * np.sqrt(3) * np.linalg.norm(points[0, :2]) ** 2, rel=0.02)
    assert areas[0] > 1.05 * areas[1] > 1.1 * areas[2]
    weak = TorqueLimits(bias, J, 0.05 * np.asarray(model.effortLimit[6:]), weight)
    with pytest.raises(wb.SpecError, match=r"no forces|torque limit"):
        equilibrium_region(points, normals, mu, torques=weak)


def test_what_holds_nothing_is_refused() -> None:
    for points, normals in (
        (np.zeros((0, 3)), np.zeros((0, 3))),
        (np.zeros((1, 3)), UP[None]),
        (np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]), np.tile(UP, (2, 1))),
        (np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.tile(-UP, (3, 1))),
    ):
        with pytest.raises(wb.SpecError):
            equilibrium_region(points, normals, np.full(len(points), 0.5))
    with pytest.raises(wb.SpecError, match="3 sides"):
        rays(UP, 0.5, 2)
