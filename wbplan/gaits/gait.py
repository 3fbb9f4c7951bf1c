"""A gait as data: which legs swing in each step, how long it lasts, how far the body goes meanwhile."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from wbplan.errors import GaitError, SpecError, listing
from wbplan.paths import name_of, number

#: Feet that a body needs to stand on.
LEAST = 3


@final
@dataclass(frozen=True)
class Stand:
    """One stance of a leg in a gait's cycle.

    Attributes:
        leg: the leg.
        first: the first step of it.
        steps: how many, in a row, past the cycle's end.
        stroke: share of the stride that the body goes meanwhile.
    """

    leg: str
    first: int
    steps: int
    stroke: float


@final
@dataclass(frozen=True)
class Gait:
    """A cycle of steps; in each one some legs swing and the others carry.

    Two lengths are told apart: the *stride* is how far the body goes in a cycle, the *stroke* s how far a
    foot goes in the body's frame while it stands. With T the cycle and n legs of which u stand on average
    (duty factor beta = u/n), each swinging once, the speed is v = stride / T = s / (beta T) = s n / (T u).

    Args:
        name: for reports.
        steps: the legs that swing in each step; an empty one is a pause on all feet.
        legs: all legs, in their order round the body; those that swing, as they come, where not given.
        lasting: time of each step against the others'; all alike where not given.
        advance: share of the stride that the body goes in each step, 1 in all; in proportion to time where
            not given.

    Raises:
        SpecError: a leg never swings, is not one of the legs, or swings in two steps running.
        GaitError: a step leaves fewer than three feet on the ground.
    """

    name: str
    steps: tuple[tuple[str, ...], ...]
    legs: tuple[str, ...] = ()
    lasting: tuple[float, ...] = ()
    advance: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        at = f"gait '{name_of(self.name, 'Gait.name')}'"
        put = partial(object.__setattr__, self)
        put("steps", tuple(_names(step, f"{at}: step {k + 1}") for k, step in enumerate(self.steps)))
        if not any(self.steps):
            raise SpecError(f"{at}: no leg swings in any step")
        swinging = tuple(dict.fromkeys(leg for step in self.steps for leg in step))
        put("legs", _names(self.legs, f"{at}.legs") or swinging)
        _check_swings(at, self.steps, self.legs, swinging)
        put("lasting", _shares(self.lasting or np.ones(len(self.steps)), self.steps, f"{at}.lasting", True))
        put("advance", _shares(self.advance or self.lasting, self.steps, f"{at}.advance", False))
        for k in range(len(self.steps)):
            left = self.support(k)
            if len(left) < LEAST:
                raise GaitError(
                    f"{at}: the body cannot be held in step {k + 1}: {', '.join(self.steps[k])} swing and "
                    f"{listing(left)} is left; it needs {LEAST} feet on the ground",
                    step=k,
                )

    @property
    def step_count(self) -> int:
        """Steps in a cycle."""
        return len(self.steps)

    @property
    def cycle(self) -> float:
        """Time of a cycle, in times of its longest swing."""
        return 1.0 / max(t for t, swing in zip(self.lasting, self.steps, strict=True) if swing)

    def support(self, step: int) -> tuple[str, ...]:
        """Legs that stand in a step, counted from 0 and past the cycle's end."""
        swing = self.steps[step % len(self.steps)]
        return tuple(leg for leg in self.legs if leg not in swing)

    def duty(self, leg: str) -> float:
        """Share of the cycle in which a leg stands."""
        if leg not in self.legs:
            raise SpecError(f"gait '{self.name}': no leg '{leg}'; legs: {listing(self.legs)}")
        return 1.0 - sum(t for t, step in zip(self.lasting, self.steps, strict=True) if leg in step)

    @property
    def duty_factor(self) -> float:
        """beta: mean share of the cycle in which a leg stands; u / n."""
        return float(np.mean([self.duty(leg) for leg in self.legs]))

    @property
    def stands(self) -> tuple[Stand, ...]:
        """Every stance of every leg in one cycle."""
        count = len(self.steps)
        found = []
        for leg in self.legs:
            for k in range(count):
                if leg not in self.steps[k]:
                    continue
                following = (j for j in range(1, count + 1) if leg in self.steps[(k + j) % count])
                steps = next(following) - 1
                stroke = sum(self.advance[(k + j) % count] for j in range(1, steps + 1))
                found.append(Stand(leg, (k + 1) % count, steps, stroke))
        return tuple(found)

    @property
    def mean_stroke(self) -> float:
        """Stroke of a stance as a share of the stride, mean over all stances; beta where legs swing once."""
        return float(np.mean([stand.stroke for stand in self.stands]))

    @property
    def longest_stroke(self) -> float:
        """The longest stance's stroke as a share of the stride."""
        return max(stand.stroke for stand in self.stands)

    def stride(self, stroke: float, *, longest: bool = True) -> float:
        """How far the body goes in a cycle [m] for a stroke [m], of the longest stance or of the mean one."""
        return stroke / (self.longest_stroke if longest else self.mean_stroke)

    def speed(self, stroke: float, cycle: float, *, longest: bool = False) -> float:
        """Speed of the body [m/s], v = s n / (T u).

        Args:
            stroke: s, of the mean stance [m] (of the longest, if so asked).
            cycle: T [s].
            longest: `stroke` is the longest stance's; the same where all are alike.
        """
        return self.stride(stroke, longest=longest) / cycle

    def renamed(self, name: str) -> Gait:
        """The same gait under another name."""
        return Gait(name, self.steps, self.legs, self.lasting, self.advance)

    def paused(self, share: float = 0.5) -> Gait:
        """The gait with a pause on all feet after every step, for the body to be shifted in.

        Args:
            share: time of a pause against the step before it.
        """
        number(share, "Gait.paused", "a positive share of a step", above=0.0)
        steps = tuple(s for step in self.steps for s in (step, ()))
        lasting = tuple(t for time in self.lasting for t in (time, share * time))
        return Gait(self.name, steps, self.legs, lasting)


