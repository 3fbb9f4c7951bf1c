"""A broken URDF is refused, with every problem and its element."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from wbplan.errors import ModelError
from wbplan.robot import load_robot, problems


def pair(make, **kwargs):
    """Body and arm, joined by one joint with something about it changed."""
    return make.robot(make.link("body"), make.link("arm"), make.joint("j", "body", "arm", **kwargs))


def with_arm(make, inside):
    """Body and arm, the arm's content given."""
    return make.robot(make.link("body"), make.link("arm", inside), make.joint("j", "body", "arm"))


def shape(inside):
    return f"<collision><geometry>{inside}</geometry></collision>"


def only(text, *words, **kwargs):
    """Exactly one problem is found, and it says all of `words`."""
    found = problems(text, **kwargs)
    assert len(found) == 1, found
    for word in words:
        assert word in found[0]


def test_a_sound_robot_has_no_problem(make):
    assert problems(make.biped()) == []
    assert problems(pair(make)) == []


@pytest.mark.parametrize("mass", ["-1", "-0.001"])
def test_negative_mass(make, mass):
    only(with_arm(make, make.inertial(mass)), f"link 'arm': mass {mass} kg, expected > 0")


def test_negative_mass_of_a_fixed_link(make):
    extra = make.link("lid", make.inertial(-0.5)) + make.joint("f", "body", "lid", kind="fixed")
    only(
        make.robot(make.link("body"), make.link("arm"), make.joint("j", "body", "arm"), extra),
        "link 'lid': mass -0.5 kg",
    )


@pytest.mark.parametrize(
    "inside",
    ["", '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'],
)
def test_moving_link_without_mass(make, inside):
    only(with_arm(make, inside), "link 'arm': mass 0 kg", "expected > 0", "joint 'j' moves it")


def test_floating_base_without_mass(make):
    text = make.robot(make.link("body", ""), make.link("arm"), make.joint("j", "body", "arm"))
    only(text, "link 'body': mass 0 kg", "floating base")


def test_a_massless_link_is_fine_where_something_fixed_to_it_has_mass(make):
    parts = [make.link("body"), make.link("arm", ""), make.link("plate", ""), make.link("motor")]
    parts += [make.joint("j", "body", "arm"), make.joint("f1", "arm", "plate", kind="fixed")]
    assert problems(make.robot(*parts, make.joint("f2", "plate", "motor", kind="fixed"))) == []
    # Not so where the motor moves against it.
    only(make.robot(*parts, make.joint("f2", "plate", "motor")), "link 'arm': mass 0 kg", "plate")


@pytest.mark.parametrize(
    ("inertia", "word"),
    [
        ('ixx="-0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"', "not positive definite"),
        ('ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"', "not positive definite"),
        ('ixx="0.02" ixy="0.03" ixz="0" iyy="0.02" iyz="0" izz="0.02"', "not positive definite"),
        ('ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.05"', "triangle inequality"),
        # Diagonal fine, principal moments not: 0.01, 0.03, 0.06.
        ('ixx="0.045" ixy="0.015" ixz="0" iyy="0.045" iyz="0" izz="0.01"', "triangle inequality"),
        ('ixx="1e11" ixy="0" ixz="0" iyy="1e11" iyz="0" izz="9e11"', "triangle inequality"),
    ],
)
def test_impossible_inertia(make, inertia, word):
    only(with_arm(make, make.inertial(1, inertia)), "link 'arm': inertia", word)


def test_a_thin_plate_rounded_to_four_digits_is_fine(make):
    plate = 'ixx="0.01234" ixy="0" ixz="0" iyy="0.05679" iyz="0" izz="0.06914"'
    assert 0.01234 + 0.05679 < 0.06914  # by rounding
    assert problems(with_arm(make, make.inertial(1, plate))) == []


@pytest.mark.parametrize(
    "bad", ["nan", "inf", "-inf", "1e999", "1,5", "one", "", "1 2", "0x10", "1_0", "\u0661"]
)
def test_numbers_that_are_none(make, bad):
    only(with_arm(make, make.inertial(bad)), f"link 'arm': mass is '{bad}', expected a finite number")
    only(pair(make, xyz=f"0 0 {bad}" if bad else "0 0"), "joint 'j': origin xyz", "expected 3 finite numbers")
    only(pair(make, axis=f"0 1 {bad}" if bad else "0 1"), "joint 'j': axis", "expected 3 finite numbers")
    limit = f'<limit lower="{bad}" upper="1" effort="1" velocity="1"/>'
    only(pair(make, limit=limit), f"joint 'j': limit lower is '{bad}', expected a finite number")
    only(pair(make, more=f'<dynamics damping="{bad}"/>'), f"joint 'j': dynamics damping is '{bad}'")


