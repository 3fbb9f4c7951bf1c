"""Disturbed trials: seeded, whoever runs them, and honest about how little they know."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbplan.errors import PhysicsError
from wbplan.physics import KINDS, Spread, wilson
from wbplan.physics.trials import draw


@pytest.mark.slow
def test_workers_change_nothing(leaning) -> None:
    wide = Spread(tilt=0.25, push=6.0)
    alone = leaning[0.03].simulate(trials=4, seed=3, workers=1, spread=wide, ladder=()).survival
    shared = leaning[0.03].simulate(trials=4, seed=3, workers=2, spread=wide, ladder=()).survival
    assert alone is not None
    assert shared is not None
    assert [t.verdict for t in alone.trials] == [t.verdict for t in shared.trials]
    assert [t.disturbance for t in alone.trials] == [t.disturbance for t in shared.trials]
    assert 0 < alone.stood < 4  # both kinds came up, so the comparison says something


@pytest.mark.slow
def test_what_kills_first_is_found(leaning) -> None:
    only = Spread(
        mass=1e-3, com=1e-4, object_mass=1e-3, object_com=1e-4, friction=1e-3, gain=1e-3, latency=1e-4,
        tilt=1e-4, push=20.0,
    )  # fmt: skip
    seen: list[float] = []
    survival = (
        leaning[0.03]
        .simulate(
            trials=1, workers=2, spread=only, ladder=(1.0,), progress=lambda share, what: seen.append(share)
        )
        .survival
    )
    assert survival is not None
    assert survival.first_killers == ("push",)
    assert [kind for kind, step in survival.ladder.items() if step is not None] == ["push"]
    assert seen
    assert max(seen) == 1.0


@given(st.integers(0, 10**6), st.integers(0, 10**4))
def test_a_draw_is_within_its_spread_and_always_the_same(seed: int, number: int) -> None:
    spread = Spread()
    off = draw(seed, number, spread, 30.0)
    assert asdict(off) == asdict(draw(seed, number, spread, 30.0))
    assert abs(off.mass - 1.0) <= spread.mass
    assert np.linalg.norm(off.com) <= spread.com + 1e-12
    assert abs(off.friction - 1.0) <= spread.friction
    assert 0.0 <= off.latency <= spread.latency
    assert np.linalg.norm(off.tilt) <= spread.tilt + 1e-12
    assert all(np.linalg.norm(p.force) * p.seconds <= spread.push + 1e-9 for p in off.pushes)
    assert all(0.0 <= p.time <= 30.0 for p in off.pushes)


@pytest.mark.parametrize("kind", KINDS)
def test_one_kind_alone_leaves_the_rest(kind: str) -> None:
    off, as_planned = draw(0, 1, Spread(), 10.0, (kind,)), draw(0, 1, Spread(), 10.0, ())
    field = {"push": "pushes"}.get(kind, kind)
    changed = {key for key, value in asdict(off).items() if value != asdict(as_planned)[key]}
    assert changed == {field}


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_holds_the_rate(counts: tuple[int, int]) -> None:
    good, n = counts
    low, high = wilson(good, n)
    assert 0.0 <= low <= good / n <= high <= 1.0
    assert low < high


def test_wilson_figures() -> None:
    """By the roots of (p - x)^2 = z^2 x (1 - x) / n, solved by themselves."""
    for good, n in ((9, 10), (50, 100), (3, 7)):
        z2, p = 1.959963984540054**2, good / n
        roots = np.sort(np.roots([1 + z2 / n, -2 * p - z2 / n, p * p]).real)
        np.testing.assert_allclose(wilson(good, n), roots, atol=1e-12)


def test_none_is_refused(leaning) -> None:
    with pytest.raises(PhysicsError, match="trials"):
        wilson(1, 0)
    with pytest.raises(PhysicsError, match="seed"):
        leaning[0.03].simulate(trials=1, seed=-1)
