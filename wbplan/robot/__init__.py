"""Robots: a URDF, checked, with limbs, tips, named poses and roles from its SRDF."""

from wbplan.robot.description import Robot
from wbplan.robot.loader import load_robot
from wbplan.robot.urdf_check import problems

__all__ = ["Robot", "load_robot", "problems"]
