"""Reads an SRDF: limbs, tips, named poses, roles and the collisions that can never matter.

Beyond the format itself these conventions give it its meaning here:

- end effectors of the group `feet` are feet, those of any other group are hands; `parent_group` is the limb;
- a group state called `leg` or `arm` of a limb's own group is a role: the joints it holds, and where;
- any other group state is a named pose, or the part of one that its group has.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import pinocchio as pin

from wbplan.errors import listing
from wbplan.robot.reading import Findings, Reader, XmlError, parse_xml

ROLES = ("leg", "arm")
LIMIT_TOLERANCE = 1e-6
"""How far [rad or m] a value may lie beyond a joint's limit, since both files round; it is clipped."""

_BASE = "root_joint"  # what other tools call the floating base's joint in groups and states


@dataclass
class Srdf:
    """What an SRDF says of a robot; filled while it is read.

    Attributes:
        limbs: limb -> its joints that move, in the file's order.
        groups: every group -> its joints that move.
        feet: limb -> link at its foot.
        hands: limb -> link at its hand.
        poses: name -> joint -> value [rad or m].
        roles: limb -> "leg" or "arm" -> the joints it holds -> value [rad or m].
        ignored_collisions: pairs of links.
    """

    limbs: dict[str, tuple[str, ...]] = field(default_factory=dict)
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    feet: dict[str, str] = field(default_factory=dict)
    hands: dict[str, str] = field(default_factory=dict)
    poses: dict[str, dict[str, float]] = field(default_factory=dict)
    roles: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    ignored_collisions: set[frozenset[str]] = field(default_factory=set)


