"""The compiled arithmetic against Pinocchio, and the linear solve against the solver it stands in for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import proxsuite
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb
from wbplan.backends.kkt import ActiveSetGuess
from wbplan.program.kernels import log_derivative, rotation_log
from wbplan.program.qp import Multipliers
from wbplan.program.stack import Stack
from wbplan.sampling import sample

angles = st.floats(0.0, np.pi - 1e-6)
components = st.floats(-1.0, 1.0)


@given(components, components, components, angles)
def test_rotation_log_is_pinocchios(x: float, y: float, z: float, angle: float) -> None:
    axis = np.array([x, y, z])
    if np.linalg.norm(axis) < 1e-3:
        axis = np.array([0.0, 0.0, 1.0])
    rotation = pin.exp3(angle * axis / np.linalg.norm(axis))
    out = np.zeros(3)
    rotation_log(rotation, out)
    np.testing.assert_allclose(pin.exp3(out), rotation, atol=1e-9)
    assert np.linalg.norm(out) <= np.pi + 1e-9
    if angle < np.pi - 1e-3:
        np.testing.assert_allclose(out, pin.log3(rotation), atol=1e-8)


@given(components, components, components)
def test_the_derivative_of_the_rotation_log_is_pinocchios(x: float, y: float, z: float) -> None:
    e = 1.7 * np.array([x, y, z])
    out = np.zeros((3, 3))
    log_derivative(e, out)
    np.testing.assert_allclose(out, pin.Jlog3(pin.exp3(e)), atol=1e-8)


def pose(*numbers: float) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array(numbers[3:])), np.array(numbers[:3]))


PATHS = {
    "min jerk": wb.MinJerk(pose(0, 0, 0, 0, 0, 0), pose(1, 2, 3, 0.5, -0.3, 1.0), 1.5),
    "min jerk, turning nothing": wb.MinJerk(pose(0, 0, 1, 0.1, 0, 0), pose(1, 2, 3, 0.1, 0, 0), 1.5),
    "min jerk of points": wb.MinJerk(np.zeros(3), np.array([1.0, -1.0, 0.5]), 0.7),
    "min jerk of rotations": wb.MinJerk(np.eye(3), pin.exp3(np.array([0.3, 0.2, 0.1])), 1.0),
    "line": wb.Line(pose(0, 1, 0, 0.2, 0, 0), pose(1, 0, 0, 0, 0.4, 0), 2.0),
    "swing": wb.Swing(np.zeros(3), np.array([0.2, 0.1, 0.0]), 0.05, 0.8),
    "swing of poses": wb.Swing(pose(0, 0, 0, 0, 0, 0), pose(0.1, 0, 0, 0, 0, 0.5), 0.05, 0.8),
    "waypoints": wb.Waypoints(
        (0, 1, 2), (pose(0, 0, 0, 0, 0, 0), pose(1, 0, 0, 0, 1, 0), pose(0, 1, 0, 2, 0, 0))
    ),
    "waypoints of points": wb.Waypoints((0, 1, 2), (np.zeros(3), np.ones(3), np.array([0.0, 1.0, -1.0]))),
    "waypoints of rotations": wb.Waypoints((0, 1), (np.eye(3), pin.exp3(np.array([0.0, 0.5, 0.0])))),
    "hold": wb.Hold(pose(1, 2, 3, 0.1, 0.2, 0.3)),
}


@pytest.mark.parametrize("kind", PATHS)
def test_many_times_at_once_are_the_same_as_one_by_one(kind: str) -> None:
    path = PATHS[kind]
    times = np.linspace(0.0, 2.5, 26)
    points, rotations = sample(path, times)
    for k, t in enumerate(times):
        value = path.at(float(t))
        if isinstance(value, pin.SE3):
            np.testing.assert_allclose(points[k], value.translation, atol=1e-12)
            np.testing.assert_allclose(rotations[k], value.rotation, atol=1e-12)
        elif np.shape(value) == (3, 3):
            np.testing.assert_allclose(rotations[k], value, atol=1e-12)
        else:
            np.testing.assert_allclose(points[k], value, atol=1e-12)


def clamp_like(robot: wb.Robot) -> wb.Phase:
    """Loop, polygon and targets that run into joint limits and out again."""
    start = robot.state("manipulate")
    out = start.pose("body").translation + np.array([0.06, 0.1, -0.08])
    tour = wb.Waypoints(
        (0.0, 1.0, 2.0), (wb.AS_IS, pin.SE3(pin.exp3(np.array([0.2, 0.0, 0.3])), out), wb.AS_IS)
    )
    return wb.Phase(
        "tour",
        contacts=[wb.Contact(f"leg{i}_foot") for i in (3, 4, 5, 6)],
        hard=[wb.RelativePoseTask("limb2_tip", root="limb1_tip")],
        soft=[wb.PoseTask("body", tour, weight=(20.0, 5.0)), wb.PostureTask(weight=0.1)],
        limits=[wb.JointLimits(), wb.SupportPolygon(0.15)],
    )


def asked_of_proxqp(stack: Stack) -> proxsuite.proxqp.Results:
    """The same problem, put to the solver from nothing and solved sharply."""
    n, m, e = len(stack.g), len(stack.b), len(stack.d)
    qp = proxsuite.proxqp.dense.QP(n, m, e, True)
    qp.settings.eps_abs, qp.settings.eps_rel = 1e-11, 0.0
    qp.init(stack.H, stack.g, stack.A, stack.b, stack.C, np.full(e, -1e20), stack.d, stack.lower, stack.upper)
    qp.solve()
    return qp.results


def test_the_linear_solve_finds_the_solvers_step_and_multipliers(
    legarm: wb.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    found_active, hits, sets = 0, [], set()
    solve = ActiveSetGuess.solve

    def compared(self: ActiveSetGuess) -> tuple[np.ndarray, Multipliers] | None:
        nonlocal found_active
        found = solve(self)
        hits.append(found is not None)
        if found is not None:
            x, multipliers = found
            results, rows = asked_of_proxqp(self._stack), len(self._stack.d)
            np.testing.assert_allclose(x, results.x, atol=2e-7)
            scale = np.abs(results.z).max(initial=0.0) + 1e-3
            np.testing.assert_allclose(multipliers.rows, results.z[:rows], atol=1e-5 * scale)
            np.testing.assert_allclose(multipliers.box, results.z[rows:], atol=1e-5 * scale)
            found_active += int((np.abs(multipliers.box) > 1e-6).any())
            sets.add(tuple(np.flatnonzero(np.abs(multipliers.box) > 1e-6)))
        return found

    monkeypatch.setattr(ActiveSetGuess, "solve", compared)
    loop = wb.Loop(legarm, clamp_like(legarm), legarm.state("manipulate"), dt=0.01)
    for _ in range(200):
        loop.step()
    assert found_active > 10, "hardly a limit was ever active: the test shows nothing"
    assert np.mean(hits) > 0.7  # joints that run into limits and out again, within their acceleration
    assert len(sets) > 3, "the active bounds hardly changed: the test shows nothing"
