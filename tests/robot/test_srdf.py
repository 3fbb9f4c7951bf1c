"""An SRDF gives limbs, tips, poses and roles, or every problem it has."""

from __future__ import annotations

import pytest

from wbplan.errors import ModelError
from wbplan.robot import load_robot

HEAD = '<robot name="toy">'


@pytest.fixture
def refused(make, write):
    """Loads the biped with an SRDF and returns the problems."""

    def _refused(srdf: str) -> tuple[str, ...]:
        with pytest.raises(ModelError, match=r"SRDF '.*toy\.srdf' cannot be used") as caught:
            load_robot(write(make.biped(), srdf))
        return caught.value.problems

    return _refused


@pytest.fixture
def loaded(make, write):
    return lambda srdf: load_robot(write(make.biped(), srdf))


def test_everything_is_read(make, loaded):
    robot = loaded(make.srdf)
    assert robot.limbs == {"left": ("left_hip", "left_knee"), "right": ("right_hip", "right_knee")}
    assert robot.feet == {"left": "left_foot", "right": "right_foot"}
    assert robot.hands == {"left": "left_shank"}
    assert robot.poses == {"stand": {"left_knee": 0.1}, "reach": {"left_knee": 0.3}}
    assert robot.roles == {"left": {"leg": {"left_knee": 0.1}, "arm": {"left_knee": 0.3}}}
    assert robot.ignored_collisions == {frozenset({"body", "left_thigh"})}
    assert robot.warnings == ()


def test_dialects_of_other_tools(loaded):
    robot = loaded(
        HEAD
        + """<virtual_joint name="world_joint" type="floating" parent_frame="world" child_link="body"/>
        <passive_joint name="left_knee"/>
        <group name="whole_body"><joint name="root_joint"/><joint name="world_joint"/><joint name="left_hip"/>
          <joint name="left_sole"/><joint name="left_knee"/>
          <joint name="right_hip"/><joint name="right_knee"/></group>
        <group name="l"><link name="left_thigh"/><link name="left_shank"/><link name="left_foot"/></group>
        <group name="r"><joint name="right_hip"/><joint name="right_knee"/></group>
        <group name="gripper"><link name="right_foot"/></group>
        <end_effector name="grip" parent_link="right_foot" group="gripper" parent_group="r"/>
        <end_effector name="other" parent_link="left_foot" group="gripper"/>
        <group_state name="standing" group="whole_body">
          <joint name="root_joint" value="0 0 0.235 0 0 0 1"/>
          <joint name="left_hip" value="0.5"/></group_state>
        <group_state name="home" group="l"><joint name="left_hip" value="0.2"/></group_state>
        <group_state name="home" group="r"><joint name="right_hip" value="0.3"/></group_state></robot>"""
    )
    assert robot.limbs == {
        "l": ("left_hip", "left_knee"),
        "r": ("right_hip", "right_knee"),
        "other": ("left_hip", "left_knee"),
    }
    assert robot.hands == {"r": "right_foot", "other": "left_foot"}
    assert robot.poses == {"standing": {"left_hip": 0.5}, "home": {"left_hip": 0.2, "right_hip": 0.3}}
    assert any("'other'" in warning and "left_hip" in warning for warning in robot.warnings)


def test_a_group_with_a_tip_is_a_limb_even_if_a_smaller_group_is_part_of_it(make, loaded):
    robot = loaded(
        make.srdf.replace(
            '<group name="all">', '<group name="hip"><joint name="left_hip"/></group><group name="all">'
        )
    )
    assert robot.limbs == {
        "left": ("left_hip", "left_knee"),
        "right": ("right_hip", "right_knee"),
        "hip": ("left_hip",),
    }


