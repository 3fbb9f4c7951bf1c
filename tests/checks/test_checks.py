"""Every promise: a good plan keeps all of them, and what breaks one is seen in its row and no other."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from wbplan.bundle import NO_MARGIN, Bundle
from wbplan.checks import check
from wbplan.errors import CheckFailed

SHIFT, SWING, CARRY, REST = range(4)
ALWAYS = {
    "values finite",
    "time increases",
    "sample spacing",
    "phase edges sampled",
    "unit quaternion",
    "joint beyond position limit",
    "joint beyond speed limit",
    "base speed",
    "base turning",
    "v agrees with q",
    "foot slip",
    "contacts level",
    "swing feet above ground",
    "touch-down speed",
    "tilt within friction",
    "contacts that span",
    "support margin",
    "margin at handover",
    "com agrees with q",
    "margin agrees with q",
    "closure gap",
    "closure turn",
    "object place",
    "object turn",
}


def broken(bundle: Bundle, **bounds: float) -> set[str]:
    return {row.promise for row in check(bundle, **bounds).broken}


def test_a_good_plan_keeps_every_promise(good: Bundle) -> None:
    report = check(good)
    assert report.ok
    assert report.broken == ()
    assert {row.promise for row in report.rows} == ALWAYS
    assert report.require() is report


def test_a_continuous_joint_has_no_position_limit(machine: ModuleType) -> None:
    bundle = machine.build(robot=machine.urdf(tray="continuous"), tray=lambda t: 2.5)
    assert check(bundle).ok


# ------------------------------------------------------------------------- one promise broken, nothing else


def with_phases(edit: Callable[[list[dict[str, Any]]], None]) -> Callable[[ModuleType, Bundle], Bundle]:
    """Edit the phases; the records follow from them."""

    def broken_plan(machine: ModuleType, good: Bundle) -> Bundle:
        promises = machine.phases()
        edit(promises)
        return machine.build(promises=promises)

    return broken_plan


def edges_between_samples(machine: ModuleType, good: Bundle) -> Bundle:
    return machine.build(promises=machine.phases((0.0, 0.405, 0.8, 1.2, 1.4)))


def late_body(machine: ModuleType, good: Bundle) -> Bundle:
    """The body is still moving away from leg 1 when that leg lifts."""

    def base(t: float) -> np.ndarray:
        return machine.base_path(t) + [0.03 * machine.blend((0.6 - t) / 0.6), 0.0, 0.0, 0.0]

    promises = machine.phases()
    margin = machine.build(base=base).trajectory.margin
    promises[SHIFT]["margin"] = 0.0
    promises[SWING]["margin"] = float(np.mean(margin[20:22]))
    return machine.build(base=base, promises=promises)


def region_too_wide(phases: list[dict[str, Any]]) -> None:
    phases[SHIFT]["region"] = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]


def box(machine: ModuleType, good: Bundle, **shift: Any) -> Bundle:
    path = good.trajectory.bodies["box"].copy()
    for key, value in shift.items():
        path[45 if key == "taken" else slice(None), :3] += value
    return machine.edited(good, bodies={"box": path})


def box_turned(machine: ModuleType, good: Bundle) -> Bundle:
    path = good.trajectory.bodies["box"].copy()
    path[45, 3:] = [0.0, 0.0, *(np.sin([0.3, 0.3 + np.pi / 2]))]
    return machine.edited(good, bodies={"box": path})


def box_jumps_when_taken(machine: ModuleType, good: Bundle) -> Bundle:
    path = good.trajectory.bodies["box"].copy()
    path[:40, 0] += 0.001
    return machine.edited(good, bodies={"box": path})


def quaternion_flips(machine: ModuleType, good: Bundle) -> Bundle:
    q = good.trajectory.q.copy()
    q[30:, 3:7] *= -1.0
    return machine.edited(good, q=q)


def quaternion_long(machine: ModuleType, good: Bundle) -> Bundle:
    q = good.trajectory.q.copy()
    q[:, 3:7] *= 1.001
    return machine.edited(good, q=q)


def drifting_foot(amount: float) -> Callable[[ModuleType, Bundle], Bundle]:
    def drifting(machine: ModuleType, good: Bundle) -> Bundle:
        return machine.build(
            foot=lambda t: machine.foot_path(t) + [amount * machine.blend((t - 0.8) / 0.6), 0, 0]
        )

    return drifting


def foot_below_ground(machine: ModuleType, good: Bundle) -> Bundle:
    return machine.build(foot=lambda t: machine.foot_path(t) * [1.0, 1.0, -0.2])


def foot_through_a_box(machine: ModuleType, good: Bundle) -> Bundle:
    """Leg 1's foot is lifted by 30 mm, halfway; the box under its way is 40 mm high."""
    box = {"name": "box on the floor", "kind": "box", "size": [0.005, 0.1, 0.04], "friction": 0.7}
    box["pose"] = [0.215, 0.12, 0.02, 0.0, 0.0, 0.0, 1.0]
    promises = machine.phases()
    promises[SWING]["obstacles"] = ["box on the floor"]
    return machine.planned(machine.build(promises=promises), obstacles=[box])


