"""A phase's stance: where its CoM may be, with what it pushes on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.errors import SpecError
from wbplan.geometry import HalfPlanes, support_polygon
from wbplan.problem.bodies import frame_number
from wbplan.problem.script import Phase
from wbplan.problem.tasks import FrameTask
from wbplan.state import State
from wbplan.statics.region import hull_is_exact, support_region

Array = NDArray[np.float64]


def support(
    phase: Phase, model: Any, state: State, points: Array, *, wanted: bool = False
) -> tuple[HalfPlanes | None, bool]:
    """The polygon that a phase's CoM keeps to, and whether it is a region rather than the contacts' hull.

    None where the phase has no such limit, unless it is `wanted` all the same.

    Raises:
        SpecError: the contacts hold the robot nowhere, or a push is not what it has to be.
    """
    at = f"phase '{phase.name}'"
    load = push_load(phase, model, state)
    if phase.support is None and not wanted:
        return None, False
    normals = np.array([c.normal for c in phase.contacts]).reshape(-1, 3)
    friction = np.array([c.friction for c in phase.contacts])
    names = ", ".join(c.frame for c in phase.contacts) or "none"
    region = bool(phase.pushes) or not hull_is_exact(points, normals, friction)
    try:
        if not region:
            return support_polygon(points[:, :2]), False
        loads = [np.zeros(6), load] if phase.pushes else [load]
        return support_region(points, normals, friction, loads).polygon, True
    except SpecError as error:
        raise SpecError(f"{at}: its contacts ({names}) span no support polygon: {error}") from None


def push_load(phase: Phase, model: Any, state: State) -> Array:
    """(6,) what the pushes do to the robot, about the world's origin, per newton of its weight."""
    load, at = np.zeros(6), f"phase '{phase.name}'.pushes"
    held = {c.frame for c in phase.contacts} | {
        t.frame for t in phase.hard if isinstance(t, FrameTask) and t.path.constant and t.root is None
    }
    for push in phase.pushes:
        frame_number(model, push.frame, at)
        if push.frame not in held:
            raise SpecError(
                f"{at}: '{push.frame}' may move while it pushes; add a hard task that holds it, such as "
                f"wb.PositionTask('{push.frame}')"
            )
        force = -np.array(push.force)
        load += np.concatenate([force, np.cross(state.pose(push.frame).translation, force)])
    weight = pin.computeTotalMass(model) * float(np.linalg.norm(model.gravity.linear))
    per_weight: Array = load / weight
    return per_weight


def ease_of_pushes(
    phase: Phase, model: Any, state: State, points: Array, polygon: HalfPlanes, *, by: float = 1.0
) -> dict[str, Array]:
    """How far [m] each edge (E,) of a phase's region gives way for every newton that a push is less.

    Args:
        phase: with pushes.
        model: its robot, with what it carries.
        state: where the frames that push are where they push.
        points: (C, 3) of the contacts [m].
        polygon: what `support` gave for them.
        by: how much less [N] the push is made to find it.
    """
    eased = {}
    for k, push in enumerate(phase.pushes):
        force = np.array(push.force)
        size = float(np.linalg.norm(force))
        if size == 0.0:
            continue
        step = min(by, size)
        less = replace(push, force=tuple(force * (1.0 - step / size)))
        pushes = (*phase.pushes[:k], less, *phase.pushes[k + 1 :])
        other, _ = support(replace(phase, pushes=pushes), model, state, points, wanted=True)
        assert other is not None  # it is wanted
        reach = (polygon.normals @ other.vertices.T).max(axis=1)
        eased[push.frame] = (reach - polygon.offsets) / step
    return eased
