"""The command line as a process of its own: signals, pipes, real exit codes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

import wbplan as wb

ROOT = Path(__file__).resolve().parents[2]
# Long enough to be interrupted, and says when planning is about to begin.
LONG = '''"""Long."""
from pathlib import Path
import wbplan as wb
ROBOT = "legarm_hexapod"
def script(robot):
    Path("begun").touch()
    contacts = [wb.Contact(foot, friction=0.7) for foot in robot.feet.values()]
    return wb.Script(wb.Phase("long", contacts=contacts, soft=[wb.PostureTask(weight=1.0)], duration=3000.0))
'''


@contextmanager
def started(*args: str, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    env = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "wbplan", *args],
        cwd=cwd,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda s: s.name)
def test_a_run_that_is_stopped_leaves_nothing_but_what_was_there(
    sent: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "long.py").write_text(LONG, encoding="utf-8")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "plan.json").write_text("earlier", encoding="utf-8")
    with started("run", "long.py", cwd=tmp_path) as process:
        end = time.monotonic() + 60
        while not (tmp_path / "begun").exists():
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < end
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(sent)
        _, err = process.communicate(timeout=30)
    if sent is signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130
        assert err == "wbplan: interrupted\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["begun", "long.py", "out"]
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["plan.json"]
    assert (tmp_path / "out" / "plan.json").read_text(encoding="utf-8") == "earlier"


def test_a_usage_error_ends_with_2_and_one_line(tmp_path: Path) -> None:
    with started("run", "no_task", cwd=tmp_path) as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("wbplan: no task is named 'no_task'")
    assert err.count("\n") == 1


def test_a_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    with started("robot", "legarm_hexapod", cwd=tmp_path) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == ""
        assert process.wait(timeout=60) == 0


def test_view_serves_until_ctrl_c(tmp_path: Path) -> None:
    (tmp_path / "short.py").write_text(LONG.replace("3000.0", "0.1"), encoding="utf-8")
    with started("run", "short.py", "--view", cwd=tmp_path) as process:
        assert process.stdout is not None
        said = ""
        while "Ctrl-C" not in said:
            line = process.stdout.readline()
            assert line, process.communicate()
            said += line
        _, played = re.findall(r"http://127\.0\.0\.1:\d+/", said)  # the live page came first
        with urllib.request.urlopen(played, timeout=10) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")


def test_a_disk_that_is_full_leaves_the_earlier_bundle(tmp_path: Path) -> None:
    """No file may grow beyond 200 kB: the scene's page does not fit."""
    (tmp_path / "short.py").write_text(LONG.replace("3000.0", "0.1"), encoding="utf-8")
    with started("run", "short.py", cwd=tmp_path) as process:
        assert process.wait(timeout=120) == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    limited = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)); "
    limited += "from wbplan.cli.commands import main; sys.exit(main(['run', 'short.py']))"
    done = subprocess.run(
        [sys.executable, "-c", limited],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2, done.stderr
    assert "cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()} == before


def _into_plan(task: str, cwd: Path) -> AbstractContextManager[subprocess.Popen[str]]:
    return started("run", f"{task}.py", "--out", "plan", cwd=cwd)


def test_two_runs_into_one_folder_leave_one_whole_bundle(tmp_path: Path) -> None:
    for name in ("one", "two"):
        text = LONG.replace("3000.0", "0.1").replace('"long"', f'"{name}"')
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    with _into_plan("one", tmp_path) as one, _into_plan("two", tmp_path) as two:
        for process in (one, two):
            assert process.wait(timeout=120) == 0, process.communicate()
    bundle = wb.Bundle.read(tmp_path / "plan")
    assert bundle.plan["phases"][0]["name"] == bundle.plan["task"] in ("one", "two")
    assert wb.check(bundle).ok
    assert sorted(p.name for p in tmp_path.iterdir()) == ["begun", "one.py", "plan", "two.py"]