def test_a_number_that_no_robot_has(make):
    only(pair(make, xyz="0 0 -1e13"), "joint 'j': origin xyz", "expected nothing beyond 1e+12")


def test_a_mesh_whose_name_no_file_can_have(make):
    mesh = shape(f'<mesh filename="{"a" * 5000}"/>')
    only(with_arm(make, make.inertial() + mesh), "link 'arm' collision: mesh", "does not exist")


def test_incomplete_inertial(make):
    only(
        with_arm(make, '<inertial><mass value="1"/></inertial>'), "link 'arm': its inertial has no <inertia>"
    )
    found = problems(
        with_arm(make, '<inertial><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"/></inertial>')
    )
    assert any("link 'arm': its inertial has no <mass>" in line for line in found)
    assert any("link 'arm': inertia izz is missing" in line for line in found)


def test_limits(make):
    wrong = '<limit lower="1" upper="-1" effort="1" velocity="1"/>'
    only(pair(make, limit=wrong), "joint 'j': limits are inverted: lower 1 > upper -1 rad")
    only(pair(make, limit=wrong, kind="prismatic"), "joint 'j': limits are inverted: lower 1 > upper -1 m")
    only(pair(make, limit=""), "joint 'j': no <limit>, expected one, for it is revolute")
    only(
        pair(make, limit='<limit effort="1" velocity="1"/>'),
        "joint 'j': its limit has neither lower nor upper",
    )
    # The format lets one of the two be absent: it is 0 then.
    only(pair(make, limit='<limit lower="1" effort="1" velocity="1"/>'), "lower 1 > upper 0")
    assert problems(pair(make, limit='<limit upper="1" effort="1" velocity="1"/>')) == []


@pytest.mark.parametrize("value", ["0", "-2"])
def test_speed_and_effort_limits(make, value):
    limit = f'<limit lower="-1" upper="1" effort="1" velocity="{value}"/>'
    only(pair(make, limit=limit), f"joint 'j': limit velocity {value} rad/s, expected > 0")
    limit = f'<limit lower="-1" upper="1" effort="{value}" velocity="1"/>'
    only(pair(make, limit=limit, kind="prismatic"), f"joint 'j': limit effort {value} N, expected > 0")
    only(pair(make, limit='<limit lower="-1" upper="1" effort="1"/>'), "joint 'j': limit velocity is missing")


def test_axis_without_direction(make):
    only(pair(make, axis="0 0 0"), "joint 'j': axis is '0 0 0', expected a direction")


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("continuous", "revolute with limits as wide"),
        ("planar", "not supported"),
        ("floating", "not supported"),
        ("screw", "unknown type 'screw', expected one of revolute, prismatic, fixed"),
        ("", "unknown type ''"),
    ],
)
def test_joint_types(make, kind, word):
    only(pair(make, kind=kind), "joint 'j': ", word)


def test_what_pinocchios_parser_insists_on(make):
    only(pair(make, more="<dynamics/>"), "joint 'j': its dynamics has neither damping nor friction")
    only(pair(make, more="<safety_controller/>"), "joint 'j': safety_controller k_velocity is missing")
    lid = make.link("lid") + make.joint("f", "body", "lid", kind="fixed", more='<limit effort="0"/>')
    parts = [make.link("body"), make.link("arm"), make.joint("j", "body", "arm"), lid]
    only(make.robot(*parts), "joint 'f': limit velocity is missing")
    assert problems(make.robot(*parts).replace('effort="0"', 'effort="0" velocity="0"')) == []


def test_mimic(make):
    only(pair(make, more='<mimic joint="j"/>'), "joint 'j': mimic joints are not supported")


def test_names(make):
    ok = [make.link("body"), make.link("arm"), make.joint("j", "body", "arm")]
    only(make.robot(*ok, make.link("arm")), "link 'arm': the name is used 2 times, expected once")
    more = [make.link("tip"), make.joint("j", "arm", "tip")]
    found = problems(make.robot(*ok, *more))
    assert found[0] == "joint 'j': the name is used 2 times, expected once"
    found = problems(make.robot(*ok, "<link/>", '<joint name=" " type="fixed"/>'))
    assert found == ["link number 3: no name", "joint number 2: no name"]
    only(make.robot(*ok, name=""), "robot: no name")
    assert "reserved" in problems(make.robot(*ok).replace('"j"', '"root_joint"'))[0]
    assert "reserved" in problems(make.robot(*ok).replace('"body"', '"universe"'))[0]


