"""Mutated files of each kind; `make fuzz` runs ten thousand."""

from __future__ import annotations

import pytest
from fuzz_cases import KINDS
from fuzz_run import Worker, fuzz


@pytest.mark.parametrize("kind", KINDS)
def test_mutated_files_are_refused_or_used(kind: str) -> None:
    """In a process of their own: a crash of a parser is seen, and told with its case."""
    tally = fuzz(70, only=kind)
    assert not tally.found, tally.table()
    assert sum(tally.counts.values()) == 70
    assert len(tally.counts) > 1, "all cases came out alike: the mutations are too mild or too wild"


def test_the_fuzzer_sees_a_process_that_dies() -> None:
    with Worker() as worker:
        worker._process.kill()
        worker._process.wait()
        try:
            verdict, _ = worker.run(("urdf", 0))
        except BrokenPipeError:
            return
    assert "crash" in verdict
