"""A bundle is read only if it is what it has to be; whatever is in its files, nothing else is raised."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbplan.bundle import SCHEMA, Bundle
from wbplan.checks import check
from wbplan.errors import BundleError

# -------------------------------------------------------------------------------------------- what is refused


def in_plan(*path: Any, value: Any = None, drop: bool = False) -> Callable[[Path], None]:
    """Replace or drop one entry of plan.json."""

    def edit(folder: Path) -> None:
        plan = json.loads((folder / "plan.json").read_text())
        inner = plan
        for key in path[:-1]:
            inner = inner[key]
        if drop:
            del inner[path[-1]]
        else:
            inner[path[-1]] = value
        (folder / "plan.json").write_text(json.dumps(plan))

    return edit


def in_arrays(**changes: Any) -> Callable[[Path], None]:
    """Replace arrays of trajectory.npz; None drops one, a function is given the old one."""

    def edit(folder: Path) -> None:
        with np.load(folder / "trajectory.npz") as file:
            arrays = dict(file)
        for key, value in changes.items():
            old = arrays.pop(key, None)
            if value is not None:
                arrays[key] = value(old) if callable(value) else value
        np.savez(folder / "trajectory.npz", **arrays)

    return edit


def raw(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(content)


def cut(folder: Path) -> None:
    content = (folder / "trajectory.npz").read_bytes()
    (folder / "trajectory.npz").write_bytes(content[: len(content) // 2])


def pickled(folder: Path) -> None:
    in_arrays(com=np.array([{"a": 1}], dtype=object))(folder)


FIRST = ("phases", 0)
REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "no plan": (lambda f: (f / "plan.json").unlink(), r"plan\.json: missing"),
    "no urdf": (lambda f: (f / "robot.urdf").unlink(), r"robot\.urdf: missing"),
    "no arrays": (lambda f: (f / "trajectory.npz").unlink(), r"trajectory\.npz: missing"),
    "plan cut": (raw("plan.json", b'{"schema": 1,'), r"plan\.json: is not valid JSON"),
    "plan empty": (raw("plan.json", b""), r"plan\.json: is not valid JSON"),
    "plan not text": (raw("plan.json", b"\xff\xfe\x00"), r"plan\.json: expected UTF-8"),
    "plan a list": (raw("plan.json", b"[]"), r"plan\.json: expected an object, found list"),
    "plan nested": (raw("plan.json", b"[" * 100_000), r"plan\.json: is not valid JSON"),
    "plan nan": (raw("plan.json", b'{"dt": NaN}'), r"plan\.json: NaN is not JSON"),
    "schema newer": (in_plan("schema", value=SCHEMA + 1), rf"schema: {SCHEMA + 1} is newer than this wbplan"),
    "schema missing": (in_plan("schema", drop=True), r"plan\.json: missing schema"),
    "schema text": (in_plan("schema", value="1"), r"schema: expected a whole number from 1, found '1'"),
    "schema true": (in_plan("schema", value=True), r"schema: expected a whole number"),
    "dt zero": (in_plan("dt", value=0), r"plan\.json: dt: expected a number above 0"),
    "dt huge": (in_plan("dt", value=10**400), r"plan\.json: dt: expected a finite number"),
    "no report": (in_plan("report", value=None), r"report: expected an object"),
    "no phases": (in_plan("phases", value=[]), r"phases: expected a list of at least 1"),
    "phases text": (in_plan("phases", value="all"), r"phases: expected a list"),
    "phase a number": (in_plan(*FIRST, value=3), r"phases\[0\]: expected an object, found 3"),
    "phase without margin": (in_plan(*FIRST, "margin", drop=True), r"phases\[0\]: missing margin"),
    "phase margin null": (in_plan(*FIRST, "margin"), r"phases\[0\]\.margin: expected a number, found None"),
    "phase backwards": (in_plan(*FIRST, "end", value=-1.0), r"\.end: expected a time after the start"),
    "gap": (in_plan(*FIRST, "end", value=0.38), r"phases\[1\]\.start: expected 0\.38, where 'shift' ends"),
    "late start": (in_plan(*FIRST, "start", value=0.02), r"start of all is 0\.02 s, the trajectory's is 0"),
    "early end": (in_plan("phases", 3, "end", value=1.38), r"end of all is 1\.38 s, the trajectory's is"),
    "frame": (in_plan(*FIRST, "contacts", 0, "frame", value="leg9_foot"), r"\[0\]\.frame: no frame 'leg9"),
    "friction": (in_plan(*FIRST, "contacts", 0, "friction", value=-0.1), r"friction: expected a finite"),
    "normal": (in_plan(*FIRST, "contacts", 0, "normal", value=[0, 0, 0]), r"normal: expected a direction"),
    "normal short": (in_plan(*FIRST, "contacts", 0, "normal", value=[0, 1]), r"normal: expected 3 numbers"),
    "closure": (in_plan("phases", 2, "closures", 0, "frame_b", value="x"), r"closures\[0\]\.frame_b"),
    "carried pose": (
        in_plan("phases", 2, "carried", 0, "pose", value=[0, 0, 0, 0, 0, 0, 2]),
        r"carried\[0\]\.pose: expected x y z and a quaternion",
    ),
    "carried mass": (in_plan("phases", 2, "carried", 0, "mass", value="0.8"), r"mass: expected a number"),
    "region": (in_plan(*FIRST, "region", value=[[0, 0], [1, 0]]), r"region: expected a list of at least 3"),
    "acceleration": (in_plan("joint_acceleration", value=[1.0]), r"joint_acceleration: expected 13 numbers"),
    "body size": (in_plan("bodies", 0, "size", value=[1, 2]), r"bodies\[0\]\.size: expected 3 numbers"),
    "urdf broken": (raw("robot.urdf", b"<robot"), r"robot\.urdf: is no URDF"),
    "urdf empty": (raw("robot.urdf", b""), r"robot\.urdf: is no URDF"),
    "urdf weightless": (raw("robot.urdf", b'<robot name="a"><link name="b"/></robot>'), r"robot\.urdf"),
    "arrays cut": (cut, r"trajectory\.npz: archive: cannot be read"),
    "arrays empty": (raw("trajectory.npz", b""), r"trajectory\.npz: archive: cannot be read"),
    "arrays text": (raw("trajectory.npz", b"time,q"), r"trajectory\.npz: archive: cannot be read"),
    "arrays pickled": (pickled, r"trajectory\.npz: com: cannot be read"),
    "key missing": (in_arrays(v=None), r"trajectory\.npz: missing v; found body_box, com"),
    "shape": (in_arrays(com=lambda a: a[:, :2]), r"com: expected shape \(71, 3\), found \(71, 2\)"),
    "samples": (in_arrays(q=lambda a: a[:-1]), r"q: expected shape \(71, 20\), found \(70, 20\)"),
    "one sample": (in_arrays(time=lambda a: a[:1]), r"time: expected at least 2 samples, found 1"),
    "time scalar": (in_arrays(time=np.array(1.0)), r"time: expected at least 2 samples"),
    "text": (in_arrays(q=lambda a: a.astype(str)), r"q: expected numbers"),
    "complex": (in_arrays(q=lambda a: a + 1j), r"q: expected numbers, found complex"),
    "nan": (in_arrays(time=lambda a: np.where(a == a[5], np.nan, a)), r"time: expected finite numbers"),
    "infinite": (in_arrays(q=lambda a: np.where(a == a[3, 2], np.inf, a)), r"q: expected finite numbers"),
    "phase float": (in_arrays(phase=lambda a: a * 1.0), r"phase: expected whole numbers"),
    "phase unknown": (in_arrays(phase=lambda a: a + 1), r"phase: expected 0 to 3, found 4 at index 60"),
    "phase elsewhere": (in_arrays(phase=lambda a: a * 0), r"phase: index 21 says 'shift', but its time"),
    "names renamed": (
        in_arrays(joint_names=lambda a: np.where(a == "tray_joint", "lid", a)),
        r"joint_names: not in the URDF: lid; missing: tray_joint",
    ),
    "names in another order": (in_arrays(joint_names=lambda a: a[::-1]), r"joint_names: expected the URDF's"),
    "names as numbers": (in_arrays(joint_names=lambda a: np.arange(13)), r"joint_names: expected \(nv-6,\)"),
    "body poses": (in_arrays(body_box=lambda a: a[:, :3]), r"body_box: expected shape \(71, 7\)"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_broken_bundle_is_refused_by_file_and_field(folder: Path, case: str) -> None:
    damage, message = REFUSED[case]
    damage(folder)
    with pytest.raises(BundleError, match=message) as caught:
        Bundle.read(folder)
    assert str(folder) in str(caught.value)


@pytest.mark.parametrize("name", ["nothing", "a_file"])
def test_what_is_no_folder_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "a_file").write_text("")
    with pytest.raises(BundleError, match=rf"{name}: expected a folder with a plan bundle"):
        Bundle.read(tmp_path / name)


def test_a_robot_with_joints_of_many_axes_is_refused(machine: ModuleType, good: Bundle, folder: Path) -> None:
    (folder / "robot.urdf").write_text(machine.urdf(tray="planar"))
    with pytest.raises(BundleError, match=r"robot\.urdf: joint tray_joint has 3 axes; expected 1"):
        Bundle.read(folder)


# ---------------------------------------------------------------------------------------------------- fuzzing


@pytest.fixture(scope="module")
def scratch(good: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Path]:
    """A bundle's folder that may be damaged, given as a function so that each example can ask for it."""
    folder = good.write(tmp_path_factory.mktemp("fuzz") / "plan")
    whole = {path.name: path.read_bytes() for path in folder.iterdir()}

    def restored() -> Path:
        for name, content in whole.items():
            (folder / name).write_bytes(content)
        return folder

    return restored


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(leaf for key, item in inner for leaf in leaves(item, (*path, key)))]


