"""Promised distances, recomputed by MuJoCo from the bundle's own URDF, bodies and obstacles.

Kept apart are, in a phase that promises a clearance: links of different rigid pieces that do not follow
each other in the chain and are not among the plan's `ignored_pairs`; a carried body and all links but those
that hold it, before and after these in the chain; and, where the phase keeps off obstacles, links and carried
bodies from these and from bodies that stand. Feet in contact are left out there. Feet, and what `may_touch`
names, may touch; they may not go further in than `TOUCH`, or than they are when the phase begins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import Bundle
from wbplan.checks.replay import Replay, Window
from wbplan.checks.report import Row, Worst
from wbplan.checks.solids import Solids, Unreadable

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

TOUCH = 0.005  #: [m], how far what may touch may go in
NEAR = 0.01  #: [m], how near to a foot's frame a shape of its link counts as the foot's
SLACK = 2e-6  #: [m], what the two libraries' distances may differ by
SEEN = 0.03  #: [m] beyond the bound up to which distances are measured


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of shapes of one phase and the bound [m] of each; promised, or merely not to be gone into."""

    first: Ints
    second: Ints
    bound: Array
    promised: NDArray[np.bool_]


def rows(bundle: Bundle, replay: Replay, folders: tuple[Path, ...] = ()) -> list[Row]:
    """One row for promised distances, and one for what may touch."""
    clear = Worst("clearance", "m", at_least=True, slack=SLACK)
    touch = Worst("depth of touch", "m", at_least=True, slack=SLACK)
    promising = [window for window in replay.windows if "clearance" in window.promises]
    if not promising:
        return []
    try:
        solids = Solids(bundle, folders)
    except Unreadable as error:
        return _cannot(replay, promising[0], str(error))
    nothing = True
    for window in promising:
        pairs = _pairs(solids, bundle, window)
        if not len(pairs.first):
            continue
        nothing = False
        found = np.empty((len(window.samples), len(pairs.first)))
        for i, k in enumerate(window.samples):
            solids.place(int(k))
            found[i] = solids.distances(pairs.first, pairs.second, pairs.bound + SEEN)
        names = [
            f"{solids.owner[a]} - {solids.owner[b]}" for a, b in zip(pairs.first, pairs.second, strict=True)
        ]
        times = replay.times(window.samples)
        bound = np.where(pairs.promised, pairs.bound, np.minimum(pairs.bound, found[0]))
        for worst, chosen in ((clear, pairs.promised), (touch, ~pairs.promised)):
            these = np.flatnonzero(chosen)
            worst.see(found[:, these], bound[these], times, window.name, [names[p] for p in these])
    if nothing:  # a promise must not pass because there was nothing to look at
        return _cannot(replay, promising[0], "there are no shapes to measure")
    return [*clear.rows(), *touch.rows()]


def nearest(
    bundle: Bundle, samples: Ints, folders: tuple[Path, ...] = ()
) -> list[tuple[str, float, Array, Array]]:
    """The pair that is nearest at each sample, of those whose distance its phase promises.

    Returns:
        Names, distance [m] and the two points (3,) in the world; nan where nothing is near or promised.
    """
    nothing = ("", float("nan"), np.full(3, np.nan), np.full(3, np.nan))
    found = [nothing] * len(samples)
    replay = Replay.of(bundle)
    try:
        solids = Solids(bundle, folders)
    except Unreadable:
        return found
    for window in replay.windows:
        if "clearance" not in window.promises:
            continue
        pairs = _pairs(solids, bundle, window)
        own = np.flatnonzero(pairs.promised)
        if not len(own):
            continue
        first, second = pairs.first[own], pairs.second[own]
        for i in np.flatnonzero(bundle.trajectory.phase[samples] == window.index):
            solids.place(int(samples[i]))
            gaps = solids.distances(first, second, pairs.bound[own] + SEEN)
            p = int(gaps.argmin())
            if gaps[p] < pairs.bound[own][p] + SEEN:
                names = f"{solids.owner[first[p]]} - {solids.owner[second[p]]}"
                found[i] = (names, float(gaps[p]), *solids.between(int(first[p]), int(second[p])))
    return found


def _cannot(replay: Replay, window: Window, why: str) -> list[Row]:
    clear = Worst("clearance", "m", at_least=True)
    clear.see([np.nan], window.promises["clearance"], replay.times(window.samples[:1]), window.name, [why])
    return clear.rows()


