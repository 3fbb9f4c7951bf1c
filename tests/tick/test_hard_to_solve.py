"""Ticks that ask too much of a solver: refused or told of, and never stuck."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wbplan as wb
from wbplan.compiled.acceleration import acceleration_bounds
from wbplan.program.nullspace import null_basis

BACKENDS = ["proxqp", "placo"]


def standing(robot: wb.Robot, soft: list[Any], limits: list[Any]) -> wb.Phase:
    return wb.Phase("stand", contacts=[wb.Contact(f) for f in robot.feet.values()], soft=soft, limits=limits)


@pytest.mark.parametrize("size", [1e10, 1e29])
@pytest.mark.parametrize(("backend", "levels"), [("proxqp", 1), ("proxqp", 2), ("placo", 1)])
def test_absurd_targets_and_weights_are_followed_or_refused(
    legarm: wb.Robot, backend: str, size: float, levels: int
) -> None:
    start = legarm.state("stand")
    soft: list[Any] = [wb.PositionTask("body", start.pose("body").translation + size, weight=min(size, 1e6))]
    soft += [wb.ComTask(start.com - size, weight=1.0), wb.PostureTask(weight=0.1)]
    phase = standing(legarm, [soft[:1], soft[1:]] if levels > 1 else soft, [wb.JointLimits()])
    loop = wb.Loop(legarm, phase, start, dt=0.01, backend=backend)
    for _ in range(3):
        before = loop.q.copy()
        try:
            tick = loop.step()
        except wb.SolveError:
            np.testing.assert_array_equal(loop.q, before)
            continue
        assert np.isfinite(tick.q).all()
        assert np.isfinite(list(tick.errors.values())).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_joint_that_comes_into_a_phase_too_fast_slows_down_and_is_named(
    legarm: wb.Robot, backend: str
) -> None:
    limits = wb.JointLimits(speed=0.05, acceleration=2.0)
    phase = wb.Phase("slow", soft=[wb.PostureTask()], limits=[limits])
    name = "leg3_joint2"
    column = legarm.joint_index(name)[1]
    velocity = np.zeros(legarm.model.nv)
    most = 0.05 * legarm.model.velocityLimit[column]
    velocity[column] = 1.3 * most
    loop = wb.Loop(legarm, phase, legarm.state("stand"), dt=0.01, backend=backend, velocity=velocity)
    ticks = [loop.step() for _ in range(40)]
    speeds = np.abs([velocity[column], *(tick.v[column] for tick in ticks)])
    fast = speeds[1:] > most * (1 + 1e-6)
    assert fast[0]
    assert not fast[-1]
    assert (np.diff(speeds)[fast] < 0.0).all()
    assert [f"speed not yet within its limit: {name}" in tick.warning for tick in ticks] == list(fast)


@pytest.mark.parametrize("jerk", [1e-300, 1e-9, 1e-3])
def test_a_tiny_jerk_limit_does_not_take_for_ever(legarm: wb.Robot, jerk: float) -> None:
    """How long a joint needs to come to rest is searched for: tick by tick it would be never."""
    phase = wb.Phase("still", soft=[wb.PostureTask()], limits=[wb.JointLimits(jerk=jerk)])
    if jerk < 1e-6:
        with pytest.raises(wb.SpecError, match="too small to come to rest"):
            wb.Loop(legarm, phase, legarm.state("stand"), dt=0.01)
        return
    assert np.isfinite(wb.Loop(legarm, phase, legarm.state("stand"), dt=0.01).step().q).all()


@pytest.mark.parametrize(
    ("speed", "limits", "why"),
    [
        (2.0, wb.JointLimits(acceleration=1.0), "cannot stop before it"),
        (2.0, wb.JointLimits(acceleration=1e3, jerk=1.0), "with the phase's jerk it cannot stop"),
        (0.1, wb.JointLimits(acceleration=10.0), None),
        (0.1, wb.JointLimits(acceleration=100.0, jerk=1e4), None),
    ],
)
def test_a_start_from_which_no_joint_could_stop_is_refused(
    legarm: wb.Robot, speed: float, limits: wb.JointLimits, why: str | None
) -> None:
    start = legarm.state("stand")
    velocity = np.zeros(legarm.model.nv)
    place, column = legarm.joint_index("leg3_joint2")
    velocity[column] = speed
    phase = wb.Phase("stop", soft=[wb.PostureTask(weight=1e-3)], limits=[limits])
    if why is not None:
        with pytest.raises(wb.SpecError, match=why):
            wb.Loop(legarm, phase, start, dt=0.01, velocity=velocity)
        return
    loop = wb.Loop(legarm, phase, start, dt=0.01, velocity=velocity)
    for _ in range(100):
        tick = loop.step()
    assert tick.q[place] <= legarm.model.upperPositionLimit[place] + 1e-9


def test_jerk_is_kept_where_one_phase_follows_another(legarm: wb.Robot) -> None:
    """The acceleration goes on with the speed."""
    joint, dt, jerk = "leg3_joint2", 0.01, 3000.0

    def loop(name: str, to: float, q: Any, **moving: Any) -> wb.Loop:
        soft = [wb.PostureTask({joint: to}, gain=100.0)]
        return wb.Loop(legarm, wb.Phase(name, soft=soft, limits=[wb.JointLimits(jerk=jerk)]), q, dt, **moving)

    first = loop("go", 2.0, legarm.state("stand"))
    column = legarm.joint_index(joint)[1]
    speeds = [0.0, *(first.step().v[column] for _ in range(4))]
    changes = {}
    for name, moving in {"whole": {"acceleration": first.acceleration}, "half": {}}.items():
        second = loop("back", -2.0, first.q, velocity=first.velocity, **moving)
        taken = [*speeds, *(second.step().v[column] for _ in range(4))]
        changes[name] = float(np.abs(np.diff(taken, 2)).max()) / dt**2
    assert changes["whole"] <= jerk * (1 + 1e-6) < changes["half"]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("during", ["advance", "keep"])
def test_a_tick_that_is_interrupted_never_was(
    legarm: wb.Robot, backend: str, during: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = legarm.state("stand")
    goal = wb.MinJerk(start.com, start.com + np.array([0.01, 0.0, 0.0]), 0.1)
    phase = standing(legarm, [wb.ComTask(goal), wb.PostureTask()], [wb.JointLimits()])
    loop, other = (wb.Loop(legarm, phase, start, dt=0.01, backend=backend) for _ in range(2))
    for each in (loop, other):
        each.step()
    method = {"advance": "advance", "keep": "measure"}[during]
    real, calls = getattr(loop.stack, method), []

    def interrupted(*args: Any) -> None:
        real(*args)
        calls.append(method)
        if len(calls) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(loop.stack, method, interrupted)
    with pytest.raises(KeyboardInterrupt):
        loop.step()
    assert loop.t == other.t
    np.testing.assert_allclose(loop.step().q, other.step().q, atol=1e-9)


def test_numbers_whose_squares_are_none_are_refused(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SpecError, match="1e\\+30"):
        wb.PositionTask("body", np.array([1e200, 0.0, 0.0]))
    with pytest.raises(wb.SpecError):
        wb.PostureTask(weight=1e200)
    q = np.array(legarm.state("stand").q)
    q[0] = 1e200
    with pytest.raises(wb.SpecError, match="q\\[0\\]"):
        legarm.state(q)
    for dt in (1e-300, 1e200):
        with pytest.raises(wb.SpecError, match="dt"):
            wb.Loop(legarm, standing(legarm, [], []), legarm.state("stand"), dt=dt)


def test_where_no_step_is_left_no_row_narrows_it(capfd: pytest.CaptureFixture[str]) -> None:
    assert null_basis(np.zeros((4, 0))).shape == (0, 0)
    assert null_basis(np.zeros((0, 3))).shape == (3, 3)
    assert not capfd.readouterr().out  # LAPACK complains there about what it cannot take


def test_a_joint_that_moves_next_to_nothing_has_a_bound(
    legarm: wb.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    n = legarm.model.nv - 6
    monkeypatch.setattr("wbplan.compiled.acceleration._own_limbs", lambda robot: np.zeros(n))
    monkeypatch.setattr("wbplan.compiled.acceleration.standing_inertia", lambda *_: np.full(n, 1e-310))
    bounds = acceleration_bounds(legarm, wb.Phase("p"), np.array(legarm.state("stand").q))
    assert np.isfinite(bounds).all()
