"""A plan simulated: replayed once as it is, and as often as asked with everything a little off."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan import catalog
from wbplan.bundle import Bundle
from wbplan.errors import PhysicsError, WbplanError
from wbplan.physics.disturbance import Disturbance
from wbplan.physics.engine import version
from wbplan.physics.motion import Motion, grip_of, motion_of
from wbplan.physics.options import Options
from wbplan.physics.run import Record, run
from wbplan.physics.scene import Scene, from_mujoco, scene_of
from wbplan.physics.trials import LADDER, Progress, Spread, Survival, survey
from wbplan.physics.verdict import Measures, Verdict, judge, measure, summary
from wbplan.pictures import png
from wbplan.robot import load_robot

Array = NDArray[np.float64]
Ignored = frozenset[frozenset[str]]

REPORT, PICTURE = "physics.json", "physics.png"
SCHEMA = 1


@final
@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """What came of simulating a plan.

    Attributes:
        bundle: the plan.
        options: what was assumed.
        verdict: of the replay without disturbance (or with the one that was asked for).
        measures: the replay beside the plan, over time.
        record: the replay itself.
        motion: the plan as the simulator was given it.
        survival: of the disturbed trials; None where none were asked for.
        seconds: that the one replay took.
        collisions: where the pairs of links that may touch come from.
    """

    bundle: Bundle
    options: Options
    verdict: Verdict
    measures: Measures
    record: Record
    motion: Motion
    survival: Survival | None
    seconds: float
    collisions: str

    def __repr__(self) -> str:
        return f"Simulation({self.bundle.plan.get('task')!r}: {self.verdict})"

    @property
    def stands(self) -> bool:
        """Whether the undisturbed replay stood."""
        return self.verdict.stands

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds a second."""
        return float(self.record.time[-1] - self.record.time[0]) / max(self.seconds, 1e-9)

    def report(self) -> dict[str, Any]:
        """The content of physics.json."""
        told: dict[str, Any] = {
            "schema": SCHEMA,
            "engine": f"MuJoCo {version()}",
            "options": asdict(self.options),
            "collision_pairs": self.collisions,
            "squeeze": dict(self.motion.squeeze),
            "grip": {s.name: grip_of(s, self.motion.friction, self.options) for s in self.motion.spans},
            "seconds": self.seconds,
            "real_time_factor": self.real_time_factor,
            "verdict": asdict(self.verdict),
            "measured": summary(self.measures, self.record, self.motion),
        }
        if self.survival is not None:
            told["trials"] = _trials(self.survival)
        return told

    def save(self, folder: str | Path) -> Path:
        """Writes physics.json and physics.png into a bundle's folder; each appears whole or not at all.

        Raises:
            PhysicsError: the folder cannot be written.
        """
        from wbplan.physics.figures import figure

        target = Path(folder)
        text = json.dumps(_plain(self.report()), indent=1, allow_nan=False) + "\n"
        for name, data in ((PICTURE, png(figure(self))), (REPORT, text.encode())):
            part = target / f".{name}.{os.getpid()}.part"
            try:
                part.write_bytes(data)
                part.replace(target / name)
            except OSError as error:
                raise PhysicsError(f"{target / name}: cannot be written: {error.strerror}") from error
            finally:
                part.unlink(missing_ok=True)
        return target / REPORT

    def configurations(self, time: Array) -> Array:
        """(K, nq) simulated configurations, in Pinocchio's order, at times [s] of the plan."""
        rows = np.clip(np.searchsorted(self.record.time, time), 0, len(self.record.time) - 1)
        model = self.bundle.model
        q = np.zeros((len(rows), model.nq))
        q[:, :7] = from_mujoco(self.record.base[rows])
        for column, joint in enumerate(list(model.joints)[2:]):
            value = self.record.joints[rows, column]
            if joint.nq == 1:
                q[:, joint.idx_q] = value
            else:
                q[:, joint.idx_q], q[:, joint.idx_q + 1] = np.cos(value), np.sin(value)
        return q


def simulate(
    bundle: Bundle,
    options: Options | None = None,
    *,
    trials: int = 0,
    seed: int = 0,
    spread: Spread | None = None,
    workers: int | None = None,
    ladder: Sequence[float] = LADDER,
    disturbance: Disturbance | None = None,
    ignored: Ignored | None = None,
    folders: Sequence[str | Path] = (),
    progress: Progress | None = None,
) -> Simulation:
    """Replays a plan in MuJoCo: servos, contact, friction, free objects.

    Args:
        bundle: the plan.
        options: what is assumed.
        trials: how many more replays, with everything a little off.
        seed: of the trials.
        spread: how far off things may be in them.
        workers: processes for them; None: one for each core.
        ladder: with the trials, multiples of its spread at which each disturbance alone is tried.
        disturbance: of the first replay; None: none.
        ignored: pairs of links that may overlap; None: as the SRDF has them where the bundle's robot is a
            shipped one, else those that touch in the first pose.
        folders: where the meshes are looked for.
        progress: called with the share of the trials that is done, and what they are.

    Raises:
        PhysicsError: MuJoCo is missing, or the plan cannot be simulated.
    """
    scene, motion, options, source = _prepared(bundle, options, ignored, folders)
    effort = np.asarray(bundle.model.effortLimit[6:], dtype=np.float64)
    started = time.perf_counter()
    record = run(scene, motion, options, disturbance)
    seconds = time.perf_counter() - started
    measures = measure(record, motion, effort, options, disturbance.friction if disturbance else 1.0)
    verdict = judge(measures, record, motion, options)
    survival = None
    if trials:
        survival = survey(
            scene, motion, options, effort, trials=trials, seed=seed, spread=spread, workers=workers,
            ladder=ladder, progress=progress,
        )  # fmt: skip
    return Simulation(bundle, options, verdict, measures, record, motion, survival, seconds, source)


def _prepared(
    bundle: Bundle, options: Options | None, ignored: Ignored | None, folders: Sequence[str | Path]
) -> tuple[Scene, Motion, Options, str]:
    options = options or Options()
    source = "as given"
    if ignored is None:
        ignored, source = _shipped_pairs(bundle)
    motion = motion_of(bundle, options)
    scene = scene_of(bundle, motion, options, ignored=ignored, folders=[Path(f) for f in folders])
    return scene, motion, options, source


def _shipped_pairs(bundle: Bundle) -> tuple[Ignored | None, str]:
    """The SRDF of a shipped robot, if the bundle was planned with just that URDF."""
    name = str(bundle.plan.get("robot", ""))
    if name in catalog.robots():
        try:
            robot = load_robot(name)
        except WbplanError:
            return None, "links that do not touch at the start"
        if robot.urdf_text == bundle.urdf:
            return robot.ignored_collisions, f"SRDF of {name}"
    return None, "links that do not touch at the start"


def _trials(survival: Survival) -> dict[str, Any]:
    words = [trial.verdict.word for trial in survival.trials]
    return {
        "number": len(words),
        "seed": survival.seed,
        "spread": asdict(survival.spread),
        "survival": survival.rate,
        "interval_95": list(survival.interval),
        "verdicts": {word: words.count(word) for word in sorted(set(words))},
        "each_alone": dict(survival.ladder),
        "kills_first": list(survival.first_killers),
        "failures": [
            {"trial": t.number, "verdict": asdict(t.verdict), "disturbance": asdict(t.disturbance)}
            for t in survival.trials
            if not t.verdict.stands
        ],
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
