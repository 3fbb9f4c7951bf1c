"""A process that runs episodes first, first + step, ... and says a JSON line before and after each.

Usage: soak_worker.py SEED FIRST STEP TICKS
"""

from __future__ import annotations

import gc
import json
import os
import resource
import sys
import traceback
import warnings
from pathlib import Path

from soak_episode import Outcome, run_episode


def resident() -> float:
    """Memory that this process holds now [MB]."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:  # not Linux: the peak will have to do
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def main(seed: int, first: int, step: int, ticks: int) -> None:
    out = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    number = first
    while ticks > 0:
        out.write(json.dumps({"begin": number}) + "\n")
        try:
            outcome = run_episode(seed, number)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(last.filename).name}:{last.lineno}"
            outcome = Outcome(
                found=[f"{type(error).__name__} at {where}: {' '.join(str(error).split())[:200]}"]
            )
        ticks -= max(outcome.ticks, 1)
        if number % 20 == first % 20:
            gc.collect()
        out.write(json.dumps({"end": number, **vars(outcome), "rss": resident()}) + "\n")
        number += step


if __name__ == "__main__":
    main(*map(int, sys.argv[1:5]))
