"""Every gait of every robot, and the modes of hexapods: walked, measured, and told in one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest

import wbplan as wb
from wbplan import catalog
from wbplan.cli.survey import Setting, setting, walk_once
from wbplan.gaits import (
    MODES,
    Manner,
    Walker,
    cycle_figure,
    gait_for,
    gaits_for,
    quadrangular,
    straight,
    walk,
)

robot_named = cache(wb.load_robot)
SIX = tuple("123456")
#: Of the 18 quadrangular gaits, which are alike but for their order, one of each three on all robots but one.
SOME = {gait.name for gait in quadrangular(SIX)[1::9]} | {"quadrangular-1"}
MODAL = ("tripod", "quadrangular-1")
#: Stances whose abductors are at the end of their range.
STUCK = {("hexpiderix", "ant"), ("legarm_hexapod", "ant")}


def hexapods() -> list[str]:
    return [name for name in sorted(catalog.robots()) if "tripod" in gaits_for(robot_named(name))]


def all_cases() -> list[tuple[str, str, str]]:
    """Robot, mode and gait, every one that there is."""
    free = [
        (robot, "free", gait) for robot in sorted(catalog.robots()) for gait in gaits_for(robot_named(robot))
    ]
    modes = [
        (robot, mode, gait)
        for robot in hexapods()
        for mode in MODES
        if mode != "free" and (robot, mode) not in STUCK
        for gait in gaits_for(robot_named(robot), MODES[mode])
    ]
    return free + modes


def walked_cases() -> list[tuple[str, str, str]]:
    """Those that are planned too."""
    found = []
    for robot, mode, gait in all_cases():
        rest = gait.startswith("quadrangular-") and gait not in SOME and robot != "heavy_hexapod"
        if gait in MODAL or (mode == "free" and not rest):
            found.append((robot, mode, gait))
    return found


@cache
def base(robot: str, mode: str, legs: int) -> Setting:
    """Stance and stroke, which are alike for all gaits of so many legs."""
    return setting(robot_named(robot), {4: "crawl-1", 5: "4+1", 6: "tripod"}[legs], MODES[mode])


def given(robot: str, mode: str, gait: str) -> Setting:
    five = gait in ("4+1", "3+2", "mixture")
    one = base(robot, mode, 5 if five else len(Walker(robot_named(robot)).legs))
    return replace(one, gait=gait_for(one.walker, gait, one.stance, one.mode.heading, one.stroke))


@pytest.mark.parametrize(("robot", "mode", "gait"), walked_cases())
def test_goes_the_gaits_way_at_its_speed(
    robot: str, mode: str, gait: str, record_property: Callable[[str, object], None]
) -> None:
    """Two strides as planned: to 1 mm and 1 mm/s, with every promise kept."""
    row = walk_once(given(robot, mode, gait), cycles=2.0, dt=0.04 if robot == "heavy_hexapod" else 0.02)
    record_property("gait", asdict(row))
    assert row.held
    assert row.gone == pytest.approx(row.distance, abs=1e-3)
    assert row.measured == pytest.approx(row.speed, abs=1e-3)
    assert row.margin >= row.promised - 1e-6
    assert row.slip < 1e-4
    assert row.clearance > 0.4 * given(robot, mode, gait).lift


def test_distance_and_speed_of_all_cases_on_paper() -> None:
    """v = s n / (T u) by the longest stance's stroke, of the course that is to be planned."""
    cases = [case for case in all_cases() if not case[2].startswith("quadrangular-") or case[2] in SOME]
    cases = cases[::2]
    assert len(cases) > 45
    for robot, mode, gait in cases:
        one = given(robot, mode, gait)
        stride = one.gait.stride(one.stroke)
        done = walk(
            one.walker,
            one.gait,
            straight(2.0 * stride, one.mode.heading),
            one.stroke,
            stance=one.stance,
            manner=Manner(step_time=10.0, height=one.lift, margin=0.0),
        )
        assert done.stride == pytest.approx(stride, abs=1e-3), (robot, mode, gait)
        assert done.speed == pytest.approx(
            one.gait.speed(one.stroke, one.gait.cycle * 10.0, longest=True), abs=1e-3
        )
        course = done.schedule.course
        assert np.linalg.norm(course.place(course.duration)[:2]) == pytest.approx(2.0 * stride, abs=1e-9)


@pytest.mark.parametrize(("robot", "mode"), sorted(STUCK))
def test_a_stance_without_room_says_which_joint_has_none(robot: str, mode: str) -> None:
    with pytest.raises(
        wb.GaitError, match=r"no leg may make the least stroke: '\w+', \w+joint1 would have to be at"
    ):
        setting(robot_named(robot), "tripod", MODES[mode])


@pytest.mark.parametrize("robot", sorted(catalog.robots()))
def test_every_gait_has_its_margins_drawn(robot: str) -> None:
    """One pair of axes a gait: the body's margin over a cycle as `cycle_margins` has it, and who stands."""
    names = gaits_for(robot_named(robot))
    cases = [given(robot, "free", name) for name in names]
    figure = cycle_figure([(one.gait, one.stance.feet, one.stroke) for one in cases], 0.0, robot)
    margins, stands = figure.axes[0::2], figure.axes[1::2]
    assert len(margins) == len(stands) == len(names)
    for name, one, above, below in zip(names, cases, margins, stands, strict=True):
        assert above.get_title("left").startswith(name)
        times = above.lines[0].get_xdata()
        assert times[[0, -1]] == pytest.approx([0.0, 1.0])
        assert len(below.patches) == sum(len(one.gait.support(k)) for k in range(one.gait.step_count))
