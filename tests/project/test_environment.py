"""tools/environment.sh: refuses what cannot work, installs once, and never trusts half an environment."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Stands in for uv: makes an environment of links and writes down what it was asked to install.
UV = """#!/bin/sh
case "$1 ${2:-}" in
    "--version "*) echo "uv stand-in" ;;
    "python find") exit 1 ;;
    venv*) for last; do :; done; mkdir -p "$last/bin"; ln -sf "$REAL_PYTHON" "$last/bin/python" ;;
    "pip install") echo "$@" >>installs.log; [ ! -e fail ] || exit 1 ;;
    *) exit 1 ;;
esac
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A folder with just what the script reads."""
    folder = tmp_path / "clone"
    (folder / "tools").mkdir(parents=True)
    for name in ("tools/environment.sh", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def stub(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)
    return path


def run(clone: Path, *args: str, **env: str) -> subprocess.CompletedProcess[str]:
    stubs = clone.parent / "stubs"
    stub(stubs, "uv", UV)
    everything: Mapping[str, str] = {
        **os.environ,
        "PATH": f"{stubs}{os.pathsep}{os.environ['PATH']}",
        "REAL_PYTHON": sys.executable,
        "PYTHON": sys.executable,
        **env,
    }
    return subprocess.run(
        ["sh", "tools/environment.sh", *args],
        cwd=clone,
        env=everything,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def installs(clone: Path) -> int:
    log = clone / "installs.log"
    return len(log.read_text(encoding="utf-8").splitlines()) if log.exists() else 0


def test_an_unsuitable_python_is_refused(clone: Path) -> None:
    old = stub(clone.parent / "stubs", "python3.14", "#!/bin/sh\nexit 1\n")
    done = run(clone, PYTHON=str(old))
    assert done.returncode == 1
    assert "3.11, 3.12 or 3.13" in done.stderr
    assert not (clone / ".venv").exists()


def test_windows_is_refused(clone: Path) -> None:
    stub(clone.parent / "stubs", "uname", "#!/bin/sh\necho MINGW64_NT-10.0\n")
    done = run(clone)
    assert done.returncode == 1
    assert "MINGW64_NT-10.0" in done.stderr
    assert "Linux and macOS only" in done.stderr


def test_the_second_time_nothing_is_installed(clone: Path) -> None:
    assert run(clone).returncode == 0
    first = installs(clone)
    assert first > 0
    again = run(clone)
    assert (again.returncode, again.stdout, installs(clone)) == (0, "", first)


def test_an_extra_and_a_changed_pin_are_installed(clone: Path) -> None:
    run(clone)
    first = installs(clone)
    run(clone, "test")
    with_extra = installs(clone)
    assert with_extra > first
    assert ".[test]" in (clone / "installs.log").read_text(encoding="utf-8")
    with (clone / "constraints.txt").open("a", encoding="utf-8") as file:
        file.write("six==1.17.0\n")
    run(clone)
    assert installs(clone) > with_extra


def test_an_unfinished_environment_is_built_anew(clone: Path) -> None:
    (clone / "fail").touch()
    assert run(clone).returncode != 0
    (clone / ".venv" / "left-over").touch()
    (clone / "fail").unlink()
    done = run(clone)
    assert done.returncode == 0
    assert "anew" in done.stdout
    assert not (clone / ".venv" / "left-over").exists()
    assert run(clone).stdout == ""


def test_an_environment_whose_python_is_gone_is_built_anew(clone: Path) -> None:
    run(clone)
    (clone / ".venv" / "bin" / "python").unlink()
    done = run(clone)
    assert done.returncode == 0
    assert (clone / ".venv" / "bin" / "python").exists()
