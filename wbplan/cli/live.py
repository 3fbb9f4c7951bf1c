"""A plan drawn while it is made: an observer for `plan` that moves a view's scene."""

from __future__ import annotations

from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan import reasons
from wbplan.problem.script import Script
from wbplan.robot import Robot
from wbplan.tick import Loop
from wbplan.view import Scene, Server

Array = NDArray[np.float64]

#: Seconds of the plan from one picture to the next.
EVERY = 0.04


@final
class LiveView:
    """Draws the loop's robot, contacts, support polygon, centre of mass, targets and bodies.

    Args:
        server: where to draw.
        robot: the robot.
        script: what is planned; its bodies are drawn.
    """

    def __init__(self, server: Server, robot: Robot, script: Script) -> None:
        self._scene = Scene(
            server,
            robot.urdf_text,
            robot.package_dirs,
            bodies=script.bodies,
            urdf_dir=robot.urdf_path.parent,
            trails=tuple(robot.hands.values()),
            obstacles=script.obstacles,
        )
        self._bodies: dict[str, Array] = {
            body.name: pin.SE3ToXYZQUAT(body.pose) for body in script.bodies if body.pose is not None
        }
        self._next, self._next_word, self._why = 0.0, 0.0, ""

    def __call__(self, loop: Loop, t: float) -> None:
        """Draws the loop as it is at time `t` [s] of the plan, `EVERY` so often."""
        if t < self._next:
            return
        self._next = t + EVERY
        if t >= self._next_word and loop.last is not None:
            self._next_word, why = t + reasons.EVERY, reasons.worst(loop.last, loop)
            self._why = "" if why is None else f"\n{why}"
        compiled, stack = loop.compiled, loop.stack
        phase, polygon, margin = compiled.phase, compiled.polygon, compiled.margin
        self._bodies.update(loop.bodies())
        self._scene.update(
            loop.q,
            contacts=[
                (contact.frame, point)
                for contact, point in zip(phase.contacts, compiled.contact_points, strict=True)
            ],
            polygon=None if polygon is None else polygon.vertices,
            inset=None if polygon is None or margin is None else polygon.inset(margin),
            com=stack.kinematics.com,
            margin=stack.margin if polygon is not None else None,
            required=margin or 0.0,
            bodies=self._bodies,
            targets=loop.targets(),
            label=f"{phase.name}\nt = {t:.1f} s{self._why}",
        )
