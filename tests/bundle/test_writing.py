"""A bundle on disk: whole or not there."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from wbplan.bundle import Bundle, is_bundle, places
from wbplan.errors import BundleError


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


# ------------------------------------------------------------------------------------------- what is written


def test_what_is_read_is_what_was_written(good: Bundle, folder: Path) -> None:
    again = Bundle.read(folder)
    assert again.urdf == good.urdf
    assert json.dumps(again.plan) == json.dumps(json.loads((folder / "plan.json").read_text()))
    assert again.phases[2]["carried"][0]["pose"] == [float(x) for x in good.phases[2]["carried"][0]["pose"]]
    for key in ("time", "q", "v", "phase", "com", "margin"):
        np.testing.assert_array_equal(getattr(again.trajectory, key), getattr(good.trajectory, key))
    assert again.trajectory.joint_names == good.trajectory.joint_names
    for group in ("bodies", "targets", "errors"):
        before, after = getattr(good.trajectory, group), getattr(again.trajectory, group)
        assert set(before) == set(after)
        for name in before:
            np.testing.assert_array_equal(after[name], before[name])


def test_the_arrays_are_those_of_the_format(good: Bundle, folder: Path) -> None:
    with np.load(folder / "trajectory.npz", allow_pickle=False) as arrays:
        assert set(arrays.files) == {
            *("time", "q", "v", "joint_names", "phase", "com", "margin"),
            *("body_box", "target_base", "error_base.position", "error_base.orientation"),
        }
        assert arrays["phase"].dtype.kind == "i"
        assert list(arrays["joint_names"]) == list(good.model.names)[2:]


def test_the_table_has_one_named_column_a_joint(machine: ModuleType, good: Bundle, folder: Path) -> None:
    def rows(folder: Path) -> list[dict[str, str]]:
        with (folder / "trajectory.csv").open(newline="") as file:
            return list(csv.DictReader(file))

    table = rows(folder)
    assert len(table) == len(good.trajectory)
    assert list(table[0])[:4] == ["time", "base_x", "base_y", "base_z"]
    column = [float(row["leg1_joint2"]) for row in table]
    index = good.model.joints[good.model.getJointId("leg1_joint2")].idx_q
    np.testing.assert_allclose(column, good.trajectory.q[:, index], rtol=1e-11)
    turning = machine.build(robot=machine.urdf(tray="continuous"), tray=lambda t: 2.5)
    angles = [float(row["tray_joint"]) for row in rows(turning.write(folder.parent / "turning"))]
    np.testing.assert_allclose(angles, 2.5, rtol=1e-11)


def test_numbers_that_json_does_not_have_become_null(
    machine: ModuleType, good: Bundle, tmp_path: Path
) -> None:
    report = {
        "worst": np.float64("nan"),
        "least": -np.inf,
        "count": np.int64(3),
        "list": np.array([1.0, np.nan]),
    }
    folder = machine.planned(good, report=report, parameters={"path": Path("a"), "on": True}).write(
        tmp_path / "p"
    )
    text = (folder / "plan.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["report"] == {"worst": None, "least": None, "count": 3, "list": [1.0, None]}
    assert json.loads(text)["parameters"] == {"path": "a", "on": True}


def test_a_value_that_cannot_be_written_is_named(machine: ModuleType, good: Bundle, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="object"):
        machine.planned(good, parameters={"x": object()}).write(tmp_path / "p")
    assert tree(tmp_path) == {}


def test_extras_are_part_of_the_bundle(good: Bundle, tmp_path: Path) -> None:
    seen: list[Path] = []

    def scene(path: Path) -> None:
        seen.append(path)
        assert (path.parent / "plan.json").exists()
        path.write_text("<html></html>")

    folder = good.write(tmp_path / "plan", extras={"scene.html": scene})
    assert (folder / "scene.html").read_text() == "<html></html>"
    assert seen[0].parent.parent == tmp_path  # beside the target: a rename moves it
    assert not seen[0].exists()


# ----------------------------------------------------------------------------------------- whole or not there


class Stop(Exception):
    """Something that goes wrong."""


@pytest.mark.parametrize("error", [Stop, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("before", [False, True])
def test_what_stops_a_write_leaves_everything_as_it_was(
    good: Bundle, tmp_path: Path, error: type[BaseException], before: bool
) -> None:
    target = tmp_path / "out" / "plan"
    if before:
        good.write(target)
    old = tree(tmp_path)

    def stop(path: Path) -> None:
        path.write_text("half")
        raise error

    with pytest.raises(error):
        good.write(target, extras={"scene.html": stop})
    assert tree(tmp_path) == old
    assert (tmp_path / "out").exists() is before


@pytest.mark.parametrize("failing", [1, 2])
def test_an_interrupt_while_folders_are_swapped_leaves_the_old_bundle(
    good: Bundle, folder: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    old, rename, calls = tree(folder.parent), Path.rename, []

    def interrupted(self: Path, target: Path) -> Path:
        calls.append(target)
        if len(calls) == failing:
            raise KeyboardInterrupt
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    monkeypatch.setattr(places, "exchange", lambda one, other: False)  # a system that cannot
    with pytest.raises(KeyboardInterrupt):
        good.write(folder)
    assert tree(folder.parent) == old


def test_a_bundle_is_replaced(machine: ModuleType, good: Bundle, folder: Path) -> None:
    (folder / "plots.png").write_text("of the old plan")
    machine.planned(good, task="another").write(folder)
    assert Bundle.read(folder).plan["task"] == "another"
    assert not (folder / "plots.png").exists()
    assert [path.name for path in folder.parent.iterdir()] == ["plan"]


def test_what_others_put_into_a_bundle_stays(good: Bundle, folder: Path) -> None:
    (folder / "notes.txt").write_text("mine")
    (folder / "more").mkdir()
    (folder / "more" / "data.csv").write_text("1")
    good.write(folder)
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "more" / "data.csv").read_text() == "1"


def test_a_bundle_is_kept_where_overwriting_is_not_allowed(good: Bundle, folder: Path) -> None:
    old = tree(folder)
    with pytest.raises(BundleError, match="plan: holds a bundle"):
        good.write(folder, overwrite=False)
    assert tree(folder) == old


def test_an_empty_folder_is_filled(good: Bundle, tmp_path: Path) -> None:
    (tmp_path / "plan").mkdir()
    good.write(tmp_path / "plan")
    assert is_bundle(tmp_path / "plan")


def test_a_link_to_a_folder_stays_a_link(good: Bundle, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    good.write(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert is_bundle(tmp_path / "real")


def test_a_folder_with_other_things_is_refused(good: Bundle, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(BundleError, match=r"thesis\.tex"):
        good.write(tmp_path)
    assert tree(tmp_path) == {"thesis.tex": b"years of work"}


def test_a_file_is_refused(good: Bundle, tmp_path: Path) -> None:
    (tmp_path / "plan").write_text("a file")
    for target in (tmp_path / "plan", tmp_path / "plan" / "below"):
        with pytest.raises(BundleError, match="plan"):
            good.write(target)
    assert tree(tmp_path) == {"plan": b"a file"}


def test_the_current_folder_is_refused(good: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BundleError, match="current folder"):
        good.write(".")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_that_may_not_be_written_is_named(good: Bundle, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(BundleError, match="locked"):
        good.write(tmp_path / "locked" / "plan")


@pytest.mark.skipif(os.geteuid() != 0, reason="only the superuser may be somebody else for a while")
def test_a_folder_that_somebody_else_may_not_write_is_named(good: Bundle) -> None:
    """The earlier bundle stays as it is, and can still be read."""
    with tempfile.TemporaryDirectory() as place:
        target = good.write(Path(place) / "plan")
        for path in (Path(place), target):
            path.chmod(0o755)
        before = tree(Path(place))
        os.seteuid(65534)
        try:
            with pytest.raises(BundleError, match="Permission denied"):
                good.write(target)
            assert Bundle.read(target).plan["task"] == good.plan["task"]
        finally:
            os.seteuid(0)
        assert tree(Path(place)) == before


def test_an_error_of_the_disk_is_named(good: Bundle, tmp_path: Path) -> None:
    def full(path: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(BundleError, match="plan: cannot be written: No space left"):
        good.write(tmp_path / "plan", extras={"plots.png": full})
    assert tree(tmp_path) == {}


def test_a_bundle_that_could_not_be_read_is_not_written(
    machine: ModuleType, good: Bundle, tmp_path: Path
) -> None:
    q = machine.changed(good.trajectory.q, (3, 8), np.nan)
    with pytest.raises(
        BundleError, match=r"trajectory\.npz: q: expected finite numbers, found nan at index \(3, 8\)"
    ):
        machine.edited(good, q=q).write(tmp_path / "plan")
    assert tree(tmp_path) == {}
