"""What a tick promises: limits, recovery, settling, named causes, and no broken step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

FEET = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot", "limb1_foot", "limb2_foot")
BACKENDS = ("proxqp", "placo")


def stand(feet: Sequence[str] = FEET, **fields: object) -> wb.Phase:
    """A phase on these feet; other fields as given."""
    return wb.Phase("stand", contacts=[wb.Contact(f) for f in feet], **fields)  # type: ignore[arg-type]


def run(loop: wb.Loop, ticks: int) -> list[wb.Tick]:
    return [loop.step() for _ in range(ticks)]


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_start_outside_a_joint_limit_comes_back_inside_within_its_speed_and_acceleration(
    legarm: wb.Robot, backend: str
) -> None:
    q = np.array(legarm.state("manipulate").q)
    index, _ = legarm.joint_index("limb1_joint2")
    upper = legarm.joint_limits("limb1_joint2")[1]
    q[index] = upper + 0.2
    loop = wb.Loop(legarm, stand(FEET[:4], soft=[wb.PostureTask(weight=1.0)]), q, dt=0.01, backend=backend)
    speed = legarm.model.velocityLimit[legarm.joint_index("limb1_joint2")[1]]
    most = loop.compiled.acceleration[index - 7]
    outside = [upper + 0.2]
    for tick in run(loop, 60):
        outside.append(tick.q[index])
        assert abs(outside[-1] - outside[-2]) <= speed * 0.01 + 1e-9
    assert outside[1] < outside[0]
    assert outside[-1] <= upper + 1e-9
    steps = np.diff([upper + 0.2, *outside]) / 0.01
    assert np.abs(np.diff(steps)).max() <= most * 0.01 + 1e-9
    assert np.diff(outside).min() < -0.5 * min(speed * 0.01, np.sqrt(0.1 * most) * 0.01)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_com_outside_the_margin_moves_inward_and_the_tick_says_so(legarm: wb.Robot, backend: str) -> None:
    start = legarm.state("stand")
    limit = wb.SupportPolygon(margin=0.43, recovery_speed=0.05)
    shift = pin.SE3(np.eye(3), start.pose("body").translation + np.array([0.04, 0.0, 0.0]))
    there = wb.Loop(legarm, stand(soft=[wb.PoseTask("body", shift, weight=20.0)]), start, dt=0.01)
    run(there, 100)
    loop = wb.Loop(legarm, stand(limits=[wb.JointLimits(), limit]), there.q, dt=0.01, backend=backend)
    before = loop.margin
    assert before < 0.427
    first = loop.step()
    assert "margin not yet reached" in first.warning
    assert first.margin > before
    assert first.margin - before < 0.05 * 0.01 * 1.5
    last = run(loop, 150)[-1]
    assert last.margin >= 0.43 - 1e-6
    assert last.warning == ""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("dt", [0.002, 0.01])
@pytest.mark.parametrize("away", [(-0.3, 0.6, 0.3), (0.0, 0.3, 0.9), (-1.0, 0.0, 0.0)])
def test_an_unreachable_target_settles_and_stays_still(
    legarm: wb.Robot, backend: str, dt: float, away: tuple[float, float, float]
) -> None:
    start = legarm.state("manipulate")
    out = start.pose("limb1_tip").translation + np.array(away)
    phase = stand(
        FEET[:4],
        soft=[wb.PositionTask("limb1_tip", out, weight=20.0), wb.PostureTask(weight=0.1)],
        limits=[wb.JointLimits(), wb.SupportPolygon(0.02)],
    )
    loop = wb.Loop(legarm, phase, start, dt=dt, backend=backend)
    last = run(loop, round(12.0 / dt))[-round(0.2 / dt) :]
    assert max(np.abs(tick.v[6:]).max() for tick in last) < 1e-3
    assert loop.stack.errors()["position(limb1_tip).position"] > 0.01


def test_the_nearest_reachable_point_is_nearest(legarm: wb.Robot) -> None:
    """Feet and body held, an arm stretched towards a far point ends on the line from its shoulder plane."""
    start = legarm.state("manipulate")
    body = wb.PoseTask("body", start.pose("body"))
    shoulder = start.pose("body").translation
    target = start.pose("limb1_tip").translation + np.array([0.0, 1.0, 0.0])
    phase = stand(FEET[:4], hard=[body], soft=[wb.PositionTask("limb1_tip", target, weight=10.0)])
    loop = wb.Loop(legarm, phase, start, dt=0.01)
    settled = run(loop, 1500)[-1]
    best = np.linalg.norm(target - wb.State(legarm.model, settled.q).pose("limb1_tip").translation)
    rng = np.random.default_rng(0)
    low, high = legarm.model.lowerPositionLimit[7:], legarm.model.upperPositionLimit[7:]
    joints = [legarm.joint_index(f"limb1_joint{k}")[0] for k in range(1, 6)]
    for _ in range(300):
        q = np.array(settled.q)
        for j in joints:
            q[j] = np.clip(q[j] + rng.normal() * 0.1, low[j - 7], high[j - 7])
        other = np.linalg.norm(target - wb.State(legarm.model, q).pose("limb1_tip").translation)
        assert other >= best - 1e-5
    assert np.linalg.norm(shoulder - target) > best


def test_a_tick_names_the_limit_that_stops_it(legarm: wb.Robot) -> None:
    start = legarm.state("stand")
    up = pin.SE3(np.eye(3), start.pose("body").translation - np.array([0.0, 0.0, 0.15]))
    loop = wb.Loop(legarm, stand(soft=[wb.PoseTask("body", up, weight=20.0)]), start, dt=0.01)
    tick = run(loop, 400)[-1]
    names = [active.name for active in tick.active]
    assert any(name.startswith("leg") and name.endswith(("upper", "lower")) for name in names), names
    assert {active.kind for active in tick.active} <= {"position", "speed", "acceleration", "hard", "margin"}
    named = {n.rsplit(" ", 1)[0]: n.rsplit(" ", 1)[1] for n in names if n.endswith(("upper", "lower"))}
    for joint, side in named.items():
        index, _ = legarm.joint_index(joint)
        assert tick.q[index] == pytest.approx(legarm.joint_limits(joint)[side == "upper"], abs=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_tick_names_the_edge_that_stops_it(legarm: wb.Robot, backend: str) -> None:
    start = legarm.state("stand")
    away = pin.SE3(np.eye(3), start.pose("body").translation + np.array([0.1, 0.0, 0.02]))
    phase = stand(
        soft=[wb.PoseTask("body", away, weight=20.0)], limits=[wb.JointLimits(), wb.SupportPolygon(0.425)]
    )
    tick = run(wb.Loop(legarm, phase, start, dt=0.01, backend=backend), 400)[-1]
    edges = [a.name for a in tick.active if a.kind == "margin"]
    assert any("leg3_foot" in edge for edge in edges), tick.active
    assert tick.margin >= 0.425


@pytest.mark.parametrize("backend", BACKENDS)
def test_contradicting_hard_tasks_are_named_with_their_least_relaxation(
    legarm: wb.Robot, backend: str
) -> None:
    start = legarm.state("manipulate")
    here = start.pose("limb1_tip").translation
    hard = [
        wb.PositionTask("limb1_tip", here + np.array([0.0, 0.0, 0.004]), name="up"),
        wb.PositionTask("limb1_tip", here - np.array([0.0, 0.0, 0.002]), name="down"),
        wb.PositionTask("limb2_tip", start.pose("limb2_tip").translation, name="bystander"),
    ]
    loop = wb.Loop(legarm, stand(FEET[:4], hard=hard), start, dt=0.01, backend=backend)
    before = np.array(loop.q)
    with pytest.raises(wb.SolveError) as caught:
        loop.step()
    clashes = {clash.name: clash for clash in caught.value.clashes}
    assert set(clashes) == {"up", "down"}
    # The two are 6 mm apart: half of it each is the least that they can give way.
    for clash in clashes.values():
        assert clash.unit == "m"
        assert clash.amount == pytest.approx(0.003, rel=1e-3)
    assert "up" in str(caught.value)
    assert "down" in str(caught.value)
    np.testing.assert_array_equal(loop.q, before)
    assert loop.t == 0.0


def test_a_hard_target_beyond_the_speed_limit_is_refused_and_names_the_joints(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    far = start.pose("limb1_tip").translation + np.array([0.0, 0.0, 0.3])
    loop = wb.Loop(
        legarm, stand(FEET[:4], hard=[wb.PositionTask("limb1_tip", far, name="far")]), start, dt=0.01
    )
    with pytest.raises(wb.SolveError) as caught:
        loop.step()
    assert caught.value.clashes[0].name == "far"
    assert caught.value.limits


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_loops_saying_the_same_are_one_promise(legarm: wb.Robot, backend: str) -> None:
    start = legarm.state("manipulate")
    hard = [
        wb.RelativePoseTask("limb2_tip", root="limb1_tip", name="loop"),
        wb.RelativePoseTask("limb1_tip", root="limb2_tip", name="the same loop"),
    ]
    goal = pin.SE3(np.eye(3), start.pose("body").translation + np.array([0.0, 0.02, 0.01]))
    phase = stand(
        FEET[:4], hard=hard, soft=[wb.PoseTask("body", wb.MinJerk(wb.AS_IS, goal, 1.0), weight=10.0)]
    )
    loop = wb.Loop(legarm, phase, start, dt=0.01, backend=backend)
    closed = start.pose("limb1_tip").actInv(start.pose("limb2_tip"))
    for tick in run(loop, 120):
        state = wb.State(legarm.model, tick.q)
        gap = pin.log6(closed.actInv(state.pose("limb1_tip").actInv(state.pose("limb2_tip"))))
        assert np.linalg.norm(gap.linear) < 1e-4
        assert np.linalg.norm(gap.angular) < 1e-3
    assert np.linalg.norm(state.pose("body").translation - goal.translation) < 2e-3


@pytest.mark.parametrize("backend", BACKENDS)
def test_locked_and_driven_joints_move_as_given_and_contacts_hold(legarm: wb.Robot, backend: str) -> None:
    start = legarm.state("manipulate")
    index, _ = legarm.joint_index("limb1_joint4")
    locked, _ = legarm.joint_index("limb2_joint4")
    path = wb.MinJerk(wb.AS_IS, 1.2, 1.0)
    phase = stand(FEET[:4], soft=[wb.PostureTask()], driven={"limb1_joint4": path}, locked=("limb2_joint4",))
    loop = wb.Loop(legarm, phase, start, dt=0.01, backend=backend)
    feet = {f: start.pose(f).translation for f in FEET[:4]}
    for tick in run(loop, 100):
        expected = path.bind(np.asarray(start.joint("limb1_joint4"))).at(tick.t)
        assert tick.q[index] == pytest.approx(float(expected), abs=1e-9)
        assert tick.q[locked] == start.joint("limb2_joint4")
        state = wb.State(legarm.model, tick.q)
        for foot, point in feet.items():
            assert np.linalg.norm(state.pose(foot).translation - point) < 1e-4


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_target_that_is_not_finite_is_refused_at_the_door(legarm: wb.Robot, bad: float) -> None:
    with pytest.raises(wb.SpecError, match="limb1_tip"):
        wb.PositionTask("limb1_tip", (0.0, bad, 0.0))
    live = wb.Live(np.zeros(3))
    with pytest.raises(wb.SpecError, match="Live"):
        live.set((0.0, bad, 0.0))
    q = np.array(legarm.state("stand").q)
    q[9] = bad
    with pytest.raises(wb.SpecError):
        wb.Loop(legarm, stand(), q)
    with pytest.raises(wb.SpecError, match="weight"):
        wb.PoseTask("body", weight=bad)
    with pytest.raises(wb.SpecError, match="time"):
        wb.Loop(legarm, stand(), legarm.state("stand")).step(bad)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_path_that_breaks_its_word_is_not_integrated(legarm: wb.Robot, backend: str) -> None:
    """A user's own path may return anything: the tick refuses what is not finite and stays where it is."""

    class Broken(wb.Path):
        def at(self, t: float) -> np.ndarray:
            return np.array([0.3, 0.0, 0.2 if t < 0.015 else np.nan])

        live = True

    loop = wb.Loop(
        legarm,
        stand(soft=[wb.PositionTask("limb1_tip", Broken(), name="broken")]),
        legarm.state("stand"),
        dt=0.01,
        backend=backend,
    )
    loop.step()
    before = np.array(loop.q)
    with pytest.raises(wb.SpecError, match="Broken"):
        loop.step()
    np.testing.assert_array_equal(loop.q, before)
    assert np.isfinite(loop.q).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_live_target_is_followed_as_it_is_set(legarm: wb.Robot, backend: str) -> None:
    start = legarm.state("stand")
    live = wb.Live(start.pose("body"))
    loop = wb.Loop(
        legarm, stand(soft=[wb.PoseTask("body", live, weight=20.0)]), start, dt=0.005, backend=backend
    )
    run(loop, 5)
    goal = pin.SE3(
        pin.exp3(np.array([0.0, 0.0, 0.05])), start.pose("body").translation + np.array([0.01, 0.01, 0.03])
    )
    live.set(goal)
    run(loop, 200)
    reached = wb.State(legarm.model, loop.q).pose("body")
    assert np.linalg.norm(pin.log6(reached.actInv(goal)).vector) < 1e-3


