"""The bundle's files: each one's format, and a folder that appears whole or not at all."""

from __future__ import annotations

import json
import math
import shutil
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import places
from wbplan.errors import BundleError

PLAN, URDF, ARRAYS, TABLE = "plan.json", "robot.urdf", "trajectory.npz", "trajectory.csv"
SCENE, PLOTS, FORCES = "scene.html", "plots.png", "forces.png"
PHYSICS = ("physics.json", "physics.png")  # of an older plan they would tell lies
FILES = (PLAN, URDF, ARRAYS, TABLE, SCENE, PLOTS, FORCES, *PHYSICS)


def is_bundle(folder: Path) -> bool:
    """Whether a folder holds a plan bundle, whole or broken."""
    return (folder / PLAN).is_file() and (folder / ARRAYS).is_file()


# ---------------------------------------------------------------------------- a folder, whole or not at all


def write_folder(
    folder: Path, writers: Mapping[str, Callable[[Path], object]], *, overwrite: bool = True
) -> Path:
    """Fill a new folder beside the target, then put it in the target's place.

    Args:
        folder: target.
        writers: file name -> function that writes the file at the path given.
        overwrite: whether a bundle that is there may be replaced.

    Raises:
        BundleError: the target is not absent, empty or a bundle, or cannot be written.
    """
    target = _refuse_foreign(folder, overwrite)
    new = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}{places.PART}")
    made: list[Path] = []
    try:
        _make_folders(target.parent, made)
        places.sweep(target)
        new.mkdir()
        with places.locked(new):
            for name, write in writers.items():
                write(new / name)
            with places.locked(target.parent):  # two runs into one folder: the later one stays
                _take_over(target, new)
                _swap(new, target)
    except OSError as error:
        _remove(new, target, made)
        raise BundleError(f"{folder}: cannot be written: {error.strerror or error}") from error
    except BaseException:  # an interrupt too must leave nothing behind
        _remove(new, target, made)
        raise
    return folder


def _refuse_foreign(folder: Path, overwrite: bool) -> Path:
    """The folder that a path leads to, if a bundle may be put there."""
    try:
        target = folder.resolve()
        if not target.exists():
            return target
        if not target.is_dir():
            raise BundleError(f"{folder}: is a file; expected a folder to write the bundle into")
        if target == Path.cwd():  # a folder is replaced whole: the caller would stand in a deleted one
            raise BundleError(f"{folder}: is the current folder; choose a folder inside it")
        content = sorted(path.name for path in target.iterdir())
    except (OSError, RuntimeError) as error:
        raise BundleError(f"{folder}: cannot be read: {error}") from error
    if not content:
        return target
    if not is_bundle(target):
        shown = ", ".join(content[:5]) + (" ..." if len(content) > 5 else "")
        raise BundleError(
            f"{folder}: is a folder with other things in it ({shown}) and no bundle; choose another folder"
        )
    if not overwrite:
        raise BundleError(f"{folder}: holds a bundle already; choose another folder or allow overwriting")
    return target


def _make_folders(folder: Path, made: list[Path]) -> None:
    for parent in reversed([p for p in (folder, *folder.parents) if not p.exists()]):
        parent.mkdir(exist_ok=True)
        made.append(parent)


def _take_over(old: Path, new: Path) -> None:
    """Copy what somebody else put into the old bundle: replacing a bundle must not lose it."""
    if not old.is_dir():
        return
    for path in old.iterdir():
        unfinished = path.name.startswith(".") and path.suffix == places.PART
        if path.name in FILES or unfinished or (new / path.name).exists():
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.copytree(path, new / path.name, symlinks=True)
        else:
            shutil.copy2(path, new / path.name, follow_symlinks=False)


def _swap(new: Path, target: Path) -> None:
    """Put the new folder into place; where that takes two steps, the old one is put back if they fail."""
    if not target.exists():
        new.rename(target)
        return
    if places.exchange(new, target):
        shutil.rmtree(new, ignore_errors=True)
        return
    old = _aside(new)
    try:
        target.rename(old)
        new.rename(target)
    except BaseException:
        if old.exists() and not target.exists():
            old.rename(target)
        raise
    finally:
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)


def _aside(new: Path) -> Path:
    """Where the replaced folder waits until the new one is in place."""
    return new.with_suffix(places.OLD)


def _remove(new: Path, target: Path, made: list[Path]) -> None:
    shutil.rmtree(new, ignore_errors=True)
    if target.exists():
        shutil.rmtree(_aside(new), ignore_errors=True)
    for folder in reversed(made):
        try:
            folder.rmdir()
        except OSError:  # somebody else uses it by now
            return


# -------------------------------------------------------------------------------------------- single files


def write_text(path: Path, text: str) -> None:
    """Write text as it is, in UTF-8."""
    path.write_bytes(text.encode("utf-8"))


def write_plan(path: Path, plan: Mapping[str, Any]) -> None:
    """Write plan.json; a number that is not finite becomes null."""
    write_text(path, json.dumps(plain(plan), indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write trajectory.npz, compressed."""
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]  # numpy's stub takes the arrays for allow_pickle


def write_table(path: Path, columns: list[str], rows: NDArray[np.float64]) -> None:
    """Write trajectory.csv with one header line; 12 digits, so that nothing visible is lost."""
    np.savetxt(
        path, rows, fmt="%.12g", delimiter=",", header=",".join(columns), comments="", encoding="utf-8"
    )


def plain(value: Any) -> Any:
    """A value in JSON's own types: numpy's become Python's, numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Path):
        return str(value)
    raise BundleError(f"{PLAN}: a value of type {type(value).__name__} cannot be written: {value!r}")


def _require(path: Path) -> None:
    try:
        there = path.is_file()
    except OSError as error:  # a link to itself, a name that is too long, a folder that may not be entered
        raise BundleError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not there:
        raise BundleError(f"{path}: missing; a bundle has {PLAN}, {URDF} and {ARRAYS}")


def read_text(path: Path) -> str:
    """Text of a file.

    Raises:
        BundleError: the file is missing, unreadable or not UTF-8.
    """
    _require(path)
    try:
        return path.read_bytes().decode("utf-8")
    except OSError as error:
        raise BundleError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise BundleError(f"{path}: expected UTF-8 text: {error}") from error


def read_plan(path: Path) -> dict[str, Any]:
    """Content of plan.json.

    Raises:
        BundleError: it is not a JSON object.
    """

    def refuse(constant: str) -> None:
        raise BundleError(f"{path}: {constant} is not JSON; expected a number or null")

    try:
        plan = json.loads(read_text(path), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path}: is not valid JSON: {error}") from error
    if not isinstance(plan, dict):
        raise BundleError(f"{path}: expected an object, found {type(plan).__name__}")
    return plan


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of an npz file, by key; nothing is unpickled.

    Raises:
        BundleError: the file or one of its arrays cannot be read.
    """
    _require(path)
    key = ""
    arrays: dict[str, NDArray[Any]] = {}
    try:
        # The file is opened here: numpy leaves it open when the archive is damaged.
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise BundleError(f"{path}: expected an npz archive, found one array")
            with archive:
                for key in archive.files:
                    arrays[key] = np.asarray(archive[key])
    except BundleError:
        raise
    except Exception as error:  # zipfile, zlib and numpy's header parser each raise kinds of their own
        raise BundleError(f"{path}: {key or 'archive'}: cannot be read: {error}") from error
    return arrays
