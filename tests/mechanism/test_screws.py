from __future__ import annotations

import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st

from wbplan.mechanism import adjoint, klein, lie, line, rank, reciprocal, skew, slide, swap

numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
screws = st.tuples(vectors, vectors).map(np.concatenate)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-12)


@given(screws, screws)
def test_products_agree_with_pinocchios(a: np.ndarray, b: np.ndarray) -> None:
    first, second = pin.Motion(swap(a)), pin.Motion(swap(b))
    np.testing.assert_allclose(swap(lie(a, b)), first.cross(second).vector, atol=1e-12)
    # A wrench (force, moment about the origin) does klein(w, V) of work on a twist.
    np.testing.assert_allclose(klein(a, b), pin.Force(a).dot(second), atol=1e-12)


@given(vectors, vectors, screws)
def test_adjoint_is_the_action_of_a_pose(turn: np.ndarray, shift: np.ndarray, screw: np.ndarray) -> None:
    pose = pin.SE3(pin.exp3(turn), shift)
    np.testing.assert_allclose(
        swap(adjoint(pose.rotation, shift) @ screw), pose.act(pin.Motion(swap(screw))).vector, atol=1e-10
    )


def test_lines_that_meet_are_reciprocal_and_others_not() -> None:
    first, crossing, apart = (
        line([1, 0, 0], [0, 0, 0]),
        line([0, 2, 0], [3, 5, 0]),
        line([0, 1, 0], [0, 0, 0.2]),
    )
    assert abs(klein(first, crossing)) < 1e-15
    np.testing.assert_allclose(abs(klein(first, apart)), 0.2)
    assert klein(first, slide([0, 1, 0])) == 0.0
    assert klein(first, slide([1, 0, 0])) == 1.0


def test_reciprocal_complements() -> None:
    random = np.random.default_rng(0)
    for count in range(7):
        rows = random.normal(size=(count, 6))
        wrenches = reciprocal(rows)
        assert wrenches.shape == (6 - count, 6)
        assert rank(wrenches) == 6 - count
        assert all(abs(klein(w, r)) < 1e-10 for w in wrenches for r in rows)
    assert rank(np.zeros((2, 6))) == 0
