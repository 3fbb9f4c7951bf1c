"""A short run of the soak, and proof that its watch sees what is broken."""

from __future__ import annotations

import io
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import soak_run
from soak_run import soak
from soak_watch import Watch

import wbplan as wb


def test_some_thousand_ticks_keep_every_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak_run, "EVERY", 0.0)
    out = io.StringIO()
    report = soak(4000, seed=1, out=out)
    assert f"{report.total.ticks} of 4000 ticks" in out.getvalue().splitlines()[-1]
    assert not report.found, report.table()
    assert report.total.ticks >= 4000
    assert {"ticks proxqp", "ticks placo"} <= set(report.total.counts)
    assert all(share <= 1.0 for share in report.total.worst.values()), report.table()


def test_a_process_that_dies_is_found_and_told_and_the_next_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def dies(seed: int, first: int, step: int, ticks: int) -> subprocess.Popen[str]:
        said = f"print('{{\"begin\": {first}}}', flush=True); raise SystemExit(3)"
        return subprocess.Popen([sys.executable, "-c", said], stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(soak_run, "_process", dies)
    out = io.StringIO()
    report = soak(2, seed=1, out=out)
    assert report.found == [(k, "the process ended with code 3") for k in (0, 1)]
    assert not report.clean
    assert out.getvalue().count("FOUND episode") == 2


@pytest.fixture(scope="module")
def standing() -> tuple[wb.Robot, wb.Phase, wb.State]:
    robot = wb.load_robot("mana")
    limits = [wb.JointLimits(), wb.SupportPolygon(margin=0.01)]
    phase = wb.Phase("stand", contacts=[wb.Contact(f) for f in robot.feet.values()], limits=limits)
    return robot, phase, robot.state("stand")


def _tick(state: wb.State, q: np.ndarray, dt: float, **more: object) -> SimpleNamespace:
    import pinocchio as pin

    v = pin.difference(state.model, state.q, q) / dt
    return SimpleNamespace(
        q=q, v=v, t=dt, com=wb.State(state.model, q).com, margin=np.nan, warning="", **more
    )


@pytest.mark.parametrize(
    ("index", "by", "promise"),
    [
        (0, 2e-4, "slip"),
        (0, 0.5, "margin:"),
        (8, 4.0, "position"),
        (8, 0.5, "speed"),
        (1, np.nan, "not finite"),
    ],
)
def test_the_watch_sees_a_broken_promise(
    standing: tuple[wb.Robot, wb.Phase, wb.State], index: int, by: float, promise: str
) -> None:
    robot, phase, state = standing
    watch = Watch(robot, phase, state.q, 0.01, {})
    q = np.array(state.q)
    q[index] += by
    tick = _tick(state, q, 0.01) if np.isfinite(by) else SimpleNamespace(q=q, v=q, t=0.0, com=q[:3])
    assert any(promise in what for what in watch.see(tick))


def test_the_watch_is_content_with_a_robot_that_stands(
    standing: tuple[wb.Robot, wb.Phase, wb.State],
) -> None:
    robot, phase, state = standing
    loop = wb.Loop(robot, phase, state, dt=0.01)
    watch = Watch(robot, phase, state.q, 0.01, {})
    for _ in range(3):
        assert watch.see(loop.step()) == []


def test_the_watch_sees_a_joint_that_starts_too_fast(
    standing: tuple[wb.Robot, wb.Phase, wb.State],
) -> None:
    robot, phase, state = standing
    q = np.array(state.q)
    q[8] += 1e-3
    bounds = np.full(robot.model.nv - 6, 9.0)
    watch = Watch(robot, phase, state.q, 0.01, {}, None, bounds)
    assert any("acceleration" in what for what in watch.see(_tick(state, q, 0.01)))
    slower = Watch(robot, phase, state.q, 0.01, {}, None, 2.0 * bounds)
    assert not any("acceleration" in what for what in slower.see(_tick(state, q, 0.01)))


def test_the_watch_sees_a_jerk_and_takes_no_excuse_for_speed(
    standing: tuple[wb.Robot, wb.Phase, wb.State],
) -> None:
    robot, _, state = standing
    phase = wb.Phase("gently", limits=[wb.JointLimits(speed=0.05, jerk=500.0)])
    q = np.array(state.q)
    q[8] += 5e-3
    tick = _tick(state, q, 0.01)
    tick.warning = "speed not yet within its limit: a joint"
    broken = " ".join(Watch(robot, phase, state.q, 0.01, {}).see(tick))
    assert "jerk" in broken
    assert "speed" in broken  # the joint was at rest
    moving = np.zeros(robot.model.nv)
    moving[7] = 0.5
    broken = " ".join(Watch(robot, phase, state.q, 0.01, {}, velocity=moving).see(tick))
    assert "speed" not in broken  # it came as fast
    assert "jerk" not in broken


def test_the_watch_sees_links_that_come_too_near(standing: tuple[wb.Robot, wb.Phase, wb.State]) -> None:
    robot, _, state = standing
    phase = wb.Phase("apart", limits=[wb.SelfCollision(distance=0.2, influence=0.3)])
    q = np.array(state.q)
    q[robot.joint_index(robot.joint_names[0])[0]] += 0.3  # one leg turned to the next
    watch = Watch(robot, phase, state.q, 0.01, {})
    assert any("clearance" in what for what in watch.see(_tick(state, q, 0.01)))