class Tree:
    """A model's links and joints by name, and which joint moves what."""

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        kinds = {
            kind: [f for f in model.frames[2:] if f.type == kind]
            for kind in (pin.FrameType.BODY, pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
        }
        self.links: dict[str, pin.Frame] = {f.name: f for f in kinds[pin.FrameType.BODY]}
        self.fixed: dict[str, pin.Frame] = {f.name: f for f in kinds[pin.FrameType.FIXED_JOINT]}
        self.moving: tuple[str, ...] = tuple(model.names[2:])

    def chain(self, frame: pin.Frame, base: pin.Frame | None = None) -> tuple[str, ...]:
        """Joints that move a frame, from the root (or from the frame `base`) on."""
        skip = 2 if base is None else len(self.model.supports[base.parentJoint])
        return tuple(self.model.names[j] for j in self.model.supports[frame.parentJoint].tolist()[skip:])

    def joint_above(self, link: str) -> tuple[str, ...]:
        """The joint that a link hangs on, if it is one that moves."""
        above = self.model.frames[self.links[link].parentFrame]
        return (above.name,) if above.type == pin.FrameType.JOINT and above.name != _BASE else ()

    def limits(self, joint: str) -> tuple[float, float]:
        """Lower and upper position limit [rad or m]."""
        index = self.model.idx_qs[self.model.getJointId(joint)]
        return float(self.model.lowerPositionLimit[index]), float(self.model.upperPositionLimit[index])


def read_srdf(text: str, model: pin.Model) -> tuple[Srdf, Findings]:
    """Reads an SRDF for a model that has a free-flyer root.

    Returns:
        What it says, and the problems and warnings found, each naming its element.
    """
    try:
        root = parse_xml(text)
    except XmlError as problem:
        return Srdf(), Findings((str(problem),))
    if root.tag != "robot":
        return Srdf(), Findings((f"the root element is <{root.tag}>, expected <robot>",))
    reading = _Reading(root, Tree(model))
    reading.read()
    return reading.out, reading.findings()


class _Reading(Reader):
    """One pass over an SRDF."""

    def __init__(self, root: Element, tree: Tree) -> None:
        super().__init__()
        self.root = root
        self.tree = tree
        self.out = Srdf()
        self.elements: dict[str, Element] = {}
        self.base_names = {_BASE, *(e.get("name", "") for e in root.findall("virtual_joint"))}

    def read(self) -> None:
        if self.root.get("name") != self.tree.model.name:
            self.warn("robot", f"named '{self.root.get('name')}', but '{self.tree.model.name}' in the URDF")
        self.elements = self.named(self.root, "group")
        for name in self.elements:
            self.out.groups[name] = tuple(dict.fromkeys(self._members(name, ())))
        self._read_end_effectors()
        self._read_limbs()
        for state in self.root.findall("group_state"):
            self._read_state(state)
        for element in self.root.findall("disable_collisions"):
            pair = frozenset(element.get(key, "") for key in ("link1", "link2"))
            known = [self._known_link("disable_collisions", link) for link in sorted(pair)]
            if all(known):
                self.out.ignored_collisions.add(pair)

    def _known_link(self, where: str, link: str) -> bool:
        if link in self.tree.links:
            return True
        self.problem(where, f"link '{link}' is not in the URDF; links: {listing(list(self.tree.links))}")
        return False

    def _known_group(self, where: str, group: str) -> bool:
        if group in self.elements:
            return True
        self.problem(where, f"group '{group}' does not exist; groups: {listing(list(self.elements))}")
        return False

    def _members(self, name: str, inside: tuple[str, ...]) -> list[str]:
        """Joints of a group that move, those of its sub-groups included."""
        where, joints = f"group '{name}'", []
        for element in self.elements[name]:
            member = element.get("name", "")
            if element.tag == "joint":
                if member in self.tree.moving:
                    joints.append(member)
                elif member not in self.tree.fixed and member not in self.base_names:
                    self.problem(
                        where, f"joint '{member}' is not in the URDF; joints: {listing(self.tree.moving)}"
                    )
            elif element.tag == "link" and self._known_link(where, member):
                # The groups of tips name links as frames; in any other, a link stands for the joint above it.
                joints += () if name in ("feet", "hands") else self.tree.joint_above(member)
            elif element.tag == "chain":
                joints += self._chain(where, element)
            elif element.tag == "group" and self._known_group(where, member):
                if member == name or member in inside:
                    self.problem(where, f"contains itself, by way of '{member}'")
                else:
                    joints += self._members(member, (*inside, name))
        return joints

    def _chain(self, where: str, element: Element) -> tuple[str, ...]:
        base, tip = element.get("base_link", ""), element.get("tip_link", "")
        known = [self._known_link(where, base), self._known_link(where, tip)]
        if not all(known):
            return ()
        start, end = self.tree.links[base], self.tree.links[tip]
        if start.parentJoint not in self.tree.model.supports[end.parentJoint].tolist():
            self.problem(where, f"its chain ends at link '{tip}', which is not below its base link '{base}'")
            return ()
        return self.tree.chain(end, start)

    def _read_end_effectors(self) -> None:
        listed: dict[str, set[str]] = {"feet": set(), "hands": set()}
        for name, element in self.named(self.root, "end_effector").items():
            where = f"end_effector '{name}'"
            link, group, limb = (element.get(key, "") for key in ("parent_link", "group", "parent_group"))
            good = [self._known_link(where, link), self._known_group(where, group)]
            if limb:
                good.append(self._known_group(where, limb))
            if not all(good):
                continue
            limb = limb or name
            chain = self.tree.chain(self.tree.links[link])
            self.out.groups.setdefault(limb, chain)
            if self.out.groups[limb] and not set(chain) & set(self.out.groups[limb]):
                self.problem(where, f"link '{link}' is moved by no joint of group '{limb}'")
            tips = self.out.feet if group == "feet" else self.out.hands
            if limb in tips:
                self.problem(
                    where, f"limb '{limb}' already has '{tips[limb]}', expected one tip in '{group}'"
                )
            tips.setdefault(limb, link)
            listed.setdefault(group, set()).add(link)
        for kind in ("feet", "hands"):
            for element in self.elements[kind].findall("link") if kind in self.elements else ():
                link = element.get("name", "")
                if link in self.tree.links and link not in listed[kind]:
                    self.problem(f"group '{kind}'", f"no end_effector says which limb '{link}' belongs to")

    def _read_limbs(self) -> None:
        """Limbs: the groups with a tip, and those that no smaller group is a part of."""
        tipped = {*self.out.feet, *self.out.hands}
        sets = {name: set(joints) for name, joints in self.out.groups.items() if joints}
        for name, joints in sets.items():
            if name in tipped or not any(other < joints for other in sets.values()):
                self.out.limbs[name] = self.out.groups[name]
        for name in sorted(tipped - set(self.out.limbs)):
            self.out.limbs[name] = ()
        owner: dict[str, str] = {}
        for name, members in self.out.limbs.items():
            for joint in members:
                if owner.setdefault(joint, name) != name:
                    self.warn(f"group '{name}'", f"joint '{joint}' is in the limb '{owner[joint]}' too")

    def _read_state(self, state: Element) -> None:
        name, group = state.get("name", ""), state.get("group", "")
        where = f"group_state '{name}' of group '{group}'"
        if not name:
            self.problem(where, "no name")
        if not self._known_group(where, group):
            return
        values = self._values(where, state, self.out.groups[group])
        if name in ROLES and group in self.out.limbs:
            roles = self.out.roles.setdefault(group, {})
            if name in roles:
                self.problem(where, "given twice, expected once")
            if not values:
                self.problem(where, f"the role '{name}' holds no joint")
            roles[name] = values
            return
        pose = self.out.poses.setdefault(name, {})
        for joint in sorted(set(pose) & set(values)):
            if pose[joint] != values[joint]:
                self.problem(where, f"joint '{joint}' is {values[joint]:g} here, but {pose[joint]:g} before")
        pose.update(values)

    def _values(self, where: str, state: Element, members: Iterable[str]) -> dict[str, float]:
        values: dict[str, float] = {}
        members = set(members)
        for element in state.findall("joint"):
            joint, text = element.get("name", ""), element.get("value")
            if joint in self.base_names:
                continue  # where the base stands follows from the feet
            if joint not in self.tree.moving:
                known = "does not move" if joint in self.tree.fixed else "is not in the URDF"
                self.problem(where, f"joint '{joint}' {known}; joints: {listing(self.tree.moving)}")
                continue
            if joint not in members:
                self.problem(where, f"joint '{joint}' is not in that group")
            if joint in values:
                self.problem(where, f"joint '{joint}' is given twice, expected once")
            value = self.number(where, f"value of joint '{joint}'", text)
            if value is None:
                continue
            lower, upper = self.tree.limits(joint)
            if not lower - LIMIT_TOLERANCE <= value <= upper + LIMIT_TOLERANCE:
                self.problem(
                    where, f"joint '{joint}' at {value:g} is outside [{lower:g}, {upper:g}], its limits"
                )
            values[joint] = min(max(value, lower), upper)
        return values
