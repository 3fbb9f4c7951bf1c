"""Contact forces against worked-out cases and against other solvers; cones; robustness figures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

import wbplan as wb
from wbplan.statics import ForceQP, WrenchCone, faces, friction_use, grasp_map, rays, tilt
from wbplan.statics.forces import effort, least_effort

UP = np.array([0.0, 0.0, 1.0])
FEET = np.array([(0.4, 0.28, 0.0), (0.4, -0.28, 0.0), (-0.4, -0.28, 0.0), (-0.4, 0.28, 0.0)])
WEIGHT = 45.0 * 9.81


def stand(feet: np.ndarray, com: tuple[float, float, float]) -> tuple[np.ndarray, float]:
    program = ForceQP(np.tile(UP, (len(feet), 1)), np.full(len(feet), 0.6))
    wrench = np.concatenate([WEIGHT * UP, np.zeros(3)])
    return program.carry(feet, wrench, np.array(com), alpha=1e-7)


def test_hiphant_on_four_feet() -> None:
    """45 kg over the middle of four feet: a quarter of the weight each."""
    force, residual = stand(FEET, (0.0, 0.0, 0.45))
    assert force == pytest.approx(np.tile([0.0, 0.0, 110.3625], (4, 1)), abs=1e-3)
    assert residual < 1e-3


def test_hiphant_beyond_its_feet() -> None:
    """A CoM ahead of the feet is not carried: the residual says so (20.1 N and N m with S = 1)."""
    _, residual = stand(FEET, (0.45, 0.0, 0.45))
    assert residual == pytest.approx(20.1, abs=0.05)


def test_hiphant_on_three_feet() -> None:
    """Left rear, right rear and right front, CoM at (-0.1, 0.05)."""
    force, residual = stand(FEET[[3, 2, 1]], (-0.1, 0.05, 0.45))
    assert force[:, 2] == pytest.approx([260.139, 15.767, 165.543], abs=2e-3)
    assert residual < 1e-3


def test_a_warm_program_answers_as_a_fresh_one() -> None:
    warm = ForceQP(np.tile(UP, (4, 1)), np.full(4, 0.6), most=300.0)
    for k in range(12):
        wrench = np.array([60 * np.sin(k), 40 * np.cos(k), WEIGHT, 30 * np.sin(2 * k), 50.0, 5.0])
        about = np.array([0.05, 0.0, 0.4])
        fresh = ForceQP(np.tile(UP, (4, 1)), np.full(4, 0.6), most=300.0)
        force, residual = warm.carry(FEET, wrench, about)
        other, same = fresh.carry(FEET, wrench, about)
        assert force == pytest.approx(other, abs=1e-3)
        assert residual == pytest.approx(same, abs=1e-4)
        assert friction_use(force, np.tile(UP, (4, 1)), np.full(4, 0.6)).max() <= 1.0 + 1e-6
        assert force[:, 2].max() <= 300.0 + 1e-4


def test_it_is_the_least_effort() -> None:
    """Against a general solver, where the pyramid holds back."""
    normals, mu = np.tile(UP, (4, 1)), np.full(4, 0.3)
    wrench, about = np.array([90.0, 0.0, WEIGHT, 0.0, 0.0, 25.0]), np.array([0.1, 0.05, 0.5])
    program = ForceQP(normals, mu)
    found, _ = program.carry(FEET, wrench, about)
    A = grasp_map(FEET, about)

    def cost(f: np.ndarray) -> float:
        return float(np.sum((A @ f - wrench) ** 2) + 1e-4 * f @ f)

    other = minimize(
        cost,
        np.tile([0.0, 0.0, WEIGHT / 4], 4),
        jac=lambda f: 2.0 * A.T @ (A @ f - wrench) + 2e-4 * f,
        constraints={"type": "ineq", "fun": lambda f: -program.G @ f, "jac": lambda f: -program.G},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert cost(found.ravel()) <= other.fun * (1.0 + 1e-4) + 1e-6
    assert (program.G @ found.ravel()).max() < 1e-5


def test_many_problems_at_once_meet_their_equations() -> None:
    rng = np.random.default_rng(1)
    count = 5
    A = np.tile(grasp_map(FEET), (count, 1, 1))
    J = rng.normal(size=(count, 12, 8))
    torque, most = rng.normal(size=(count, 8)), np.array([5.0] * 7 + [np.inf])
    w = np.hstack([np.tile(WEIGHT * UP, (count, 1)), rng.normal(size=(count, 3))])
    normals, mu = np.tile(UP, (4, 1)), np.full(4, 0.6)
    H, g = effort(J, torque, most, normals, mu, WEIGHT)
    force = least_effort(A, w, H, g)
    assert np.einsum("nij,nj->ni", A, force) == pytest.approx(w, abs=1e-4)
    # No other forces of the same wrench cost less: the gradient is in the wrench's rows.
    free = np.linalg.svd(A[0])[2][6:]
    assert np.abs((np.einsum("nij,nj->ni", H, force) - g) @ free.T).max() < 1e-9


def test_bad_contacts_are_refused() -> None:
    with pytest.raises(wb.SpecError, match="got none"):
        ForceQP(np.zeros((0, 3)), np.zeros(0))
    with pytest.raises(wb.SpecError, match="above 0"):
        ForceQP(UP[None], np.array([0.5]), most=0.0)


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1),
    st.floats(0.05, 2.0),
    st.integers(3, 12),
)
def test_inner_pyramids_lie_in_the_cone_and_outer_ones_around_it(
    normal: tuple[float, float, float], friction: float, sides: int
) -> None:
    n = np.array(normal) / np.linalg.norm(normal)
    inner, outer = rays(n, friction, sides), rays(n, friction, sides, outer=True)
    assert friction_use(inner[:, None], n[None], [friction]) == pytest.approx(1.0)
    assert friction_use(outer[:, None], n[None], [friction]) == pytest.approx(1.0 / np.cos(np.pi / sides))
    G = faces(n, friction, sides)
    values = G @ inner.T
    assert values.max() < 1e-9
    assert ((np.abs(values) < 1e-9).sum(axis=1) == 2).all()  # each face has two of the edges


def test_four_outer_sides_promise_41_percent_too_much() -> None:
    assert friction_use(rays(UP, 0.5, 4, outer=True)[:, None], UP[None], [0.5]).max() == pytest.approx(
        np.sqrt(2.0)
    )


def test_friction_use_of_what_pulls_or_does_nothing() -> None:
    forces = np.array([[0.0, 0.0, -5.0], [0.0, 0.0, 0.0], [3.0, 4.0, 10.0]])
    assert friction_use(forces[:, None], UP[None], [0.5]).ravel().tolist() == [np.inf, 0.0, 1.0]


def test_the_largest_push_on_level_feet() -> None:
    """Tipping: F h = W m over the nearest edge; or sliding: F = mu W. The lesser of the two."""
    normals, com = np.tile(UP, (4, 1)), np.array([[0.1, 0.05, 0.5]])
    wrench = np.concatenate([WEIGHT * UP, np.cross(com[0], WEIGHT * UP)])[None]
    rough = WrenchCone(FEET, normals, np.full(4, 2.0)).room(wrench, com)[0]
    assert rough == pytest.approx(WEIGHT * (0.28 - 0.05) / 0.5, rel=1e-3)
    assert np.tan(tilt(rough, WEIGHT)) == pytest.approx(0.46, rel=1e-3)
    smooth = WrenchCone(FEET, normals, np.full(4, 0.3), sides=32).room(wrench, com)[0]
    assert 0.9 * 0.3 * WEIGHT < smooth <= 0.3 * WEIGHT
    beyond = np.array([[0.5, 0.0, 0.5]])
    lost = np.concatenate([WEIGHT * UP, np.cross(beyond[0], WEIGHT * UP)])[None]
    assert WrenchCone(FEET, normals, np.full(4, 2.0)).room(lost, beyond)[0] < 0.0


def test_the_largest_push_against_linear_programs() -> None:
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(4, 3)) * 0.2 + UP
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points, mu, com = FEET + rng.uniform(-0.1, 0.1, (4, 3)), np.full(4, 0.7), np.array([0.05, -0.05, 0.4])
    room = WrenchCone(points, normals, mu).room(
        np.concatenate([WEIGHT * UP, np.cross(com, WEIGHT * UP)])[None], com[None]
    )[0]
    columns = [
        np.concatenate([ray, np.cross(p, ray)])
        for p, n in zip(points, normals, strict=True)
        for ray in rays(n, 0.7, 8)
    ]
    least = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 120):
        d = np.array([np.cos(angle), np.sin(angle), 0.0])
        found = linprog(
            np.concatenate([np.zeros(len(columns)), [-1.0]]),
            A_eq=np.column_stack([*columns, np.concatenate([d, np.cross(com, d)])]),
            b_eq=np.concatenate([WEIGHT * UP, np.cross(com, WEIGHT * UP)]),
            bounds=(0, None),
        )
        least.append(-found.fun)
    assert room <= min(least) + 1e-3
    assert room == pytest.approx(min(least), rel=0.01)


def test_too_few_contacts_have_no_such_cone() -> None:
    with pytest.raises(wb.SpecError, match="2 contacts"):
        WrenchCone(FEET[:2], np.tile(UP, (2, 1)), np.full(2, 0.7))
    walls = np.array([(0.0, 0.3, 0.0), (0.0, -0.3, 0.0), (0.1, 0.3, 0.4), (0.1, -0.3, 0.4)])
    facing = np.array([(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)] * 2)
    with pytest.raises(wb.SpecError, match="oppose"):
        WrenchCone(walls, facing, np.full(4, 1.5))
