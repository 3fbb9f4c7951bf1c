"""Nothing is the hexapod's own: a small four-legged machine from a bare URDF, without an SRDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

CORNERS = {"lf": (0.25, 0.15), "rf": (0.25, -0.15), "lh": (-0.25, 0.15), "rh": (-0.25, -0.15)}
LENGTH = 0.2  # of thigh and shank [m]


def link(name: str, mass: float, size: tuple[float, float, float], z: float = 0.0) -> str:
    x, y, h = size
    i = [mass / 12.0 * (a * a + b * b) for a, b in ((y, h), (x, h), (x, y))]
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{i[0]}" iyy="{i[1]}" izz="{i[2]}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<visual><origin xyz="0 0 {z}"/><geometry><box size="{x} {y} {h}"/></geometry></visual></link>'
    )


def joint(name: str, parent: str, child: str, xyz: str, axis: str, limits: tuple[float, float] | None) -> str:
    moves = ""
    if limits is not None:
        moves = (
            f'<axis xyz="{axis}"/><limit lower="{limits[0]}" upper="{limits[1]}" effort="20" velocity="4"/>'
        )
    return (
        f'<joint name="{name}" type="{"fixed" if limits is None else "revolute"}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/>{moves}</joint>'
    )


def urdf() -> str:
    parts = [link("trunk", 6.0, (0.6, 0.25, 0.1)), '<link name="mast"/>']
    parts.append(joint("mast_fixed", "trunk", "mast", "0.1 0 0.2", "", None))
    for leg, (x, y) in CORNERS.items():
        parts += [
            link(f"{leg}_hip", 0.2, (0.05, 0.05, 0.05)),
            link(f"{leg}_thigh", 0.3, (0.04, 0.04, LENGTH), -LENGTH / 2),
            link(f"{leg}_shank", 0.2, (0.03, 0.03, LENGTH), -LENGTH / 2),
            f'<link name="{leg}_sole"/>',
            joint(f"{leg}_roll", "trunk", f"{leg}_hip", f"{x} {y} 0", "1 0 0", (-0.8, 0.8)),
            joint(f"{leg}_pitch", f"{leg}_hip", f"{leg}_thigh", "0 0 0", "0 1 0", (-1.5, 2.0)),
            joint(f"{leg}_knee", f"{leg}_thigh", f"{leg}_shank", f"0 0 -{LENGTH}", "0 1 0", (-2.5, -0.05)),
            joint(f"{leg}_ankle", f"{leg}_shank", f"{leg}_sole", f"0 0 -{LENGTH}", "", None),
        ]
    return f'<?xml version="1.0"?><robot name="dog">{"".join(parts)}</robot>'


@pytest.fixture(scope="module")
def dog(tmp_path_factory: pytest.TempPathFactory) -> wb.Robot:
    path = tmp_path_factory.mktemp("dog") / "dog.urdf"
    path.write_text(urdf(), encoding="utf-8")
    return wb.load_robot(path, feet={leg: f"{leg}_sole" for leg in CORNERS})


@pytest.fixture(scope="module")
def crouched(dog: wb.Robot) -> wb.State:
    q = np.array(pin.neutral(dog.model))
    for leg in CORNERS:
        q[dog.joint_index(f"{leg}_pitch")[0]] = 0.6
        q[dog.joint_index(f"{leg}_knee")[0]] = -1.2
    q[2] = 2.0 * LENGTH * np.cos(0.6)
    return dog.state(q)


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_another_robot_sways_and_keeps_its_promises(
    dog: wb.Robot, crouched: wb.State, tmp_path: Path, backend: str
) -> None:
    here = crouched.pose("trunk")
    way = [
        wb.AS_IS,
        pin.SE3(pin.exp3(np.array([0.08, 0.0, 0.1])), here.translation + np.array([0.03, 0.02, -0.02])),
        pin.SE3(pin.exp3(np.array([-0.08, 0.05, 0.0])), here.translation + np.array([-0.03, -0.02, 0.01])),
        here,
    ]
    phase = wb.Phase(
        "sway",
        contacts=[wb.Contact(dog.feet[leg], friction=0.6) for leg in CORNERS],
        soft=[
            wb.PoseTask("trunk", wb.Waypoints((0.0, 0.5, 1.0, 1.5), way), weight=(20.0, 10.0)),
            wb.PostureTask(weight=0.01),
            wb.DampingTask(),
        ],
        limits=[wb.JointLimits(speed=0.9), wb.SupportPolygon(margin=0.05)],
        duration=1.5,
    )
    plan = wb.plan(dog, phase, start=crouched, dt=0.01, backend=backend)
    report = plan.check()
    assert report.ok, report
    tilt = [pin.XYZQUATToSE3(row[:7]).rotation for row in plan.trajectory.q]
    assert max(np.linalg.norm(pin.log3(turn)) for turn in tilt) > 0.1
    worst = plan.bundle.phases[0]["tasks"][0]
    assert worst["position"] < 1e-3
    assert worst["orientation"] < 2e-3
    assert wb.check(wb.Bundle.read(plan.bundle.write(tmp_path / "sway"))).ok


def test_another_robot_lifts_a_foot_and_carries(dog: wb.Robot, crouched: wb.State) -> None:
    bag = wb.Body("bag", mass=0.5, size=(0.1, 0.1, 0.1), com=(0.0, 0.0, 0.02))
    feet = [dog.feet[leg] for leg in CORNERS]
    sole = crouched.pose("lf_sole").translation
    body = crouched.pose("trunk")
    back = pin.SE3(body.rotation, body.translation + np.array([-0.06, -0.05, 0.0]))
    common = {"carried": [wb.Carried(bag, by="mast")], "limits": [wb.JointLimits(), wb.SupportPolygon(0.01)]}
    shift = wb.PoseTask("trunk", wb.MinJerk(wb.AS_IS, back, 0.8), weight=20.0)
    step = wb.PositionTask("lf_sole", wb.Swing(wb.AS_IS, sole + np.array([0.04, 0.0, 0.0]), 0.03, 0.6))
    keep = [wb.PoseTask("trunk", weight=10.0), wb.PostureTask(weight=0.01)]
    plan = wb.plan(
        dog,
        wb.Script(
            wb.Phase("shift", contacts=[wb.Contact(f) for f in feet], soft=[shift], duration=0.9, **common),
            wb.Phase(
                "step",
                contacts=[wb.Contact(f) for f in feet[1:]],
                hard=[step],
                soft=keep,
                duration=0.6,
                **common,
            ),
        ),
        start=crouched,
    )
    assert plan.check().ok
    soles = [wb.State(dog.model, q).pose("lf_sole").translation for q in plan.trajectory.q]
    assert max(point[2] for point in soles) == pytest.approx(sole[2] + 0.03, abs=2e-3)
    np.testing.assert_allclose(soles[-1], sole + np.array([0.04, 0.0, 0.0]), atol=1e-4)


def test_roles_are_unknown_to_a_robot_without_any(dog: wb.Robot, crouched: wb.State) -> None:
    with pytest.raises(wb.SpecError, match=r"roles: limb 'lf' does not exist; there are: none"):
        wb.plan(dog, wb.Phase("p", roles={"lf": "arm"}), start=crouched)


def test_a_foot_that_must_not_slip_is_named_by_its_frame(dog: wb.Robot, crouched: wb.State) -> None:
    with pytest.raises(wb.SpecError, match=r"phase 'p'\.contacts: robot 'dog': no frame 'lf'; .*lf_"):
        wb.plan(dog, wb.Phase("p", contacts=[wb.Contact("lf")]), start=crouched)
