"""Promises about samples, joints and the base."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wbplan.bundle import Bundle
from wbplan.checks.replay import EDGE, Array, Replay
from wbplan.checks.report import Row, Tolerances, Worst

BASE_SPEED = 3.0  #: [m/s], a base that is faster has jumped: `q` is to be continuous
BASE_TURNING = 6.0  #: [rad/s]


def sampling_rows(bundle: Bundle) -> list[Row]:
    """Rows that everything else rests on: values are finite, time increases."""
    motion = bundle.trajectory
    samples = np.arange(len(motion), dtype=np.float64)
    names = [bundle.phases[i]["name"] for i in motion.phase]
    finite = Worst("values finite", "values")
    for key in ("time", "q", "v", "com"):
        broken = np.count_nonzero(~np.isfinite(getattr(motion, key).reshape(len(motion), -1)), axis=1)
        # Time itself may be what is broken: say the sample instead.
        where = f"{key}, sample {int(samples[np.argmax(broken)])}" if broken.any() else ""
        finite.see(broken, 0.0, motion.time, names, [where])
    increases = Worst("time increases", "s", at_least=True)
    increases.see(np.diff(motion.time), EDGE, motion.time[:-1], names, [""])
    return [*finite.rows(), *increases.rows()]


def rows(replay: Replay, bounds: Tolerances) -> list[Row]:
    """Sampling at `dt`, unit quaternions, joint limits, continuity, and `v` as recorded."""
    del bounds
    return [
        *_sampling(replay),
        *_unit_length(replay),
        *_positions(replay),
        *_speeds(replay),
        *_accelerations(replay),
        *_continuity(replay),
        *_velocity_record(replay),
    ]


def _sampling(replay: Replay) -> list[Row]:
    time, dt = replay.record.time, float(replay.plan["dt"])
    spacing = Worst("sample spacing", "s")
    spacing.see(np.abs(np.diff(time) - dt), EDGE, time[:-1], replay.phase_names, [""])
    edges = Worst("phase edges sampled", "s")
    for window in replay.windows:
        for key in ("start", "end"):
            edge = float(window.promises[key])
            edges.see([np.min(np.abs(time - edge))], EDGE, [edge], window.name, [key])
    return [*spacing.rows(), *edges.rows()]


def _unit_length(replay: Replay) -> list[Row]:
    q, time, model = replay.record.q, replay.record.time, replay.model
    length = Worst("unit quaternion", "")
    length.see(np.abs(np.linalg.norm(q[:, 3:7], axis=1) - 1.0), 1e-6, time, replay.phase_names, ["base"])
    for name, joint in _joints(model):
        if joint.nq == 2:  # a continuous joint, stored as its cosine and sine
            off = np.abs(np.linalg.norm(q[:, joint.idx_q : joint.idx_q + 2], axis=1) - 1.0)
            length.see(off, 1e-6, time, replay.phase_names, [name])
    return length.rows()


def _positions(replay: Replay) -> list[Row]:
    """max(lower - q, q - upper) <= 0."""
    model = replay.model
    limited = [(name, joint.idx_q) for name, joint in _joints(model) if joint.nq == 1]
    columns = [index for _, index in limited]
    values = replay.record.q[:, columns]
    excess = np.maximum(
        model.lowerPositionLimit[columns] - values, values - model.upperPositionLimit[columns]
    )
    worst = Worst("joint beyond position limit", "rad", slack=1e-9)
    names = [name for name, _ in limited]
    worst.see(excess, 0.0, replay.record.time, replay.phase_names, names, _units(model, names, ""))
    return worst.rows()


def _speeds(replay: Replay) -> list[Row]:
    """|q[k+1] - q[k]| / (t[k+1] - t[k]) - speed limit <= 0."""
    excess = np.abs(replay.step[:, 6:]) - replay.model.velocityLimit[6:]
    worst = Worst("joint beyond speed limit", "rad/s", slack=1e-6)
    names = replay.record.joint_names
    worst.see(
        excess, 0.0, replay.record.time[:-1], replay.phase_names, names, _units(replay.model, names, "/s")
    )
    return worst.rows()


def _accelerations(replay: Replay) -> list[Row]:
    """The change of velocity from one step to the next, over its duration; at both ends, from and to rest."""
    if "joint_acceleration" not in replay.plan:
        return []
    limit = np.array(replay.plan["joint_acceleration"], dtype=np.float64)
    time, names = replay.record.time, replay.record.joint_names
    duration = np.diff(time)[:, None]
    excess = np.abs(np.diff(replay.step[:, 6:], axis=0)) / duration[1:] - limit
    worst = Worst("joint beyond acceleration limit", "rad/s2", slack=1e-6)
    units = _units(replay.model, names, "/s2")
    worst.see(excess, 0.0, time[1:-1], replay.phase_names[1:], names, units)
    # A plan that was cut short says so, and ends as it moved.
    whole = not replay.plan.get("report", {}).get("incomplete")
    ends = np.array([0, -1] if whole else [0])
    moving = np.abs(replay.step[ends, 6:]) / duration[ends] - limit
    rest = Worst("joint not at rest at an end", "rad/s2", slack=1e-6)
    phases = [replay.phase_names[0], replay.phase_names[len(duration) - 1]][: len(ends)]
    rest.see(moving, 0.0, time[[0, -2]][: len(ends)], phases, names, units)
    return [*worst.rows(), *rest.rows()]


def _continuity(replay: Replay) -> list[Row]:
    """The base does not jump; a quaternion that changes its sign is a jump of `q` as well."""
    q, time = replay.record.q, replay.record.time
    duration = np.diff(time)
    speed = Worst("base speed", "m/s")
    speed.see(
        _length(np.diff(q[:, :3], axis=0)) / duration, BASE_SPEED, time[:-1], replay.phase_names, ["base"]
    )
    turning = Worst("base turning", "rad/s")  # |dQ/dt| = |omega| / 2
    rate = 2.0 * _length(np.diff(q[:, 3:7], axis=0)) / duration
    turning.see(rate, BASE_TURNING, time[:-1], replay.phase_names, ["base"])
    return [*speed.rows(), *turning.rows()]


def _velocity_record(replay: Replay) -> list[Row]:
    """The recorded v[k] leads from q[k] to q[k+1]; the last one is zero."""
    expected = np.vstack([replay.step, np.zeros((1, replay.model.nv))])
    base = ["base x", "base y", "base z", "base turn x", "base turn y", "base turn z"]
    names = [*base, *replay.record.joint_names]
    units = ["m/s"] * 3 + ["rad/s"] * 3 + _units(replay.model, replay.record.joint_names, "/s")
    worst = Worst("v agrees with q", "rad/s")
    worst.see(np.abs(replay.record.v - expected), 1e-6, replay.record.time, replay.phase_names, names, units)
    return worst.rows()


def _units(model: Any, names: Sequence[str], per: str) -> list[str]:
    """Unit of each joint's value: metres where it slides."""
    slides = [model.joints[model.getJointId(name)].shortname().startswith("JointModelP") for name in names]
    return [("m" if slide else "rad") + per for slide in slides]


def _joints(model: Any) -> list[tuple[str, Any]]:
    """Name and joint model of every joint after the free flyer."""
    return [(model.names[i], model.joints[i]) for i in range(2, model.njoints)]


def _length(rows_: Array) -> Array:
    length: Array = np.linalg.norm(rows_, axis=1)
    return length
