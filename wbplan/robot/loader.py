"""From a name or a file to a checked `Robot`."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar
from xml.etree.ElementTree import tostring

import pinocchio as pin

from wbplan import catalog
from wbplan.errors import ModelError, SpecError, listing
from wbplan.robot.description import Robot
from wbplan.robot.reading import is_file, parse_xml, read_text
from wbplan.robot.srdf import Srdf, Tree, read_srdf
from wbplan.robot.urdf_check import examine
from wbplan.state import find_frame

_V = TypeVar("_V")


def load_robot(
    name_or_path: str | PathLike[str],
    *,
    srdf: str | PathLike[str] | None = None,
    feet: Mapping[str, str] | None = None,
    hands: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
) -> Robot:
    """Loads a robot and checks all of it first.

    Args:
        name_or_path: a robot that ships with wbplan ("legarm_hexapod"), or a path to a `.urdf` file.
        srdf: path of the SRDF; if absent, the file beside the URDF with the same stem, where there is one.
        feet: limb -> frame of its foot, in place of the SRDF's. A limb that the SRDF does not know gets the
            joints between the root and that frame.
        hands: limb -> frame of its hand, likewise.
        package_dirs: folders in which `package://` meshes are looked for.

    Raises:
        SpecError: no such robot, or `feet` or `hands` name a frame that does not exist.
        ModelError: the URDF or SRDF is unusable; the message lists every problem.
    """
    urdf_path = _find(name_or_path)
    packages = _folders(package_dirs)
    text = read_text(urdf_path, "URDF")
    findings = examine(text, packages, urdf_path.parent)
    if findings.problems:
        raise ModelError(_headline("URDF", urdf_path, findings.problems), findings.problems)
    model = _build(text, urdf_path)
    srdf_path = _path("srdf", srdf) if srdf is not None else urdf_path.with_suffix(".srdf")
    said, warnings = Srdf(), findings.warnings
    if srdf is not None or srdf_path.exists():
        said, heard = read_srdf(read_text(srdf_path, "SRDF"), model)
        if heard.problems:
            raise ModelError(_headline("SRDF", srdf_path, heard.problems), heard.problems)
        warnings += heard.warnings
    limbs = dict(said.limbs)
    for argument, given in (("feet", feet), ("hands", hands)):
        _add_tips(model, argument, given, said, limbs)
    return Robot(
        name=model.name,
        urdf_path=urdf_path,
        urdf_text=text,
        model=model,
        limbs=_frozen(limbs),
        feet=_frozen(said.feet if feet is None else feet),
        hands=_frozen(said.hands if hands is None else hands),
        poses=_frozen({name: _frozen(pose) for name, pose in said.poses.items()}),
        roles=_frozen(
            {limb: _frozen({r: _frozen(held) for r, held in its.items()}) for limb, its in said.roles.items()}
        ),
        ignored_collisions=frozenset(said.ignored_collisions),
        package_dirs=packages,
        srdf_path=srdf_path if srdf is not None or srdf_path.exists() else None,
        warnings=warnings,
    )


def _frozen(mapping: Mapping[str, _V]) -> Mapping[str, _V]:
    return MappingProxyType(dict(mapping))


def _find(name_or_path: str | PathLike[str]) -> Path:
    """The URDF that is meant: a shipped one by its name, else a path."""
    if not isinstance(name_or_path, (str, PathLike)):
        raise SpecError(f"robot: {name_or_path!r} is neither a name nor a path")
    path = Path(name_or_path)
    text = str(name_or_path)
    is_name = (
        isinstance(name_or_path, str) and path.suffix != ".urdf" and "/" not in text and "\\" not in text
    )
    known = catalog.robots()
    if is_name and text in known:
        return known[text]
    if is_name and not is_file(path):
        close = difflib.get_close_matches(text, known, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        raise SpecError(
            f"no robot '{text}'; known robots: {listing(list(known))} (or give a path to a .urdf file){hint}"
        )
    return _path("robot", name_or_path)


def _path(argument: str, given: str | PathLike[str]) -> Path:
    try:
        return Path(given).expanduser().resolve()
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise SpecError(f"{argument}: {given!r} is not a path ({error})") from None


def _folders(package_dirs: Sequence[str | PathLike[str]]) -> tuple[Path, ...]:
    if isinstance(package_dirs, (str, PathLike)):
        raise SpecError(f"package_dirs: expected a list of folders, found {str(package_dirs)!r} by itself")
    folders = tuple(_path("package_dirs", folder) for folder in package_dirs)
    for folder in folders:
        if not folder.is_dir():
            raise SpecError(f"package_dirs: '{folder}' is not a folder")
    return folders


def _headline(kind: str, path: Path, problems: Sequence[str]) -> str:
    return f"{kind} '{path}' cannot be used: {len(problems)} problem{'s' if len(problems) > 1 else ''}"


def _build(text: str, path: Path) -> pin.Model:
    """The model. Shapes play no part in it, so they are left out: the parser complains of them on stderr."""
    root = parse_xml(text)
    for parent in [root, *root.findall("link")]:
        for element in [*parent.findall("visual"), *parent.findall("collision"), *parent.findall("material")]:
            parent.remove(element)
    try:
        return pin.buildModelFromXML(tostring(root, encoding="unicode"), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        # Whatever the checks did not foresee still has to name the file.
        raise ModelError(_headline("URDF", path, ["?"]), [f"Pinocchio refuses it: {error}"]) from error


def _add_tips(
    model: pin.Model,
    argument: str,
    tips: Mapping[str, str] | None,
    said: Srdf,
    limbs: dict[str, tuple[str, ...]],
) -> None:
    """Checks tips that a caller gave, and adds the limbs that the SRDF does not know."""
    if tips is None:
        return
    if not isinstance(tips, Mapping):
        raise SpecError(f"{argument}: expected limb -> frame, found {tips!r}")
    tree = Tree(model)
    for limb, frame in tips.items():
        try:
            chain = tree.chain(model.frames[find_frame(model, frame)])
        except SpecError as error:
            raise SpecError(f"{argument}[{limb!r}]: {error}") from None
        known = said.limbs.get(limb) or said.groups.get(limb)
        if known and not set(known) & set(chain):
            raise SpecError(f"{argument}[{limb!r}]: no joint of that limb moves frame '{frame}'")
        limbs[limb] = known or tuple(dict.fromkeys([*limbs.get(limb, ()), *chain]))
