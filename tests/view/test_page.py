"""The page in a real browser: what is drawn, that it moves, that it is silent and alone."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbplan.view import Scene, Server, inline, serve, write_html

pytestmark = pytest.mark.browser

#: Pixels that each kind of thing takes at least in a picture of 480 by 300.
SMALLEST = {
    "ground": 2000,
    "contacts": 60,
    "support": 1000,
    "com": 60,
    "com_ground": 30,
    "targets": 60,
    "bodies": 500,
    "trails": 30,
}


def drawn(picture: np.ndarray) -> np.ndarray:
    """Where something is, after everything else and the background were hidden."""
    return picture[..., 3] > 0


def check_motion(view) -> None:
    """The robot is seen, in its colours, and one leg swings between 1 s and 2 s."""
    view.seek(0.0)
    view.only("robot")
    start = view.picture()
    assert 0.02 < drawn(start).mean() < 0.5
    reddish = (start[..., 0] > 120) & (start[..., 2] < 100) & drawn(start)
    bluish = (start[..., 2] > start[..., 0] + 40) & drawn(start)
    assert reddish.sum() > 300
    assert bluish.sum() > 100
    view.seek(0.9)
    assert np.array_equal(view.picture(), start)  # so far it stands still
    view.seek(2.0)
    changed = (view.picture() != start).any(axis=2)
    assert 100 < changed.sum() < drawn(start).sum()
    view.seek(0.0)
    assert np.array_equal(view.picture(), start)


@pytest.fixture(scope="module")
def scene_html(bundle, tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.html"
    write_html(bundle, path)
    return path


def test_a_file_plays_alone(look, scene_html):
    view = look(scene_html.as_uri())
    check_motion(view)
    assert view.complaints == []
    assert [url for url in view.requests if not url.startswith(("data:", "blob:"))] == [scene_html.as_uri()]


def test_a_served_plan_plays_and_speaks_to_its_server_alone(look, bundle):
    with serve(bundle) as server:
        view = look(server.url)
        view.page.wait_for_function("() => viewer.animator.actions.length > 0", timeout=30_000)
        check_motion(view)
        assert view.complaints == []
        assert view.requests == [server.url, server.url.replace("http:", "ws:") + "messages"]


@pytest.fixture(scope="module")
def view(look_long, scene_html):
    """The file, open."""
    return look_long(scene_html.as_uri())


@pytest.mark.parametrize("kind", sorted(SMALLEST))
def test_everything_of_a_plan_is_drawn(view, kind):
    view.seek(1.9)
    view.only(kind)
    assert drawn(view.picture()).sum() > SMALLEST[kind]


def test_phases_change_what_is_shown(view):
    pictures = {}
    for kind in ("support", "contacts", "targets"):
        view.only(kind)
        for time in (0.5, 1.5):
            view.seek(time)
            pictures[kind, time] = view.picture()
    # A triangle of three of four feet is half of the square.
    four, three = (drawn(pictures["support", t]).sum() for t in (0.5, 1.5))
    assert 0.35 * four < three < 0.65 * four
    assert not np.array_equal(pictures["contacts", 0.5], pictures["contacts", 1.5])
    assert not drawn(pictures["targets", 0.5]).any()
    assert drawn(pictures["targets", 1.5]).any()


def test_a_trail_grows_with_time(view):
    view.only("trails")
    lengths = []
    for time in (0.5, 1.4, 2.0):
        view.seek(time)
        lengths.append(drawn(view.picture()).sum())
    assert lengths[0] < lengths[1] < lengths[2]


def test_a_trail_forgets_what_is_long_past(look, make_bundle, stool_model, stool, tmp_path):
    write_html(make_bundle(stool_model, stool, seconds=20.0, dt=0.05), tmp_path / "long.html")
    view = look((tmp_path / "long.html").as_uri())
    ranges = []
    for time in (5.0, 11.0, 20.0):
        view.seek(time)
        find = "() => viewer.scene_tree.find(['wbplan', 'trails', 'foot_a', '<object>'])"
        ranges.append(view.page.evaluate(f"{find}.object.geometry.drawRange"))
    assert ranges[0] == {"start": 0, "count": 1}
    assert ranges[1]["start"] == 0
    assert ranges[1]["count"] > 5
    assert ranges[2]["start"] > 5
    assert ranges[2]["count"] > ranges[1]["count"]


def test_the_label_and_the_time_bar_tell_the_phase(view):
    view.seek(1.5)
    assert view.page.inner_text("#label b") == "swing"
    assert "phase 2 of 2" in view.page.inner_text("#label span")
    assert view.page.inner_text("#clock") == "1.50 / 2.0 s"
    view.page.fill("#track input", "0.25")
    view.page.wait_for_function("() => document.querySelector('#clock').textContent.startsWith('0.50')")
    assert view.page.inner_text("#label b") == "stand on four"
    view.page.click("#play")
    view.page.wait_for_function("() => !document.querySelector('#clock').textContent.startsWith('0.50')")
    assert view.page.evaluate("() => viewer.animator.playing") is True
    view.page.click("#play")
    assert view.page.evaluate("() => viewer.animator.playing") is False


def test_the_whole_scene_is_inside_the_picture(view):
    for time in (0.0, 2.0):
        view.seek(time)
        view.only("robot", "bodies")
        seen = drawn(view.picture())
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        assert 5 < rows[0] < rows[-1] < seen.shape[0] - 5
        assert 5 < columns[0] < columns[-1] < seen.shape[1] - 5
        assert max(np.ptp(rows) / seen.shape[0], np.ptp(columns) / seen.shape[1]) > 0.5


def test_a_live_scene_follows_its_updates(look, stool, stool_model, q_stand):
    with Server() as server:
        scene = Scene(server, stool, bodies={"box": (0.1, 0.2, 0.08)})
        box = [0.45, 0.0, 0.04, 0.0, 0.0, 0.0, 1.0]
        scene.update(q_stand, bodies={"box": box}, label="one\nstanding")
        view = look(server.url)
        view.wait_for("robot/leg_a")
        view.only("robot")
        before = view.picture()
        assert view.page.inner_text("#label b") == "one"
        assert not view.page.is_visible("#bar")
        step = np.zeros(stool_model.nv)
        step[6] = -0.7
        scene.update(pin.integrate(stool_model, q_stand, step), label="two\nswinging")
        view.page.wait_for_function("() => document.querySelector('#label b').textContent === 'two'")
        moved = (view.picture() != before).any(axis=2)
        assert 100 < moved.sum() < drawn(before).sum()
        scene.update(q_stand, label="three")
        view.page.wait_for_function("() => document.querySelector('#label b').textContent === 'three'")
        assert np.array_equal(view.picture(), before)
        assert view.complaints == []


def test_a_page_opened_again_shows_the_same(look, stool, q_stand):
    with Server() as server:
        scene = Scene(server, stool)
        for height in (0.5, 0.3, 0.2):
            q_stand[2] = height
            scene.update(q_stand, com=[0, 0, 0.2], margin=0.01)
        pictures = []
        for _ in range(2):
            view = look(server.url)
            view.wait_for("com/broken")
            view.only("robot", "com")
            pictures.append(view.picture())
    assert np.array_equal(*pictures)


def test_a_notebook_cell_needs_no_server(look, bundle, tmp_path):
    (tmp_path / "cell.html").write_text(
        f"<!DOCTYPE html><body>{inline(bundle).data}</body>", encoding="utf-8"
    )
    browser_page = look.bare((tmp_path / "cell.html").as_uri())
    frame = browser_page.frames[1]
    frame.wait_for_function("() => window.wbplanReady === true", timeout=60_000)
    assert frame.evaluate("() => viewer.animator.duration") == pytest.approx(2.0)
