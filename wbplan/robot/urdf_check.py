"""Says what is wrong with a URDF: all of it, each problem with its element.

The parsers behind Pinocchio and yourdfpy take a negative mass, inverted limits or an impossible inertia
without a word; a plan made with such a model is wrong without one too. So every number is checked here
first, and the parsers see only what passed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from wbplan.errors import listing
from wbplan.robot.reading import Findings, Reader, XmlError, parse_xml
from wbplan.robot.urdf_links import check_link

_SUPPORTED = ("revolute", "prismatic", "fixed")
_REFUSED = {
    "continuous": "continuous joints are not supported (they have no position limits); "
    "write it as revolute with limits as wide as it may turn",
    "floating": "floating joints are not supported inside a robot; its root link floats already",
    "planar": "planar joints are not supported; write it as two prismatic joints and a revolute one",
}


@dataclass(frozen=True)
class _Joint:
    """A joint as far as it could be read; None for a link that is not there."""

    name: str
    kind: str
    parent: str | None
    child: str | None


def problems(urdf_text: str, package_dirs: Sequence[Path] = (), base_dir: Path | None = None) -> list[str]:
    """Everything that is wrong with a URDF, each with its element; an empty list if nothing is.

    Args:
        urdf_text: the URDF itself.
        package_dirs: folders in which `package://` names are looked for.
        base_dir: folder from which relative mesh names count; the working folder if absent.
    """
    return list(examine(urdf_text, package_dirs, base_dir).problems)


def examine(urdf_text: str, package_dirs: Sequence[Path] = (), base_dir: Path | None = None) -> Findings:
    """Problems and warnings of a URDF; arguments as `problems`."""
    reader = Reader()
    try:
        root = parse_xml(urdf_text)
    except XmlError as problem:
        return Findings((str(problem),))
    if root.tag != "robot":
        return Findings((f"the root element is <{root.tag}>, expected <robot>",))
    if any(element.tag.startswith("xacro:") for element in root.iter()):
        return Findings(("it is a xacro file: expand it to a URDF first",))
    if not root.get("name", "").strip():
        reader.problem("robot", "no name")
    links, joint_elements = reader.named(root, "link"), reader.named(root, "joint")
    if not links:
        reader.problem("robot", "no link")
        return reader.findings()
    _check_names(reader, links, joint_elements)
    for material in root.findall("material"):
        reader.optional(f"material '{material.get('name', '')}'", material.find("color"), (("rgba", 4),))
    folder = base_dir or Path.cwd()
    masses = {name: check_link(reader, name, link, folder, package_dirs) for name, link in links.items()}
    joints = [_check_joint(reader, name, joint, links) for name, joint in joint_elements.items()]
    _check_tree(reader, list(links), joints)
    _check_masses(reader, masses, joints)
    if all(joint.kind == "fixed" for joint in joints):
        reader.problem("robot", "no joint that moves, so there is nothing to plan")
    return reader.findings()


def _check_names(reader: Reader, links: Mapping[str, Element], joints: Mapping[str, Element]) -> None:
    """Names that Pinocchio keeps for itself, and those that a link and a joint share."""
    for kind, names in (("link", links), ("joint", joints)):
        for reserved in ("universe", "root_joint"):
            if reserved in names:
                reader.problem(f"{kind} '{reserved}'", "the name is reserved, choose another")
    for name in links:
        if name in joints:
            reader.warn(f"link '{name}'", "a joint has the same name; as a frame, the name means the link")


def _check_joint(reader: Reader, name: str, element: Element, links: Mapping[str, Element]) -> _Joint:
    where = f"joint '{name}'"
    kind = element.get("type", "")
    if kind in _REFUSED:
        reader.problem(where, _REFUSED[kind])
    elif kind not in _SUPPORTED:
        reader.problem(where, f"unknown type '{kind}', expected one of {', '.join(_SUPPORTED)}")
    ends = {}
    for end in ("parent", "child"):
        found = element.find(end)
        link = found.get("link") if found is not None else None
        if link is None:
            reader.problem(where, f"no {end}, expected <{end} link=...>")
        elif link not in links:
            reader.problem(where, f"{end} link '{link}' does not exist; links: {listing(list(links))}")
            link = None
        ends[end] = link
    reader.optional(where, element.find("origin"), (("xyz", 3), ("rpy", 3)))
    if element.find("mimic") is not None:
        reader.problem(where, "mimic joints are not supported; remove <mimic>, or make the joint fixed")
    _check_details(reader, where, element)
    if kind in ("revolute", "prismatic"):
        _check_motion(reader, where, element, kind)
    elif (limit := element.find("limit")) is not None:
        for what in ("velocity", "effort"):  # Pinocchio's parser insists, even where they mean nothing
            reader.number(where, f"limit {what}", limit.get(what))
    return _Joint(name, kind, ends["parent"], ends["child"])


def _check_details(reader: Reader, where: str, element: Element) -> None:
    """What a joint of any kind may have beside its limits."""
    dynamics, safety = element.find("dynamics"), element.find("safety_controller")
    reader.optional(where, dynamics, (("damping", 1), ("friction", 1)))
    if dynamics is not None and dynamics.get("damping") is None and dynamics.get("friction") is None:
        reader.problem(where, "its dynamics has neither damping nor friction")
    reader.optional(where, element.find("calibration"), (("rising", 1), ("falling", 1)))
    soft = (("soft_lower_limit", 1), ("soft_upper_limit", 1), ("k_position", 1), ("k_velocity", 1))
    reader.optional(where, safety, soft)
    if safety is not None and safety.get("k_velocity") is None:
        reader.problem(where, "safety_controller k_velocity is missing, expected a finite number")


def _check_motion(reader: Reader, where: str, element: Element, kind: str) -> None:
    """Axis and limits of a joint that moves."""
    axis = element.find("axis")
    if axis is not None:
        direction = reader.numbers(where, "axis", axis.get("xyz"), 3)
        if direction is not None and math.hypot(*direction) < 1e-6:
            reader.problem(where, f"axis is '{axis.get('xyz')}', expected a direction")
    limit = element.find("limit")
    if limit is None:
        reader.problem(where, f"no <limit>, expected one, for it is {kind}")
        return
    length, unit, force = ("rad", "rad/s", "N m") if kind == "revolute" else ("m", "m/s", "N")
    if limit.get("lower") is None and limit.get("upper") is None:
        reader.problem(where, "its limit has neither lower nor upper, expected a range")
    else:
        lower = reader.number(where, "limit lower", limit.get("lower", "0"))
        upper = reader.number(where, "limit upper", limit.get("upper", "0"))
        if lower is not None and upper is not None and lower > upper:
            reader.problem(where, f"limits are inverted: lower {lower:g} > upper {upper:g} {length}")
    for what, its_unit in (("velocity", unit), ("effort", force)):
        most = reader.number(where, f"limit {what}", limit.get(what))
        if most is not None and most <= 0:
            reader.problem(where, f"limit {what} {most:g} {its_unit}, expected > 0")


def _check_tree(reader: Reader, links: Sequence[str], joints: Sequence[_Joint]) -> None:
    """Notes what keeps links and joints from being one tree."""
    above: dict[str, list[_Joint]] = {link: [] for link in links}
    for joint in joints:
        if joint.child is not None:
            above[joint.child].append(joint)
    for link, its in above.items():
        if len(its) > 1:
            names = ", ".join(f"'{joint.name}'" for joint in its)
            reader.problem(f"link '{link}'", f"child of {len(its)} joints ({names}), expected one")
    roots = [link for link, its in above.items() if not its]
    if len(roots) != 1:
        found = f"{len(roots)} root links ({listing(roots)})" if roots else "no root link"
        reader.problem("robot", f"{found}, expected one that is no joint's child")
    for cycle in _cycles(above):
        reader.problem("robot", f"the joints form a cycle: {' -> '.join(reversed(cycle))}")


def _cycles(above: Mapping[str, Sequence[_Joint]]) -> list[list[str]]:
    """Each cycle met when walking up from any link by the first joint above it."""
    cycles: list[list[str]] = []
    done: set[str] = set()
    for start in above:
        path: list[str] = []
        link: str | None = start
        while link is not None and link not in done and link not in path:
            path.append(link)
            link = above[link][0].parent if above[link] else None
        if link is not None and link in path:
            cycles.append([*path[path.index(link) :], link])
        done.update(path)
    return cycles


def _check_masses(reader: Reader, masses: Mapping[str, float | None], joints: Sequence[_Joint]) -> None:
    """All that moves has mass: the root (it floats) and the child of each joint, with what is fixed to it."""
    below: dict[str, list[_Joint]] = {link: [] for link in masses}
    for joint in joints:
        if joint.parent is not None:
            below[joint.parent].append(joint)
    children = {joint.child for joint in joints}
    roots = [link for link in masses if link not in children]
    heads = [(roots[0], "it is the floating base")] if len(roots) == 1 else []
    heads += [
        (j.child, f"joint '{j.name}' moves it") for j in joints if j.kind != "fixed" and j.child is not None
    ]
    for head, why in heads:
        part = _part(head, below)
        weights = [masses[link] for link in part or ()]
        total = sum(weight for weight in weights if weight is not None)
        if part and None not in weights and total <= 0:
            fixed = f" together with {listing(part[1:])}, fixed to it" if len(part) > 1 else ""
            reader.problem(f"link '{head}'", f"mass 0 kg{fixed}, expected > 0, for {why}")


def _part(head: str, below: Mapping[str, Sequence[_Joint]]) -> list[str] | None:
    """A link and all that is fixed to it; None where a joint that cannot be read leaves it open."""
    part = [head]
    for link in part:  # it grows while it is walked
        for joint in below[link]:
            if joint.child is None or joint.kind not in (*_SUPPORTED, *_REFUSED):
                return None
            if joint.kind == "fixed" and joint.child not in part:
                part.append(joint.child)
    return part
