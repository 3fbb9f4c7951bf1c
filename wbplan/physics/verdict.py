"""What a replay measured, in figures, and what it comes to: stands, slips, drops or falls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.physics.motion import Motion
from wbplan.physics.options import Options
from wbplan.physics.run import LOADED, Record
from wbplan.physics.scene import from_mujoco

Array = NDArray[np.float64]
Word = Literal["stands", "slips", "drops", "falls"]

LIFTED = 0.1  #: a foot off the ground for longer than this [s], though it should stand, has lifted off
SATURATED = 0.999  #: share of the effort from which a servo counts as saturated


@final
@dataclass(frozen=True)
class Verdict:
    """What a replay comes to.

    Attributes:
        word: "stands", "slips", "drops" or "falls".
        time: [s] of the plan when it happened; None where it stands.
        phase: the phase it happened in.
        cause: what happened, with its figures; and what came before it.
    """

    word: Word
    time: float | None = None
    phase: str = ""
    cause: str = ""

    @property
    def stands(self) -> bool:
        """Whether nothing happened."""
        return self.word == "stands"

    def __str__(self) -> str:
        if self.stands:
            return "stands"
        return f"{self.word} at {self.time:.2f} s, in phase '{self.phase}': {self.cause}"


@final
@dataclass(frozen=True, eq=False)
class Measures:
    """The replay beside the plan; K steps from the plan's start on.

    Attributes:
        time: (K,) [s].
        position: (K, 3) [m], base, simulated less planned, world.
        rotation: (K, 3) [rad], rotation vector of the base likewise.
        tilt: (K,) [rad], angle between the two bases' vertical axes.
        joints: (K, J) [rad, m], simulated less planned.
        load: (K, J) servo force as a share of its effort.
        normal: (K, C) [N] on each foot.
        slip: (K, C) [m], how far each foot has slid since it was put down.
        use: (K, C), tangential force as a share of what friction allows; 0 in the air.
        lifted: (K, C) [s], for how long a foot that should stand has been in the air.
        drift: object -> (K,) [m] from its planned place while carried and after; nan before.
        turn: object -> (K,) [rad] likewise.
        collision: (K,) [N], the largest force between two links.
    """

    time: Array
    position: Array
    rotation: Array
    tilt: Array
    joints: Array
    load: Array
    normal: Array
    slip: Array
    use: Array
    lifted: Array
    drift: Mapping[str, Array]
    turn: Mapping[str, Array]
    collision: Array


def measure(
    record: Record, motion: Motion, effort: Array, options: Options, friction: float = 1.0
) -> Measures:
    """Compares a replay with its plan.

    Args:
        record: the replay.
        motion: the plan.
        effort: (J,) the servos' limits [N m, N].
        options: what was assumed.
        friction: factor on the planned friction that this replay had.
    """
    from_start = record.time >= -1e-9
    time = record.time[from_start]
    sample = np.clip(np.searchsorted(motion.time, time + 1e-9, side="right") - 1, 0, len(motion.time) - 1)
    joints = record.joints[from_start] - _between(motion.joints, motion.time, time)
    position = record.base[from_start, :3] - _between(motion.base[:, :3], motion.time, time)
    planned = _matrices(motion.base[:, 3:])[sample]
    simulated = _matrices(from_mujoco(record.base)[from_start, 3:])
    rotation = _logs(simulated @ np.swapaxes(planned, 1, 2))
    cosine = np.einsum("ki,ki->k", simulated[:, :, 2], planned[:, :, 2])
    touching = motion.touching[sample]
    normal = record.normal[from_start]
    limit = np.maximum(motion.friction[sample] * friction, 1e-9) * np.maximum(normal, 1e-9)
    use = np.where(touching & (normal > 2.0), record.tangent[from_start] / limit, 0.0)
    drift, turn = _objects(record, motion, from_start, sample)
    return Measures(
        time=time, position=position, rotation=rotation, tilt=np.arccos(np.clip(cosine, -1.0, 1.0)),
        joints=joints, load=np.abs(record.torque[from_start]) / effort, normal=normal,
        slip=_slips(record.slide[from_start], touching, options.dt), use=use,
        lifted=_lifted(normal, touching, options.dt), drift=drift, turn=turn,
        collision=record.collision[from_start],
    )  # fmt: skip


def judge(m: Measures, record: Record, motion: Motion, options: Options) -> Verdict:
    """The first thing that went wrong for good; a fall counts before a drop, a drop before a slip.

    A fall takes what is carried with it, and a drop may come of a slip: the cause tells what came before.
    """
    bounds = options.bounds
    fallen = (m.tilt > bounds.tilt) | (m.position[:, 2] < -bounds.sink) | ~np.isfinite(m.tilt)
    events: list[tuple[int, Word, str]] = []
    if fallen.any() or not record.finished:
        k = int(np.argmax(fallen)) if fallen.any() else len(m.time) - 1
        how = f"the base is {np.degrees(m.tilt[k]):.0f} deg and {1e3 * m.position[k, 2]:.0f} mm off its plan"
        events.append((k, "falls", how))
    for name, drift in m.drift.items():
        off = (drift > bounds.drift) | (m.turn[name] > bounds.turn)
        if off.any():
            k = int(np.argmax(off))
            how = (
                f"'{name}' is {1e3 * drift[k]:.0f} mm and {np.degrees(m.turn[name][k]):.0f} deg off its plan"
            )
            events.append((k, "drops", how))
    slid = m.slip > bounds.slip
    if slid.any():
        k = int(np.argmax(slid.any(axis=1)))
        foot = int(np.argmax(m.slip[k]))
        events.append((k, "slips", f"{motion.feet[foot]} has slid {1e3 * m.slip[k, foot]:.0f} mm"))
    if not events:
        return Verdict("stands")
    order = ("falls", "drops", "slips")
    k, word, how = min(events, key=lambda event: (order.index(event[1]), event[0]))
    before = [f"{other} before, {text} at {m.time[j]:.2f} s" for j, other, text in events if j < k]
    before += _signs(m, motion, k)
    phase = motion.phases[int(motion.phase[motion.sample(float(m.time[k]))])]
    return Verdict(word, float(m.time[k]), phase, "; ".join([how, *before]))


def _signs(m: Measures, motion: Motion, k: int) -> list[str]:
    """What was at its limit in the second before."""
    window = slice(int(max(0, np.searchsorted(m.time, m.time[k] - 1.0))), k + 1)
    signs = []
    load = (m.load[window] > SATURATED).mean(axis=0)
    if load.max(initial=0.0) > 0.2:
        names = [motion.names[j] for j in np.argsort(-load)[:3] if load[j] > 0.2]
        signs.append(f"servos saturated: {', '.join(names)}")
    lifted = m.lifted[window].max(axis=0)
    if lifted.max(initial=0.0) > LIFTED:
        names = [motion.feet[i] for i in np.flatnonzero(lifted > LIFTED)]
        signs.append(f"off the ground: {', '.join(names)}")
    use = m.use[window].max(axis=0)
    if use.max(initial=0.0) > 0.98:
        names = [motion.feet[i] for i in np.flatnonzero(use > 0.98)]
        signs.append(f"friction used up: {', '.join(names)}")
    if m.collision[window].max(initial=0.0) > LOADED:
        signs.append("links touch each other")
    return signs


def summary(m: Measures, record: Record, motion: Motion) -> dict[str, Any]:
    """The worst of everything, with its time and place, for physics.json."""

    def worst(values: Array, names: tuple[str, ...] = ()) -> dict[str, Any]:
        flat = np.nan_to_num(values, nan=0.0)
        if not flat.size:
            return {"worst": 0.0, "time": None}
        k = np.unravel_index(int(np.argmax(flat)), flat.shape)
        row: dict[str, Any] = {"worst": float(flat[k]), "time": float(m.time[k[0]])}
        if names:
            row["where"] = names[int(k[1])]
        return row

    touching = np.array([motion.touching[motion.sample(t)] for t in m.time[:: max(1, len(m.time) // 2000)]])
    loaded = m.normal[:: max(1, len(m.time) // 2000)] > LOADED
    result: dict[str, Any] = {
        "base_position": worst(np.linalg.norm(m.position, axis=1)),
        "base_rotation": worst(np.linalg.norm(m.rotation, axis=1)),
        "tilt": worst(m.tilt),
        "joint_error": worst(np.abs(m.joints), motion.names),
        "torque": worst(m.load, motion.names),
        "saturated": {
            name: float(share)
            for name, share in zip(motion.names, (m.load > SATURATED).mean(axis=0), strict=True)
            if share > 0.0
        },
        "foot_slip": worst(m.slip, motion.feet),
        "friction_use": worst(m.use, motion.feet),
        "lift_off": worst(m.lifted, motion.feet),
        "off_schedule": float((touching != loaded).mean()),
        "normal_force": worst(m.normal, motion.feet),
        "self_collision": {**worst(m.collision), "links": record.links[0]},
        "strayed": record.links[1],
        "objects": {name: {"drift": worst(m.drift[name]), "turn": worst(m.turn[name])} for name in m.drift},
        "pads": {pad: float(force.max(initial=0.0)) for pad, force in record.pads.items()},
    }
    return result


def _between(values: Array, known: Array, time: Array) -> Array:
    return np.column_stack([np.interp(time, known, column) for column in values.T])


def _matrices(quaternions: Array) -> Array:
    """(K, 4) x y z w -> (K, 3, 3)."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _logs(rotations: Array) -> Array:
    """(K, 3, 3) -> (K, 3) rotation vectors."""
    return np.array([pin.log3(R) for R in rotations]).reshape(-1, 3)


