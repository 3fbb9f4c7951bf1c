"""Episodes shared out to processes; one that dies is a finding, and the next goes on after its episode.

A line every minute says how far it is, and every finding is said as it comes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from soak_episode import Outcome

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PATIENCE = 300.0  #: [s], an episode that takes longer hangs
EVERY = 60.0  #: [s] between two lines that say how far it is
FLAT = 60.0  #: [MB], that a process may grow by over the second half of its episodes


@dataclass
class Report:
    """What came of all episodes.

    Attributes:
        found: (episode, what).
        memory: for each process that ran, what it held after each of its episodes [MB].
    """

    total: Outcome = field(default_factory=Outcome)
    found: list[tuple[int, str]] = field(default_factory=list)
    memory: list[list[float]] = field(default_factory=list)
    episodes: int = 0
    seconds: float = 0.0

    @property
    def growth(self) -> float:
        """Most that a process's memory grew by over the second half of its episodes [MB]."""
        return max((max(m[len(m) // 2 :]) - m[len(m) // 2] for m in self.memory if len(m) > 3), default=0.0)

    @property
    def clean(self) -> bool:
        return not self.found and self.growth < FLAT

    def table(self) -> str:
        lines = [f"{self.total.ticks} ticks in {self.episodes} episodes, {self.seconds:.0f} s"]
        lines += [f"  {n:>9} {name}" for name, n in sorted(self.total.counts.items())]
        lines.append(f"slowest tick: {self.total.slowest:.3f} s")
        lines.append("promises, the largest share of each bound that was used:")
        lines += [f"  {share:>9.3f} {promise}" for promise, share in sorted(self.total.worst.items())]
        peaks = ", ".join(f"{m[len(m) // 2]:.0f} to {m[-1]:.0f}" for m in self.memory if m)
        lines.append(f"memory half way and at the end [MB]: {peaks}; growth {self.growth:.1f}")
        lines += [f"FOUND episode {number}: {what}" for number, what in self.found[:40]]
        lines.append(f"{len(self.found)} findings")
        return "\n".join(lines)


class Progress:
    """Says how far a run is: to a terminal in one line that changes, elsewhere in a line every minute."""

    def __init__(self, ticks: int, out: TextIO) -> None:
        self.ticks, self.out, self.terminal = ticks, out, out.isatty()
        self.started = self.last = time.perf_counter()

    def __call__(self, report: Report) -> None:
        now = time.perf_counter()
        if now - self.last < (0.5 if self.terminal else EVERY):
            return
        self.last, done = now, report.total.ticks
        rate = done / (now - self.started)
        told = f"{done} of {self.ticks} ticks, {rate:.0f} a second, {len(report.found)} findings"
        print(f"\r{told} " if self.terminal else told, end="" if self.terminal else "\n", file=self.out)
        self.out.flush()

    def found(self, number: int, what: str) -> None:
        line_ends = "\n" if self.terminal else ""
        print(f"{line_ends}FOUND episode {number}: {what}", file=self.out, flush=True)


def soak(ticks: int, *, seed: int = 0, workers: int = 1, out: TextIO | None = None) -> Report:
    """Run at least as many ticks; `out` is told how far it is."""
    report, lock, started = Report(), threading.Lock(), time.perf_counter()
    progress = None if out is None else Progress(ticks, out)

    def finds(number: int, found: list[str]) -> None:
        report.found += [(number, what) for what in found]
        for what in found if progress else ():
            progress.found(number, what)

    def serve(first: int) -> None:
        left, number = ticks // workers, first
        while left > 0:
            memory: list[float] = []
            with lock:
                report.memory.append(memory)
            with _process(seed, number, workers, left) as process:
                timer = threading.Timer(PATIENCE, process.kill)
                timer.start()
                assert process.stdout is not None
                for line in process.stdout:
                    timer.cancel()
                    timer = threading.Timer(PATIENCE, process.kill)
                    timer.start()
                    said = json.loads(line)
                    number = said.get("begin", number)
                    if "end" not in said:
                        continue
                    number = said["end"] + workers
                    memory.append(said["rss"])
                    with lock:
                        before = report.total.ticks
                        report.total.add(said["counts"], said["worst"], [], said["slowest"])
                        finds(said["end"], said["found"])
                        report.episodes += 1
                        left -= max(report.total.ticks - before, 1)
                        if progress:
                            progress(report)
                timer.cancel()
                code = process.wait()
            if code:
                with lock:
                    finds(number, [f"the process ended with code {code}"])
                number, left = number + workers, left - 1

    threads = [threading.Thread(target=serve, args=(k,)) for k in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    report.seconds = time.perf_counter() - started
    return report


def _process(seed: int, first: int, step: int, ticks: int) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(ROOT), str(HERE), os.environ.get("PYTHONPATH", "")])
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return subprocess.Popen(
        [sys.executable, str(HERE / "soak_worker.py"), *map(str, (seed, first, step, ticks))],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, **threads, "PYTHONPATH": paths},
    )
