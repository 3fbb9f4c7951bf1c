"""A solver that fails at a tick: retried anew, then by the other backend; else the plan ends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbplan as wb
from wbplan import backends
from wbplan.backends import PlacoBackend, ProxqpBackend
from wbplan.errors import Relaxation

Fails = Callable[[int, int], bool]
DT = 0.01


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Makes a backend raise at its tick k of the n-th solver made, where told to."""

    def install(name: str, fails: Fails, error: Exception | None = None) -> None:
        real = {"proxqp": ProxqpBackend, "placo": PlacoBackend}[name]
        made: list[object] = []

        class Failing:
            def __init__(self, stack: Any) -> None:
                self._real, self._number, self._tick = real(stack), len(made), -1
                self.name = name
                made.append(self)

            def solve(self) -> Any:
                self._tick += 1
                if fails(self._number, self._tick):
                    raise error or wb.SolveError("out of luck")
                return self._real.solve()

        monkeypatch.setitem(backends.BACKENDS, name, Failing)

    return install


def sway(*, phases: int = 1) -> tuple[wb.Robot, wb.Script]:
    robot = wb.load_robot("mana")
    com = robot.state("stand").com
    contacts = [wb.Contact(foot) for foot in robot.feet.values()]
    ways = [com + (0.01 * (k % 2 == 0), 0.0, 0.0) for k in range(phases)]
    limits = [wb.JointLimits(), wb.SupportPolygon(margin=0.01)]
    return robot, wb.Script(
        wb.Phase(
            f"sway{k}",
            contacts=contacts,
            soft=[wb.ComTask(wb.MinJerk(wb.AS_IS, way, 0.1), weight=10.0), wb.PostureTask()],
            limits=limits,
            duration=0.1,
        )
        for k, way in enumerate(ways)
    )


# Number 0 is the solver of the tick that only compiles; 1 is the first phase's.
def test_a_solver_that_fails_once_is_asked_anew(failing: Callable[..., None]) -> None:
    robot, script = sway()
    smooth = wb.plan(robot, script, dt=DT)
    failing("proxqp", lambda number, tick: number == 1 and tick == 4)
    plan = wb.plan(robot, script, dt=DT)
    assert plan.check().ok
    np.testing.assert_allclose(plan.trajectory.q, smooth.trajectory.q, atol=1e-6)
    (retry,) = plan.report["retries"]
    assert (retry["time"], retry["phase"]) == (pytest.approx(0.04), "sway0")
    assert (retry["what"], retry["why"]) == ("a solver without memory", "out of luck")
    assert any("without memory" in warning for warning in plan.report["warnings"])
    assert smooth.report["retries"] == []


@pytest.mark.parametrize("error", [None, RuntimeError("singular\nmatrix"), np.linalg.LinAlgError("no")])
def test_then_the_other_backend_is_asked(failing: Callable[..., None], error: Exception | None) -> None:
    robot, script = sway()
    failing("proxqp", lambda number, tick: (number, tick) in ((1, 4), (2, 0)), error)
    plan = wb.plan(robot, script, dt=DT)
    assert plan.check().ok
    (retry,) = plan.report["retries"]
    assert retry["what"] == "backend 'placo'"
    assert plan.bundle.plan["backend"] == "proxqp"
    assert "\n" not in str(retry["why"])


@pytest.mark.parametrize(("last", "phases"), [(4, 1), (14, 2), (10, 2)])
def test_a_plan_that_nobody_can_go_on_with_ends_at_the_last_good_state(
    failing: Callable[..., None], tmp_path: Path, last: int, phases: int
) -> None:
    robot, script = sway(phases=phases)
    whole = wb.plan(robot, script, dt=DT)
    # A solver is made for each phase, one more for the tick that compiles: the failing one is the last.
    first = last - 10 * (phases - 1)
    failing("proxqp", lambda number, tick: number > phases or (number == phases and tick >= first))
    failing("placo", lambda number, tick: True)
    with pytest.raises(wb.SolveError, match=rf"at 0\.{last:02d} s of the plan, .*out of luck") as caught:
        wb.plan(robot, script, dt=DT)
    partial = caught.value.partial
    assert partial is not None
    assert len(partial.trajectory) == last + 1
    np.testing.assert_allclose(partial.trajectory.q, whole.trajectory.q[: last + 1], atol=1e-9)
    assert "out of luck" in partial.report["incomplete"]
    assert partial.check().ok
    folder = partial.bundle.write(tmp_path / "partial")
    assert wb.check(wb.Bundle.read(folder)).ok


def test_nothing_is_kept_where_nothing_moved(failing: Callable[..., None]) -> None:
    robot, script = sway()
    failing("proxqp", lambda number, tick: True)
    failing("placo", lambda number, tick: True)
    with pytest.raises(wb.SolveError, match=r"at 0\.00 s") as caught:
        wb.plan(robot, script, dt=DT)
    assert caught.value.partial is None


def test_rows_that_clash_are_not_tried_again(failing: Callable[..., None]) -> None:
    robot, script = sway()
    clash = Relaxation("contact(a)", 0.1, "m")
    failing("proxqp", lambda number, tick: number == 1 and tick == 4, wb.SolveError("clash", [clash]))
    with pytest.raises(wb.SolveError, match="clash") as caught:
        wb.plan(robot, script, dt=DT)
    assert caught.value.clashes == (clash,)
    assert len(caught.value.partial.trajectory) == 5


def test_a_loop_can_be_restarted_with_the_other_backend() -> None:
    robot, script = sway()
    loop = wb.Loop(robot, script.phases[0], robot.state("stand"), dt=DT)
    loop.step()
    before = loop.q.copy()
    loop.restart("placo")
    assert loop.backend == "placo"
    np.testing.assert_array_equal(loop.q, before)
    loop.step()
    loop.restart()
    assert loop.backend == "placo"
    with pytest.raises(wb.SpecError, match="backend 'none' does not exist"):
        loop.restart("none")
