"""Task files: one experiment each, found by name or path, its parameters read from their annotations.

A task file has a docstring (what, source), `ROBOT = "name"` and
`def script(robot, *, parameter: float = default, ...) -> wb.Script`. One that is written for several robots
has `ROBOTS = ("name", ...)` too, or `ROBOTS = "any"`.
"""

from __future__ import annotations

import ast
import inspect
import math
import sys
import traceback
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, Union, final, get_args, get_origin

from wbplan import catalog
from wbplan.errors import SpecError, WbplanError, listing
from wbplan.problem.script import Script
from wbplan.robot.reading import is_file, is_folder

_SUPPORTED = "float, int, bool, str, tuple of these, Literal[...], or one of these | None"
_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


@final
@dataclass(frozen=True)
class Parameter:
    """A keyword parameter of a task's `script`.

    Attributes:
        name: as in `--set name=value`.
        annotation: its type, resolved.
        default: its value where nothing is set.
    """

    name: str
    annotation: Any
    default: Any

    def convert(self, text: str) -> Any:
        """The value that a text stands for, by the annotation.

        Args:
            text: what follows the `=`; a tuple is written with commas, `0, 0.5, 0.06`.

        Raises:
            SpecError: the text is not of that type, or not finite.
        """
        try:
            return _convert(text.strip(), self.annotation)
        except ValueError as error:
            raise SpecError(
                f"parameter '{self.name}': expected {type_name(self.annotation)}, got '{text}'"
                + (f" ({error})" if str(error) else "")
            ) from None

    def __str__(self) -> str:
        default = ",".join(map(str, self.default)) if isinstance(self.default, tuple) else self.default
        return f"{self.name}={default} ({type_name(self.annotation)})"


@final
@dataclass(frozen=True)
class TaskFile:
    """A task: a robot's name and a function from parameters to a script.

    Attributes:
        name: the file's name without `.py`.
        path: the file.
        robot: name or path of the robot it is written for, its `ROBOT`.
        robots: all that it may be run with; None: any.
        docstring: what it does, and its source.
        parameters: what `script` takes beside the robot.
        function: its `script`.
    """

    name: str
    path: Path
    robot: str
    robots: tuple[str, ...] | None
    docstring: str
    parameters: tuple[Parameter, ...]
    function: Callable[..., Any]

    @property
    def summary(self) -> str:
        """The docstring's first line."""
        return first_line(self.docstring)

    def robot_for(self, name: str | None) -> str:
        """Name or path of the robot to run it with: its own, or another that it is written for too.

        Raises:
            SpecError: it is not written for that one.
        """
        if name is None or self.robots is None or name in self.robots:
            return name or self.robot
        raise SpecError(
            f"task '{self.name}' is not written for robot '{name}'; it is for: {listing(self.robots)}"
        )

    def values(self, settings: Sequence[str]) -> dict[str, Any]:
        """Every parameter's value: the default, or what is set.

        Args:
            settings: `KEY=VALUE` each; of two with one key the later counts.

        Raises:
            SpecError: no such parameter (the message lists the valid ones), or a value of another type.
        """
        known = {p.name: p for p in self.parameters}
        values = {p.name: p.default for p in self.parameters}
        for setting in settings:
            key, equals, text = setting.partition("=")
            key = key.strip()
            if not equals or not key:
                raise SpecError(f"task '{self.name}': expected KEY=VALUE, got '{setting}'")
            if key not in known:
                close = get_close_matches(key, known, n=1)
                raise SpecError(
                    f"task '{self.name}' has no parameter '{key}'; "
                    + (f"did you mean '{close[0]}'? " if close else "")
                    + f"it takes: {listing(list(known), most=40)}"
                )
            values[key] = known[key].convert(text)
        return values

    def script(self, robot: Any, values: Mapping[str, Any] | None = None) -> Script:
        """The script of this task for a robot.

        Args:
            robot: the robot, loaded.
            values: parameters by name; what is missing keeps its default.

        Raises:
            SpecError: the task's code raised, or returned something else; the message names file and line.
        """
        try:
            script = self.function(robot, **dict(values or {}))
        except (Exception, SystemExit) as error:
            raise _blame(error, self.path) from error
        if not isinstance(script, Script):
            raise SpecError(f"{self.path}: script() returned {_describe(script)}, expected a wbplan.Script")
        return script


