"""One case: files mutated from a seed, and everything that a user would do with them.

What comes out is "done", or the kind of `WbplanError`; any other exception is a finding.
"""

from __future__ import annotations

import contextlib
import json
import random
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from fuzz_arrays import mutate_npz
from fuzz_python import mutate_python
from fuzz_text import chance, mutate_json, mutate_xml, scarred

import wbplan as wb
from wbplan import catalog
from wbplan.errors import WbplanError
from wbplan.physics import Options
from wbplan.physics.motion import motion_of
from wbplan.physics.scene import scene_of
from wbplan.plots import overview as plots
from wbplan.taskfile import glance, load_task
from wbplan.view.playback import page
from wbplan.view.robot_meshes import robot_meshes

TESTS = Path(__file__).resolve().parent.parent
KINDS = ("urdf", "srdf", "task", "bundle")
SHARE = {"urdf": 0.3, "srdf": 0.2, "task": 0.2, "bundle": 0.3}
TETRAHEDRON = (
    "solid t\n"
    + "".join(
        "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {v}\n" for v in face) + "endloop\nendfacet\n"
        for face in (
            ("0 0 0", "0 .1 0", ".1 0 0"), ("0 0 0", ".1 0 0", "0 0 .1"), ("0 0 0", "0 0 .1", "0 .1 0"),
            (".1 0 0", "0 .1 0", "0 0 .1"),
        )
    )
    + "endsolid t\n"
).encode()  # fmt: skip


def run_case(kind: str, seed: int, folder: Path) -> str:
    """Make the files of a case in an empty folder and use them."""
    rng = random.Random(f"{kind} {seed}")
    use: Callable[[random.Random, Path], None] = {
        "urdf": _urdf, "srdf": _srdf, "task": _task, "bundle": _bundle,
    }[kind]  # fmt: skip
    try:
        use(rng, folder)
    except WbplanError as error:
        said = str(error)
        assert said.strip(), "an error without a word"
        assert len(said) < 200_000, "an error of a novel's length"
        return type(error).__name__
    return "done"


