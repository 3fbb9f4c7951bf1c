"""Cases shared out to worker processes; one that crashes, hangs or swallows memory is named and replaced."""

from __future__ import annotations

import contextlib
import os
import queue
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PATIENCE = 180.0  #: [s], a case that takes longer hangs; the first one compiles
KINDS = {"urdf": 0.3, "srdf": 0.2, "task": 0.2, "bundle": 0.3}

Case = tuple[str, int]


@dataclass
class Tally:
    """What came of the cases.

    Attributes:
        counts: (kind, verdict) -> how many.
        found: what should not have happened -> cases.
        slowest: (seconds, case).
    """

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    found: dict[str, list[Case]] = field(default_factory=dict)
    slowest: tuple[float, Case] = (0.0, ("", 0))

    def take(self, case: Case, verdict: str, seconds: float) -> None:
        if verdict.startswith("FOUND "):
            self.found.setdefault(verdict.removeprefix("FOUND "), []).append(case)
            verdict = "FOUND"
        self.counts[case[0], verdict] += 1
        self.slowest = max(self.slowest, (seconds, case))

    def table(self) -> str:
        lines = []
        for kind in KINDS:
            its = {verdict: n for (k, verdict), n in sorted(self.counts.items()) if k == kind}
            if its:
                told = ", ".join(f"{verdict} {n}" for verdict, n in its.items())
                lines.append(f"{kind:<7} {sum(its.values()):>6} cases: {told}")
        seconds, (kind, seed) = self.slowest
        lines.append(
            f"all     {sum(self.counts.values()):>6} cases; the slowest took {seconds:.1f} s ({kind}:{seed})"
        )
        for what, cases in sorted(self.found.items(), key=lambda item: -len(item[1])):
            named = ", ".join(f"{kind}:{seed}" for kind, seed in cases[:4])
            lines.append(f"FOUND {len(cases)} x {what} ({named})")
        lines.append(f"{len(self.found)} findings")
        return "\n".join(lines)


def cases_of(count: int, first: int = 0, only: str = "") -> list[Case]:
    """As many cases, shared out among the kinds; seeds count up from `first`."""
    if only:
        return [(only, first + k) for k in range(count)]
    found: list[Case] = []
    for kind, share in KINDS.items():
        found += [(kind, first + k) for k in range(round(count * share))]
    return found


def fuzz(count: int, *, first: int = 0, workers: int = 1, only: str = "", show: bool = False) -> Tally:
    """Run cases in worker processes."""
    waiting: queue.SimpleQueue[Case] = queue.SimpleQueue()
    for case in cases_of(count, first, only):
        waiting.put(case)
    tally, lock = Tally(), threading.Lock()

    def serve() -> None:
        while True:
            try:
                case = waiting.get_nowait()
            except queue.Empty:
                return
            with Worker() as worker:
                while case is not None:
                    verdict, seconds = worker.run(case)
                    with lock:
                        tally.take(case, verdict, seconds)
                        if show:
                            done = sum(tally.counts.values())
                            print(
                                f"\r{done} of {count}, {len(tally.found)} findings", end="", file=sys.stderr
                            )
                    if not worker.alive:
                        break
                    try:
                        case = waiting.get_nowait()
                    except queue.Empty:
                        return

    threads = [threading.Thread(target=serve) for _ in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return tally


class Worker:
    """One process that runs cases until one of them kills it."""

    def __enter__(self) -> Worker:
        self._scratch = tempfile.mkdtemp(prefix="fuzz.")
        paths = os.pathsep.join([str(ROOT), str(HERE), os.environ.get("PYTHONPATH", "")])
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "fuzz_worker.py"), self._scratch],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=self._scratch,
            env={**os.environ, **threads, "PYTHONPATH": paths, "MPLBACKEND": "agg"},
        )
        self._buffer = b""
        self._selector = selectors.DefaultSelector()
        assert self._process.stdout is not None
        self._selector.register(self._process.stdout, selectors.EVENT_READ)
        said = self._line() or self._line()
        assert said == "ready", f"the worker did not start: {said}"
        self.alive = True
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        self._selector.close()
        shutil.rmtree(self._scratch, ignore_errors=True)

    def run(self, case: Case) -> tuple[str, float]:
        """Verdict and seconds of one case."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{case[0]} {case[1]}\n".encode())
        self._process.stdin.flush()
        while (line := self._line()) is not None:
            if line.startswith("end "):
                _, seconds, verdict = line.split(" ", 2)
                return verdict, float(seconds)
        self.alive = False
        if self._process.poll() is None:
            try:
                self._process.wait(1.0)
            except subprocess.TimeoutExpired:
                return "FOUND hang", PATIENCE
        code = self._process.returncode
        return f"FOUND crash by {signal.Signals(-code).name if code < 0 else f'exit code {code}'}", 0.0

    def _line(self) -> str | None:
        """The next line, or None where the process ended or does not answer."""
        assert self._process.stdout is not None
        while b"\n" not in self._buffer:
            if not self._selector.select(PATIENCE):
                return None
            more = os.read(self._process.stdout.fileno(), 65536)
            if not more:
                return None
            self._buffer += more
        line, self._buffer = self._buffer.split(b"\n", 1)
        return line.decode("utf-8", "replace")