def _pairs(solids: Solids, bundle: Bundle, window: Window) -> _Pairs:
    told: Mapping[str, Any] = window.promises.get("kept_apart") or {"self": 0.0, "obstacles": 0.0}
    clearance = float(window.promises["clearance"])
    found: list[tuple[int, int, float, bool]] = []
    carried = {item["name"]: item["frame"] for item in window.promises["carried"]}
    moving = [g for g, kind in enumerate(solids.kind) if kind == "link" or solids.owner[g] in carried]
    if told.get("self") is not None:
        bound = max(clearance, float(told["self"]))
        ignored = {frozenset(pair) for pair in bundle.plan.get("ignored_pairs", ())}
        closer = {frozenset(pair) for pair in told.get("closer", ())}
        holding = {name: _holders(solids, window, frame) for name, frame in carried.items()}
        for i, a in enumerate(moving):
            for b in moving[i + 1 :]:
                names = frozenset((solids.owner[a], solids.owner[b]))
                if names in ignored or _one(solids, holding, a, b):
                    continue
                found.append((a, b, 0.0 if names in closer else bound, names not in closer))
    if told.get("obstacles") is not None:
        bound = max(clearance, float(told["obstacles"]))
        standing = set(window.promises.get("obstacles", ()))
        world = [
            g
            for g, kind in enumerate(solids.kind)
            if (kind == "obstacle" and solids.owner[g] in standing)
            or (
                kind == "body" and solids.owner[g] not in carried and _stands(bundle, window, solids.owner[g])
            )
        ]
        firm, may = _touching(solids, bundle, window, told)
        for a in (g for g in moving if g not in firm):
            for b in world:
                touches = a in may.get("", ()) or a in may.get(solids.owner[b], ())
                found.append((a, b, -TOUCH if touches else bound, not touches))
    table = np.array(found, dtype=np.float64).reshape(-1, 4)
    return _Pairs(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2], table[:, 3] > 0.5)


def _one(solids: Solids, holding: Mapping[str, frozenset[int]], a: int, b: int) -> bool:
    """Whether two shapes are on one piece, are neighbours, or hold each other."""
    if solids.kind[a] == solids.kind[b] == "link":
        return solids.neighbours(int(solids.group[a]), int(solids.group[b]))
    if solids.kind[a] == solids.kind[b]:
        return solids.owner[a] == solids.owner[b] or bool(holding[solids.owner[a]] & holding[solids.owner[b]])
    body, link = (a, b) if solids.kind[a] == "body" else (b, a)
    return int(solids.group[link]) in holding[solids.owner[body]]


def _holders(solids: Solids, window: Window, frame: str) -> frozenset[int]:
    """Pieces that hold a body: the holder's, those that loops tie to it, and the ones before and after."""
    frames = {frame}
    for _ in window.promises["closures"]:
        for loop in window.promises["closures"]:
            pair = {loop["frame_a"], loop["frame_b"]}
            if pair & frames:
                frames |= pair
    pieces = {solids.piece(name) for name in frames} - {-1}
    every = {int(piece) for piece in solids.group}
    return frozenset(p for p in every | pieces for q in pieces if solids.neighbours(p, q))


def _stands(bundle: Bundle, window: Window, name: str) -> bool:
    poses = bundle.trajectory.bodies.get(name)
    return poses is not None and bool(np.isfinite(poses[window.samples[0]]).all())


def _touching(
    solids: Solids, bundle: Bundle, window: Window, told: Mapping[str, Any]
) -> tuple[frozenset[int], dict[str, frozenset[int]]]:
    """Shapes of feet in contact; and by obstacle ("" for all) those that may touch it."""
    firm = frozenset(g for foot in window.feet for g in solids.shapes_at(foot, NEAR))
    may = {"": frozenset(g for foot in bundle.plan.get("feet", ()) for g in solids.shapes_at(foot, NEAR))}
    for item in told.get("may_touch", ()):
        name, obstacle = (item, "") if isinstance(item, str) else item
        shapes = solids.shapes_at(name, NEAR) | frozenset(
            g for g, owner in enumerate(solids.owner) if solids.kind[g] == "body" and owner == name
        )
        may[obstacle] = may.get(obstacle, frozenset()) | shapes
    return firm, may
