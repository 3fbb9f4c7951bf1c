"""Solvers behind one protocol: `proxqp` (the default, own stack) and `placo` (all in C++)."""

from __future__ import annotations

from collections.abc import Callable

from wbplan.backends.placo import PlacoBackend
from wbplan.backends.proxqp import ProxqpBackend
from wbplan.errors import SpecError
from wbplan.program.qp import Backend
from wbplan.program.stack import Stack

__all__ = ["BACKENDS", "Backend", "make_backend"]

BACKENDS: dict[str, Callable[[Stack], Backend]] = {"proxqp": ProxqpBackend, "placo": PlacoBackend}


def make_backend(name: str, stack: Stack) -> Backend:
    """The backend of that name for one phase.

    Raises:
        SpecError: there is no such backend, or it cannot express the phase.
    """
    if name not in BACKENDS:
        raise SpecError(f"backend '{name}' does not exist; there are: {', '.join(BACKENDS)}")
    levels = len(stack.levels)
    if levels > 1 and name == "placo":
        raise SpecError(
            f"backend '{name}' has no strict priorities: expected one level of soft tasks, got {levels}"
        )
    return BACKENDS[name](stack)
