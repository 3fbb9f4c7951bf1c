"""Bundles and processes: killed ones, several at once, disks that are full."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import ModuleType

import pytest

from wbplan.bundle import Bundle, places
from wbplan.errors import BundleError

ROOT = Path(__file__).resolve().parents[2]
WRITES = """
import sys
from wbplan.bundle import Bundle
bundle = Bundle.read(sys.argv[1])
print("ready", flush=True)
while True:
    bundle.write(sys.argv[2])
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_killed_writer_never_costs_the_bundle(good: Bundle, tmp_path: Path) -> None:
    """Killed in the middle of replacing: a bundle is there each time, and the next writer tidies up."""
    source, target = good.write(tmp_path / "source"), tmp_path / "out" / "plan"
    good.write(target)
    for wait in (0.05, 0.17):
        with subprocess.Popen(
            [sys.executable, "-c", WRITES, str(source), str(target)],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"ready\n"
            time.sleep(wait)
            process.kill()
        assert Bundle.read(target).plan["task"] == "step"
    good.write(target)
    assert names(target.parent) == ["plan"]


def test_what_a_killed_writer_left_is_swept_away(good: Bundle, folder: Path) -> None:
    left = folder.with_name(".plan.0123abcd.part")
    left.mkdir()
    (left / "plan.json").write_text("half")
    other = folder.with_name(".other.0123abcd.part")
    other.mkdir()
    good.write(folder)
    assert names(folder.parent) == [".other.0123abcd.part", "plan"]


def test_what_another_writer_is_filling_is_left_alone(good: Bundle, folder: Path) -> None:
    busy, fresh = folder.with_name(".plan.0123abcd.part"), folder.with_name(".plan.4567cdef.part")
    for path in (busy, fresh):
        path.mkdir()
    (busy / "plan.json").write_text("half")
    with places.locked(busy):
        good.write(folder)
    assert names(folder.parent) == [".plan.0123abcd.part", ".plan.4567cdef.part", "plan"]
    long_ago = time.time() - 2.0 * places.FRESH
    os.utime(fresh, (long_ago, long_ago))
    good.write(folder)
    assert names(folder.parent) == ["plan"]


def test_a_bundle_that_was_set_aside_comes_back(good: Bundle, folder: Path) -> None:
    """As a kill leaves it between the two renames of a system that cannot exchange folders."""
    folder.rename(folder.with_name(".plan.0123abcd.old"))

    def full(path: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(BundleError, match="No space left"):
        good.write(folder, extras={"plots.png": full})
    assert Bundle.read(folder).plan["task"] == "step"
    assert names(folder.parent) == ["plan"]


@pytest.mark.parametrize("exchanges", [True, False])
def test_two_writers_at_once_leave_one_whole_bundle(
    machine: ModuleType, good: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchanges: bool
) -> None:
    if not exchanges:
        monkeypatch.setattr(places, "exchange", lambda one, other: False)
    target, wrong = tmp_path / "plan", []
    good.write(target)
    (target / "notes.txt").write_text("mine")

    def write(task: str) -> None:
        bundle = machine.planned(good, task=task)
        try:
            for _ in range(8):
                bundle.write(target)
        except BundleError as error:
            wrong.append(error)

    threads = [threading.Thread(target=write, args=(task,)) for task in ("one", "two")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert Bundle.read(target).plan["task"] in ("one", "two")
    assert (target / "notes.txt").read_text() == "mine"
    assert names(tmp_path) == ["plan"]


def test_folders_are_exchanged_in_one_step_here(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for path in (one, other):
        path.mkdir()
        (path / "name").write_text(path.name)
    if not places.exchange(one, other):
        pytest.skip("this file system cannot exchange folders")
    assert ((one / "name").read_text(), (other / "name").read_text()) == ("other", "one")
    assert not places.exchange(one, tmp_path / "nowhere")


def test_a_link_to_itself_is_named(tmp_path: Path) -> None:
    (tmp_path / "plan").symlink_to("plan")
    with pytest.raises(BundleError, match="plan: expected a folder with a plan bundle"):
        Bundle.read(tmp_path / "plan")
    with pytest.raises(BundleError, match="cannot be read"):
        Bundle.read(tmp_path / ("a" * 5000))
