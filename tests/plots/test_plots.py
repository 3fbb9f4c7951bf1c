"""The picture of a plan: what it shows, and that it can always be drawn."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from wbplan import gaits
from wbplan.bundle import NO_MARGIN, Bundle
from wbplan.errors import BundleError
from wbplan.pictures import DPI
from wbplan.plots import force_figure
from wbplan.plots import overview as plots


def texts(drawing: Figure) -> set[str]:
    found = set()
    for axes in drawing.axes:
        labels = axes.get_legend_handles_labels()[1]
        found |= {axes.get_title(loc="left"), axes.get_xlabel(), axes.get_ylabel(), *labels}
        found |= {text.get_text() for text in (*axes.texts, *axes.get_yticklabels())}
    return found


def lines(drawing: Figure, label: str) -> list[np.ndarray]:
    return [line.get_xydata() for axes in drawing.axes for line in axes.lines if line.get_label() == label]


@pytest.fixture(scope="module")
def drawing(good: Bundle) -> Figure:
    return plots.figure(good)


def test_the_picture_names_phases_feet_tasks_and_joints(good: Bundle, drawing: Figure) -> None:
    shown = texts(drawing)
    assert {phase["name"] for phase in good.phases} <= shown
    assert {"leg1", "leg2", "leg3", "leg4", "base"} <= shown
    assert set(good.trajectory.joint_names) <= shown
    assert {"margin [m]", "error [m]", "error [rad]", "x [m]", "y [m]", "time [s]"} <= shown


def test_the_margin_and_its_least_value_are_the_trajectory_s(good: Bundle, drawing: Figure) -> None:
    motion = good.trajectory
    (margin,) = lines(drawing, "margin")
    np.testing.assert_allclose(margin, np.column_stack([motion.time, motion.margin]))
    least = f"least: {motion.margin.min():.4f} m"
    (marked,) = lines(drawing, least)
    assert marked[0, 0] == motion.time[np.argmin(motion.margin)]
    (promised,) = lines(drawing, "promised")
    assert promised[0, 1] == good.phases[0]["margin"]


def test_the_com_s_path_starts_and_ends_where_it_does(good: Bundle, drawing: Figure) -> None:
    (start,), (end,) = lines(drawing, "CoM at the start"), lines(drawing, "CoM at the end")
    np.testing.assert_allclose(start[0], good.trajectory.com[0, :2])
    np.testing.assert_allclose(end[0], good.trajectory.com[-1, :2])
    view = drawing.axes[0]
    path = np.array(view.collections[0].get_segments())
    np.testing.assert_allclose(path[:, 0], good.trajectory.com[:-1, :2])
    # Three polygons, each with its inset: four feet, three feet, four feet with the first one ahead.
    assert len(view.patches) == 6


def test_the_file_is_a_picture_and_the_same_each_time(good: Bundle, tmp_path: Path) -> None:
    first = plots.save(good, tmp_path / "one.png")
    picture = imread(first)
    assert picture.shape[:2] == (int(plots.SIZE[1] * DPI), int(plots.SIZE[0] * DPI))
    assert len(np.unique((picture[::7, ::7, :3] * 255).astype(int).reshape(-1, 3), axis=0)) > 50
    assert plots.save(good, tmp_path / "two.png").read_bytes() == first.read_bytes()


def test_a_notebook_gets_a_picture_without_pyplot(drawing: Figure, good: Bundle) -> None:
    legs = [f"leg{k}" for k in range(6)]
    gait = gaits.cycle_figure([(gaits.tripod(legs), gaits.regular_stance(legs), 0.1)], heading=0.0)
    for other in (force_figure(good), gait):
        assert other._repr_png_().startswith(b"\x89PNG")
    assert drawing._repr_png_().startswith(b"\x89PNG")


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = (
        "import sys; from wbplan import plots; from wbplan.bundle import Bundle; "
        "sys.exit(any(name.split('.')[0] == 'matplotlib' for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_drawing_leaves_pyplot_alone(good: Bundle) -> None:
    plots.figure(good)
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or pyplot.get_fignums() == []


def test_a_plan_with_little_in_it_can_be_drawn(machine: ModuleType, good: Bundle, tmp_path: Path) -> None:
    promises = machine.phases()
    for phase in promises:
        phase.update(margin=NO_MARGIN, contacts=[], carried=[], closures=[], tasks=[])
    bare = machine.build(promises=promises, tray=lambda t: 0.3, robot=machine.urdf(tray="continuous"))
    bare = machine.edited(bare, errors={"hand.position": np.full(len(bare.trajectory), np.nan)}, targets={})
    shown = texts(plots.figure(bare))
    assert "no such task" in shown
    assert "tray_joint" not in shown
    assert plots.save(bare, tmp_path / "bare.png").stat().st_size > 10_000


def test_only_the_largest_errors_have_a_line_of_their_own(machine: ModuleType, good: Bundle) -> None:
    motion = good.trajectory
    errors = {f"task{i}.position": np.full(len(motion), 10.0 ** (i - 9)) for i in range(12)}
    shown = texts(plots.figure(machine.edited(good, errors=errors)))
    assert {f"task{i}" for i in range(4, 12)} <= shown
    assert "4 with smaller errors" in shown
    assert "task3" not in shown


def test_contacts_are_one_line(machine: ModuleType, good: Bundle) -> None:
    size = len(good.trajectory)
    errors = {f"contact(leg{i}_foot).position": np.full(size, 1e-6 * i) for i in (1, 2, 3)}
    errors["contact(leg3_foot).position"][:9] = np.nan
    (worst,) = lines(plots.figure(machine.edited(good, errors=errors)), "worst contact")
    np.testing.assert_allclose(worst[:, 1], [2e-6] * 9 + [3e-6] * (size - 9))


def test_the_manipulability_has_a_line_on_its_own_scale(machine: ModuleType, good: Bundle) -> None:
    w = np.linspace(6.75, 7.19, len(good.trajectory))
    w[:3] = np.nan
    drawing = plots.figure(machine.edited(good, measures={"manipulability(arm_tip).manipulability": w}))
    assert f"w, arm_tip:\n{w[3]:.3g} to 7.19" in texts(drawing)
    drawn = [line.get_ydata() for axes in drawing.axes for line in axes.get_lines()]
    assert any(len(y) == len(w) and np.array_equal(y, w, equal_nan=True) for y in drawn)


def test_many_phases_keep_their_names_apart(machine: ModuleType, good: Bundle) -> None:
    time = good.trajectory.time
    starts = np.arange(0, 70, 3)
    names = [f"phase number {i}" for i in range(len(starts))]
    ends = [*starts[1:], 70]
    promises = [
        {**good.phases[0], "name": name, "start": float(time[a]), "end": float(time[b])}
        for name, a, b in zip(names, starts, ends, strict=True)
    ]
    drawing = plots.figure(machine.planned(good, phases=promises))
    margin = next(axes for axes in drawing.axes if axes.get_ylabel() == "margin [m]")
    placed = [text.get_position()[0] for text in margin.texts]
    assert [text.get_text() for text in margin.texts] == names
    assert np.diff(placed).min() > 0.02 * time[-1]
    assert placed[0] >= 0.0
    assert placed[-1] <= time[-1]


@pytest.mark.parametrize("size", [1e200, 1.7e308])
def test_absurd_numbers_are_drawn_without_a_word(
    machine: ModuleType, good: Bundle, tmp_path: Path, size: float
) -> None:
    """Matplotlib's scales overflow, and it says so in warnings that are no use to anybody."""
    errors = {"hand.position": np.linspace(0.0, size, len(good.trajectory))}
    assert plots.save(machine.edited(good, errors=errors), tmp_path / "far.png").stat().st_size > 10_000


def test_a_path_that_cannot_be_written_is_named(good: Bundle, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"nowhere.*plots\.png: cannot be written"):
        plots.save(good, tmp_path / "nowhere" / "plots.png")
