"""Mutations of an npz file: arrays that are missing, misshapen, of another type, or full of nonsense."""

from __future__ import annotations

import contextlib
import io
import random
from typing import Any

import numpy as np
from fuzz_text import chance, scarred

VALUES = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 1e-320, 1e6, 0.1)
DTYPES = ("f2", "f4", ">f8", "i1", "i4", "u8", "c16", "U3", "S4", "?", "M8[s]", "m8[s]", "g", "O")
KEYS = (
    "time", "q", "v", "phase", "com", "margin", "joint_names", "body_", "body_x", "target_", "error_",
    "error_x.joints", "force_leg1_foot", "torque", "x", "", "../x", "\u00e9", "body_a/b", "target_base",
)  # fmt: skip


def mutate_npz(rng: random.Random, arrays: dict[str, Any]) -> bytes:
    arrays = dict(arrays)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        _change(rng, arrays)
    file = io.BytesIO()
    try:
        save = np.savez_compressed if chance(rng, 0.5) else np.savez
        save(file, allow_pickle=True, **arrays)
    except (ValueError, TypeError, UnicodeError):
        return b""
    data = file.getvalue()
    return scarred(rng, data) if chance(rng, 0.08) else data


def _change(rng: random.Random, arrays: dict[str, Any]) -> None:
    if not arrays:
        return
    key = rng.choice(list(arrays))
    array = np.asarray(arrays[key])
    kind = rng.randrange(11)
    if kind == 0:
        del arrays[key]
    elif kind == 1:
        arrays[rng.choice(KEYS)] = array
    elif kind == 2:
        arrays[key] = arrays[rng.choice(list(arrays))]
    elif kind == 3:
        arrays[key] = _retyped(rng, array)
    elif kind == 4:
        arrays[key] = _reshaped(rng, array)
    elif kind == 5:  # the same rows cut off everywhere: shapes still agree
        keep = rng.choice([0, 1, 2, 3, len(array) // 2 if array.ndim else 0])
        for name in [n for n in arrays if n != "joint_names"]:
            if np.ndim(arrays[name]):
                arrays[name] = arrays[name][:keep]
    elif kind == 6 and array.size and array.dtype.kind == "U":
        names = array.copy()
        names[rng.randrange(len(names))] = rng.choice(["", "x", "\u00e9", *names.tolist()])
        arrays[key] = names
    elif array.size and array.dtype.kind in "fi" and array.ndim:
        arrays[key] = _revalued(rng, array)


def _retyped(rng: random.Random, array: Any) -> Any:
    kind = rng.choice(DTYPES)
    try:
        with np.errstate(all="ignore"):
            return array.astype(kind)
    except (ValueError, TypeError, RuntimeError):
        return np.zeros(array.shape, dtype="f4")


def _reshaped(rng: random.Random, array: Any) -> Any:
    choices = [
        array.T, array[None], array.ravel(), array[..., None], np.zeros(0), np.zeros(()),
        np.zeros((0, 3)), np.zeros((2, 2, 2)), np.asfortranarray(array),
        np.zeros((1_000_000,)), np.zeros((3, 0)),
    ]  # fmt: skip
    if array.ndim:
        choices += [array[:0], array[:-1], array[1:], array[::-1], np.concatenate([array, array[-1:]])]
    if array.ndim > 1:
        choices += [array[:, :-1], array[:, ::-1], np.hstack([array, array[:, :1]])]
    return rng.choice(choices)


def _revalued(rng: random.Random, array: Any) -> Any:
    array = array.copy()
    value: Any = rng.choice(VALUES)
    if array.dtype.kind == "i":
        value = rng.choice((-1, 0, 7, 2**31, -(2**63), 2**63 - 1))
    where: Any = rng.choice((rng.randrange(len(array)), slice(None), slice(rng.randrange(len(array)), None)))
    if array.ndim > 1 and chance(rng, 0.7):
        where = (where, rng.choice((rng.randrange(array.shape[1]), slice(3, 7))))
    if chance(rng, 0.3) and array.dtype.kind == "f":
        with np.errstate(all="ignore"):
            array[where] = array[where] * value
    else:
        with np.errstate(all="ignore"), contextlib.suppress(OverflowError):  # of 32 bits
            array[where] = value
    return array
