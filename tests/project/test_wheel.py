"""A wheel built from the repository carries all it needs: it plans in an empty folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]


def run(command: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
    env = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")}
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=600)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built through an sdist, so that both are complete, without asking a registry."""
    folder = tmp_path_factory.mktemp("dist")
    built = run([sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)], folder)
    assert built.returncode == 0, built.stdout + built.stderr
    assert len(list(folder.glob("*.tar.gz"))) == 1
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment's bin folder: the wheel in it, and behind it the tests' packages."""
    folder = tmp_path_factory.mktemp("venv")
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    if (uv := shutil.which("uv")) and run([uv, "--version"], folder).returncode == 0:
        command = [uv, "pip", "install", "--offline", "--python", str(python)]
    else:
        command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-index"]
    done = run([*command, "--no-deps", str(wheel)], folder)
    assert done.returncode == 0, done.stdout + done.stderr
    # addsitedir, not a bare path: Pinocchio's own folder is reached through a .pth file in there.
    packages = sysconfig.get_path("purelib")
    (site,) = (folder / "lib").glob("python3.*/site-packages")
    (site / "packages.pth").write_text(f"import site; site.addsitedir({packages!r})\n", encoding="utf-8")
    return folder / "bin"


def test_the_wheel_carries_data_and_nothing_else(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for expected in (
        "wbplan/py.typed",
        "wbplan/_data/tasks/clamp.py",
        "wbplan/_data/urdf/legarm_hexapod/legarm_hexapod.urdf",
        "wbplan/_data/urdf/legarm_hexapod/legarm_hexapod.srdf",
    ):
        assert expected in names
    assert {name.split("/")[0].split("-")[0] for name in names} == {"wbplan"}
    assert not [name for name in names if "__pycache__" in name]


def test_it_plans_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    where = run([str(installed / "python"), "-c", "import wbplan; print(wbplan.__file__)"], tmp_path)
    assert where.stdout.startswith(str(installed.parent)), where.stdout + where.stderr
    listed = run([str(installed / "wbplan"), "list"], tmp_path)
    assert listed.returncode == 0, listed.stderr
    assert "clamp" in listed.stdout
    assert "legarm_hexapod" in listed.stdout
    planned = run([str(installed / "wbplan"), "run", "clamp"], tmp_path)
    assert planned.returncode == 0, planned.stdout + planned.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert sorted(p.name for p in (tmp_path / "out" / "clamp").iterdir()) == [
        "forces.png",
        "plan.json",
        "plots.png",
        "robot.urdf",
        "scene.html",
        "trajectory.csv",
        "trajectory.npz",
    ]
