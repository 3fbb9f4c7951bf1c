from __future__ import annotations

import dataclasses
import errno
import re

import numpy as np
import pytest
import umsgpack
from hypothesis import given, settings
from hypothesis import strategies as st

from wbplan.bundle import Bundle
from wbplan.errors import ViewError
from wbplan.view import inline, page, serve, write_html
from wbplan.view.messages import SetProperty, Store
from wbplan.view.playback import draw_plan

FLOAT32 = 0x17


def plain(thing):
    """A message with its packed arrays as numpy's."""
    if isinstance(thing, umsgpack.Ext):
        return np.frombuffer(thing.data, dtype="<f4") if thing.type == FLOAT32 else thing.data
    if isinstance(thing, dict):
        return {key: plain(value) for key, value in thing.items()}
    return [plain(value) for value in thing] if isinstance(thing, list) else thing


def told(bundle: Bundle) -> list[dict]:
    store = Store()
    draw_plan(bundle, store)
    return [plain(umsgpack.unpackb(message)) for message in store.messages()]


class Played:
    """An animation as the page plays it: values between keys are linear, those of booleans the last one."""

    def __init__(self, bundle: Bundle):
        self.messages = told(bundle)
        assert self.messages[-1]["type"] == "set_animation"
        self.clips = self.messages[-1]["animations"]
        self.tracks = {(c["path"], t["name"]): t for c in self.clips for t in c["clip"]["tracks"]}

    def at(self, path: str, name: str, time: float) -> np.ndarray:
        track = self.tracks[path, name]
        values = np.reshape(track["values"], (len(track["times"]), -1))
        return np.array([np.interp(time, track["times"], column) for column in values.T])

    def shown(self, path: str, time: float) -> bool:
        if (path, ".visible") not in self.tracks:
            return True
        track = self.tracks[path, ".visible"]
        return bool(track["values"][np.searchsorted(track["times"], time + 1e-6, side="right") - 1])

    def drawn(self, kind: str) -> list[str]:
        drawn = [m["path"] for m in self.messages if m["type"] == "set_object"]
        return sorted({"/".join(p.split("/")[:4]) for p in drawn if p.startswith(f"/wbplan/{kind}/")})


@pytest.fixture(scope="module")
def played(bundle) -> Played:
    return Played(bundle)


@settings(max_examples=30, deadline=None)
@given(time=st.floats(0.0, 2.0))
def test_links_follow_the_plan_between_samples(played, bundle, time):
    # The hip turns about y with a constant speed, so half its angle's sine is nearly linear between keys.
    angle = np.interp(time, bundle.trajectory.time, bundle.trajectory.q[:, 7])
    quaternion = played.at("/wbplan/robot/leg_a", ".quaternion", time)
    np.testing.assert_allclose(quaternion[1] * np.sign(quaternion[3]), np.sin(angle / 2.0), atol=1e-3)
    np.testing.assert_allclose(played.at("/wbplan/robot/base", ".position", time), [0, 0, 0.2], atol=1e-4)
    box = np.array([np.interp(time, bundle.trajectory.time, c) for c in bundle.trajectory.bodies["box"].T])
    np.testing.assert_allclose(played.at("/wbplan/bodies/box", ".position", time), box[:3], atol=1e-4)


@settings(max_examples=30, deadline=None)
@given(time=st.floats(0.0, 2.0))
def test_one_polygon_one_com_colour_and_one_mark_a_foot_is_shown(played, time):
    supports = [path for path in played.drawn("support") if played.shown(path, time)]
    assert len(played.drawn("support")) == 2
    assert len(supports) == 1
    for place in ("com", "com_ground"):
        assert sum(played.shown(f"/wbplan/{place}/{g}", time) for g in ("clear", "near", "broken")) == 1
    for foot in "abcd":
        on = played.shown(f"/wbplan/contacts/foot_{foot}/on", time)
        assert on is (foot != "a" or time < 1.0 - 1e-6)
        assert played.shown(f"/wbplan/contacts/foot_{foot}/off", time) is not on


def test_a_target_is_shown_only_while_it_is_asked_for(played):
    assert [played.shown("/wbplan/targets/box", t) for t in (0.0, 0.95, 1.05, 2.0)] == [
        False,
        False,
        True,
        True,
    ]