def find_task(name_or_path: str | Path) -> Path:
    """The file of a task: a path to a `.py` file, or the name of a shipped task.

    Raises:
        SpecError: there is none; the message lists the shipped ones.
    """
    path = Path(name_or_path).expanduser()
    if path.suffix == ".py" or len(path.parts) > 1:
        if not is_file(path):
            what = "is a folder" if is_folder(path) else "does not exist"
            raise SpecError(f"task file '{path}' {what}; expected a Python file")
        return path
    shipped = catalog.tasks()
    if str(name_or_path) not in shipped:
        raise SpecError(
            f"no task is named '{name_or_path}'; there are: {listing(list(shipped))}; "
            "or give a path to a .py file"
        )
    return shipped[str(name_or_path)]


def load_task(name_or_path: str | Path) -> TaskFile:
    """Loads a task file and checks its shape; the script itself is not built yet.

    Args:
        name_or_path: a name under `tasks/`, or a path to a `.py` file.

    Raises:
        SpecError: no such file, an error in it (named with its line), or not the shape of a task.
    """
    path = find_task(name_or_path)
    tree, source = _parse(path)
    module = types.ModuleType(f"wbplan_task_{path.stem}", ast.get_docstring(tree))
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses in the file look their own module up
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise _blame(error, path) from error
    robot = getattr(module, "ROBOT", None)
    if not isinstance(robot, str) or not robot:
        found = "it has none" if robot is None else f"got {robot!r}"
        raise SpecError(f'{path}: expected ROBOT = "name of a robot"; {found}')
    function = getattr(module, "script", None)
    if not callable(function):
        raise SpecError(f"{path}: expected a function 'def script(robot, *, ...) -> wb.Script'; it has none")
    return TaskFile(
        name=path.stem,
        path=path,
        robot=_beside(robot, path),
        robots=_robots(module, robot, path),
        docstring=ast.get_docstring(tree) or "",
        parameters=_parameters(function, path),
        function=function,
    )


def glance(path: Path) -> tuple[str, str]:
    """Robot and first docstring line of a task file, read without running it.

    Raises:
        SpecError: the file cannot be read, or is not Python.
    """
    tree, _ = _parse(path)
    robot = "?"
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Constant):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(isinstance(t, ast.Name) and t.id == "ROBOT" for t in targets):
                robot = str(node.value.value)
    return robot, first_line(ast.get_docstring(tree) or "")


def first_line(docstring: str) -> str:
    """The first line of a docstring, without the full stop."""
    return next(iter(docstring.strip().splitlines()), "").strip().removesuffix(".")


def type_name(annotation: Any) -> str:
    """How a parameter's type reads in a message."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return annotation.__name__
    if get_origin(annotation) is Literal:
        return "one of " + ", ".join(map(str, get_args(annotation)))
    if get_origin(annotation) is tuple:
        kinds = get_args(annotation)
        if not kinds:
            return "no value at all"
        if kinds[-1] is Ellipsis:
            return f"{type_name(kinds[0])}s separated by commas"
        return f"{len(kinds)} values separated by commas ({', '.join(map(type_name, kinds))})"
    if get_origin(annotation) in (Union, types.UnionType):
        return " or ".join("none" if a is type(None) else type_name(a) for a in get_args(annotation))
    return str(annotation)


def _parse(path: Path) -> tuple[ast.Module, str]:
    try:
        source = path.read_text(encoding="utf-8")
        return ast.parse(source, filename=str(path)), source
    except OSError as error:
        raise SpecError(f"task file '{path}' cannot be read: {error.strerror}") from None
    except SyntaxError as error:
        raise SpecError(f"{path}, line {error.lineno}: not valid Python: {error.msg}") from None
    except ValueError as error:  # not UTF-8, or a null byte
        raise SpecError(f"{path}: not a text file of Python: {error}") from None


def _beside(robot: str, path: Path) -> str:
    """A robot given as a relative path is meant from the task file's folder."""
    if not robot.endswith(".urdf") or Path(robot).is_absolute():
        return robot
    return str(path.parent / robot)


def _robots(module: types.ModuleType, robot: str, path: Path) -> tuple[str, ...] | None:
    """All robots that a task may be run with; None: any."""
    given = getattr(module, "ROBOTS", (robot,))
    if given == "any":
        return None
    if not isinstance(given, tuple | list) or not all(isinstance(name, str) and name for name in given):
        raise SpecError(f'{path}: ROBOTS: expected names of robots or "any", got {given!r}')
    return tuple(_beside(name, path) for name in dict.fromkeys((robot, *given)))


