"""Fuzzing: mutated robots, task files and bundles; a `WbplanError` or success, nothing else.

Usage: python tests/fuzz [--cases 10000] [--seed 0] [--workers 2] [--only KIND[:SEED]]
"""

from __future__ import annotations

import argparse
import os
import sys

from fuzz_run import Tally, fuzz


def main() -> int:
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first case")
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--only", default="", help="KIND or KIND:SEED")
    asked = parser.parse_args()
    kind, _, seed = asked.only.partition(":")
    tally = fuzz(
        1 if seed else asked.cases, first=int(seed) if seed else asked.seed, workers=asked.workers, only=kind,
        show=sys.stderr.isatty(),
    )  # fmt: skip
    print(tally.table())
    return 1 if tally.found else 0


__all__ = ["Tally"]

if __name__ == "__main__":
    sys.exit(main())
