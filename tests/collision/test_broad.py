"""No pair that is near is ever left out, however the robot came to be where it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wbplan as wb

NEAR = 0.03
GRID = np.linspace(-1.0, 1.0, 5)
#: How far [m] two measurements of a distance may differ: one begins where it ended the last time.
NOISE = 2e-5


@pytest.fixture(scope="module", params=["legarm_hexapod", "hiphant"])
def loop(request: pytest.FixtureRequest) -> wb.Loop:
    """A robot with a box in one hand, over the ground and beside a wall and a ball."""
    robot = wb.load_robot(request.param)
    start = robot.state("manipulate" if request.param == "legarm_hexapod" else "ready")
    hand = next(iter(robot.hands.values()))
    held = start.pose(hand) * pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    box = wb.Body("box", mass=0.1, size=(0.1, 0.1, 0.1), pose=held)
    world = (
        wb.Obstacle("ground", wb.Ground()),
        wb.Obstacle("wall", wb.Box((0.05, 2.0, 2.0)), (0.9, 0.0, 0.0)),
        wb.Obstacle("ball", wb.Sphere(0.1), (-0.4, 0.3, 0.4)),
        wb.Obstacle("hills", wb.HeightField(GRID, GRID, np.zeros((5, 5))), (0.0, 0.0, -0.3)),
    )
    phase = wb.Phase(
        "any",
        carried=[wb.Carried(box, by=hand)],
        soft=[wb.PostureTask()],
        limits=[wb.JointLimits(), wb.SelfCollision(0.0, NEAR), wb.Obstacles(world, 0.0, NEAR)],
    )
    return wb.Loop(robot, phase, start.q, placed={"box": held}, bodies=[box])


class Everything:
    """Distances of all pairs, by themselves."""

    def __init__(self, loop: wb.Loop) -> None:
        self._kinematics = loop.stack.kinematics
        clearance = loop.stack.clearance
        assert clearance is not None
        self.model = clearance.model
        self._data = self.model.geometry.createData()

    def distances(self) -> np.ndarray:
        kin, geometry = self._kinematics, self.model.geometry
        pin.updateGeometryPlacements(kin.model, kin.data, geometry, self._data)
        count = len(geometry.collisionPairs)
        return np.array([pin.computeDistance(geometry, self._data, k).min_distance for k in range(count)])


def missed(loop: wb.Loop, everything: Everything, q: np.ndarray) -> list[str]:
    """Pairs that are near at a configuration and not measured, or measured wrongly."""
    clearance = loop.stack.clearance
    assert clearance is not None
    loop.stack.kinematics.update(q)
    clearance.measure()
    true = everything.distances()
    told = (clearance.spare + clearance.model.bound)[: len(true)]  # those with height fields come last
    near = true < clearance.model.influence[: len(true)] - NOISE
    wrong = near & ~(np.abs(told - true) < np.where(true > 0.0, NOISE, 2e-3))
    return [
        f"{clearance.model.name(int(p))}: {true[p]:.5f}, told {told[p]:.5f}" for p in np.flatnonzero(wrong)
    ]


def moves(robot: wb.Robot, rng: np.random.Generator, size: float) -> np.ndarray:
    """A step of the whole robot, some of its joints faster than others."""
    step = size * rng.normal(size=robot.model.nv) * rng.choice([0.0, 0.1, 1.0], robot.model.nv)
    return np.asarray(step)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([1e-4, 1e-3, 0.01, 0.1]))
def test_nothing_near_is_missed(loop: wb.Loop, seed: int, size: float) -> None:
    """Steady motions, turns on the spot, sudden jumps and a glance at a broken configuration."""
    rng = np.random.default_rng(seed)
    model = loop.compiled.model
    everything = Everything(loop)
    q = np.array(loop.q)
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    step = moves(loop.compiled.robot, rng, size)
    for k in range(24):
        if k % 6 == 5:
            step = moves(loop.compiled.robot, rng, size)
        jump = moves(loop.compiled.robot, rng, 0.5) if rng.random() < 0.1 else 0.0
        q = pin.integrate(model, q, step + jump)
        q[7:] = np.clip(q[7:], low, high)
        if rng.random() < 0.05:
            loop.stack.kinematics.update(np.full(model.nq, np.nan))
            assert loop.stack.clearance is not None
            loop.stack.clearance.measure()
        assert missed(loop, everything, q) == []


def test_far_pairs_are_left_alone(loop: wb.Loop) -> None:
    """On a slow way few boxes are compared again."""
    clearance = loop.stack.clearance
    assert clearance is not None
    model, q = loop.compiled.model, np.array(loop.q)
    step = 1e-4 * np.ones(model.nv)
    compared: list[int] = []
    broad: Any = clearance._broad
    for _ in range(50):
        q = pin.integrate(model, q, step)
        loop.stack.kinematics.update(q)
        before = broad._at.copy()
        clearance.measure()
        compared.append(int((broad._at != before).sum()))
    assert sum(compared[1:]) / 49 < 0.1 * len(clearance.model.first)


def test_a_pose_that_is_no_number_keeps_no_promise(loop: wb.Loop) -> None:
    """Nothing is measured there, nothing is said to be kept, and the next good pose is measured again."""
    clearance = loop.stack.clearance
    assert clearance is not None
    q = np.array(loop.q)
    q[9] = np.nan
    loop.stack.kinematics.update(q)
    clearance.measure()
    assert clearance.checked == 0
    assert not clearance.kept()
    assert missed(loop, Everything(loop), np.array(loop.q)) == []
    clearance.start()
    assert clearance.kept()
