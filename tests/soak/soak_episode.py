"""One episode: a robot, some phases one after the other, some hundred ticks each, all of them watched."""

from __future__ import annotations

import random
import re
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from soak_robots import any_robot
from soak_scenes import jump, scene, start_of
from soak_watch import Watch

import wbplan as wb

LONGEST = 800  #: ticks of one phase
ENDLESS = 30.0  #: [s] of the processor's time, that a tick may take; the first ones compile
REFUSALS = 3  #: in a row, then the phase is given up


@dataclass
class Outcome:
    """What came of an episode; sums and maxima, so that outcomes can be added up.

    Attributes:
        counts: "ticks proxqp", "refused: ...", "warned" ... -> how often.
        worst: promise -> largest share of its bound that was used.
        found: what should not have happened.
        slowest: longest time of a tick that was made or refused [s].
    """

    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    found: list[str] = field(default_factory=list)
    slowest: float = 0.0

    def add(
        self, counts: dict[str, int], worst: dict[str, float], found: list[str], slowest: float = 0.0
    ) -> None:
        self.counts.update(counts)
        self.slowest = max(self.slowest, slowest)
        for promise, share in worst.items():
            self.worst[promise] = max(share, self.worst.get(promise, -np.inf))
        self.found += found

    @property
    def ticks(self) -> int:
        return sum(n for name, n in self.counts.items() if name.startswith("ticks "))


def run_episode(seed: int, number: int, *, most: int = 4 * LONGEST) -> Outcome:
    """Runs one; whatever it raises beside `WbplanError` is a finding."""
    rng = random.Random(f"soak {seed} {number}")
    out = Outcome()
    robot = any_robot(rng)
    state = start_of(rng, robot)
    q, roles, velocity, acceleration = np.array(state.q), None, None, None
    placed: dict[str, Any] = {}
    dt = rng.choice((0.001, 0.002, 0.005, 0.01, 0.02))
    for k in range(rng.randint(1, 4)):
        backend = rng.choice(("proxqp", "placo"))
        try:
            made = scene(rng, robot, robot.state(q), f"phase{k}")
            if len(made.phase.levels) > 1:
                backend = "proxqp"  # the one that has levels
            loop = wb.Loop(
                robot, made.phase, q, dt, backend=backend, placed=placed, roles=roles,
                velocity=velocity, acceleration=acceleration,
            )  # fmt: skip
        except wb.WbplanError as error:
            out.counts[f"phase refused: {kind_of(error)}"] += 1
            continue
        out.counts["phases"] += 1
        held = {h.body.name: h.T_holder_body for h in loop.compiled.held}
        polygon = loop.compiled.polygon
        region = (polygon.normals, polygon.offsets) if polygon is not None and loop.compiled.region else None
        bounds = loop.compiled.acceleration
        watch = Watch(robot, made.phase, q, dt, held, region, bounds, velocity, acceleration)
        _run_phase(rng, loop, made, watch, out, backend, min(LONGEST, most - out.ticks))
        out.add({}, watch.worst, [])
        q, roles = np.array(loop.q), loop.compiled.roles
        moves = rng.random() < 0.5
        velocity = np.array(loop.velocity) if moves else None
        acceleration = np.array(loop.acceleration) if moves else None
        if out.found or out.ticks >= most:
            break
    return out


def _run_phase(
    rng: random.Random, loop: Any, made: Any, watch: Watch, out: Outcome, backend: str, most: int
) -> None:
    refused = 0
    for _ in range(rng.randint(min(20, most), most)):
        for live, far in made.live:
            if rng.random() < 0.05:
                jump(rng, live, far)
        q, t = loop.q.copy(), loop.t
        began = time.process_time()
        try:
            tick = loop.step()
        except wb.WbplanError as error:
            out.counts[f"tick refused: {kind_of(error)}"] += 1
            if not (np.array_equal(loop.q, q) and loop.t == t):
                out.found.append(f"a refused tick moved the loop ({backend})")
            refused += 1
            if refused >= REFUSALS:
                return
            continue
        finally:
            took = time.process_time() - began
            out.slowest = max(out.slowest, took)
            if took > ENDLESS:
                out.found.append(f"a tick took {took:.1f} s ({backend}, {loop.compiled.robot.name})")
        refused = 0
        out.counts[f"ticks {backend}"] += 1
        if tick.warning:
            out.counts[f"warned: {re.split('[:(]', tick.warning)[0]}"] += 1
        if rng.random() < 0.01:
            str(tick.active)
            if not np.isfinite(list(tick.errors.values())).all():
                out.found.append(f"an error that is not finite: {dict(tick.errors)} ({backend})")
            _ask_why(rng, tick, out, backend)
        broken = watch.see(tick)
        if broken:
            out.found += [f"{what} ({backend}, {loop.compiled.robot.name})" for what in broken]
            return


def _ask_why(rng: random.Random, tick: Any, out: Outcome, backend: str) -> None:
    """What holds a task back, while the loop goes on."""
    tasks = [name.rsplit(".", 1) for name in tick.errors if not name.startswith("contact(")]
    if not tasks:
        return
    task, part = rng.choice(tasks)
    try:
        why = tick.why(task, part)
    except wb.WbplanError as error:
        out.counts[f"why refused: {kind_of(error)}"] += 1
        return
    out.counts["asked why"] += 1
    gains = [reason.gain_per_unit for reason in why.reasons]
    if not (np.isfinite(gains).all() and str(why)):
        out.found.append(f"why of '{task}' is not finite: {why} ({backend})")


def kind_of(error: wb.WbplanError) -> str:
    """The sentence of an error without its names and numbers."""
    said = re.sub(r"'[^']*'|\"[^\"]*\"", "_", str(error).splitlines()[0])
    said = re.sub(r"[-+]?\d[\d.e+-]*", "#", said)
    said = re.sub(r"\(.*", "", re.sub(r"no step keeps all of.*", "rows that clash", said))
    return f"{type(error).__name__}: {' '.join(said.split())[:90]}"