def test_a_name_shared_by_link_and_joint_is_a_warning_and_means_the_link(make, write):
    text = make.biped().replace('"left_hip"', '"left_foot"')
    assert problems(text) == []
    robot = load_robot(write(text))
    assert any("left_foot" in warning for warning in robot.warnings)
    assert robot.state().pose("left_foot").translation[2] == pytest.approx(-0.5)


def test_joint_ends(make):
    parts = [make.link("body"), make.link("arm"), make.joint("j", "body", "arm")]
    only(
        make.robot(*parts, make.joint("k", "arm", "hand")),
        "joint 'k': child link 'hand' does not exist; links: arm, body",
    )
    found = problems(make.robot(*parts, make.link("hand"), make.joint("k", "wrist", "hand")))
    assert found == ["joint 'k': parent link 'wrist' does not exist; links: arm, body, hand"]
    found = problems(pair(make).replace('<parent link="body"/>', ""))
    assert found == ["joint 'j': no parent, expected <parent link=...>"]


def test_two_parents(make):
    text = make.robot(
        *map(make.link, "abc"),
        make.joint("j", "a", "b"),
        make.joint("k", "b", "c"),
        make.joint("l", "a", "c"),
    )
    only(text, "link 'c': child of 2 joints ('k', 'l'), expected one")


def test_roots_and_cycles(make):
    two = make.robot(*map(make.link, "abc"), make.joint("j", "a", "b"))
    only(two, "robot: 2 root links (a, c), expected one")
    ring = make.robot(*map(make.link, "abc"), *(make.joint(p + c, p, c) for p, c in ("ab", "bc", "ca")))
    found = problems(ring)
    assert len(found) == 2
    assert "no root link" in found[0]
    assert "cycle: " in found[1]
    aside = make.robot(*map(make.link, "abcd"), *(make.joint(p + c, p, c) for p, c in ("ab", "cd", "dc")))
    only(aside, "robot: the joints form a cycle: ", "c -> d")


def test_nothing_that_moves(make):
    only(make.robot(make.link("a")), "robot: no joint that moves")
    only(
        make.robot(make.link("a"), make.link("b"), make.joint("f", "a", "b", kind="fixed")),
        "no joint that moves",
    )
    only(make.robot(), "robot: no link")


@pytest.mark.parametrize(
    ("inside", "word"),
    [
        ('<box size="1 1"/>', "box size is '1 1', expected 3 finite numbers"),
        ('<box size="1 0 1"/>', "expected > 0"),
        ('<cylinder radius="1"/>', "cylinder length is missing"),
        ('<sphere radius="-1"/>', "sphere radius is '-1' m, expected > 0"),
        ("<cone/>", "unknown shape 'cone'"),
        ("", "no geometry"),
        ("<mesh/>", "mesh without a filename"),
        ('<mesh filename="http://example.org/a.stl"/>', "mesh 'http://example.org/a.stl' does not exist"),
    ],
)
def test_shapes(make, inside, word):
    only(with_arm(make, make.inertial() + shape(inside)), "link 'arm' collision: ", word)


def test_meshes(make, tmp_path):
    folder = tmp_path / "models" / "toy_description"
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    (folder / "meshes" / "a b.stl").write_text("solid")

    def text(filename, more=""):
        return with_arm(make, make.inertial() + shape(f'<mesh filename="{filename}" {more}/>'))

    package = text("package://toy_description/meshes/a b.stl")
    only(package, "does not exist", "toy_description", "package_dirs", base_dir=tmp_path)
    assert problems(package, [tmp_path / "models"], tmp_path) == []
    assert problems(package, [folder], tmp_path) == []
    assert problems(package, base_dir=folder / "urdf") == []
    relative = text("../meshes/a b.stl")
    assert problems(relative, base_dir=folder / "urdf") == []
    only(relative, "'../meshes/a b.stl' does not exist", str(tmp_path), base_dir=tmp_path)
    assert problems(text((folder / "meshes" / "a b.stl").as_uri())) == []
    assert problems(text(str(folder / "meshes" / "a b.stl"), 'scale="1 -1 1"')) == []
    only(text("../meshes", ""), "does not exist", base_dir=folder / "urdf")  # a folder is no mesh
    only(text(str(folder / "meshes" / "a b.stl"), 'scale="1 0 1"'), "mesh scale is '1 0 1'")


