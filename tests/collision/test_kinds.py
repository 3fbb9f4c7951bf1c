"""Phases share a collision model only where it is the same."""

from __future__ import annotations

import wbplan as wb
from wbplan.collision import collision_model
from wbplan.compiled.phase import compile_phase


def test_phases_on_other_feet_have_other_pairs() -> None:
    robot = wb.load_robot("hexpiderix")
    world = wb.Obstacles([wb.Obstacle("ground", wb.Ground())])
    feet = list(robot.feet.values())

    def pairs(standing: list[str]) -> int:
        phase = wb.Phase("p", contacts=[wb.Contact(foot) for foot in standing], limits=[world])
        return len(collision_model(compile_phase(robot, phase, robot.state("stand").q)).first)

    assert pairs(feet) < pairs(feet[:3])
