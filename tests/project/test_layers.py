"""A module imports only from modules above it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

# From the top down; a package counts as one module.
LAYERS = [
    "errors",
    "version",
    "pictures",
    "geometry",
    "splines",
    "paths",
    "obstacles",
    "state",
    "catalog",
    "robot",
    "mechanism",
    "problem",
    "statics",
    "compiled",
    "collision",
    "sampling",
    "gaits",
    "program",
    "backends",
    "explain",
    "tick",
    "fallback",
    "bundle",
    "checks",
    "plots",
    "view",
    "physics",
    "reasons",
    "recorder",
    "planner",
    "taskfile",
    "papers",
    "bench",
    "cli",
]
ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "wbplan"
FILES = sorted(p for p in PACKAGE.rglob("*.py") if "_data" not in p.parts)


def layer_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path: Path, source: str | None = None) -> list[tuple[int, str]]:
    """(line, module of wbplan) for every import anywhere in a file; "" for the package itself."""
    found = []
    for node in ast.walk(ast.parse(source if source is not None else path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            if node.module == "wbplan":
                names = [f"wbplan.{a.name}" if a.name in LAYERS else "wbplan" for a in node.names]
            else:
                names = [node.module or ""]
        else:
            continue
        parts = [name.split(".") for name in names if name.split(".")[0] == "wbplan"]
        found += [(node.lineno, p[1] if len(p) > 1 else "") for p in parts]
    return found


def faults(path: Path, source: str | None = None) -> list[str]:
    own = LAYERS.index(layer_of(path))
    return [
        f"{path.relative_to(ROOT)}:{line}: imports wbplan{'.' if name else ''}{name}"
        for line, name in imports_of(path, source)
        if name != LAYERS[own] and (name not in LAYERS or LAYERS.index(name) >= own)
    ]


def test_every_module_has_its_place() -> None:
    assert sorted({layer_of(p) for p in FILES} - {"__init__", "__main__"}) == sorted(LAYERS)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_only_from_above(path: Path) -> None:
    if layer_of(path) in ("__init__", "__main__"):
        pytest.skip("sees everything")
    assert not faults(path)


@pytest.mark.parametrize(
    "source",
    [
        "import wbplan",
        "from wbplan import cli",
        "def f():\n    from wbplan.cli import main",
        "from wbplan import Robot",
    ],
)
def test_an_import_from_below_is_seen(source: str) -> None:
    assert faults(PACKAGE / "geometry.py", source)


def at_run_time(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a tree, less those that only a type checker sees."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield from at_run_time(child)


def rooms() -> dict[str, set[str]]:
    """Every file of a package by its dotted name, and the files of the same package that it imports."""
    names = {".".join(p.relative_to(PACKAGE).with_suffix("").parts): p for p in FILES}
    found: dict[str, set[str]] = {}
    for name, path in names.items():
        if "." not in name or name.endswith("__init__"):
            continue
        found[name] = set()
        for node in at_run_time(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("wbplan."):
                module = node.module.removeprefix("wbplan.")
                those = [module, *(f"{module}.{a.name}" for a in node.names)]
                found[name] |= {m for m in those if m in names and m.split(".")[0] == name.split(".")[0]}
    return found


def circle(imports: dict[str, set[str]]) -> list[str]:
    """Names that import each other in a loop, or none."""
    left = {name: set(seen) for name, seen in imports.items()}
    while free := {name for name, seen in left.items() if not seen & left.keys()}:
        left = {name: seen for name, seen in left.items() if name not in free}
    return sorted(left)


def test_no_two_files_of_a_package_import_each_other() -> None:
    assert len(rooms()) > 100
    assert circle(rooms()) == []
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["a", "b", "c"]


def test_what_planned_never_approves() -> None:
    """The checks see the bundle, geometry and what stands in the world (with the checks of its fields), and
    nothing that plans, however far back."""
    sees = {"checks"}
    while (
        more := {name for p in FILES if layer_of(p) in sees for _, name in imports_of(p) if name in LAYERS}
        - sees
    ):
        sees |= more
    assert sees <= {"checks", "bundle", "geometry", "errors", "obstacles", "paths", "splines"}


def test_tasks_use_the_public_names_only() -> None:
    for path in sorted((ROOT / "tasks").glob("*.py")):
        assert [name for _, name in imports_of(path) if name] == [], path
