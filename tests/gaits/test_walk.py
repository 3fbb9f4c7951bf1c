"""Walks: planned, every promise kept, distance and speed those of the gait."""

from __future__ import annotations

import re

import numpy as np
import pytest

import wbplan as wb
from wbplan.cli.survey import clearance
from wbplan.gaits import Gait, Manner, Stance, Walk, Walker, comfortable, gait_for, straight, walk

HEAVY = Walker(wb.load_robot("heavy_hexapod"))
MANA = Walker(wb.load_robot("mana"))


def walked(
    walker: Walker, gait: str, cycles: float, heading: float = 0.0, **manner: float
) -> tuple[Walk, float]:
    """A walk with the stance and stroke that are easy, and its stride."""
    stance = walker.stance()
    lift = 0.1 * stance.height
    stance, stroke = comfortable(walker, stance, lift)
    made = gait_for(walker, gait, stance, heading, stroke)
    track = straight(cycles * made.stride(stroke), heading)
    fields = {"height": lift, **manner}
    return walk(walker, made, track, stroke, stance=stance, manner=Manner(**fields)), made.stride(stroke)  # type: ignore[arg-type]


def test_speed_is_the_gaits_at_full_speed() -> None:
    for gait in ("tripod", "pentagon", "quadrangular-5"):
        done, stride = walked(HEAVY, gait, 2.0, step_time=4.0)
        assert done.gait is not None
        assert done.stride == pytest.approx(stride, abs=1e-6)
        assert done.speed == pytest.approx(stride / (4.0 * done.gait.cycle), abs=1e-6)
        course = done.schedule.course
        half = course.duration / 2.0
        assert course.gone(half + 1.0) - course.gone(half - 1.0) == pytest.approx(2.0 * done.speed, abs=1e-6)


@pytest.mark.parametrize("gait", ["tripod", "crawl"])
def test_any_distance_is_gone_at_the_gaits_speed(gait: str) -> None:
    walker = HEAVY if gait == "tripod" else MANA
    for cycles in (2.0, 2.3, 2.71):
        done, stride = walked(walker, gait, cycles)
        assert done.stride == pytest.approx(stride, rel=2e-3)
        assert done.schedule.course.gone(1e9) == pytest.approx(cycles * stride, abs=1e-9)
    short, stride = walked(walker, gait, 0.1)
    assert short.speed < stride
    assert len(short.schedule.steps) <= 2 * len(short.gait.steps)  # type: ignore[union-attr]


def test_body_moves_without_stops_or_jumps() -> None:
    done, _ = walked(HEAVY, "quadrangular-1", 2.0)
    course = done.schedule.course
    times = np.linspace(0.0, course.duration, 2000)
    speed = np.gradient(course.places(times)[:, 0], times)
    assert speed[0] == pytest.approx(0.0, abs=0.01 * done.speed)
    assert speed[-1] == pytest.approx(0.0, abs=0.01 * done.speed)
    assert np.abs(np.diff(speed)).max() < 0.01 * done.speed
    inner = speed[(times > 0.3 * course.duration) & (times < 0.7 * course.duration)]
    assert inner.min() > 0.99 * done.speed


def test_every_step_starts_and_ends_inside_both_supports() -> None:
    done, _ = walked(MANA, "crawl", 2.0)
    for before, after in zip(done.steps[:-1], done.steps[1:], strict=True):
        com = done.com.at(np.array([after.begin]))[0]
        for step in (before, after):
            from wbplan.geometry import support_polygon

            polygon = support_polygon(np.array([foot[:2] for foot in step.support.values()]))
            assert polygon.margin(com) >= done.margin - 1e-9
    assert min(done.com.least) >= done.margin


def test_swing_feet_clear_the_ground_and_standing_ones_stay() -> None:
    done, _ = walked(MANA, "crawl", 1.0)
    plan = wb.plan(MANA.robot, done.script)
    report = {row.promise: row for row in plan.check().rows}
    assert plan.check().ok
    assert report["foot slip"].worst < 5e-5
    assert report["swing feet above ground"].worst > -1e-4
    assert clearance(done, plan) > 0.007


def test_a_margin_out_of_reach_says_how_much_there_is_and_which_stride_would_hold() -> None:
    stance = HEAVY.stance()
    with pytest.raises(
        wb.GaitError, match=r"step '00\d tripod.*largest there is.*a stride of .* would hold"
    ) as error:
        walk(
            HEAVY, gait_for(HEAVY, "tripod", stance, 0.0, 0.2), straight(0.8), 0.2, manner=Manner(margin=0.54)
        )
    assert error.value.margin is not None
    assert error.value.margin < 0.54
    assert error.value.stride is not None
    stroke = 0.2 * error.value.stride / gait_for(HEAVY, "tripod", stance, 0.0, 0.2).stride(0.2)
    held = walk(
        HEAVY,
        gait_for(HEAVY, "tripod", stance, 0.0, stroke),
        straight(0.8),
        stroke,
        stance=stance,
        manner=Manner(margin=0.54),
    )
    assert min(held.com.least) >= 0.54 - 1e-9