def test_the_backends_agree_on_what_they_reach(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    goal = pin.SE3(
        pin.exp3(np.array([0.1, 0.0, 0.0])), start.pose("body").translation + np.array([0.02, -0.02, 0.0])
    )
    tip = start.pose("limb1_tip").translation + np.array([0.03, 0.02, -0.03])
    soft = [
        wb.PoseTask("body", wb.MinJerk(wb.AS_IS, goal, 1.0), weight=(20.0, 10.0)),
        wb.PositionTask("limb1_tip", wb.MinJerk(wb.AS_IS, tip, 1.0), weight=(10.0, 20.0, 30.0)),
        wb.ComTask(weight=(0.1, 0.1, 0.0)),
        wb.PostureTask(weight=0.1),
    ]
    phase = stand(FEET[:4], soft=soft, limits=[wb.JointLimits(), wb.SupportPolygon(0.02)])
    ends = {}
    for backend in BACKENDS:
        loop = wb.Loop(legarm, phase, start, dt=0.002, backend=backend)
        tick = run(loop, 500)[-1]
        ends[backend] = (tick.q, tick.errors)
    # Each corrects drift when it sees it, so their joints differ by what a tick may leave to the next.
    np.testing.assert_allclose(ends["proxqp"][0], ends["placo"][0], atol=3e-5)
    for name, error in ends["proxqp"][1].items():
        bound = 3e-5 if name.endswith("joints") else 1e-5
        assert ends["placo"][1][name] == pytest.approx(error, abs=bound), name


def test_an_unknown_backend_lists_those_that_exist(legarm: wb.Robot) -> None:
    with pytest.raises(wb.SpecError, match="proxqp, placo"):
        wb.Loop(legarm, stand(), legarm.state("stand"), backend="osqp")


def test_a_tick_keeps_what_it_reports(legarm: wb.Robot) -> None:
    """Errors and active limits read later are those of the tick, not of the loop as it is then."""
    start = legarm.state("stand")
    down = pin.SE3(np.eye(3), start.pose("body").translation - np.array([0.0, 0.0, 0.15]))
    phase = stand(soft=[wb.PoseTask("body", down, weight=20.0), wb.PostureTask(weight=0.1)])
    loop = wb.Loop(legarm, phase, start, dt=0.01)
    first = {a.name for a in wb.Loop(legarm, phase, start, dt=0.01).step().active}
    ticks, errors = [], []
    for _ in range(60):
        ticks.append(loop.step())
        errors.append(loop.stack.errors())
    assert errors[0] != errors[-1]
    assert [dict(tick.errors) for tick in ticks] == errors
    assert {a.name for a in ticks[0].active} == first
    assert {a.kind for a in ticks[0].active} != {a.kind for a in ticks[-1].active}


def test_a_posture_path_that_breaks_its_word_is_refused(legarm: wb.Robot) -> None:
    class Broken(wb.Path):
        def at(self, t: float) -> float:
            return 0.1 if t < 0.015 else np.nan

    phase = stand(soft=[wb.PostureTask({"leg3_joint2": Broken()}, weight=1.0)])
    loop = wb.Loop(legarm, phase, legarm.state("stand"), dt=0.01)
    loop.step()
    before = np.array(loop.q)
    with pytest.raises(wb.SpecError, match="posture"):
        loop.step()
    np.testing.assert_array_equal(loop.q, before)


@pytest.mark.parametrize("dt", ["0.01", 0.0, -1.0, np.nan])
def test_a_tick_needs_a_length(legarm: wb.Robot, dt: float) -> None:
    with pytest.raises(wb.SpecError, match="dt"):
        wb.Loop(legarm, stand(), legarm.state("stand"), dt=dt)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_com_that_cannot_come_inside_stays_where_it_is(legarm: wb.Robot, backend: str) -> None:
    """Every joint is locked, so nothing can move inward: that is no reason to find no step."""
    start = legarm.state("stand")
    limits = [wb.JointLimits(), wb.SupportPolygon(margin=0.5)]
    loop = wb.Loop(legarm, stand(limits=limits, locked=legarm.joint_names), start, dt=0.01, backend=backend)
    tick = loop.step()
    assert "margin not yet reached" in tick.warning
    np.testing.assert_allclose(tick.q, start.q, atol=2e-5)  # the drift that is left to the next tick, twice


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("feet", [FEET, FEET[:4]], ids=["six feet", "four feet"])
def test_a_body_that_is_asked_too_high_settles_on_its_stretched_legs(
    legarm: wb.Robot, backend: str, feet: Sequence[str]
) -> None:
    """The base has no lever arm of its own: what bends its path are the legs that it stands on."""
    start = legarm.state("stand")
    high = pin.SE3(np.eye(3), start.pose("body").translation + np.array([0.0, 0.0, 0.2]))
    soft = [wb.PoseTask("body", high, weight=((0.5, 0.5, 20.0), 0.5)), wb.PostureTask(weight=0.1)]
    loop = wb.Loop(legarm, stand(feet, soft=soft), start, dt=0.01, backend=backend)
    last = run(loop, 1000)[-20:]
    assert max(np.abs(tick.v[6:]).max() for tick in last) < 1e-3
    assert last[-1].errors["pose(body).position"] > 0.05