def _names(given: Iterable[str], what: str) -> tuple[str, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise SpecError(f"{what}: expected a list of legs, got {given!r}")
    names = tuple(name_of(leg, what) for leg in given)
    twice = sorted({leg for leg in names if names.count(leg) > 1})
    if twice:
        raise SpecError(f"{what}: named more than once: {', '.join(twice)}")
    return names


def _check_swings(
    at: str, steps: tuple[tuple[str, ...], ...], legs: tuple[str, ...], swinging: tuple[str, ...]
) -> None:
    strange = [leg for leg in swinging if leg not in legs]
    if strange:
        raise SpecError(f"{at}: {listing(strange)} swings but is none of its legs: {listing(legs)}")
    never = [leg for leg in legs if leg not in swinging]
    if never:
        raise SpecError(
            f"{at}: {listing(never)} never swings; every leg has to, or the body leaves it behind"
        )
    for k, step in enumerate(steps):
        again = sorted(set(step) & set(steps[k - 1])) if len(steps) > 1 else step
        if again:
            raise SpecError(
                f"{at}: {', '.join(again)} swings in step {(k - 1) % len(steps) + 1} and in step {k + 1}; "
                "it has to stand between two swings"
            )


def _shares(
    given: Sequence[float] | np.ndarray, steps: tuple[tuple[str, ...], ...], what: str, positive: bool
) -> tuple[float, ...]:
    """As many numbers as steps, scaled to 1 in all."""
    values = [
        number(
            v, f"{what}[{k}]", "a positive number" if positive else "a number of 0 or more",
            **({"above": 0.0} if positive else {"least": 0.0}),
        )
        for k, v in enumerate(given)
    ]  # fmt: skip
    total = sum(values)
    if len(values) != len(steps) or not total > 0.0:
        raise SpecError(f"{what}: expected {len(steps)} numbers, one for each step, not all 0; got {values}")
    return tuple(v / total for v in values)
