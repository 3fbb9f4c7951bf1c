"""A robot's folder as the tests read it: both files, through Pinocchio and as XML."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb

URDF = Path(__file__).resolve().parents[2] / "urdf"


@dataclass(frozen=True)
class Machine:
    """A robot by the name of its folder."""

    name: str

    @property
    def folder(self) -> Path:
        return URDF / self.name

    @property
    def urdf(self) -> Path:
        return self.folder / f"{self.name}.urdf"

    @cached_property
    def links(self) -> ElementTree.Element:
        return ElementTree.parse(self.urdf).getroot()

    @cached_property
    def meaning(self) -> ElementTree.Element:
        return ElementTree.parse(self.urdf.with_suffix(".srdf")).getroot()

    @cached_property
    def model(self) -> pin.Model:
        return pin.buildModelFromUrdf(str(self.urdf), pin.JointModelFreeFlyer())

    @cached_property
    def solids(self) -> pin.GeometryModel:
        return pin.buildGeomFromUrdf(self.model, str(self.urdf), pin.GeometryType.COLLISION)

    @cached_property
    def robot(self) -> wb.Robot:
        """As the planner sees it."""
        return wb.load_robot(self.name)

    def states(self, group: str) -> dict[str, dict[str, float]]:
        """Group states: name -> joint -> value."""
        return {
            state.attrib["name"]: {j.attrib["name"]: float(j.attrib["value"]) for j in state.iter("joint")}
            for state in self.meaning.iter("group_state")
            if state.attrib["group"] == group
        }

    def q(self, values: dict[str, float] | str) -> np.ndarray:
        """Configuration with these joint values, or of a named pose; the base at the world's origin."""
        q = pin.neutral(self.model)
        for joint, value in (self.states("all")[values] if isinstance(values, str) else values).items():
            assert self.model.existJointName(joint), joint
            q[self.model.joints[self.model.getJointId(joint)].idx_q] = value
        return q

    def placements(self, q: np.ndarray) -> dict[str, pin.SE3]:
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        return {frame.name: data.oMf[i].copy() for i, frame in enumerate(self.model.frames)}

    def disabled(self, *reasons: str) -> list[frozenset[str]]:
        """Pairs of links that are not checked for collision."""
        return [
            frozenset((e.attrib["link1"], e.attrib["link2"]))
            for e in self.meaning.iter("disable_collisions")
            if not reasons or e.attrib["reason"] in reasons
        ]

    def solids_with(self, wanted: set[frozenset[str]], keep: bool) -> pin.GeometryModel:
        """Collision shapes that check just the pairs of links that are (keep) or are not in `wanted`."""
        chosen = self.solids.copy()
        chosen.removeAllCollisionPairs()
        links = [self.link_of(g) for g in chosen.geometryObjects]
        for i, one in enumerate(links):
            for j in range(i + 1, len(links)):
                if one != links[j] and (frozenset((one, links[j])) in wanted) == keep:
                    chosen.addCollisionPair(pin.CollisionPair(i, j))
        return chosen

    def hits(self, chosen: pin.GeometryModel, q: np.ndarray) -> set[tuple[str, str]]:
        """Pairs of links that touch."""
        found = chosen.createData()
        pin.computeCollisions(self.model, self.model.createData(), chosen, found, q, False)
        shapes = chosen.geometryObjects
        return {
            (self.link_of(shapes[pair.first]), self.link_of(shapes[pair.second]))
            for pair, result in zip(chosen.collisionPairs, found.collisionResults, strict=True)
            if result.isCollision()
        }

    def least(self, chosen: pin.GeometryModel, q: np.ndarray) -> float:
        """Least distance [m] of all pairs."""
        found = chosen.createData()
        pin.computeDistances(self.model, self.model.createData(), chosen, found, q)
        return min(result.min_distance for result in found.distanceResults)

    @cached_property
    def checked(self) -> pin.GeometryModel:
        """Collision shapes with the pairs of links that a planner would check."""
        return self.solids_with(set(self.disabled()), keep=False)

    def link_of(self, geometry: pin.GeometryObject) -> str:
        return str(self.model.frames[geometry.parentFrame].name)


MACHINES = {path.parent.name: Machine(path.parent.name) for path in sorted(URDF.glob("*/generate.py"))}


@pytest.fixture(scope="session", params=MACHINES.values(), ids=MACHINES.keys())
def machine(request) -> Machine:
    """Each robot of the repository."""
    return request.param


@pytest.fixture(scope="session")
def machines() -> dict[str, Machine]:
    """The same by name."""
    return MACHINES


@pytest.fixture(scope="session")
def legarm() -> Machine:
    return MACHINES["legarm_hexapod"]


@pytest.fixture(scope="session")
def sway() -> Callable[..., wb.Plan]:
    """Plans how a robot's body moves out and back while all its feet stay."""

    def plan(robot: wb.Robot, pose: str, shift, turn, margin: float = 0.02) -> wb.Plan:
        start = robot.state(pose)
        body = next(frame.name for frame in robot.model.frames if frame.type == pin.FrameType.BODY)
        here = start.pose(body)
        there = pin.SE3(here.rotation @ pin.exp3(np.array(turn)), here.translation + np.array(shift))
        phase = wb.Phase(
            "sway",
            contacts=[wb.Contact(foot, friction=0.6) for foot in robot.standing_feet(start.q)],
            soft=[
                wb.PoseTask(
                    body, wb.Waypoints((0.0, 0.6, 1.2), [wb.AS_IS, there, here]), weight=(20.0, 10.0)
                ),
                wb.PostureTask(weight=0.01),
                wb.DampingTask(),
            ],
            limits=[wb.JointLimits(), wb.SupportPolygon(margin=margin)],
            duration=1.2,
        )
        return wb.plan(robot, phase, start=start, dt=0.02)

    return plan


@pytest.fixture(scope="session")
def run_script() -> Iterator[Callable[[str], ModuleType]]:
    """Imports a script under urdf/ by its path there; it may extend sys.path, and leaves no bytecode."""

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"urdf_{name.replace('/', '_')[:-3]}", URDF / name)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        patch.setitem(sys.modules, spec.name, module)  # where dataclasses look for their module
        spec.loader.exec_module(module)
        return module

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", list(sys.path))
        patch.setattr(sys, "dont_write_bytecode", True)
        yield load