def test_a_margin_that_no_stride_has_says_which_stance_would_hold() -> None:
    stance = HEAVY.stance()
    gait = gait_for(HEAVY, "tripod", stance, 0.0, 0.02)
    with pytest.raises(wb.GaitError, match=r"no shorter stride would hold.*stance over 1\.09 times as wide"):
        walk(HEAVY, gait, straight(0.2), 0.02, manner=Manner(margin=0.65))
    wider = HEAVY.stance(radius=1.12 * stance.radius, height=0.5)
    held = walk(HEAVY, gait, straight(0.2), 0.02, stance=wider, manner=Manner(margin=0.65, height=0.03))
    assert min(held.com.least) >= 0.65 - 1e-9


def test_a_gait_without_pauses_cannot_carry_a_quadruped_over_its_diagonal() -> None:
    gait = Gait("crawl", (("leg1",), ("leg3",), ("leg2",), ("leg4",)), MANA.legs)
    with pytest.raises(wb.GaitError, match=r"cannot be held.*no shorter stride would hold.*pause"):
        walk(MANA, gait, straight(0.1), 0.05, manner=Manner(margin=0.01))
    paused = walk(MANA, gait.paused(0.5), straight(0.1), 0.05, manner=Manner(margin=0.01, height=0.015))
    assert min(paused.com.least) >= 0.01 - 1e-9


def test_a_leg_that_does_not_reach_is_named_and_the_stride_that_is_told_holds() -> None:
    gait = gait_for(HEAVY, "tripod", HEAVY.stance(), 0.0, 0.5)
    with pytest.raises(wb.GaitError, match=r"'leg\d' cannot reach its .*a stride of .* would hold") as error:
        walk(HEAVY, gait, straight(2.0), 0.5)
    assert error.value.stride is not None
    stroke = 0.5 * error.value.stride / gait.stride(0.5)
    assert walk(HEAVY, gait, straight(2.0), stroke).stride == pytest.approx(error.value.stride, rel=0.1)


def test_joints_too_slow_for_the_step_time_are_named_and_the_time_that_is_told_holds() -> None:
    with pytest.raises(
        wb.GaitError, match=r"joint 'leg\d_knee' would have to move at .* step_time of .* would hold"
    ) as error:
        walked(HEAVY, "tripod", 1.0, step_time=0.3)
    told = re.search(r"step_time of ([\d.]+) s", str(error.value))
    assert told is not None
    assert walked(HEAVY, "tripod", 1.0, step_time=float(told.group(1)) + 0.01)[0].fastest.share <= 1.0


def test_a_gait_of_other_legs_is_refused() -> None:
    with pytest.raises(wb.SpecError, match=r"gait 'tripod': of legs .*, the stance has"):
        walk(MANA, gait_for(HEAVY, "tripod", HEAVY.stance(), 0.0, 0.2), straight(1.0), 0.2)
    with pytest.raises(wb.SpecError, match="walk: stroke"):
        walk(HEAVY, gait_for(HEAVY, "", HEAVY.stance(), 0.0, 0.2), straight(1.0), -0.2)
    with pytest.raises(wb.SpecError, match="margin"):
        Manner(margin=float("nan"))


@pytest.mark.parametrize(
    ("lean", "radius", "says"),
    [(0.0, 1.0, "not both"), (None, 5.0, "'leg1' cannot reach its stance"), (None, 0.01, "cannot reach")],
)
def test_stances_out_of_reach_are_refused(lean: float | None, radius: float, says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        HEAVY.stance(lean=lean, radius=radius)


def test_regular_stances() -> None:
    stance = HEAVY.stance(radius=1.1, angles={"leg5": 0.1})
    assert all(np.linalg.norm(foot) == pytest.approx(1.1) for foot in stance.feet.values())
    assert stance.feet["leg5"] == pytest.approx([1.1 * np.cos(0.1), 1.1 * np.sin(0.1)])
    less = stance.with_feet({"leg1": (0.0, 1.0)}, without=["leg2"])
    assert isinstance(less, Stance)
    assert set(less.feet) == set(HEAVY.legs) - {"leg2"}
    assert HEAVY.ring == ("leg1", "leg2", "leg3", "leg4", "leg5", "leg6")
    # Parallel to the x axis at lean 0, radial at 60 degrees.
    crab, mixed = HEAVY.stance(lean=0.0), HEAVY.stance(lean=np.pi / 3)
    for leg in ("leg1", "leg3", "leg4", "leg6"):
        assert (crab.feet[leg] - HEAVY.hip(leg))[1] == pytest.approx(0.0, abs=1e-9)
        assert mixed.feet[leg] == pytest.approx(HEAVY.foot(leg), abs=1e-9)
    for leg in ("leg2", "leg5"):
        assert crab.feet[leg] == pytest.approx(HEAVY.foot(leg), abs=1e-9)
