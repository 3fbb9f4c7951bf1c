"""Promises about the centre of mass: it stays inside the support region, by the margin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from wbplan.checks.replay import Array, Replay, Window
from wbplan.checks.report import Row, Tolerances, Worst
from wbplan.errors import SpecError
from wbplan.geometry import support_polygon

SIDES = 64  #: of the pyramid around a friction cone


@dataclass(frozen=True, eq=False)
class _Balance:
    """A phase's CoM and its margin over the phase's samples; no margin where there is no polygon.

    Attributes:
        window: the phase.
        com: (K, 3) [m], world.
        margin: (K,) [m], in the polygon of the feet as they are at each sample.
        margin_at_rest: (K,) [m], in the polygon of the feet as they are when the phase begins.
    """

    window: Window
    com: Array
    margin: Array | None
    margin_at_rest: Array | None


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Support margins, their handover from phase to phase, regions, and `com` and `margin` as recorded."""
    del bounds
    phases = [_balance(replay, window) for window in replay.windows]
    return [
        *_polygons(replay, phases),
        *_margins(replay, phases),
        *_regions(replay),
        *_records(replay, phases),
    ]


def _balance(replay: Replay, window: Window) -> _Balance:
    com = replay.total_com(window, window.samples)
    try:
        if "region" in window.promises:
            margin = support_polygon(window.promises["region"]).margins(com[:, :2])
            return _Balance(window, com, margin, margin)
        points = np.array([replay.frames[foot].position[window.samples, :2] for foot in window.feet])
        polygon = support_polygon(points[:, 0] if len(points) else np.zeros((0, 2)))
    except SpecError:  # fewer than three feet, or all on a line
        return _Balance(window, com, None, None)
    moving = _margins_of_moving(points, polygon.edges, com[:, :2])
    return _Balance(window, com, moving, polygon.margins(com[:, :2]))


def _margins_of_moving(points: Array, edges: tuple[tuple[int, int], ...], com: Array) -> Array:
    """Margin (K,) [m] in the polygon of the feet as they are at each sample.

    Feet in contact may slip by less than a tenth of a millimetre; the margin must not profit from it.
    Which feet make an edge is known from the first sample.

    Args:
        points: (C, K, 2) [m], world.
        edges: pairs of feet, counter-clockwise.
        com: (K, 2) [m], world.
    """
    distances = []
    for i, j in edges:
        along = points[j] - points[i]
        along /= np.linalg.norm(along, axis=1)[:, None]
        reach = com - points[i]
        distances.append(along[:, 0] * reach[:, 1] - along[:, 1] * reach[:, 0])
    margin: Array = np.min(distances, axis=0)
    return margin


def _polygons(replay: Replay, phases: list[_Balance]) -> list[Row]:
    """Where a margin is promised there is a polygon to have it in."""
    worst = Worst("contacts that span", "contacts", at_least=True)
    for phase in phases:
        if phase.window.margin is not None:
            feet = len(set(phase.window.feet))
            spanning = feet if phase.margin is not None else min(feet, 2)
            at = replay.times(phase.window.samples[:1])
            worst.see([spanning], 3.0, at, phase.window.name, [", ".join(phase.window.feet)])
    return worst.rows()


def _margins(replay: Replay, phases: list[_Balance]) -> list[Row]:
    """At least what is promised; apart, the first sample of a later phase, where feet lift."""
    through = Worst("support margin", "m", at_least=True, slack=1e-6)
    handover = Worst("margin at handover", "m", at_least=True, slack=1e-6)
    for phase in phases:
        window, promised = phase.window, phase.window.margin
        if promised is None or phase.margin is None:
            continue
        entry = (
            1
            if window.index > 0 and replay.times(window.samples[0]) <= window.promises["start"] + 1e-9
            else 0
        )
        times = replay.times(window.samples)
        handover.see(phase.margin[:entry], promised, times[:entry], window.name, ["CoM"])
        through.see(phase.margin[entry:], promised, times[entry:], window.name, ["CoM"])
    return [*through.rows(), *handover.rows()]


def _records(replay: Replay, phases: list[_Balance]) -> list[Row]:
    """The recorded `com` and `margin` are those of the recorded phase.

    A recorded margin may be the one in the polygon of the feet when the phase began: a planner need not
    know how far they slipped since. The promise is held against the feet as they are.
    """
    com, margin = Worst("com agrees with q", "m"), Worst("margin agrees with q", "m")
    for phase in phases:
        window = phase.window
        own = replay.record.phase[window.samples] == window.index
        samples = window.samples[own]
        times = replay.times(samples)
        off = np.linalg.norm(replay.record.com[samples] - phase.com[own], axis=1)
        com.see(off, 1e-9, times, window.name, ["CoM"])
        if phase.margin is None or phase.margin_at_rest is None:
            continue
        recorded = replay.record.margin[samples]
        off = np.minimum(np.abs(recorded - phase.margin[own]), np.abs(recorded - phase.margin_at_rest[own]))
        # A margin that nobody asked for may be left out, but not be wrong.
        counts = np.isfinite(recorded) if window.margin is None else np.ones(len(samples), dtype=np.bool_)
        margin.see(off[counts], 1e-6, times[counts], window.name, ["CoM"])
    return [*com.rows(), *margin.rows()]


def _regions(replay: Replay) -> list[Row]:
    """Every corner of a region in the plan can be held by forces in the contacts' friction cones."""
    worst = Worst("region corners that do not hold", "corners")
    for window in replay.windows:
        if "region" not in window.promises:
            continue
        corners = np.array(window.promises["region"], dtype=np.float64)
        feet = [replay.frames[foot].position[window.samples[0]] for foot in window.feet]
        friction = [float(contact["friction"]) for contact in window.promises["contacts"]]
        rays, moments = _pyramids(np.array(feet).reshape(-1, 3), window.normals, friction)
        # A micrometre towards the middle: a corner is on the boundary, where rounding decides.
        inside = corners + 1e-6 * (corners.mean(axis=0) - corners)
        fallen = sum(not _stands(rays, moments, corner) for corner in inside)
        worst.see([fallen], 0.0, replay.times(window.samples[:1]), window.name, [", ".join(window.feet)])
    return worst.rows()


def _pyramids(feet: Array, normals: Array, friction: list[float]) -> tuple[Array, Array]:
    """Edges (R, 3) of the pyramids around the friction cones, and their moments about the world's origin."""
    angles = 2.0 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
    rays, moments = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for foot, normal, mu in zip(feet, normals, friction, strict=True):
        side = np.cross(normal, np.eye(3)[0 if abs(normal[0]) < 0.9 else 1])
        side /= np.linalg.norm(side)
        circle = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(normal, side))
        edges = normal + mu / np.cos(np.pi / SIDES) * circle
        rays.append(edges)
        moments.append(np.cross(foot, edges))
    return np.vstack(rays), np.vstack(moments)


def _stands(rays: Array, moments: Array, com: Array) -> bool:
    """Whether sum f_i = z and sum p_i x f_i = c x z for forces f_i that are sums of the rays."""
    if not len(rays) or not np.isfinite(moments).all():  # a foot that is nowhere carries nothing
        return False
    up = np.array([0.0, 0.0, 1.0])
    weight = np.concatenate([up, np.cross([com[0], com[1], 0.0], up)])
    balance = np.hstack([rays, moments]).T
    return bool(linprog(np.zeros(len(rays)), A_eq=balance, b_eq=weight, bounds=(0, None)).status == 0)