@cache
def _module(name: str, path: str) -> ModuleType:
    spec = spec_from_file_location(name, TESTS / path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # its dataclasses look it up
    spec.loader.exec_module(module)
    return module


@cache
def _texts() -> dict[str, tuple[str, str]]:
    """Robot -> its URDF and SRDF."""
    toy = _module("toys", "robot/conftest.py")
    toys = {"toy": (toy.biped(), toy.BIPED_SRDF)}
    for name, path in catalog.robots().items():
        toys[name] = (path.read_text(encoding="utf-8"), path.with_suffix(".srdf").read_text(encoding="utf-8"))
    mesh = '<visual><geometry><mesh filename="t.stl" scale="1 1 1"/></geometry></visual>'
    mesh += '<collision><origin xyz="0 0 0" rpy="0 0 0.1"/><geometry>'
    mesh += '<sphere radius="0.1"/></geometry></collision>'
    toys["shaped"] = (
        toys["toy"][0].replace('<link name="body">', f'<link name="body">{mesh}'),
        toy.BIPED_SRDF,
    )
    return toys


def _pick(rng: random.Random) -> tuple[str, str]:
    """The toys are quicker than the shipped robots, and have as many ways to be wrong."""
    names = list(_texts())
    return _texts()[rng.choice([*names, "toy", "toy", "toy", "shaped", "shaped", "shaped"])]


# --------------------------------------------------------------------------------------------- robots


def _urdf(rng: random.Random, folder: Path) -> None:
    urdf, srdf = _pick(rng)
    path = folder / "robot.urdf"
    path.write_bytes(mutate_xml(rng, urdf))
    (folder / "t.stl").write_bytes(TETRAHEDRON if chance(rng, 0.8) else scarred(rng, TETRAHEDRON))
    if chance(rng, 0.5):
        path.with_suffix(".srdf").write_text(srdf, encoding="utf-8")
    _use_robot(rng, path)


def _srdf(rng: random.Random, folder: Path) -> None:
    urdf, srdf = _pick(rng)
    path = folder / "robot.urdf"
    path.write_text(urdf, encoding="utf-8")
    (folder / "t.stl").write_bytes(TETRAHEDRON)
    path.with_suffix(".srdf").write_bytes(mutate_xml(rng, srdf))
    _use_robot(rng, path)


def _use_robot(rng: random.Random, path: Path) -> None:
    robot = wb.load_robot(path)
    robot.summary()
    for pose in robot.pose_names:
        state = robot.state(pose)
        assert np.isfinite(state.q).all()
        assert np.isfinite(state.com).all()
        robot.standing_feet(state.q)
    if chance(rng, 0.3):
        with contextlib.suppress(WbplanError):  # a mesh that no reader takes is the picture's affair
            robot_meshes(robot.urdf_text, urdf_dir=path.parent)
    _tick(rng, robot, robot.pose_names[0])


def _tick(rng: random.Random, robot: wb.Robot, pose: str) -> None:
    """Two ticks with what there is to stand on."""
    state = robot.state(pose)
    feet = robot.standing_feet(state.q)
    limits: list[Any] = [wb.JointLimits()]
    if len(feet) > 2:
        limits.append(wb.SupportPolygon(margin=rng.choice((-1.0, 0.0, 0.01))))
    soft: list[Any] = [wb.PostureTask(weight=0.1), wb.ComTask(state.com + (0.0, 0.01, 0.0), weight=5.0)]
    if robot.hands:
        goal = wb.MinJerk(
            wb.AS_IS, state.pose(next(iter(robot.hands.values()))).translation + 0.02, duration=0.5
        )
        soft.append(wb.PositionTask(next(iter(robot.hands.values())), goal, weight=3.0))
    carried = []
    if robot.hands and chance(rng, 0.3):
        carried = [
            wb.Carried(wb.Body("parcel", mass=0.5, size=(0.1, 0.1, 0.1)), by=next(iter(robot.hands.values())))
        ]
    phase = wb.Phase("p", [wb.Contact(foot) for foot in feet], carried=carried, soft=soft, limits=limits)
    loop = wb.Loop(robot, phase, state, dt=0.01, backend="placo" if chance(rng, 0.2) else "proxqp")
    for _ in range(2):
        tick = loop.step()
        assert np.isfinite(tick.q).all(), "a tick that is not finite"
        assert np.isfinite(tick.v).all(), "a tick that is not finite"


# ---------------------------------------------------------------------------------------------- tasks


@cache
def _sources() -> dict[str, str]:
    sources = {name: path.read_text(encoding="utf-8") for name, path in catalog.tasks().items()}
    sources["sway"] = _module("cli_tasks", "cli/conftest.py").SWAY
    return sources


@cache
def _shipped(name: str) -> wb.Robot:
    return wb.load_robot(name)


def _task(rng: random.Random, folder: Path) -> None:
    path = folder / "task.py"
    names = list(_sources())
    path.write_bytes(mutate_python(rng, _sources()[rng.choice([*names, "sway", "sway"])]))
    with contextlib.suppress(WbplanError):
        glance(path)
    task = load_task(path)
    assert task.summary is not None
    settings = []
    for parameter in task.parameters:
        str(parameter)
        if chance(rng, 0.2):
            text = rng.choice(
                ["0", "-1", "nan", "1e9", "0.05", "", "x", "none", "true", "0,0,0", "1,", "(1, 2)", "\u00e9"]
            )
            settings.append(f"{parameter.name}={text}")
    try:
        values = task.values(settings)
    except WbplanError:
        values = task.values([])
    robot = _shipped(task.robot) if task.robot in catalog.robots() else wb.load_robot(task.robot)
    script = task.script(robot, values)
    start = script.start if isinstance(script.start, wb.State) else robot.state(script.start)
    phase = rng.choice([script.phases[0], script.phases[0], rng.choice(script.phases)])
    placed = {body.name: body.pose for body in script.bodies if body.pose is not None}
    loop = wb.Loop(
        robot, phase, start, dt=0.02, placed=placed, backend="placo" if chance(rng, 0.2) else "proxqp"
    )
    for _ in range(2):
        tick = loop.step()
        assert np.isfinite(tick.q).all(), "a tick that is not finite"


# -------------------------------------------------------------------------------------------- bundles


@cache
def _good() -> tuple[wb.Bundle, ...]:
    machine = _module("machine", "bundle/machine.py")
    good = machine.build()
    phases = json.loads(json.dumps(good.plan["phases"]))
    phases[0]["region"] = [[0.2, 0.12], [-0.2, 0.12], [-0.2, -0.12], [0.2, -0.12]]
    phases[1]["contacts"][0]["normal"] = [0.0, 0.1, 1.0]
    return good, machine.planned(good, phases=phases, joint_acceleration=[1e4] * 13)


def _bundle(rng: random.Random, folder: Path) -> None:
    good = rng.choice(_good())
    target = folder / "plan"
    target.mkdir()
    plan, urdf, arrays = json.loads(json.dumps(good.plan)), good.urdf, good._arrays()
    which = rng.choice(("plan", "plan", "arrays", "arrays", "urdf", "two", "file"))
    files: dict[str, bytes] = {"plan.json": json.dumps(plan).encode(), "robot.urdf": urdf.encode()}
    if which in ("plan", "two"):
        files["plan.json"] = mutate_json(rng, plan)
    if which in ("urdf", "two"):
        files["robot.urdf"] = mutate_xml(rng, urdf)
    if which == "arrays" or (which == "two" and chance(rng, 0.3)):
        files["trajectory.npz"] = mutate_npz(rng, arrays)
    for name, content in files.items():
        (target / name).write_bytes(content)
    if "trajectory.npz" not in files:
        np.savez(target / "trajectory.npz", **arrays)
    if which == "file":
        _spoil(rng, target / rng.choice(("plan.json", "robot.urdf", "trajectory.npz")))
    _use_bundle(rng, wb.Bundle.read(target), folder)


def _spoil(rng: random.Random, file: Path) -> None:
    """The file itself: gone, empty, a folder, a link to itself or to nowhere, cut off."""
    data = file.read_bytes()
    kind = rng.randrange(7)
    file.unlink()
    if kind == 1:
        file.mkdir()
    elif kind == 2:
        file.symlink_to(file.name)
    elif kind == 3:
        file.symlink_to("nowhere")
    elif kind > 3:
        file.write_bytes(scarred(rng, data))


def _use_bundle(rng: random.Random, bundle: wb.Bundle, folder: Path) -> None:
    report = wb.check(bundle)
    report.table()
    json.dumps(report.to_dict(), allow_nan=False)
    use = rng.random()
    if use < 0.06:
        assert page(bundle).startswith("<!")
    elif use < 0.12:
        plots.save(bundle, folder / "plots.png")
    elif use < 0.3:
        options = Options()
        scene_of(bundle, motion_of(bundle, options), options)
    elif use < 0.4:
        bundle.write(folder / "again")
        again = wb.Bundle.read(folder / "again")
        assert again.trajectory.joint_names == bundle.trajectory.joint_names
