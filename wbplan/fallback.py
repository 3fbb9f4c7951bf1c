"""A tick whose solver fails: tried with a solver that remembers nothing, then with the other backend.

Hard rows that contradict each other have no step, whoever is asked: such an error is passed on as it is.
"""

from __future__ import annotations

from typing import final

from wbplan.backends import BACKENDS
from wbplan.errors import SolveError, WbplanError
from wbplan.tick import Loop, Tick

RETRIED = "a solver without memory"


@final
class Retries:
    """Steps a loop, and keeps what had to be tried again.

    Attributes:
        made: for the report: time [s] of the plan, phase, what found the step, and what had gone wrong.
    """

    def __init__(self) -> None:
        self.made: list[dict[str, object]] = []

    def step(self, loop: Loop, at: float) -> Tick:
        """One tick of a loop.

        Args:
            loop: the loop; after a retry with the other backend it goes on with its own one.
            at: time [s] of the plan, for the report.

        Raises:
            SolveError: hard rows clash, or neither backend finds a step; the first error of all.
        """
        try:
            return loop.step()
        except SolveError as error:
            if error.clashes:
                raise
            first = error
        own = loop.backend
        for backend in (own, *(name for name in BACKENDS if name != own)):
            try:
                loop.restart(backend)
                tick = loop.step()
            except WbplanError:
                continue
            what = RETRIED if backend == own else f"backend '{backend}'"
            phase = loop.compiled.phase.name
            self.made.append({"time": at, "phase": phase, "what": what, "why": " ".join(str(first).split())})
            if backend != own:
                loop.restart(own)
            return tick
        loop.restart(own)
        raise first

    def warnings(self) -> list[str]:
        """One line for each."""
        return [
            f"{r['phase']}: at {r['time']:.2f} s {r['what']} found the step ({r['why']})" for r in self.made
        ]
