"""Promises about feet: they stay, stand on one level, arrive at rest and do not sink."""

from __future__ import annotations

import numpy as np

from wbplan.checks.replay import Array, Replay, Window
from wbplan.checks.report import Row, Tolerances, Worst
from wbplan.obstacles import Terrain

TOUCHDOWN = 0.02  #: [m/s], fastest mean speed of a foot over the last step before it is in contact
SINK = 1e-3  #: [m], how far a foot that is not in contact may be below the ground
LEVEL = 1e-6  #: horizontal part of a unit normal that still counts as upright


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Slip, level contacts, swing feet above the ground, touch-downs at rest."""
    return [
        *_slip(replay, bounds),
        *_level(replay, bounds),
        *_swings(replay),
        *_touchdown(replay),
        *_friction(replay),
    ]


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
    """Contacts whose hull is used as support region lie in one plane.

    Each phase by itself: upright contacts share one height, contacts on a slope are compared with their own
    plane. From phase to phase the level is the same by the feet that stay, which do not slip; feet that
    change places may stand on another one.
    """
    level = Worst("contacts level", "m")
    for window in replay.windows:
        if not (_uses_hull(window) and window.feet):
            continue
        points = np.array([replay.frames[foot].position[window.samples[0]] for foot in window.feet])
        if _upright(window):
            across = np.abs(points[:, 2] - np.median(points[:, 2]))
        else:  # that three points always lie in a plane is no merit
            centered = points - points.mean(axis=0)
            across = np.abs(centered @ np.linalg.svd(centered)[2][2]) if len(points) > 3 else np.zeros(0)
        level.see(across[None], bounds.ground, replay.times(window.samples[:1]), window.name, window.feet)
    return level.rows()


def _swings(replay: Replay) -> list[Row]:
    """Feet in the air are not below the ground.

    The ground is what the plan says to stand in the world; where that has nothing, and contacts are upright,
    the lower one of the two places that a foot comes from and goes to.
    """
    swing = Worst("swing feet above ground", "m", at_least=True)
    for k, window in enumerate(replay.windows):
        standing = set(window.promises.get("obstacles", ()))
        terrain = Terrain([item for item in replay.obstacles if item.name in standing])
        known = _uses_hull(window) and _upright(window)
        for foot in sorted({foot for other in replay.windows for foot in other.feet} - set(window.feet)):
            places = replay.frames[foot].position[window.samples]
            ends = [_stands_at(replay, foot, k, step) for step in (-1, 1)] if known else []
            lower = min((z for z in ends if z is not None), default=-np.inf)
            above = terrain.above(places)
            above = np.where(np.isfinite(above), above, places[:, 2] - lower)
            seen = np.isfinite(above)
            swing.see(above[seen], -SINK, replay.times(window.samples[seen]), window.name, [foot])
    return swing.rows()


def _stands_at(replay: Replay, foot: str, k: int, step: int) -> float | None:
    """Height [m] at which a foot stands in the nearest phase before (`step` -1) or after phase k."""
    windows = replay.windows[k + 1 :] if step > 0 else replay.windows[:k][::-1]
    held = next((window for window in windows if foot in window.feet), None)
    return None if held is None else float(replay.frames[foot].position[held.samples[0], 2])


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