def _slips(slide: Array, touching: NDArray[np.bool_], dt: float) -> Array:
    """(K, C) length of what each foot's sliding adds up to since it last was put down."""
    total = np.cumsum(np.where(touching[..., None], slide, 0.0), axis=0) * dt
    down = touching & ~np.vstack([np.zeros((1, touching.shape[1]), dtype=bool), touching[:-1]])
    slips = np.zeros(touching.shape)
    for i in range(touching.shape[1]):
        first = np.maximum.accumulate(np.where(down[:, i], np.arange(len(slide)), 0))
        slips[:, i] = np.linalg.norm(total[:, i] - total[first, i], axis=1)
    return np.where(touching, slips, 0.0)


def _lifted(normal: Array, touching: NDArray[np.bool_], dt: float) -> Array:
    """(K, C) [s] since a foot that should stand last touched the ground."""
    air = touching & (normal < LOADED)
    steps = np.arange(len(normal))[:, None]
    last = np.maximum.accumulate(np.where(air, -1, steps), axis=0)
    return np.where(air, (steps - last) * dt, 0.0)


def _objects(
    record: Record, motion: Motion, from_start: NDArray[np.bool_], sample: NDArray[np.int64]
) -> tuple[dict[str, Array], dict[str, Array]]:
    drifts, turns = {}, {}
    for name, poses in record.objects.items():
        begins = min((span.start for span in motion.spans if span.name == name), default=np.inf)
        counts = record.time[from_start] >= begins
        planned, simulated = motion.objects[name][sample], from_mujoco(poses)[from_start]
        drifts[name] = np.where(counts, np.linalg.norm(simulated[:, :3] - planned[:, :3], axis=1), np.nan)
        dots = np.abs(np.einsum("ki,ki->k", simulated[:, 3:], planned[:, 3:]))
        turns[name] = np.where(counts, 2.0 * np.arccos(np.clip(dots, 0.0, 1.0)), np.nan)
    return drifts, turns