def test_every_problem_is_listed(make, refused):
    srdf = (
        make.srdf.replace('<joint name="left_hip"/>', '<joint name="left_hop"/>')
        .replace('parent_link="right_foot"', 'parent_link="right_toe"')
        .replace('link2="left_thigh"', 'link2="left_thing"')
        .replace('value="0.3"', 'value="nan"', 1)
    )
    found = refused(srdf)
    for words in (
        "group 'left': joint 'left_hop' is not in the URDF; joints: left_hip",
        "end_effector 'r': link 'right_toe' is not in the URDF",
        "disable_collisions: link 'left_thing' is not in the URDF",
        "group_state 'reach' of group 'all': value of joint 'left_knee' is 'nan'",
        "group 'feet': no end_effector says which limb 'right_foot' belongs to",
    ):
        assert sum(words in problem for problem in found) == 1, words
    assert len(found) == 5


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '<group name="left"/>',
            '<group name="middle"/>',
            "group 'all': group 'middle' does not exist; groups: all,",
        ),
        ('<group name="left"/>', '<group name="all"/>', "group 'all': contains itself"),
        ('<group name="hands">', '<group name="left">', "group 'left': the name is used 2 times"),
        ('<group name="hands">', "<group>", "group number 5: no name"),
        ('tip_link="right_foot"', 'tip_link="none"', "group 'right': link 'none' is not in the URDF"),
        (
            'base_link="body"',
            'base_link="left_thigh"',
            "'right_foot', which is not below its base link 'left_thigh'",
        ),
        (
            'parent_link="left_foot"',
            'parent_link="right_foot"',
            "end_effector 'l': link 'right_foot' is moved by no joint",
        ),
        (
            'group="feet" parent_group="right"',
            'group="feet" parent_group="left"',
            "limb 'left' already has 'left_foot'",
        ),
        (
            'group="feet" parent_group="right"',
            'group="foot" parent_group="right"',
            "group 'foot' does not exist",
        ),
        ('name="stand" group="all"', 'name="stand" group="none"', "group 'none' does not exist"),
        ('name="stand" group="all"', 'name="stand" group="right"', "joint 'left_knee' is not in that group"),
        ('name="stand" group="all"', 'group="all"', "no name"),
        (
            'name="reach" group="all"',
            'name="stand" group="all"',
            "joint 'left_knee' is 0.3 here, but 0.1 before",
        ),
        (
            'value="0.1"',
            'value="2.1"',
            "group_state 'stand' of group 'all': joint 'left_knee' at 2.1 is outside [-1, 2]",
        ),
        ('value="0.1"', "", "value of joint 'left_knee' is missing"),
        (
            '<joint name="left_knee" value="0.1"/>',
            '<joint name="left_sole" value="0"/>',
            "joint 'left_sole' does not move",
        ),
    ],
)
def test_each_problem(make, refused, old, new, words):
    assert old in make.srdf
    assert any(words in problem for problem in refused(make.srdf.replace(old, new, 1))), words


@pytest.mark.parametrize(
    ("held", "words"),
    [
        ('<joint name="left_knee" value="2.1"/>', "at 2.1 is outside"),
        ('<joint name="left_kne" value="0"/>', "joint 'left_kne' is not in the URDF"),
        ('<joint name="left_knee" value="0"/><joint name="left_knee" value="1"/>', "given twice"),
        ("", "the role 'leg' holds no joint"),
    ],
)
def test_roles_that_cannot_be_held(make, refused, held, words):
    old = '<group_state name="leg" group="left"><joint name="left_knee" value="0.1"/>'
    assert old in make.srdf
    found = refused(make.srdf.replace(old, f'<group_state name="leg" group="left">{held}'))
    assert any("group_state 'leg' of group 'left'" in problem and words in problem for problem in found)


def test_a_role_given_twice(make, refused):
    old = '<group_state name="arm" group="left">'
    assert any("given twice" in p for p in refused(make.srdf.replace(old, old.replace("arm", "leg"))))


def test_a_value_beyond_a_limit_by_rounding_is_clipped(make, loaded):
    robot = loaded(make.srdf.replace('value="0.1"', 'value="2.0000005"'))
    assert robot.poses["stand"]["left_knee"] == 2.0


def test_files_that_are_no_srdf(refused):
    assert "empty" in refused("")[0]
    assert "not well-formed" in refused("<robot>")[0]
    assert "root element is <urdf>" in refused("<urdf/>")[0]


def test_another_robots_srdf_is_a_warning(make, loaded):
    robot = loaded(make.srdf.replace(HEAD, '<robot name="other">'))
    assert robot.warnings == ("robot: named 'other', but 'toy' in the URDF",)
