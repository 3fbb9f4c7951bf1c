"""A process that runs cases one by one and says which, before and after: if it dies, the case is known.

Usage: fuzz_worker.py SCRATCH, then "kind seed" a line on stdin.
"""

from __future__ import annotations

import os
import resource
import shutil
import sys
import time
import traceback
import warnings
from pathlib import Path

from fuzz_cases import run_case

MEMORY = 6 << 30  #: [bytes] of address space: who asks for more gets a MemoryError
GROWTH = 1 << 20  #: [kB], the most that one case may add to the process's peak

ROOT = Path(__file__).resolve().parents[2]


def place(error: BaseException) -> str:
    """Kind of an exception and the last line of this project that it passed."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename.startswith(str(ROOT)) and "/fuzz/" not in f.filename] or frames[
        -1:
    ]
    last = own[-1]
    said = " ".join(str(error).split())[:160]
    return f"{type(error).__name__} in {Path(last.filename).name}:{last.name}: {said}"


def main(scratch: Path) -> None:
    out = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)  # task files print, parsers complain
    os.dup2(quiet, 2)
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most))
    warnings.simplefilter("error")  # a warning that leaks out is a finding too
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    warnings.filterwarnings("ignore", category=SyntaxWarning)  # of a mutated task's own text
    out.write("ready\n")
    for line in sys.stdin:
        kind, seed = line.split()
        folder = scratch / "case"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        out.write(f"begin {kind} {seed}\n")
        before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
        try:
            verdict = run_case(kind, int(seed), folder)
        except Exception as error:
            verdict = f"FOUND {place(error)}"
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        if grown > GROWTH:
            verdict = f"FOUND memory grew by {grown // 1024} MB, then {verdict}"
        out.write(f"end {time.perf_counter() - started:.3f} {verdict}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
