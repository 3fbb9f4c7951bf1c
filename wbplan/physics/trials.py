"""Many replays with everything a little off: how many stand, and what fells the others first."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np

from wbplan.errors import PhysicsError
from wbplan.physics.disturbance import Disturbance, Push
from wbplan.physics.motion import Motion
from wbplan.physics.options import Options
from wbplan.physics.run import run
from wbplan.physics.scene import Scene
from wbplan.physics.verdict import Verdict, judge, measure

Progress = Callable[[float, str], None]

Z95 = 1.959963984540054  #: of the normal distribution, for 95 %


@final
@dataclass(frozen=True)
class Spread:
    """How far off everything may be: half the width of an even draw, or the size of a drawn direction.

    Attributes:
        mass: share of the links' mass.
        com: [m], of the base's centre of mass, in any direction.
        object_mass: share of the objects' mass.
        object_com: [m], likewise.
        friction: share of all friction.
        gain: share of the servos' stiffness.
        latency: [s], drawn from 0 up.
        tilt: [rad] of the ground, drawn from 0 up, in any direction.
        push: [N s] on the base, drawn from 0 up, level, in any direction, at any time.
    """

    mass: float = 0.05
    com: float = 0.01
    object_mass: float = 0.1
    object_com: float = 0.01
    friction: float = 0.2
    gain: float = 0.2
    latency: float = 0.03
    tilt: float = 0.03
    push: float = 1.0


KINDS: tuple[str, ...] = tuple(Spread.__dataclass_fields__)
LADDER = (0.5, 1.0, 2.0, 4.0)  #: multiples of its spread at which each kind alone is tried
RUNGS = 2  #: draws on each step of the ladder


@final
@dataclass(frozen=True)
class Trial:
    """One disturbed replay.

    Attributes:
        number: from 0.
        disturbance: what was off.
        verdict: what came of it.
    """

    number: int
    disturbance: Disturbance
    verdict: Verdict


@final
@dataclass(frozen=True)
class Survival:
    """What came of all trials.

    Attributes:
        trials: in the order of their numbers.
        seed: they were drawn with.
        spread: they were drawn from.
        ladder: kind -> the smallest multiple of its spread at which it alone fells the plan; None: none did.
        interval: 95 % confidence interval of the survival rate (Wilson).
    """

    trials: tuple[Trial, ...]
    seed: int
    spread: Spread
    ladder: dict[str, float | None] = field(default_factory=dict)

    @property
    def stood(self) -> int:
        """How many stood."""
        return sum(trial.verdict.stands for trial in self.trials)

    @property
    def rate(self) -> float:
        """Share that stood."""
        return self.stood / len(self.trials)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the survival rate."""
        return wilson(self.stood, len(self.trials))

    @property
    def first_killers(self) -> tuple[str, ...]:
        """The kinds that alone fell the plan at the smallest multiple of their spread."""
        felled = {kind: step for kind, step in self.ladder.items() if step is not None}
        least = min(felled.values(), default=None)
        return tuple(kind for kind, step in felled.items() if step == least)


def wilson(good: int, n: int) -> tuple[float, float]:
    """95 % confidence interval (Wilson's score) of a share of `good` in `n`.

    (p + z^2/2n -+ z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n)
    """
    if n < 1 or not 0 <= good <= n:
        raise PhysicsError(f"trials: expected one or more and 0 to all good, got {good} of {n}")
    p, z2 = good / n, Z95 * Z95
    middle, half = p + z2 / (2 * n), Z95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
    low, high = (middle - half) / (1 + z2 / n), (middle + half) / (1 + z2 / n)
    return (0.0 if good == 0 else float(low)), (1.0 if good == n else float(high))


def draw(
    seed: int, number: int, spread: Spread, duration: float, kinds: Sequence[str] = KINDS, scale: float = 1.0
) -> Disturbance:
    """The disturbance of one trial; it depends on nothing but the arguments.

    Args:
        seed: of the whole survey.
        number: of the trial.
        spread: how far off everything may be.
        duration: of the plan [s], in which the push comes.
        kinds: what is off; the rest is as planned.
        scale: multiple of the spread.
    """
    random = np.random.default_rng(np.random.SeedSequence([seed, number]))
    even = {kind: float(random.uniform(-1.0, 1.0)) for kind in KINDS}
    ways = random.normal(size=(4, 3))
    ways[2:, 2] = 0.0  # tilt and push are level
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    when = float(random.uniform(0.0, max(duration - 0.5, 0.0)))
    size = {kind: scale * getattr(spread, kind) if kind in kinds else 0.0 for kind in KINDS}

    def way(row: int, kind: str) -> Any:
        return tuple(float(x) for x in ways[row] * size[kind] * abs(even[kind]))

    impulse = way(3, "push")
    return Disturbance(
        mass=max(1.0 + size["mass"] * even["mass"], 0.05),
        com=way(0, "com"),
        object_mass=max(1.0 + size["object_mass"] * even["object_mass"], 0.05),
        object_com=way(1, "object_com"),
        friction=max(1.0 + size["friction"] * even["friction"], 0.02),
        gain=max(1.0 + size["gain"] * even["gain"], 0.02),
        latency=size["latency"] * abs(even["latency"]),
        tilt=way(2, "tilt")[:2],
        pushes=(Push(when, (impulse[0] / 0.1, impulse[1] / 0.1, 0.0), 0.1),) if any(impulse) else (),
    )


