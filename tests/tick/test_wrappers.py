"""PlaCo's robots are used again, never by two at once, and as if they were new."""

from __future__ import annotations

import gc
import threading
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.backends.wrappers import WRAPPERS, Wrappers
from wbplan.compiled.phase import CompiledPhase, compile_phase


class Owner:
    """Of a lent robot."""


def phase(
    robot: wb.Robot, limits: wb.JointLimits | None = None, mass: float = 0.0, at: float = 0.1
) -> wb.Phase:
    """A stand on all feet that leans sideways, with a body in one hand."""
    pose = pin.SE3(pin.exp3(np.full(3, 3.0 * at)), np.array([at, 0.02, 0.0]))
    body = wb.Body("load", mass=mass, size=(0.1, 0.1, 0.1), com=(0.0, 0.03, 0.01))
    return wb.Phase(
        "stand",
        contacts=[wb.Contact(foot) for foot in list(robot.feet.values())[2:]],
        carried=[wb.Carried(body, by="limb1_tip", pose=pose)],
        soft=[
            wb.PostureTask(weight=0.1),
            wb.ComTask(np.array([0.1, -0.1, 0.2]), gain=20.0),
            wb.PositionTask("load", np.array([0.5, 0.5, 0.5]), gain=20.0),
        ],
        limits=[limits or wb.JointLimits(), wb.SupportPolygon(0.01)],
    )


def run(robot: wb.Robot, made: wb.Phase, ticks: int = 5) -> np.ndarray:
    loop = wb.Loop(robot, made, robot.state("manipulate"), dt=0.01, backend="placo")
    return np.array([loop.step().q for _ in range(ticks)])


def test_many_loops_one_after_the_other_share_a_robot(legarm: wb.Robot) -> None:
    gc.collect()
    before = WRAPPERS.made
    for k in range(20):
        run(legarm, phase(legarm, mass=0.1 * k, at=0.01 * k), ticks=1)
    assert WRAPPERS.made <= before + 2


