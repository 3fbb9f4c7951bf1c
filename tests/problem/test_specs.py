"""Contacts, limits, bodies, phases and scripts as specifications."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wbplan as wb

POSE = pin.SE3.Identity()
BOX = wb.Body("box", mass=0.8)


# ------------------------------------------------------------------------------------------------ contacts


@pytest.mark.parametrize("friction", [0.0, -0.5, np.nan, np.inf, "rough", "0.5", None, [0.5]], ids=str)
def test_friction_is_a_finite_positive_number(friction: Any) -> None:
    with pytest.raises(
        wb.SpecError, match=r"Contact 'foot'\.friction: expected a finite positive number, got"
    ):
        wb.Contact("foot", friction=friction)


@pytest.mark.parametrize(
    "normal",
    [(0, 0, 0), (0, 0, 1, 0), (0, 1), 1.0, (0, np.nan, 1), (0, 0, np.inf), "up", POSE, wb.AS_IS],
    ids=str,
)
def test_a_normal_is_a_direction(normal: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"Contact 'foot'\.normal: "):
        wb.Contact("foot", normal=normal)


@pytest.mark.parametrize("frame", ["", None, 4, ["foot"]], ids=str)
def test_a_contact_names_a_frame(frame: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"Contact\.frame: expected a name"):
        wb.Contact(frame)


@given(st.tuples(*[st.floats(-10.0, 10.0)] * 3).filter(lambda n: np.linalg.norm(n) > 1e-3))
def test_a_normal_has_length_one_and_keeps_its_direction(normal: tuple[float, float, float]) -> None:
    kept = np.array(wb.Contact("foot", normal=normal).normal)
    assert np.linalg.norm(kept) == pytest.approx(1.0)
    np.testing.assert_allclose(kept * np.linalg.norm(normal), normal, atol=1e-9)


# -------------------------------------------------------------------------------------------------- limits


@pytest.mark.parametrize("speed", [0.0, -0.1, 1.0001, np.nan, np.inf, "fast", None], ids=str)
def test_a_speed_limit_is_a_fraction(speed: Any) -> None:
    with pytest.raises(wb.SpecError, match=r"JointLimits\.speed: expected a fraction in \(0, 1\], got"):
        wb.JointLimits(speed=speed)
    assert wb.JointLimits(speed=1).speed == 1.0


@pytest.mark.parametrize("margin", [np.nan, np.inf, -np.inf, "wide", None, [0.1, 0.2]], ids=str)
def test_a_margin_is_a_finite_length(margin: Any) -> None:
    with pytest.raises(
        wb.SpecError, match=r"SupportPolygon\.margin: expected a finite number of metres, got"
    ):
        wb.SupportPolygon(margin=margin)
    assert wb.SupportPolygon(margin=-0.1).margin == -0.1


@pytest.mark.parametrize("speed", [0.0, -1.0, np.nan, np.inf, "slow"], ids=str)
def test_a_recovery_speed_is_finite_and_positive(speed: Any) -> None:
    with pytest.raises(
        wb.SpecError, match=r"SupportPolygon\.recovery_speed: expected a finite positive speed"
    ):
        wb.SupportPolygon(recovery_speed=speed)


# -------------------------------------------------------------------------------------------------- bodies


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"mass": -0.1}, r"Body 'box'\.mass: expected kilograms of 0 or more, got -0\.1"),
        ({"mass": np.nan}, r"Body 'box'\.mass"),
        ({"mass": np.inf}, r"Body 'box'\.mass"),
        ({"mass": "light"}, r"Body 'box'\.mass"),
        ({"size": (0.1, 0.0, 0.1)}, r"Body 'box'\.size: expected positive lengths"),
        ({"size": (0.1, -0.1, 0.1)}, r"Body 'box'\.size: expected positive lengths"),
        ({"size": (0.1, np.nan, 0.1)}, r"Body 'box'\.size: NaN"),
        ({"size": (0.1, 0.1)}, r"Body 'box'\.size: expected three numbers"),
        ({"size": 0.1}, r"Body 'box'\.size: expected three numbers"),
        ({"size": POSE}, r"Body 'box'\.size: expected three numbers"),
        ({"com": (0.0, np.inf, 0.0)}, r"Body 'box'\.com: NaN, infinite value or more"),
        ({"com": (0.0,)}, r"Body 'box'\.com: expected three numbers"),
        ({"pose": np.zeros(3)}, r"Body 'box'\.pose: expected pin\.SE3"),
        ({"pose": wb.AS_IS}, r"Body 'box'\.pose: expected pin\.SE3"),
        ({"pose": np.eye(4)}, r"Body 'box'\.pose: expected pin\.SE3"),
        ({"name": ""}, r"Body\.name: expected a name"),
        ({"name": None}, r"Body\.name: expected a name"),
    ],
)
def test_a_body_has_a_name_mass_size_and_place(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        wb.Body(**{"name": "box", "mass": 0.8, **fields})


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"body": "box"}, r"Carried\.body: expected a wb\.Body, got 'box'"),
        ({"by": ""}, r"Carried 'box'\.by: expected a name"),
        ({"by": None}, r"Carried 'box'\.by: expected a name"),
        ({"pose": np.zeros(3)}, r"Carried 'box'\.pose: expected pin\.SE3"),
        ({"pads": "tip"}, r"Carried 'box'\.pads: expected a list of frames, got 'tip'"),
        ({"pads": [""]}, r"Carried 'box'\.pads: expected a name"),
        ({"pose": None}, r"Carried 'box'\.pose: expected pin\.SE3"),
        (
            {"pose": pin.SE3(np.eye(3), np.array([0.0, np.nan, 0.0]))},
            r"Carried 'box'\.pose: the pose holds NaN",
        ),
    ],
)
def test_carrying_takes_a_body_a_frame_and_a_pose(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        wb.Carried(**{"body": BOX, "by": "tip", **fields})


def test_a_body_keeps_copies() -> None:
    size, com, pose, grip = np.full(3, 0.2), [0.0, 0.0, 0.01], pin.SE3.Identity(), pin.SE3.Identity()
    body = wb.Body("box", mass=1.0, size=size, com=com, pose=pose)
    carried = wb.Carried(body, by="tip", pose=grip)
    size[:], com[2] = np.nan, np.nan
    pose.translation = grip.translation = np.ones(3)
    assert body.size == (0.2, 0.2, 0.2)
    assert body.com == (0.0, 0.0, 0.01)
    assert body.pose == pin.SE3.Identity()
    assert carried.pose == pin.SE3.Identity()


# ------------------------------------------------------------------------------------- phases and scripts


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, "1", None, [1.0]], ids=str)
def test_a_duration_is_finite_and_positive(duration: Any) -> None:
    with pytest.raises(
        wb.SpecError, match=r"phase 'stand'\.duration: expected a finite positive time in seconds"
    ):
        wb.Phase("stand", duration=duration)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"name": ""}, r"Phase\.name: expected a name"),
        ({"name": 3}, r"Phase\.name: expected a name, got 3"),
        ({"contacts": ["foot"]}, r"phase 'p'\.contacts: expected Contact, got 'foot'"),
        ({"contacts": wb.Contact("foot")}, r"phase 'p'\.contacts: expected a list"),
        ({"contacts": "foot"}, r"phase 'p'\.contacts: expected a list"),
        ({"carried": [BOX]}, r"phase 'p'\.carried: expected Carried"),
        ({"hard": [POSE]}, r"phase 'p'\.hard: expected Task"),
        ({"soft": [wb.JointLimits()]}, r"phase 'p'\.soft: expected Task"),
        ({"soft": wb.ComTask()}, r"phase 'p'\.soft: expected a list"),
        ({"limits": [wb.ComTask()]}, r"phase 'p'\.limits: expected JointLimits or SupportPolygon"),
        ({"locked": "knee"}, r"phase 'p'\.locked: expected a list"),
        ({"locked": [3]}, r"phase 'p'\.locked: expected str, got 3"),
        ({"roles": "arm"}, r"phase 'p'\.roles: expected a mapping"),
        ({"roles": {"limb1": 3}}, r"phase 'p'\.roles\['limb1'\]: expected a name, got 3"),
        ({"roles": {3: "arm"}}, r"phase 'p'\.roles: key: expected a name, got 3"),
        ({"driven": ["knee"]}, r"phase 'p'\.driven: expected a mapping"),
        ({"driven": {"knee": np.nan}}, r"phase 'p'\.driven\['knee'\]: NaN"),
        ({"driven": {"knee": [0.1, 0.2]}}, r"phase 'p'\.driven\['knee'\]: expected a number"),
        ({"driven": {"knee": POSE}}, r"phase 'p'\.driven\['knee'\]: expected a number, got pin\.SE3"),
        ({"driven": {"knee": wb.Live(0.1)}}, r"phase 'p'\.driven\['knee'\]: a Live value"),
        ({"driven": {"knee": 0.1}, "locked": ["knee"]}, r"phase 'p': joints both driven and locked: knee"),
        ({"contacts": [wb.Contact("a"), wb.Contact("a")]}, r"phase 'p'\.contacts: named more than once: a"),
        (
            {"carried": [wb.Carried(BOX, by="a"), wb.Carried(BOX, by="b")]},
            r"phase 'p'\.carried: named more than once: box",
        ),
        (
            {"hard": [wb.PoseTask("tip")], "soft": [wb.PoseTask("tip")]},
            r"phase 'p': tasks \(give name=\.\.\.\): named more than once: pose\(tip\)",
        ),
        ({"soft": [wb.ComTask(name="x"), wb.PostureTask(name="x")]}, "named more than once: x"),
        (
            {"contacts": [wb.Contact("a")], "soft": [wb.ComTask(name="contact(a)")]},
            r"named more than once: contact\(a\)",
        ),
        (
            {"limits": [wb.JointLimits(), wb.JointLimits(0.5)]},
            r"phase 'p'\.limits: more than one JointLimits",
        ),
        ({"limits": [wb.SupportPolygon()] * 2}, r"phase 'p'\.limits: more than one SupportPolygon"),
        (
            {"soft": [[wb.ComTask()], wb.PostureTask()]},
            r"phase 'p'\.soft: expected tasks, or levels .*both",
        ),
        ({"soft": [[wb.ComTask()], [3]]}, r"phase 'p'\.soft\[1\]: expected Task, got 3"),
        ({"soft": [[wb.ComTask()], []]}, r"phase 'p'\.soft\[1\]: expected one task or more in a level"),
        ({"soft": [[wb.ComTask()], [wb.ComTask()]]}, "named more than once: com"),
        (
            {"soft": [[wb.DampingTask()], [wb.ComTask()]]},
            r"phase 'p'\.soft\[0\]: damping would forbid the levels below all motion",
        ),
        ({"hard": [wb.DampingTask()]}, r"phase 'p'\.hard: a damping task forbids all motion; put it in soft"),
    ],
)
def test_a_phase_refuses_by_its_field(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(wb.SpecError, match=says):
        wb.Phase(**{"name": "p", **fields})


def test_levels_keep_their_order() -> None:
    a, b, c = wb.ComTask(), wb.PostureTask(), wb.DampingTask()
    flat, layered = wb.Phase("p", soft=[a, b, c]), wb.Phase("p", soft=[[a], (b, c)])
    assert flat.levels == (flat.soft,) == ((a, b, c),)
    assert layered.levels == layered.soft == ((a,), (b, c))
    assert flat.soft_tasks == layered.soft_tasks == flat.tasks == (a, b, c)
    assert replace(layered, name="q").levels == layered.levels
    assert wb.Phase("p").levels == ((),)


def test_a_phase_keeps_copies() -> None:
    contacts, soft, locked = [wb.Contact("a")], [wb.ComTask()], ["ankle"]
    roles, driven = {"limb1": "arm"}, {"knee": 0.5}
    phase = wb.Phase("p", contacts=contacts, soft=soft, locked=locked, roles=roles, driven=driven)
    contacts.clear(), soft.clear(), locked.clear(), roles.clear(), driven.clear()
    assert [c.frame for c in phase.contacts] == ["a"]
    assert [t.label for t in phase.soft] == ["com"]
    assert phase.locked == ("ankle",)
    assert phase.roles == {"limb1": "arm"}
    assert list(phase.driven) == ["knee"]
    with pytest.raises(TypeError):
        phase.roles["limb1"] = "leg"
    with pytest.raises(TypeError):
        phase.driven["knee"] = 0.0


def test_a_phase_says_what_it_promises() -> None:
    loop = wb.RelativePoseTask("right", root="left")
    some = wb.RelativePoseTask("right", root="body", weight=((1, 1, 0), 1), name="some axes")
    moving = wb.RelativePoseTask("right", root="foot", target=wb.MinJerk(wb.AS_IS, POSE, 1.0), name="moving")
    soft = wb.RelativePoseTask("left", root="body", name="soft")
    boxed = wb.RelativePoseTask("right", root="box", name="by the box")
    held = wb.RelativePoseTask("box", root="left", name="what is held anyway")
    phase = wb.Phase(
        "p",
        carried=[wb.Carried(BOX, by="left")],
        hard=[loop, some, moving, boxed, held],
        soft=[soft],
        limits=[wb.SupportPolygon(0.03)],
    )
    # An object is no frame of the robot's: its holder, to which it is fast, stands for it.
    assert phase.closures == (("left", "right"), ("left", "right"))
    assert phase.margin == 0.03
    assert phase.joint_limits is None
    assert wb.Phase("q").margin is None
    assert wb.Phase("q").joint_limits == wb.JointLimits()


def test_a_script_is_one_or_more_phases_of_different_names() -> None:
    first, second = wb.Phase("a", duration=1.5), wb.Phase("b", duration=2.0)
    assert wb.Script(first, [second]).phases == (first, second)
    assert wb.Script([first, second]).duration == 3.5
    with pytest.raises(wb.SpecError, match="Script: expected one or more phases, got none"):
        wb.Script()
    with pytest.raises(wb.SpecError, match="Script: phases: named more than once: a"):
        wb.Script(first, wb.Phase("a"))
    with pytest.raises(wb.SpecError, match="Script: expected Phase, got 'c'"):
        wb.Script(first, ["c"])
    with pytest.raises(wb.SpecError, match="Script: expected a list, got 5"):
        wb.Script(5)
    with pytest.raises(wb.SpecError, match=r"Script\.bodies: expected Body"):
        wb.Script(first, bodies=["box"])


@pytest.mark.parametrize(
    "other",
    [
        wb.Body("box", mass=0.9),
        wb.Body("box", mass=0.8, size=(0.1, 0.1, 0.2)),
        wb.Body("box", mass=0.8, com=(0.0, 0.0, 0.01)),
        wb.Body("box", mass=0.8, pose=POSE),
    ],
    ids=["mass", "size", "com", "pose"],
)
def test_two_different_bodies_do_not_share_a_name(other: wb.Body) -> None:
    phase = wb.Phase("a", carried=[wb.Carried(BOX, by="tip")])
    with pytest.raises(wb.SpecError, match="Script: two different bodies are named 'box'"):
        wb.Script(phase, bodies=[other])
    with pytest.raises(wb.SpecError, match="Script: two different bodies are named 'box'"):
        wb.Script(phase, wb.Phase("b", carried=[wb.Carried(other, by="tip")]))


@pytest.mark.parametrize(
    "other",
    [
        wb.Body("box", mass=0.9, pose=POSE),
        wb.Body("box", mass=0.8, pose=pin.SE3(np.eye(3), np.array([0.0, 0.0, 1e-6]))),
    ],
    ids=["mass", "place"],
)
def test_two_bodies_that_stand_somewhere_are_alike_in_all_or_different(other: wb.Body) -> None:
    with pytest.raises(wb.SpecError, match="Script: two different bodies are named 'box'"):
        wb.Script(wb.Phase("a"), bodies=[wb.Body("box", mass=0.8, pose=POSE), other])


def test_the_same_body_is_known_once() -> None:
    place = wb.Body("box", mass=0.8, pose=POSE)
    again = wb.Body("box", mass=0.8, pose=POSE)
    script = wb.Script(wb.Phase("a", carried=[wb.Carried(again, by="tip")]), bodies=[place])
    assert script.bodies == (place,)


@pytest.mark.parametrize(
    ("spec", "field"),
    [
        (wb.Contact("a"), "frame"),
        (wb.JointLimits(), "speed"),
        (wb.SupportPolygon(), "margin"),
        (BOX, "mass"),
        (wb.Carried(BOX, by="tip"), "by"),
        (wb.Phase("a"), "duration"),
        (wb.Script(wb.Phase("a")), "phases"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_specification_cannot_be_assigned_to(spec: Any, field: str) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(spec, field, getattr(spec, field))