anything = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=5),
    st.just([]), st.just({}), st.lists(st.floats(-1, 1), max_size=7), st.sampled_from([-1e9, 1e308, 10**400]),
)  # fmt: skip


@given(data=st.data(), value=anything)
def test_any_entry_of_the_plan_may_be_anything(
    scratch: Callable[[], Path], data: st.DataObject, value: Any
) -> None:
    folder = scratch()
    plan = json.loads((folder / "plan.json").read_text())
    path = data.draw(st.sampled_from(leaves(plan)[1:]))
    inner = plan
    for key in path[:-1]:
        inner = inner[key]
    old, inner[path[-1]] = copy.deepcopy(inner[path[-1]]), value
    (folder / "plan.json").write_text(json.dumps(plan))
    with contextlib.suppress(BundleError):  # nothing else may be raised
        report = check(Bundle.read(folder))
        assert report.rows
        assert report.ok or old != value


@given(at=st.floats(0.0, 1.0, exclude_max=True), byte=st.integers(0, 255))
def test_any_byte_of_the_arrays_may_be_damaged(scratch: Callable[[], Path], at: float, byte: int) -> None:
    folder = scratch()
    content = bytearray((folder / "trajectory.npz").read_bytes())
    content[int(at * len(content))] = byte
    (folder / "trajectory.npz").write_bytes(bytes(content))
    with contextlib.suppress(BundleError):
        assert check(Bundle.read(folder)).ok


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('<mass value="4.0"/>', '<mass value="%s%n"/>', "mass value"),  # Pinocchio's parser crashes on it
        ('<mass value="4.0"/>', "<mass/>", "expected a value"),
        ('<axis xyz="1 0 0"/>', '<axis xyz="0 nan 1"/>', "axis xyz"),
        ('<robot name="quad">', '<robot name="quad" a:b="c">', "no URDF that can be read"),
        ("</robot>", "", "no URDF that can be read"),
        ("</robot>", f"{'<a>' * 5000}{'</a>' * 5000}</robot>", "no URDF that Pinocchio can build"),
    ],
)
def test_a_urdf_that_no_parser_should_see(folder: Path, old: str, new: str, word: str) -> None:
    file = folder / "robot.urdf"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(BundleError, match=word):
        Bundle.read(folder)
