"""The bench does what it says; what it measures depends on the machine, and is not asserted."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rich.console import Console

from wbplan.bench import SCENES, Lap, Row, Scene, make_solvers, race, rows_of, table_of, write_json
from wbplan.bench.__main__ import main
from wbplan.bench.breakdown import PARTS, breakdown
from wbplan.bench.clearance import clearance_cost, clearance_text
from wbplan.bench.solvers import pink_is_installed
from wbplan.errors import BundleError
from wbplan.program.stack import Stack

TICKS = 120  # two rounds and a bit: over a second of the path
OURS = {"kinematics-floor", "placo", "wbplan-proxqp", "wbplan-placo"}

needs_pink = pytest.mark.skipif(
    not pink_is_installed(), reason="Pink, of the extra 'bench', is not installed"
)


@pytest.fixture(scope="module", params=sorted(SCENES))
def scene(request: pytest.FixtureRequest) -> Scene:
    return SCENES[request.param](TICKS)


@pytest.fixture(scope="module")
def laps(scene: Scene) -> Mapping[str, Lap]:
    return {lap.solver: lap for lap in race(scene, make_solvers(scene)[0])}


def test_every_solver_takes_part(laps: Mapping[str, Lap]) -> None:
    assert set(laps) == OURS | ({"pink"} if pink_is_installed() else set())
    assert len({len(lap.nanoseconds) for lap in laps.values()}) == 1
    assert all((lap.nanoseconds > 0).all() for lap in laps.values())


@pytest.mark.parametrize(
    "solver", ["placo", pytest.param("pink", marks=needs_pink), "wbplan-proxqp", "wbplan-placo"]
)
def test_every_solver_does_the_same_work(scene: Scene, laps: Mapping[str, Lap], solver: str) -> None:
    lap = laps[solver]
    assert lap.faults == ()
    assert lap.tracking < 1e-4
    assert lap.slip < 2e-5
    if scene.loop is not None:
        assert lap.gap < 2e-5
    if scene.margin is not None:
        assert lap.margin > scene.margin


def test_the_path_asks_for_something(scene: Scene) -> None:
    """A robot that stood still would be seen."""
    start, end = scene.tracked[0].poses[0], scene.tracked[0].poses[-1]
    assert np.linalg.norm(end.translation - start.translation) > 2e-3
    assert np.linalg.norm(pin.log3(start.rotation.T @ end.rotation)) > 5e-3
    assert len(scene.tracked[0].poses) == TICKS + 1


def test_a_robot_that_stands_still_is_not_the_same_work(scene: Scene) -> None:
    floor = make_solvers(scene)[0][0]
    floor.moves = True
    (lap,) = race(scene, [floor])
    assert any("path missed" in fault for fault in lap.faults)
    text = _text(table_of(scene.name, [lap, Lap("placo", "", np.ones(1))]))
    assert "NOT THE SAME WORK: path missed" in text


def test_clamp_is_the_whole_stack() -> None:
    scene = SCENES["clamp"](20)
    assert set(scene.feet) == {f"leg{k}_foot" for k in (3, 4, 5, 6)}
    assert scene.loop == ("limb1_tip", "limb2_tip")
    assert {t.frame for t in scene.tracked} == {"box", "limb1_tip", "limb2_tip"}
    assert scene.margin == 0.04
    assert len(scene.compiled.free) == 28


def test_tips_go_with_the_box() -> None:
    """Their own splines, and yet where the box takes them: to a tenth of a millimetre."""
    box, *tips = SCENES["clamp"](400).tracked
    for tip in tips:
        offset = box.poses[0].actInv(tip.poses[0])
        for a, b in zip(box.poses, tip.poses, strict=True):
            assert np.linalg.norm((a * offset).translation - b.translation) < 1e-4


def test_longer_runs_go_round_again() -> None:
    poses = SCENES["stand"](1700).tracked[0].poses
    assert poses[800].isApprox(poses[0], 1e-9)
    assert poses[1000].isApprox(poses[200], 1e-9)
    assert not poses[1000].isApprox(poses[0], 1e-3)


def test_ratios_are_to_placo() -> None:
    laps = [Lap("placo", "", np.array([1e3, 2e3, 3e3])), Lap("pink", "", np.array([8e3, 8e3, 8e3]))]
    assert rows_of("stack", laps) == [
        Row("stack", "placo", 2.0, 2.98, 1.0),
        Row("stack", "pink", 8.0, 8.0, 4.0),
    ]


def test_the_table_says_who_is_missing() -> None:
    text = _text(table_of("clamp", [Lap("placo", "", np.ones(3))], [("pink", "not installed")]))
    assert "pink" in text
    assert "not installed" in text


def test_without_pink_the_others_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbplan.bench.solvers.pink_is_installed", lambda: False)
    solvers, missing = make_solvers(SCENES["stand"](5))
    assert {solver.name for solver in solvers} == OURS
    assert missing[0][0] == "pink"
    assert "wbplan[bench]" in missing[0][1]


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_parts_of_a_tick(backend: str) -> None:
    before = Stack.measure, Stack.assemble, pin.integrate
    found = breakdown(SCENES["clamp"](30), backend)
    assert set(found) == {*PARTS, "tick"}
    for name in PARTS:
        if (backend, name) != ("placo", "assemble"):  # PlaCo has rows of its own
            assert 0.0 < found[name] < found["tick"]
    assert (Stack.measure, Stack.assemble, pin.integrate) == before


def test_the_command_writes_the_file(tmp_path: Path) -> None:
    out = tmp_path / "new" / "bench.json"
    done = subprocess.run(
        [sys.executable, "-m", "wbplan.bench", "--out", str(out), "--ticks", "20"],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).resolve().parents[2],
    )
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads(out.read_text())
    assert {row["stack"] for row in rows} == set(SCENES)
    assert {row["solver"] for row in rows if row["stack"] == "clamp"} >= OURS
    for row in rows:
        assert list(row) == ["stack", "solver", "median_us", "p99_us", "ratio_to_placo"]
        assert 0.0 < row["median_us"] <= row["p99_us"]
        assert row["ratio_to_placo"] > 0.0
    assert all(row["ratio_to_placo"] == 1.0 for row in rows if row["solver"] == "placo")
    assert "wbplan-proxqp" in done.stdout
    assert list(out.parent.iterdir()) == [out]


def test_the_profile_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bench.json"
    assert main(["--profile", "--stack", "stand", "--ticks", "10", "--out", str(out)]) == 0
    assert "assemble" in capsys.readouterr().out
    assert not out.exists()


def test_a_file_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BundleError, match="cannot write"):
        write_json([], tmp_path / "file" / "bench.json")


@pytest.mark.parametrize("ticks", ["0", "-3", "many"])
def test_bad_counts_are_refused(ticks: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--ticks", ticks])
    assert left.value.code == 2
    assert "--ticks" in capsys.readouterr().err


def _text(table: object) -> str:
    console = Console(width=200, record=True, quiet=False)
    with console.capture() as captured:
        console.print(table)
    return captured.get()


@pytest.mark.parametrize("name", sorted(SCENES))
def test_what_distances_cost(name: str) -> None:
    """The same scene, and a promise that takes part: pairs, measured ones and rows are counted."""
    scene = SCENES[name](60)
    cost = clearance_cost(scene)
    assert cost.pairs > 1000
    assert 0 < cost.rows <= cost.checked < 0.1 * cost.pairs
    assert min(cost.without, cost.along) > 0.0
    text = clearance_text(scene)
    assert f"clearance of '{name}'" in text
    assert f"of {cost.pairs} pairs" in text
