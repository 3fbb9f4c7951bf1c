"""The repository keeps its own rules: linted, typed, documented, no traces of the machine it grew on."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import wbplan

ROOT = Path(__file__).resolve().parents[2]
MOST_LINES = 400
LINTERS = ["ruff check --output-format concise", "ruff format --check --output-format concise", "mypy"]


def tracked() -> list[Path]:
    """Files that are, or are about to be, in the repository."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("not a git checkout")
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


@pytest.mark.parametrize("command", LINTERS)
def test_linters_are_content(command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", *command.split()], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_file_names_a_machine() -> None:
    # In pieces, or this file would find itself.
    traces = [r"/wo" r"rk/", r"/tm" r"p/", r"/ro" r"ot/", r"/ho" r"me/\w", r"/Us" r"ers/\w", r"py" r"pi\.org"]
    pattern = re.compile("|".join(traces))
    found = []
    for path in tracked():
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            continue
        found += [
            f"{path.relative_to(ROOT)}:{n}: {line}" for n, line in enumerate(lines, 1) if pattern.search(line)
        ]
    assert found == []


def test_what_is_imported_is_declared() -> None:
    """A package that another one happens to bring may be gone with its next release."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split(r"[><=]", line)[0].lower() for line in project["dependencies"]}
    named_otherwise = {"pinocchio": "pin", "umsgpack": "u-msgpack-python", "mujoco": "mujoco-core"}
    optional = {"IPython", "pink", "daqp"}  # notebooks, and the extra "bench"
    found = set()
    for path in (*(ROOT / "wbplan").rglob("*.py"), *(ROOT / "tasks").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").split(".")[0])
    found -= {"wbplan", *optional, *sys.stdlib_module_names}
    assert {named_otherwise.get(name, name) for name in found} - declared == set()


def test_files_stay_short() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for path in tracked()
        if path.suffix == ".py" and (lines := len(path.read_text(encoding="utf-8").splitlines())) > MOST_LINES
    }
    assert long == {}


@pytest.mark.parametrize("name", sorted(wbplan.__all__))
def test_public_names_are_documented(name: str) -> None:
    public = getattr(wbplan, name)
    if not (inspect.isclass(public) or inspect.isfunction(public)):
        return
    assert (public.__doc__ or "").strip(), name
    assert not (public.__doc__ or "").startswith(f"{name}("), f"{name}: only what dataclass wrote"
    if inspect.isclass(public):
        for key, value in vars(public).items():
            if key.startswith("_") or not (inspect.isfunction(value) or isinstance(value, property)):
                continue
            assert inspect.getdoc(getattr(public, key)), f"{name}.{key}"


def test_every_public_name_is_there() -> None:
    assert wbplan.__all__ == sorted(set(wbplan.__all__), key=wbplan.__all__.index)
    assert all(hasattr(wbplan, name) for name in wbplan.__all__)


def test_the_version_is_a_release_in_the_changelog() -> None:
    assert f"## {wbplan.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"version: {wbplan.__version__}" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