def test_load_refuses_a_missing_mesh_and_takes_package_dirs(make, write, tmp_path):
    path = write(with_arm(make, make.inertial() + shape('<mesh filename="package://pkg/a.stl"/>')))
    with pytest.raises(ModelError, match=r"package://pkg/a\.stl"):
        load_robot(path)
    (tmp_path / "lib" / "pkg").mkdir(parents=True)
    (tmp_path / "lib" / "pkg" / "a.stl").write_text("solid")
    robot = load_robot(path, package_dirs=[tmp_path / "lib"])
    assert robot.mesh_path("package://pkg/a.stl") == (tmp_path / "lib" / "pkg" / "a.stl").resolve()


def test_colours_do_no_harm_and_make_no_noise(make, write, capfd):
    visual = '<visual><geometry><sphere radius="1"/></geometry><material/></visual>'
    text = make.robot("<material/>", make.link("body", make.inertial() + visual), make.leg("leg", 1, 0))
    assert load_robot(write(text)).urdf_text == text
    assert capfd.readouterr() == ("", "")
    found = problems(text.replace("<material/>", '<material name="m"><color rgba="1 1 1"/></material>'))
    assert found == [
        "material 'm': color rgba is '1 1 1', expected 4 finite numbers",
        "link 'body' visual: color rgba is '1 1 1', expected 4 finite numbers",
    ]


def test_every_problem_is_in_one_error(make, write, capfd):
    wrong = '<limit lower="1" upper="-1" effort="0" velocity="nan"/>'
    path = write(
        make.robot(
            make.link("body", make.inertial(-1, 'ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="3"')),
            make.link("arm", shape('<mesh filename="gone.stl"/>')),
            make.link("arm"),
            make.link("alone"),
            make.joint("j", "body", "arm", limit=wrong, axis="0 0 0"),
        )
    )
    with pytest.raises(ModelError) as caught:
        load_robot(path)
    expected = [
        "mass -1",
        "triangle",
        "gone.stl",
        "2 times",
        "2 root links",
        "inverted",
        "effort 0",
        "velocity is 'nan'",
        "axis",
        "link 'arm': mass 0",
    ]
    for words in expected:
        assert sum(words in problem for problem in caught.value.problems) == 1, words
    assert len(caught.value.problems) == len(expected)
    message = str(caught.value)
    assert str(path) in message
    assert all(problem in message for problem in caught.value.problems)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("  \n ", "empty"),
        ("not xml", "not well-formed"),
        ("<robot name='a'><link name='b'></robot>", "not well-formed"),
        ("<mujoco/>", "root element is <mujoco>, expected <robot>"),
        ('<robot name="a" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="m"/></robot>', "xacro"),
        ("<robot name='a'/>\0", "not well-formed"),
    ],
)
def test_files_that_are_no_urdf(write, text, word):
    with pytest.raises(ModelError, match=word) as caught:
        load_robot(write(text))
    assert "toy.urdf" in str(caught.value)
    assert len(caught.value.problems) == 1


def test_bytes_that_are_no_text(tmp_path):
    path = tmp_path / "toy.urdf"
    path.write_bytes(b"\xff\xfe\x00<robot/>")
    with pytest.raises(ModelError, match="not UTF-8 text"):
        load_robot(path)


def test_byte_order_mark_and_declared_encoding_are_fine(make, tmp_path):
    path = tmp_path / "toy.urdf"
    path.write_bytes(b"\xef\xbb\xbf" + make.biped().encode())
    assert load_robot(path).name == "toy"


@pytest.mark.parametrize("kind", ["urdf", "srdf"])
def test_an_entity_bomb_is_refused_at_once(make, write, kind):
    levels = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE robot [<!ENTITY e0 "ha">{levels}]><robot name="&e11;"/>'
    path = write(bomb) if kind == "urdf" else write(make.biped(), bomb)
    start = time.perf_counter()
    with pytest.raises(ModelError, match="entit"):
        load_robot(path)
    assert time.perf_counter() - start < 1.0


def test_an_entity_from_a_file_is_refused(write, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("hidden")
    path = write(f'<!DOCTYPE robot [<!ENTITY x SYSTEM "{secret.as_uri()}">]><robot name="a">&x;</robot>')
    with pytest.raises(ModelError, match="entity 'x'") as caught:
        load_robot(path)
    assert "hidden" not in str(caught.value)


def test_relative_meshes_count_from_the_working_folder_if_none_is_given(make, tmp_path, monkeypatch):
    (tmp_path / "a.stl").write_text("solid")
    text = with_arm(make, make.inertial() + shape('<mesh filename="a.stl"/>'))
    assert len(problems(text, base_dir=Path("/nowhere"))) == 1
    monkeypatch.chdir(tmp_path)
    assert problems(text) == []