def foot_lands_high(machine: ModuleType, good: Bundle) -> Bundle:
    return machine.build(foot=lambda t: machine.foot_path(t) + [0, 0, 0.003 * machine.blend((t - 0.4) / 0.4)])


def foot_lands_fast(machine: ModuleType, good: Bundle) -> Bundle:
    return machine.build(foot=lambda t: np.array([0.2, 0.12, 0.1 * max(0.0, min(t - 0.4, 0.8 - t))]))


def loop_turns(machine: ModuleType, good: Bundle) -> Bundle:
    """Seen at the joint's own axis, where nothing moves."""
    promises = machine.phases()
    promises[CARRY]["closures"] = [{"frame_a": "tray", "frame_b": "base"}]
    return machine.build(tray=lambda t: 5e-3 * machine.blend((t - 0.8) / 0.2), promises=promises)


def jump(machine: ModuleType, good: Bundle) -> Bundle:
    return machine.build(
        base=lambda t: machine.base_path(t) + [0.065 * (0.09 < t < 0.11), 0.0, 0.0, 0.0],
        robot=machine.urdf(speed=1000.0),
    )


BROKEN: dict[str, tuple[Callable[[ModuleType, Bundle], Bundle], set[str]]] = {
    "q not a number": (
        lambda m, b: m.edited(b, q=m.changed(b.trajectory.q, (9, 12), np.nan)),
        {"values finite"},
    ),
    "v infinite": (
        lambda m, b: m.edited(b, v=m.changed(b.trajectory.v, (9, 12), np.inf)),
        {"values finite"},
    ),
    "time not a number": (
        lambda m, b: m.edited(b, time=m.changed(b.trajectory.time, 9, np.nan)),
        {"values finite", "time increases"},
    ),
    "time stands still": (
        lambda m, b: m.edited(b, time=m.changed(b.trajectory.time, 9, b.trajectory.time[8])),
        {"time increases"},
    ),
    "another dt": (lambda m, b: m.planned(b, dt=0.01), {"sample spacing"}),
    "edges between samples": (edges_between_samples, {"phase edges sampled"}),
    "long quaternion": (quaternion_long, {"unit quaternion"}),
    "flipped quaternion": (quaternion_flips, {"base turning"}),
    "joint outside": (lambda m, b: m.build(tray=lambda t: 1.81), {"joint beyond position limit"}),
    "joint too fast": (lambda m, b: m.build(robot=m.urdf(speed=0.5)), {"joint beyond speed limit"}),
    "too sudden": (
        lambda m, b: m.planned(b, joint_acceleration=[1.0] * 13),
        {"joint beyond acceleration limit"},
    ),
    "body jumps": (jump, {"base speed"}),
    "wrong v": (
        lambda m, b: m.edited(b, v=m.changed(b.trajectory.v, (9, 8), b.trajectory.v[9, 8] + 1e-5)),
        {"v agrees with q"},
    ),
    "last v moves": (
        lambda m, b: m.edited(b, v=m.changed(b.trajectory.v, (-1, 8), 1e-5)),
        {"v agrees with q"},
    ),
    "foot drifts": (drifting_foot(2e-3), {"foot slip"}),
    # Less than the bound in each phase, more than it over both.
    "foot drifts on": (drifting_foot(1.3e-4), {"foot slip"}),
    "foot under ground": (foot_below_ground, {"swing feet above ground"}),
    "foot through a box": (foot_through_a_box, {"swing feet above ground"}),
    "foot lands high": (foot_lands_high, {"contacts level"}),
    "foot lands fast": (foot_lands_fast, {"touch-down speed"}),
    "too steep": (
        with_phases(lambda p: p[SHIFT]["contacts"][1].update(normal=[0.6, 0.0, 0.8])),
        {"tilt within friction"},
    ),
    "upside down": (
        with_phases(lambda p: p[SHIFT]["contacts"][1].update(normal=[0.0, 0.0, -1.0])),
        {"tilt within friction"},
    ),
    "two feet": (with_phases(lambda p: p[SWING]["contacts"].pop()), {"contacts that span"}),
    "no feet": (with_phases(lambda p: p[REST].update(contacts=[])), {"contacts that span"}),
    "one foot three times": (
        with_phases(lambda p: p[REST].update(contacts=[p[REST]["contacts"][0]] * 3)),
        {"contacts that span"},
    ),
    "margin too small": (with_phases(lambda p: p[SHIFT].update(margin=0.09)), {"support margin"}),
    "foot lifts too early": (late_body, {"margin at handover"}),
    "wrong com": (
        lambda m, b: m.edited(b, com=b.trajectory.com + [0.0, 0.0, 2e-9]),
        {"com agrees with q"},
    ),
    "wrong margin": (
        lambda m, b: m.edited(b, margin=m.changed(b.trajectory.margin, 9, b.trajectory.margin[9] + 2e-6)),
        {"margin agrees with q"},
    ),
    "no margin recorded": (
        lambda m, b: m.edited(b, margin=m.changed(b.trajectory.margin, 9, np.nan)),
        {"margin agrees with q"},
    ),
    "region too wide": (with_phases(region_too_wide), {"region corners that do not hold"}),
    "loop opens": (
        lambda m, b: m.build(tray=lambda t: 5e-4 * m.blend((t - 0.8) / 0.2)),
        {"closure gap"},
    ),
    "loop turns": (loop_turns, {"closure turn"}),
    "box beside its holder": (lambda m, b: box(m, b, taken=2e-6), {"object place"}),
    "box turned": (box_turned, {"object turn"}),
    "box jumps when taken": (box_jumps_when_taken, {"object place"}),
    "clearance": (with_phases(lambda p: p[SHIFT].update(clearance=0.01)), {"clearance"}),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_promise_breaks_its_row_and_no_other(machine: ModuleType, good: Bundle, case: str) -> None:
    breaks, expected = BROKEN[case]
    bundle = breaks(machine, good)
    assert broken(bundle) == expected
    with pytest.raises(CheckFailed) as caught:
        check(bundle).require()
    assert set(caught.value.broken) == expected
    assert all(name in str(caught.value) for name in expected)


def test_every_promise_has_a_case() -> None:
    cases = set().union(*(rows for _, rows in BROKEN.values()))
    assert cases - ALWAYS == {
        "joint beyond acceleration limit",
        "region corners that do not hold",
        "clearance",
    }
    assert cases >= ALWAYS


# ------------------------------------------------------------------------------------------- what rows say


def test_rows_say_when_and_where(machine: ModuleType) -> None:
    row = check(drifting_foot(2e-3)(machine, machine.build()))["foot slip"]
    assert row.where == "leg1_foot"
    assert row.phase == "rest"
    assert row.time == pytest.approx(1.4)
    assert row.worst == pytest.approx(2e-3, rel=1e-6)
    assert (row.bound, row.unit, row.at_least, row.held) == (1e-4, "m", False, False)
    limit = check(machine.build(tray=lambda t: 1.81))["joint beyond position limit"]
    assert (limit.where, limit.unit) == ("tray_joint", "rad")
    assert limit.worst == pytest.approx(0.01)


def test_margins_are_those_of_the_plan(good: Bundle) -> None:
    report, margin = check(good), good.trajectory.margin
    swing = good.trajectory.phase == SWING
    assert report["margin at handover"].worst == pytest.approx(margin[20])
    assert report["support margin"].worst <= margin[swing].min() + 1e-6
    assert report["support margin"].at_least


def test_bounds_can_be_loosened(machine: ModuleType, good: Bundle) -> None:
    assert broken(drifting_foot(2e-3)(machine, good), slip=0.01) == set()
    assert broken(foot_lands_high(machine, good), ground=0.01) == set()
    opened = machine.build(tray=lambda t: 5e-3 * machine.blend((t - 0.8) / 0.2))
    assert broken(opened) == {"closure gap", "closure turn"}
    assert broken(opened, closure=0.01) == {"closure turn"}
    assert broken(opened, closure=0.01, rotation=0.01) == set()


def test_the_report_as_data_and_as_a_table(machine: ModuleType, good: Bundle) -> None:
    report = check(with_phases(lambda p: p[SHIFT].update(clearance=0.01))(machine, good))
    data = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert data["ok"] is False
    assert [row["promise"] for row in data["rows"] if not row["held"]] == ["clearance"]
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(report.table())
    text = console.export_text()
    assert text.count("BROKEN") == 1
    assert text.count("holds") == len(report.rows) - 1
    assert all(row.promise in text for row in report.rows)
    with pytest.raises(KeyError, match="foot slip"):
        report["no such promise"]


def test_a_recorded_margin_need_not_know_of_a_small_slip(machine: ModuleType, good: Bundle) -> None:
    slipped = machine.build(
        foot=lambda t: machine.foot_path(t) - [0.0, 8e-5 * machine.blend((t - 0.8) / 0.6), 0.0]
    )
    assert check(slipped)["foot slip"].worst > 7e-5
    assert check(slipped).ok


# ---------------------------------------------------------------------------------- phases without a margin


def test_a_phase_that_promises_no_margin_may_stand_on_two_feet(machine: ModuleType) -> None:
    promises = machine.phases()
    promises[REST].update(margin=NO_MARGIN, contacts=promises[REST]["contacts"][:2])
    assert broken(machine.build(promises=promises)) == set()


def test_a_region_that_holds_is_accepted(machine: ModuleType) -> None:
    promises = machine.phases()
    promises[SHIFT]["region"] = [[x, y] for x, y in machine.CORNERS]
    report = check(machine.build(promises=promises))
    assert report.ok
    assert report["region corners that do not hold"].worst == 0


def test_a_wall_holds_nothing_that_the_feet_do_not(machine: ModuleType) -> None:
    promises = machine.phases()
    promises[SHIFT]["region"] = [[x, y] for x, y in machine.CORNERS]
    promises[SHIFT]["contacts"][0].update(normal=[-1.0, 0.0, 0.0], friction=0.1)
    row = check(machine.build(promises=promises))["region corners that do not hold"]
    assert row.worst == 1
