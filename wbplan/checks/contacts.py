"""Promises about feet: they stay, stand on one level, arrive at rest and do not sink."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wbplan.checks.replay import Array, Replay, Window
from wbplan.checks.report import Row, Tolerances, Worst

TOUCHDOWN = 0.02  #: [m/s], fastest mean speed of a foot over the last step before it is in contact
SINK = 1e-3  #: [m], how far a foot that is not in contact may be below the ground
LEVEL = 1e-6  #: horizontal part of a unit normal that still counts as upright


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Slip, level contacts, touch-downs at rest, swing feet above the ground."""
    return [*_slip(replay, bounds), *_level(replay, bounds), *_touchdown(replay), *_friction(replay)]


def _slip(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Distance from where the foot was when its phase began, and from where it touched down.

    Consecutive phases that hold the same foot are one stance: small slips must not add up.
    """
    worst = Worst("foot slip", "m")
    touched: dict[str, Array] = {}
    for window in replay.windows:
        positions = {foot: replay.frames[foot].position[window.samples] for foot in window.feet}
        touched = {foot: touched.get(foot, path[0]) for foot, path in positions.items()}
        for foot, path in positions.items():
            for anchor in (path[0], touched[foot]):
                moved = np.linalg.norm(path - anchor, axis=1)
                worst.see(moved, bounds.slip, replay.times(window.samples), window.name, [foot])
    return worst.rows()


def _level(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Contacts whose hull is used as support region lie in one plane, and level ground stays level.

    Between two phases with a static-equilibrium region, which may change level, all upright contacts
    share one height; contacts on a slope are compared with their own plane. The other feet, while they
    swing, stay above that height.
    """
    level, swing = Worst("contacts level", "m"), Worst("swing feet above ground", "m", at_least=True)
    for run in _runs_on_one_level(replay):
        starts = [(w, f, replay.frames[f].position[w.samples[0], 2]) for w in run for f in w.feet]
        ground = float(np.median([height for _, _, height in starts]))
        feet = sorted({foot for _, foot, _ in starts})
        for window, foot, height in starts:
            at = replay.times(window.samples[:1])
            level.see([abs(height - ground)], bounds.ground, at, window.name, [foot])
        for window in run:
            for foot in feet:
                if foot not in window.feet:
                    above = replay.frames[foot].position[window.samples, 2] - ground
                    swing.see(above, -SINK, replay.times(window.samples), window.name, [foot])
    for window in replay.windows:
        if _uses_hull(window) and not _upright(window) and len(window.feet) > 3:
            points = np.array([replay.frames[foot].position[window.samples[0]] for foot in window.feet])
            centered = points - points.mean(axis=0)
            across = np.abs(centered @ np.linalg.svd(centered)[2][2])
            level.see(across[None], bounds.ground, replay.times(window.samples[:1]), window.name, window.feet)
    return [*level.rows(), *swing.rows()]


def _runs_on_one_level(replay: Replay) -> Iterator[list[Window]]:
    """Consecutive phases that stand on one level by what they promise."""
    run: list[Window] = []
    for window in replay.windows:
        if "region" in window.promises or not _upright(window):
            if run:
                yield run
            run = []
        elif _uses_hull(window) and window.feet:
            run.append(window)
    if run:
        yield run


def _touchdown(replay: Replay) -> list[Row]:
    """A foot that comes into contact arrives at rest: its mean speed over the step that ends there."""
    worst = Worst("touch-down speed", "m/s")
    for before, window in zip(replay.windows, replay.windows[1:], strict=False):
        first = int(window.samples[0])
        for foot in window.feet:
            if foot in before.feet or first == 0:
                continue
            last = replay.frames[foot].position[[first - 1, first]]
            duration = float(np.diff(replay.times([first - 1, first]))[0])
            speed = float(np.linalg.norm(last[1] - last[0])) / duration
            worst.see([speed], TOUCHDOWN, replay.times([first]), window.name, [foot])
    return worst.rows()


def _friction(replay: Replay) -> list[Row]:
    """Each contact can carry weight: the vertical lies in its friction cone, tan(tilt) <= friction.

    Only then is the hull of the feet a support region; with a region in the plan that is checked instead.
    """
    worst = Worst("tilt within friction", "tan(tilt)")
    for window in replay.windows:
        if _uses_hull(window) and window.feet:
            normals = window.normals
            up = normals[:, 2]
            tilt = np.where(up > 0.0, np.linalg.norm(normals[:, :2], axis=1) / np.maximum(up, 1e-12), np.inf)
            friction = np.array([contact["friction"] for contact in window.promises["contacts"]])
            worst.see(tilt[None], friction, replay.times(window.samples[:1]), window.name, window.feet)
    return worst.rows()


def _uses_hull(window: Window) -> bool:
    return window.margin is not None and "region" not in window.promises


def _upright(window: Window) -> bool:
    normals = window.normals
    return bool((normals[:, 2] > 0.0).all() and (np.abs(normals[:, :2]) <= LEVEL).all())
