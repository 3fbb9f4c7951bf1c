"""Mutations of a task file's syntax tree. Only numpy and wbplan are called: nothing else is put in."""

from __future__ import annotations

import ast
import contextlib
import copy
import random
from typing import Any

from fuzz_text import chance, scarred

CONSTANTS: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 0.0, -0.5, 1e-9, 1e9, 1e308, float("inf"), float("nan"), "", "x",
    "stand", "neutral", "leg", "arm", "leg1", "universe", "root_joint", "xyz", "\u00e9", "a" * 2000, b"x", (),
    (0.0, 0.0), 1j,
)  # fmt: skip
NAMES = ("robot", "stand", "wb", "np", "AS_IS", "contacts", "start", "unknown_name", "len", "float", "dict")


def mutate_python(rng: random.Random, source: str) -> bytes:
    if chance(rng, 0.06):
        return scarred(rng, source.encode())
    tree = ast.parse(source)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 5))):
        with contextlib.suppress(IndexError):  # nothing of that kind is left
            _change(rng, tree)
    try:
        return ast.unparse(ast.fix_missing_locations(tree)).encode("utf-8", "replace")
    except (ValueError, TypeError, AttributeError, RecursionError):
        return scarred(rng, source.encode())


def _change(rng: random.Random, tree: ast.Module) -> None:
    nodes = list(ast.walk(tree))
    kind = rng.randrange(10)
    if kind < 4:
        constants = [n for n in nodes if isinstance(n, ast.Constant)]
        constant: Any = rng.choice(constants)
        constant.value, constant.kind = rng.choice(CONSTANTS), None
        if isinstance(constant.value, tuple):
            constant.value = None
    elif kind == 4:
        bodies = [n.body for n in nodes if isinstance(getattr(n, "body", None), list)]
        body = rng.choice([b for b in bodies if b])
        place = rng.randrange(len(body))
        if chance(rng, 0.5):
            del body[place]
            if not body:
                body.append(ast.Pass())
        else:
            body.insert(rng.randrange(len(body) + 1), copy.deepcopy(body[place]))
    elif kind == 5:
        calls = [n for n in nodes if isinstance(n, ast.Call) and (n.keywords or n.args)]
        if calls:
            _change_call(rng, rng.choice(calls))
    elif kind == 6:
        names: Any = rng.choice([n for n in nodes if isinstance(n, ast.Name)] or [ast.Name("f")])
        names.id = rng.choice(NAMES)
    elif kind == 7:
        _change_parameter(rng, rng.choice([n for n in nodes if isinstance(n, ast.arguments)]))
    elif kind == 8:
        pairs = [n for n in nodes if isinstance(n, ast.List | ast.Tuple) and n.elts]
        items = rng.choice(pairs).elts
        items.append(copy.deepcopy(rng.choice(items))) if chance(rng, 0.5) else items.pop()
    else:
        calls = [n for n in nodes if isinstance(n, ast.Call) and n.args]
        call = rng.choice(calls or [ast.Call(ast.Name("f"), [ast.Constant(0)], [])])
        call.args[rng.randrange(len(call.args))] = copy.deepcopy(
            rng.choice([n for n in nodes if isinstance(n, ast.expr)])
        )


def _change_call(rng: random.Random, call: ast.Call) -> None:
    kind = rng.randrange(4)
    if kind == 0 and call.keywords:
        call.keywords.pop(rng.randrange(len(call.keywords)))
    elif kind == 1 and call.keywords:
        rng.choice(call.keywords).value = ast.Constant(
            rng.choice([c for c in CONSTANTS if not isinstance(c, tuple)])
        )
    elif kind == 2 and call.keywords:
        rng.choice(call.keywords).arg = rng.choice(
            ["weight", "target", "duration", "gain", "contacts", "hard", "x"]
        )
    elif call.args:
        rng.shuffle(call.args)


def _change_parameter(rng: random.Random, arguments: ast.arguments) -> None:
    named = [*arguments.kwonlyargs, *arguments.args]
    if not named:
        return
    parameter = rng.choice(named)
    kind = rng.randrange(4)
    if kind == 0:
        parameter.annotation = None
    elif kind == 1:
        said = rng.choice(
            ["int", "float | None", "tuple[float, ...]", "list", "Unknown", "'float'", "bool", "tuple[()]"]
        )
        parameter.annotation = ast.parse(said, mode="eval").body
    elif kind == 2:
        parameter.arg = rng.choice(["robot", "x", "duration"])
    elif arguments.kw_defaults:
        place = rng.randrange(len(arguments.kw_defaults))
        arguments.kw_defaults[place] = ast.Constant(
            rng.choice([c for c in CONSTANTS if not isinstance(c, tuple)])
        )
