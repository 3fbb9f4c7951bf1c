"""Promises about closed loops and about objects: carried ones follow their holder, others stay put."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wbplan.checks.replay import Poses, Replay, Window
from wbplan.checks.report import Row, Tolerances, Worst

RECORD = 1e-6  #: [m] and [rad], how well a carried object's recorded pose follows from its holder's


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Closures and objects."""
    return [*_closures(replay, bounds), *_objects(replay, bounds)]


def _closures(replay: Replay, bounds: Tolerances) -> list[Row]:
    """T_a_b against what it was when the phase began, and when the loop was closed."""
    gap, turn = Worst("closure gap", "m"), Worst("closure turn", "rad")
    closed: dict[tuple[str, str], Poses] = {}
    for window in replay.windows:
        pairs = [(loop["frame_a"], loop["frame_b"]) for loop in window.promises["closures"]]
        paths = {(a, b): replay.frames[b].seen_from(replay.frames[a])[window.samples] for a, b in pairs}
        closed = {pair: closed.get(pair, path[:1]) for pair, path in paths.items()}
        times = replay.times(window.samples)
        for (a, b), path in paths.items():
            for anchor in (path[:1], closed[a, b]):
                gap.see(path.distance(anchor), bounds.closure, times, window.name, [f"{a} - {b}"])
                turn.see(path.turn(anchor), bounds.rotation, times, window.name, [f"{a} - {b}"])
    return [*gap.rows(), *turn.rows()]


def _objects(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Recorded poses of objects against T_world_frame T_frame_object, or against where they were left.

    At a phase's edges an object is where both phases say: it does not jump when it is taken or let go.
    """
    place, turn = Worst("object place", "m"), Worst("object turn", "rad")
    for name, recorded in replay.record.bodies.items():
        path = Poses.of(recorded)
        known = np.isfinite(np.abs(recorded).max(axis=1))
        left: Poses | None = None
        for window in replay.windows:
            item = _carried(window, name)
            samples = window.samples if item is not None else window.samples[known[window.samples]]
            if not len(samples):
                continue  # an object need not have a pose before anybody touches it
            expected = replay.held_pose(item, samples) if item is not None else left or path[samples[:1]]
            own = replay.record.phase[samples] == (window.index if item is not None else -1)
            times = replay.times(samples)
            for worst, off, bound in (
                (place, path[samples].distance(expected), bounds.closure),
                (turn, path[samples].turn(expected), bounds.rotation),
            ):
                worst.see(off, np.where(own, RECORD, bound).reshape(-1, 1), times, window.name, [name])
            left = expected[-1:]
    return [*place.rows(), *turn.rows()]


def _carried(window: Window, name: str) -> Mapping[str, Any] | None:
    for item in window.promises["carried"]:
        if item["name"] == name:
            found: Mapping[str, Any] = item
            return found
    return None