def test_a_used_robot_is_as_a_new_one(legarm: wb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbplan.backends.placo.WRAPPERS", pool := Wrappers())
    wanted = phase(legarm, mass=1.0)
    fresh = run(legarm, wanted)
    run(legarm, phase(legarm, wb.JointLimits(speed=0.01), mass=5.0, at=0.3), ticks=50)
    again = run(legarm, wanted)
    assert pool.made == 1
    np.testing.assert_array_equal(again, fresh)


def test_two_loops_at_once_have_a_robot_each(legarm: wb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbplan.backends.placo.WRAPPERS", pool := Wrappers())
    wanted = phase(legarm, mass=1.0)
    alone = run(legarm, wanted)
    start = legarm.state("manipulate")
    loops = [wb.Loop(legarm, wanted, start, dt=0.01, backend="placo") for _ in range(2)]
    both = np.array([[loop.step().q for loop in loops] for _ in range(5)])
    assert pool.made == 2
    np.testing.assert_array_equal(both[:, 0], alone)
    np.testing.assert_array_equal(both[:, 1], alone)


def test_a_restart_keeps_the_results(legarm: wb.Robot) -> None:
    wanted = phase(legarm, mass=1.0)
    loop = wb.Loop(legarm, wanted, legarm.state("manipulate"), dt=0.01, backend="placo")
    steps = []
    for _ in range(5):
        steps.append(loop.step().q)
        loop.restart()
    np.testing.assert_allclose(np.array(steps), run(legarm, wanted), atol=1e-9)


def test_a_lent_robot_has_the_phase_s_limits_masses_and_bodies(legarm: wb.Robot) -> None:
    pool, start = Wrappers(), legarm.state("manipulate")
    for mass, at in ((0.0, 0.0), (2.0, 0.2), (0.5, -0.1)):
        compiled = compile_phase(legarm, phase(legarm, mass=mass, at=at), start.q)
        owner = Owner()
        robot = pool.lend(owner, compiled)
        _spoil(robot, legarm)
        del owner
        owner = Owner()
        robot = pool.lend(owner, compiled)
        robot.state.q = start.q
        robot.update_kinematics()
        data = compiled.model.createData()
        pin.framesForwardKinematics(compiled.model, data, start.q)
        np.testing.assert_allclose(
            robot.com_world(), pin.centerOfMass(compiled.model, data, start.q), atol=1e-12
        )
        place = data.oMf[compiled.held[0].frame].homogeneous
        np.testing.assert_allclose(robot.get_T_world_frame("load"), place, atol=1e-12)
        for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
            np.testing.assert_array_equal(getattr(robot.model, name)[6:], getattr(legarm.model, name)[6:])
        del owner
    assert pool.made == 1


def _spoil(robot: Any, of: wb.Robot) -> None:
    for name in of.joint_names:
        robot.set_joint_limits(name, -0.01, 0.01)
        robot.set_velocity_limit(name, 1e-3)
    robot.state.q = robot.state.q + 1.0
    robot.model.upperPositionLimit[7:] = 1e20


def test_threads_never_get_the_same_robot(legarm: wb.Robot) -> None:
    pool, start = Wrappers(), legarm.state("manipulate")
    compiled: CompiledPhase = compile_phase(legarm, phase(legarm), start.q)
    used: set[int] = set()
    clashes: list[int] = []

    def work() -> None:
        for _ in range(10):
            owner = Owner()
            robot = pool.lend(owner, compiled)
            if id(robot) in used:
                clashes.append(id(robot))
            used.add(id(robot))
            for _ in range(100):
                robot.update_kinematics()
            used.discard(id(robot))
            del owner

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not clashes
    assert pool.made <= 4


def test_a_loop_is_gone_when_nobody_has_it_and_its_ticks_still_say_why(legarm: wb.Robot) -> None:
    loop = wb.Loop(legarm, phase(legarm), legarm.state("manipulate"), dt=0.01)
    tick, gone = loop.step(), weakref.ref(loop)
    said = str(tick.why("load"))
    del loop
    assert gone() is None
    assert str(tick.why("load")) == said


def test_a_given_joint_may_be_a_hair_beyond_its_limit(legarm: wb.Robot) -> None:
    """pi/2, where the URDF has its first eleven digits."""
    joint = "limb1_finger_a"
    limit = legarm.joint_limits(joint)[1]
    assert 0.0 < np.pi / 2 - limit < 1e-11
    moved = wb.Phase("close", driven={joint: np.pi / 2}, duration=0.5, limits=[wb.JointLimits()])
    loop = wb.Loop(legarm, moved, legarm.state("stand"), dt=0.01, backend="placo")
    for _ in range(60):
        tick = loop.step()
    assert tick.q[legarm.joint_index(joint)[0]] == pytest.approx(np.pi / 2, abs=1e-12)


def test_what_only_the_looks_say_twice_does_not_disturb_placo(legarm: wb.Robot, tmp_path: Path) -> None:
    """Its reader refuses two materials of one name, which Pinocchio's does not see."""
    twice = '<material name="grey"><color rgba="1 1 1 1"/></material>' * 2
    text = legarm.urdf_text.replace("</robot>", f"{twice}</robot>")
    path = tmp_path / "twice.urdf"
    path.write_text(text, encoding="utf-8")
    assert legarm.srdf_path is not None
    path.with_suffix(".srdf").write_text(legarm.srdf_path.read_text(encoding="utf-8"), encoding="utf-8")
    robot = wb.load_robot(path, package_dirs=[legarm.urdf_path.parent])
    phase = wb.Phase("still", soft=[wb.PostureTask()], limits=[wb.JointLimits()])
    assert wb.Loop(robot, phase, robot.state("stand"), dt=0.01, backend="placo").step().q.size


def test_a_robot_that_placo_cannot_read_is_refused(legarm: wb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object) -> None:
        raise ValueError("no\nrobot")

    monkeypatch.setattr("placo.RobotWrapper", refuses)
    monkeypatch.setattr("wbplan.backends.placo.WRAPPERS", Wrappers())
    phase = wb.Phase("still", soft=[wb.PostureTask()], limits=[wb.JointLimits()])
    with pytest.raises(wb.SpecError, match="'placo' cannot read robot 'legarm_hexapod': no robot"):
        wb.Loop(legarm, phase, legarm.state("stand"), dt=0.01, backend="placo")
