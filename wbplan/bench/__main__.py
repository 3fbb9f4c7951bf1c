"""`python -m wbplan.bench`: see the package."""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from rich.console import Console

from wbplan.bench.breakdown import breakdown_table
from wbplan.bench.clearance import clearance_text
from wbplan.bench.forces import forces_table
from wbplan.bench.levels import levels_text
from wbplan.bench.race import COLD, ROUND, race
from wbplan.bench.report import Row, rows_of, table_of, write_json
from wbplan.bench.scenes import DT, SCENES
from wbplan.bench.solvers import make_solvers, pink_is_installed
from wbplan.errors import WbplanError

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def main(args: Sequence[str] | None = None) -> int:
    """Runs the bench.

    Args:
        args: without the program's name; those of the process where `None`.

    Returns:
        0; 1 where a solver did not do the same work as the others; 2 on bad usage.
    """
    options = _options(args)
    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False, markup=False)
    rows: list[Row] = []
    same_work = True
    try:
        for name in options.stack or SCENES:
            scene = SCENES[name](options.ticks)
            if options.profile:
                console.print(breakdown_table(scene))
                continue
            solvers, missing = make_solvers(scene)
            laps = race(scene, solvers)
            console.print(table_of(name, laps, missing))
            console.print(levels_text(scene))
            console.print(clearance_text(scene))
            console.print()
            rows += rows_of(name, laps)
            same_work &= not any(lap.faults for lap in laps)
        if not options.profile:
            console.print(forces_table())
            console.print()
        console.print(_circumstances(options.ticks))
        if rows:
            write_json(rows, options.out)
            console.print(f"written to {options.out}")
    except WbplanError as error:
        print(f"wbplan.bench: {error}", file=sys.stderr)
        return 2
    return 0 if same_work else 1


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser("python -m wbplan.bench", description="The tick beside its peers.")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="file for the numbers")
    parser.add_argument("--ticks", type=_count, default=2000, help="ticks that count, per solver (2000)")
    parser.add_argument(
        "--stack", action="append", choices=tuple(SCENES), help="only this one; may be repeated"
    )
    parser.add_argument("--profile", action="store_true", help="show where wbplan's own tick goes, instead")
    return parser.parse_args(args)


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {count}")
    return count


def _circumstances(ticks: int) -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("pin", "placo", "proxsuite", "numpy"))
    pink = f", pin-pink {version('pin-pink')}" if pink_is_installed() else ""
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return (
        f"{ticks} ticks of {DT:g} s for each, in rounds of {ROUND} of which the first {COLD} do not count; "
        f"one thread, wall clock; {load}; "
        f"Python {platform.python_version()}, {packages}{pink}"
    )


def _one_thread() -> None:
    """Starts over where the libraries, loaded by now, were allowed threads."""
    if any(os.environ.get(name) != "1" for name in THREADS):
        os.execve(sys.executable, sys.orig_argv, {**os.environ, **dict.fromkeys(THREADS, "1")})


if __name__ == "__main__":
    _one_thread()
    sys.exit(main())