def test_a_target_that_is_absurdly_far_is_not_shown(bundle):
    motion = bundle.trajectory
    far = motion.targets["box"].copy()
    far[-1, :2] = np.finfo(float).max
    played = Played(dataclasses.replace(bundle, trajectory=dataclasses.replace(motion, targets={"box": far})))
    assert [played.shown("/wbplan/targets/box", t) for t in (1.05, float(motion.time[-1]))] == [True, False]


def test_all_clips_last_as_long_as_the_plan(played):
    assert {clip["clip"]["duration"] for clip in played.clips} == {2.0}
    assert max(track["times"][-1] for track in played.tracks.values()) <= 2.0 + 1e-6


def test_what_rests_costs_two_keys(played):
    assert len(played.tracks["/wbplan/robot/leg_d", ".quaternion"]["times"]) == 2
    assert 30 < len(played.tracks["/wbplan/robot/leg_a", ".quaternion"]["times"]) < 70


def test_trails_are_drawn_of_what_moves(played):
    assert played.drawn("trails") == ["/wbplan/trails/foot_a"]
    times = [m["value"] for m in played.messages if m.get("property") == "times"]
    assert np.all(np.diff(times[0]) > 0)


def test_the_story_names_the_phases(played):
    (story,) = [m["value"] for m in played.messages if m.get("property") == "story"]
    assert story["names"] == ["stand on four", "swing"]
    assert story["starts"] == [0.0, 1.0]
    assert len(story["times"]) == len(story["margins"])


def changed(bundle: Bundle, plan: dict | None = None, **trajectory) -> Bundle:
    motion = dataclasses.replace(bundle.trajectory, **trajectory)
    return dataclasses.replace(bundle, plan={**bundle.plan, **(plan or {})}, trajectory=motion)


def test_a_phase_on_two_feet_has_no_polygon_and_no_error(bundle):
    phases = [dict(phase, margin=-1e9) for phase in bundle.plan["phases"]]
    phases[1]["contacts"] = phases[1]["contacts"][:2]
    nothing = np.full(len(bundle.trajectory.time), np.nan)
    played = Played(changed(bundle, {"phases": phases}, margin=nothing))
    assert len(played.drawn("support")) == 1
    assert not played.shown("/wbplan/support/0", 1.5)
    assert not any("inset" in m["path"] for m in played.messages if m["type"] == "set_object")


def test_a_region_that_is_given_is_drawn_instead_of_the_feet(bundle):
    corners = [[0.05, 0.0], [-0.05, 0.05], [-0.05, -0.05]]
    phases = [dict(phase, region=corners) for phase in bundle.plan["phases"]]
    played = Played(changed(bundle, {"phases": phases}))
    fill = next(m for m in played.messages if m["path"] == "/wbplan/support/0/fill" and "object" in m)
    points = fill["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].reshape(-1, 3)
    np.testing.assert_allclose(sorted(points[:, :2].tolist()), sorted(corners), atol=1e-6)


def test_a_plan_that_starts_late_is_played_from_its_start(bundle):
    phases = [dict(p, start=p["start"] + 7.0, end=p["end"] + 7.0) for p in bundle.plan["phases"]]
    played = Played(changed(bundle, {"phases": phases}, time=bundle.trajectory.time + 7.0))
    assert all(clip["clip"]["duration"] == pytest.approx(2.0) for clip in played.clips)
    (story,) = [m["value"] for m in played.messages if m.get("property") == "story"]
    assert story["starts"] == [0.0, 1.0]


def test_a_plan_of_one_sample_is_a_still(bundle):
    motion = {f.name: getattr(bundle.trajectory, f.name) for f in dataclasses.fields(bundle.trajectory)}
    first = {k: v[:1] for k, v in motion.items() if isinstance(v, np.ndarray)}
    first |= {k: {n: c[:1] for n, c in v.items()} for k, v in motion.items() if isinstance(v, dict)}
    assert Played(changed(bundle, **first)).drawn("robot")


def test_a_plan_without_samples_is_refused(bundle):
    nothing = {"time": np.zeros(0), "q": np.zeros((0, 11)), "phase": np.zeros(0, dtype=np.int64)}
    with pytest.raises(ViewError, match="no samples"):
        page(changed(bundle, **nothing))


def test_the_file_is_small_and_asks_for_nothing(bundle, tmp_path):
    write_html(bundle, tmp_path / "scene.html")
    text = (tmp_path / "scene.html").read_text(encoding="utf-8")
    assert len(text) < 1.5e6
    assert not re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"'](?!data:)", text)
    assert "<title>swing &lt;a leg&gt;, stool</title>" in text
    assert [path.name for path in tmp_path.iterdir()] == ["scene.html"]


