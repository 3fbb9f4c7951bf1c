"""Positions, speeds and accelerations never contradict each other: random limits, states and targets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from wbplan.program.jerk_box import jerk_box, ways_to_rest
from wbplan.program.joint_box import BRAKING, NEVER, box, brake, stopping

TICKS = 150
seeds = st.integers(0, 2**32 - 1)


class Joints:
    """Random joints with random limits, moved by a controller that asks for anything."""

    def __init__(self, seed: int, left: float = NEVER) -> None:
        rng = self.rng = np.random.default_rng(seed)
        n = self.n = int(rng.integers(1, 6))
        self.dt = float(rng.choice([0.001, 0.005, 0.02, 0.05]))
        self.v, self.a = 10 ** rng.uniform(-1, 1.5, n), 10 ** rng.uniform(-1, 3.5, n)
        half = 10 ** rng.uniform(-3, 0.7, n)
        self.low, self.high = -half, half
        self.q = rng.uniform(-half, half)
        self.previous, self.older = np.zeros(n), np.zeros(n)
        self.most, self.reach = self.a * self.dt**2, self.v * self.dt
        self.slowing = BRAKING * self.most * rng.uniform(0.2, 1.0, n)
        self.led = rng.random(n) < 0.2
        self.lower, self.upper = np.zeros(6 + n), np.zeros(6 + n)
        self.left, self.index, self.none = left, np.arange(n), np.zeros(0)

    def fill(self) -> None:
        limits = (self.q, self.index, self.low, self.high)
        ticks, factor = stopping(
            *limits, self.slowing, self.previous, self.led, self.none, self.none, self.left
        )
        box(
            *limits, self.reach, self.most, self.slowing, self.previous, self.led, self.left, ticks, factor,
            0, self.lower, self.upper,
        )  # fmt: skip

    def step(self) -> None:
        """To the end of the box that a whim draws to, or anywhere in it."""
        low, high = self.lower[6:], self.upper[6:]
        assert (low <= high).all()
        whim = self.rng.random(self.n)
        share = np.where(whim < 0.4, 1.0, np.where(whim < 0.7, 0.0, self.rng.random(self.n)))
        x = low + share * (high - low)
        assert (np.abs(x - self.previous) <= self.most * (1 + 1e-9)).all()
        assert (np.abs(x) <= self.reach * (1 + 1e-9)).all()
        self.q = self.q + x
        assert (self.q >= self.low - 1e-12).all()
        assert (self.q <= self.high + 1e-12).all()
        self.older, self.previous = self.previous, x


@settings(max_examples=150, deadline=None)
@given(seed=seeds)
def test_from_rest_no_limit_is_ever_broken_and_the_box_is_never_empty(seed: int) -> None:
    joints = Joints(seed)
    for _ in range(TICKS):
        joints.fill()
        joints.step()


@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_all_are_at_rest_when_they_are_to_be(seed: int) -> None:
    joints = Joints(seed)
    for left in range(TICKS, 0, -1):
        joints.left = float(left)
        joints.fill()
        joints.step()
    assert (np.abs(joints.previous) <= joints.most).all()


@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_with_a_bound_on_the_jerk_too(seed: int) -> None:
    joints = Joints(seed)
    jerk = 10 ** joints.rng.uniform(0, 5, joints.n) * joints.dt**3
    slowing = BRAKING * joints.most
    share = np.minimum(0.9, np.minimum(BRAKING * jerk / (2 * joints.most), slowing / joints.reach))
    rest = ways_to_rest(np.maximum(share, 1e-3), joints.reach, slowing)
    for _ in range(TICKS):
        joints.fill()
        jerk_box(
            joints.q, joints.index, joints.low, joints.high, joints.reach, joints.most, jerk, share, rest,
            joints.previous, joints.older, NEVER, joints.lower, joints.upper,
        )  # fmt: skip
        before, older = joints.previous, joints.older
        joints.step()
        turned = joints.previous - 2 * before + older
        assert (np.abs(turned) <= jerk * (1 + 1e-6) + 1e-15).all()


@given(gap=st.floats(0.0, 10.0), slowing=st.floats(1e-6, 1.0))
def test_braking_stops_within_the_gap_and_uses_it(gap: float, slowing: float) -> None:
    step = brake(gap, slowing)
    assume(step / slowing < 1e4)
    way = sum(max(step - i * slowing, 0.0) for i in range(int(step / slowing) + 2))
    assert way == pytest.approx(gap, rel=1e-9, abs=1e-12)
