"""PlaCo's robots, used again: it never gives back the memory of one (about 1.6 MB), and each phase needs one.

A backend has a robot to itself for as long as it lives; then the robot waits for the next backend whose URDF
is the same. Where carried bodies sit and what they weigh, which differs from phase to phase, is told to the
robot anew, as is all that a backend changes on it.
"""

from __future__ import annotations

import threading
import weakref
from collections import deque
from typing import Any, final

import placo
from lxml import etree

from wbplan.compiled.phase import CompiledPhase
from wbplan.errors import SpecError

_LIMITS = ("lowerPositionLimit", "upperPositionLimit", "velocityLimit")


@final
class Wrappers:
    """`placo.RobotWrapper` objects by URDF, lent out and given back.

    Attributes:
        made: how many there are by now.
    """

    def __init__(self) -> None:
        self.made = 0
        self._lock = threading.Lock()
        self._idle: dict[str, list[Any]] = {}
        # Finalizers run in the middle of anything, also where this thread holds the lock: they only append.
        self._back: deque[tuple[str, Any]] = deque()

    def lend(self, owner: object, phase: CompiledPhase) -> Any:
        """A robot for one phase, as if it were new; it comes back when its owner is collected.

        Args:
            owner: who uses it, and nobody else.
            phase: its robot and carried bodies.
        """
        text = _urdf_with_carried(phase)
        with self._lock:
            while self._back:
                given, back = self._back.popleft()
                self._idle.setdefault(given, []).append(back)
            idle = self._idle.get(text)
            robot = idle.pop() if idle else None
            self.made += robot is None
        if robot is None:
            robot = _made(text, phase)
        weakref.finalize(owner, self._back.append, (text, robot)).atexit = False
        _renew(robot, phase)
        return robot


#: Those of this process.
WRAPPERS = Wrappers()


def _made(text: str, phase: CompiledPhase) -> Any:
    try:
        return placo.RobotWrapper("", int(placo.Flags.ignore_collisions), text)
    except (ValueError, RuntimeError) as error:
        said = " ".join(str(error).split())[:120]
        raise SpecError(f"backend 'placo' cannot read robot '{phase.robot.name}': {said}") from error


def _renew(robot: Any, phase: CompiledPhase) -> None:
    """Put a robot in the state of a new one, with the phase's carried bodies."""
    model, mine = phase.model, robot.model
    if list(mine.names) != list(model.names):
        return  # the backend refuses it
    robot.reset()
    for name in _LIMITS:
        getattr(mine, name)[:] = getattr(model, name)
    for joint in range(1, model.njoints):
        mine.inertias[joint] = model.inertias[joint]
    for held in phase.held:
        for name in (held.body.name, f"{held.body.name}_held"):
            mine.frames[mine.getFrameId(name)].placement = model.frames[held.frame].placement


def _urdf_with_carried(phase: CompiledPhase) -> str:
    """The URDF without its looks, and with each carried body as a link fixed to its holder, without mass."""
    root = etree.fromstring(phase.robot.urdf_text.encode(), etree.XMLParser(resolve_entities=False))
    for element in list(root.iter("visual", "collision", "material")):
        element.getparent().remove(element)
    for held in phase.held:
        name = held.body.name
        etree.SubElement(root, "link", name=name)
        joint = etree.SubElement(root, "joint", name=f"{name}_held", type="fixed")
        etree.SubElement(joint, "parent", link=held.holder)
        etree.SubElement(joint, "child", link=name)
    return str(etree.tostring(root, encoding="unicode"))
