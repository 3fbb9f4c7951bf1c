"""A long run over random robots, stacks and targets: no crash, no NaN, no promise broken, memory flat.

Usage: python tests/soak [--ticks 1000000] [--seed 0] [--workers 2] [--episode N]
"""

from __future__ import annotations

import argparse
import os
import sys

from soak_run import soak


def main() -> int:
    parser = argparse.ArgumentParser(prog="soak", description=__doc__)
    parser.add_argument("--ticks", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--episode", type=int, help="this one only, in this process")
    asked = parser.parse_args()
    if asked.episode is not None:
        from soak_episode import run_episode

        print(run_episode(asked.seed, asked.episode))
        return 0
    report = soak(asked.ticks, seed=asked.seed, workers=asked.workers, out=sys.stderr)
    print(report.table())
    return 0 if report.clean else 1


if __name__ == "__main__":
    sys.exit(main())