def _parameters(function: Callable[..., Any], path: Path) -> tuple[Parameter, ...]:
    try:
        signature = inspect.signature(function, eval_str=True)
    except Exception as error:
        raise SpecError(f"{path}: an annotation of script() cannot be evaluated: {error}") from error
    takes = list(signature.parameters.values())
    if not takes or takes[0].kind not in (takes[0].POSITIONAL_ONLY, takes[0].POSITIONAL_OR_KEYWORD):
        raise SpecError(f"{path}: script() takes the robot as its first argument; found script{signature}")
    return tuple(_parameter(p, f"{path}: parameter '{p.name}' of script()") for p in takes[1:])


def _parameter(given: inspect.Parameter, at: str) -> Parameter:
    if given.kind not in (given.KEYWORD_ONLY, given.POSITIONAL_OR_KEYWORD):
        raise SpecError(f"{at}: *args and **kwargs have no names to set; expected keyword parameters")
    if given.annotation is given.empty:
        raise SpecError(f"{at} has no annotation; expected {_SUPPORTED}")
    if not _supported(given.annotation):
        raise SpecError(f"{at}: annotated {type_name(given.annotation)}; expected {_SUPPORTED}")
    if given.default is given.empty:
        raise SpecError(f"{at} has no default value")
    if not _is_a(given.default, given.annotation):
        raise SpecError(f"{at}: default {given.default!r} is not {type_name(given.annotation)}")
    return Parameter(given.name, given.annotation, given.default)


def _supported(annotation: Any) -> bool:
    if annotation in (float, int, bool, str):
        return True
    if get_origin(annotation) is Literal:
        return all(isinstance(a, str) for a in get_args(annotation))
    kinds = [a for a in get_args(annotation) if a not in (Ellipsis, type(None))]
    if get_origin(annotation) is tuple:
        return bool(kinds) and all(a in (float, int, bool, str) for a in kinds)
    if get_origin(annotation) in (Union, types.UnionType):
        return len(kinds) == 1 and type(None) in get_args(annotation) and _supported(kinds[0])
    return False


def _is_a(value: Any, annotation: Any) -> bool:
    """Whether a default value is of a supported annotation's type; an int will do for a float."""
    kinds = get_args(annotation)
    if get_origin(annotation) is Literal:
        return value in kinds
    if get_origin(annotation) is tuple:
        if not isinstance(value, tuple):
            return False
        each = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else list(kinds)
        return len(each) == len(value) and all(map(_is_a, value, each))
    if kinds:
        return any(value is None if a is type(None) else _is_a(value, a) for a in kinds)
    if isinstance(value, bool):
        return annotation is bool
    return isinstance(value, int | float if annotation is float else annotation)


def _convert(text: str, annotation: Any) -> Any:
    """Raises ValueError where the text is not of that type."""
    kinds = get_args(annotation)
    if get_origin(annotation) is Literal:
        if text not in kinds:
            raise ValueError
        return text
    if get_origin(annotation) is tuple:
        parts = [part.strip() for part in text.strip("()[]").split(",")]
        each = [kinds[0]] * len(parts) if kinds[-1] is Ellipsis else list(kinds)
        if len(each) != len(parts):
            raise ValueError(f"{len(parts)} given")
        return tuple(map(_convert, parts, each))
    if kinds:
        if text.lower() == "none":
            return None
        return _convert(text, next(a for a in kinds if a is not type(None)))
    if annotation is bool:
        if text.lower() not in (*_TRUE, *_FALSE):
            raise ValueError("true or false")
        return text.lower() in _TRUE
    if annotation is str:
        return text
    try:
        value = annotation(text)
    except ValueError:
        raise ValueError from None  # Python's own wording adds nothing
    if not math.isfinite(value):
        raise ValueError("not finite")
    return value


def _describe(value: object) -> str:
    return "nothing" if value is None else f"a {type(value).__name__}"


def _blame(error: BaseException, path: Path) -> WbplanError:
    """An error raised by a task file's code, told in one line with the line of the file it came from."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    where = f"{path}, line {lines[-1]}" if lines else str(path)
    if isinstance(error, SpecError):
        return SpecError(f"{where}: {error}")
    if isinstance(error, WbplanError):
        return error
    told = " ".join(str(error).split())
    return SpecError(f"{where}: {type(error).__name__}{': ' + told if told else ''}")