def test_an_old_file_is_kept_when_the_new_one_cannot_be_drawn(bundle, tmp_path):
    (tmp_path / "scene.html").write_text("old")
    with pytest.raises(ViewError):
        write_html(changed(bundle, q=bundle.trajectory.q * np.nan), tmp_path / "scene.html")
    assert (tmp_path / "scene.html").read_text() == "old"


def test_an_old_file_is_kept_when_the_disk_is_full(bundle, tmp_path, monkeypatch):
    (tmp_path / "scene.html").write_text("old")

    def full(self, *args, **kwargs):
        with self.open("w") as file:
            file.write("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", full)
    with pytest.raises(ViewError, match="No space left"):
        write_html(bundle, tmp_path / "scene.html")
    assert (tmp_path / "scene.html").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["scene.html"]


@pytest.mark.parametrize("place", ["no/such/folder/scene.html", "file/scene.html"])
def test_a_place_that_cannot_be_written_is_named(bundle, tmp_path, place):
    (tmp_path / "file").write_text("")
    with pytest.raises(ViewError, match=r"scene\.html cannot be written"):
        write_html(bundle, tmp_path / place)


def test_a_notebook_gets_the_whole_page(bundle):
    shown = inline(bundle, height=333)
    assert shown.data.startswith("<div><iframe srcdoc=")
    assert "height: 333px" in shown.data
    assert shown.data.count('"') == 6  # everything inside the attribute is escaped
    assert len(shown.data) > 800_000


def test_serve_stops_again_when_the_plan_cannot_be_drawn(bundle):
    import threading

    with pytest.raises(ViewError):
        serve(changed(bundle, q=bundle.trajectory.q * np.nan))
    assert not [t for t in threading.enumerate() if t.name.startswith("wbplan-view")]


@given(
    st.lists(st.tuples(st.sampled_from(["/a", "/a/b", "/c"]), st.sampled_from("xy"), st.integers(-99, 99)))
)
def test_a_store_tells_the_last_of_everything_said(said):
    store = Store()
    for path, key, value in said:
        store.send(SetProperty(path, key, value))
    heard = [umsgpack.unpackb(message) for message in store.messages()]
    assert {(m["path"], m["property"]): m["value"] for m in heard} == {(p, k): v for p, k, v in said}
    assert len(heard) == len({(p, k) for p, k, _ in said})


def test_planned_forces_grow_with_their_arrows_and_cones_stand_at_the_feet(bundle):
    motion = bundle.trajectory
    frames = [contact["frame"] for contact in bundle.phases[0]["contacts"]]
    rising = np.linspace(0.0, 20.0, len(motion))[:, None] * np.array([0.0, 0.0, 1.0])
    forced = dataclasses.replace(motion, forces=dict.fromkeys(frames, rising))
    played = Played(dataclasses.replace(bundle, trajectory=forced))
    end = float(motion.time[-1] - motion.time[0])
    for frame in frames:
        path = f"/wbplan/planned_forces/{frame}"
        half, full = played.at(path, ".scale", 0.5 * end)[2], played.at(path, ".scale", end)[2]
        assert full == pytest.approx(2.0 * half, rel=0.05)
        assert not played.shown(path, 0.0)  # nothing is drawn of no force
        assert played.shown(path, end)
    assert len(played.drawn("planned_forces")) == len(frames)
    assert len(played.drawn("cones")) >= len(frames)


def test_a_plan_without_forces_draws_none(bundle):
    played = Played(dataclasses.replace(bundle, trajectory=dataclasses.replace(bundle.trajectory, forces={})))
    assert played.drawn("planned_forces") == played.drawn("cones") == []
