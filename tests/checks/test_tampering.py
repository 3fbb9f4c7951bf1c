"""What was tampered with is seen, and nothing that is in a bundle makes the checks crash."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wbplan.bundle import Bundle
from wbplan.checks import check
from wbplan.errors import BundleError


def broken(bundle: Bundle) -> set[str]:
    return {row.promise for row in check(bundle).broken}


@pytest.fixture(scope="module")
def plan(good: Bundle) -> Callable[[], Bundle]:
    """Gives the good plan: Hypothesis would print all of its numbers."""
    return lambda: good


@given(
    sample=st.integers(0, 70),
    joint=st.integers(0, 12),
    amount=st.floats(1e-3, 3.0).flatmap(lambda x: st.sampled_from([x, -x])),
)
def test_a_joint_value_that_was_changed_is_seen(
    machine: ModuleType, plan: Callable[[], Bundle], sample: int, joint: int, amount: float
) -> None:
    good = plan()
    q = good.trajectory.q.copy()
    q[sample, 7 + joint] += amount
    found = broken(machine.edited(good, q=q))
    assert "v agrees with q" in found


@given(sample=st.integers(0, 70), leg=st.integers(0, 11), amount=st.floats(1e-3, 0.1))
def test_changing_v_along_with_q_does_not_hide_it(
    machine: ModuleType, plan: Callable[[], Bundle], sample: int, leg: int, amount: float
) -> None:
    good = plan()
    assume(leg > 2 or not 20 < sample < 40)  # leg 1 swings: it may be anywhere
    q, motion = good.trajectory.q.copy(), good.trajectory
    q[sample, 7 + leg] += amount
    forged = machine.assemble(good.model, good.urdf, motion.time, q, copy.deepcopy(good.phases), {})
    assert "foot slip" in broken(forged)


@given(
    index=st.tuples(st.integers(0, 70), st.integers(0, 19)), value=st.sampled_from([0.0, 1e9, -1e300, 1e308])
)
def test_absurd_values_make_broken_rows_and_no_crash(
    machine: ModuleType, plan: Callable[[], Bundle], index: tuple[int, int], value: float
) -> None:
    good = plan()
    q = machine.changed(good.trajectory.q, index, value)
    report = check(machine.edited(good, q=q))
    assert not report.ok or abs(value - good.trajectory.q[index]) < 1e-3


def test_a_zero_quaternion_breaks_rows_and_does_not_crash(machine: ModuleType, good: Bundle) -> None:
    q = good.trajectory.q.copy()
    q[3, 3:7] = 0.0
    assert "unit quaternion" in broken(machine.edited(good, q=q))


def test_a_misshapen_bundle_is_refused(machine: ModuleType, good: Bundle) -> None:
    with pytest.raises(BundleError, match=r"trajectory.npz: q: expected shape \(71, 20\), found \(70, 20\)"):
        check(machine.edited(good, q=good.trajectory.q[:-1]))
    with pytest.raises(BundleError, match=r"robot\.urdf"):
        check(replace(good, urdf="<robot/>"))
