"""`wbplan simulate`, and the ghost in the view."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from wbplan.cli import commands as cli
from wbplan.cli.commands import main
from wbplan.physics import ghost_of, simulate
from wbplan.view import page


def test_what_stands_ends_with_0(
    leaning, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "replay", partial(simulate, ladder=()))  # which takes half a minute
    folder = leaning[0.03].bundle.write(tmp_path / "lean")
    assert main(["simulate", str(folder), "--trials", "1", "--seed", "5"]) == 0
    out = capsys.readouterr().out
    assert "undisturbed: stands" in out
    assert "times real time" in out
    assert "1 of 1 stand" in out
    told = json.loads((folder / "physics.json").read_text(encoding="utf-8"))
    assert told["trials"]["seed"] == 5
    assert told["trials"]["interval_95"][0] < 1.0
    assert (folder / "physics.png").stat().st_size > 10_000


def test_what_falls_ends_with_1(leaning, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = leaning[-0.01].bundle.write(tmp_path / "lean")
    assert main(["simulate", str(folder)]) == 1
    said = capsys.readouterr()
    assert said.err.startswith("wbplan: falls at ")
    assert said.err.count("\n") == 1
    assert json.loads((folder / "physics.json").read_text(encoding="utf-8"))["verdict"]["word"] == "falls"


def test_bad_input_ends_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path / "nowhere")]) == 2
    assert main(["simulate", str(tmp_path), "--trials", "-1"]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_the_ghost_is_where_the_simulation_was(leaning) -> None:
    done = leaning[-0.01].simulate()
    ghost = ghost_of(done)
    assert ghost.q.shape == (len(ghost.time), leaning[-0.01].bundle.model.nq)
    k = int(np.searchsorted(done.record.time, ghost.time[-1]))
    np.testing.assert_allclose(ghost.q[-1, :3], done.record.base[k, :3], atol=2e-3)
    held = sum(force[0, 5] for force in ghost.forces.values())
    assert held == pytest.approx(6.507 * 9.81, rel=0.1)


def test_the_ghost_is_on_the_page(leaning) -> None:
    from wbplan.view.messages import Store
    from wbplan.view.playback import draw_plan

    def nodes(ghost: object) -> set[str]:
        store = Store()
        draw_plan(leaning[0.03].bundle, store, ghost=ghost)
        return {key[0] for key in store._kept}

    ghost = ghost_of(leaning[0.03].simulate())
    added = nodes(ghost) - nodes(None)
    assert any(path.startswith("/wbplan/ghost/body") for path in added)
    assert "/wbplan/forces/leg3_foot" in added
    assert page(leaning[0.03].bundle)