def survey(
    scene: Scene,
    motion: Motion,
    options: Options,
    effort: Any,
    *,
    trials: int,
    seed: int = 0,
    spread: Spread | None = None,
    workers: int | None = None,
    ladder: Sequence[float] = LADDER,
    progress: Progress | None = None,
) -> Survival:
    """Replays a plan many times, each time with everything a little off.

    Args:
        scene: the world.
        motion: the plan.
        options: what is assumed.
        effort: (J,) the servos' limits.
        trials: how many.
        seed: of the draws; a trial depends on it and on its number only, never on the workers.
        spread: how far off things may be.
        workers: processes; None: as many as there are cores, 1: none but this one.
        ladder: multiples of its spread at which each kind alone is tried, until it fells the plan.
        progress: called with the share that is done, and what it was.

    Raises:
        PhysicsError: no trials were asked for.
    """
    if trials < 1:
        raise PhysicsError(f"trials: expected one or more, got {trials}")
    if seed < 0:
        raise PhysicsError(f"seed: expected 0 or more, got {seed}")
    spread = spread or Spread()
    job = _Job(scene, motion, options, effort)
    numbers = range(trials)
    draws = [draw(seed, n, spread, motion.duration) for n in numbers]
    verdicts = _all(job, draws, workers, progress, "trials")
    done = tuple(Trial(n, off, verdict) for n, off, verdict in zip(numbers, draws, verdicts, strict=True))
    felled: dict[str, float | None] = {}
    if ladder:
        felled = _climb(job, seed, spread, motion, ladder, workers, progress)
    return Survival(done, seed, spread, felled)


def _climb(
    job: _Job,
    seed: int,
    spread: Spread,
    motion: Motion,
    ladder: Sequence[float],
    workers: int | None,
    progress: Progress | None,
) -> dict[str, float | None]:
    """Each kind alone at full size, in drawn directions, one multiple after the other."""
    kinds = [kind for kind in KINDS if motion.objects or not kind.startswith("object")]
    felled: dict[str, float | None] = dict.fromkeys(kinds)
    for step in sorted(ladder):
        left = [kind for kind in kinds if felled[kind] is None]
        draws = [
            _full(draw(seed, 1_000_000 + r, spread, motion.duration, (kind,), step), kind, r, spread, step)
            for kind in left
            for r in range(RUNGS)
        ]
        verdicts = _all(job, draws, workers, progress, f"each alone, {step:g} times")
        for i, kind in enumerate(left):
            if not all(v.stands for v in verdicts[RUNGS * i : RUNGS * (i + 1)]):
                felled[kind] = step
    return felled


def _full(off: Disturbance, kind: str, rung: int, spread: Spread, step: float) -> Disturbance:
    """A draw at the end of its range: the drawn direction, or one of the two signs, at full size."""
    size, sign = step * float(getattr(spread, kind)), (-1.0, 1.0)[rung % 2]
    changed: Any
    if kind in ("mass", "object_mass", "friction", "gain"):
        changed = max(1.0 + sign * size, 0.02)
    elif kind == "latency":
        changed = size
    elif kind == "push":
        push = off.pushes[0]
        kind, changed = "pushes", (replace(push, force=_scaled(push.force, size / push.seconds)),)
    else:
        changed = _scaled(getattr(off, kind), size)
    return replace(off, **{kind: changed})


def _scaled(vector: Sequence[float], size: float) -> Any:
    """The vector, as long as told."""
    values = np.array(vector)
    return tuple(float(x) for x in values / np.linalg.norm(values) * size)


@final
@dataclass(frozen=True, eq=False)
class _Job:
    """What every worker gets once."""

    scene: Scene
    motion: Motion
    options: Options
    effort: Any

    def verdict(self, off: Disturbance) -> Verdict:
        record = run(self.scene, self.motion, self.options, off)
        found = measure(record, self.motion, self.effort, self.options, off.friction)
        return judge(found, record, self.motion, self.options)


_job: _Job | None = None


def _begin(job: _Job) -> None:
    global _job  # a worker process has one job for its whole life
    _job = job


def _work(number: int, off: Disturbance) -> tuple[int, Verdict]:
    if _job is None:
        raise RuntimeError("a worker without a job")
    return number, _job.verdict(off)


def _all(
    job: _Job, draws: Sequence[Disturbance], workers: int | None, progress: Progress | None, what: str
) -> list[Verdict]:
    verdicts: dict[int, Verdict] = {}
    for number, verdict in _results(job, draws, workers):
        verdicts[number] = verdict
        if progress is not None:
            progress(len(verdicts) / len(draws), what)
    return [verdicts[n] for n in range(len(draws))]


def _results(
    job: _Job, draws: Sequence[Disturbance], workers: int | None
) -> Iterator[tuple[int, Verdict]] | Iterable[tuple[int, Verdict]]:
    count = min(workers or multiprocessing.cpu_count(), len(draws))
    if count <= 1:
        yield from ((n, job.verdict(off)) for n, off in enumerate(draws))
        return
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of linear algebra
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(job,))
    try:
        for future in as_completed([pool.submit(_work, n, off) for n, off in enumerate(draws)]):
            yield future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
