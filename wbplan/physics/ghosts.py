"""A simulation as the view's ghost."""

from __future__ import annotations

import numpy as np

from wbplan.physics.scene import from_mujoco
from wbplan.physics.simulate import Simulation
from wbplan.view import Ghost

RATE = 50.0  #: samples a second


def ghost_of(simulation: Simulation) -> Ghost:
    """The simulated robot, the objects, and the forces on the feet, for the view."""
    record = simulation.record
    step = max(1, round(1.0 / (RATE * simulation.options.dt)))
    rows = np.flatnonzero(record.time >= -1e-9)[::step]
    time = record.time[rows]
    sizes = {item["name"]: tuple(item["size"]) for item in simulation.bundle.plan.get("bodies", ())}
    forces = {
        foot: np.column_stack([record.feet[rows, i], record.force[rows, i]])
        for i, foot in enumerate(simulation.motion.feet)
    }
    bodies = {name: from_mujoco(poses)[rows] for name, poses in record.objects.items()}
    return Ghost(time, simulation.configurations(time), forces, bodies, sizes)
