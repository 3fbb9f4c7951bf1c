"""MANA's simulations (figures 8 to 10): feet that roll, and feet as ball joints, beside what is prescribed.

The paper drove the joints of a virtual prototype in ADAMS along the planned angles; here stiff servos drive
them in MuJoCo, with weight, contact and friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.papers.rows import Row
from wbplan.physics import Options, Servo
from wbplan.physics.options import Feet
from wbplan.planner import plan
from wbplan.robot import load_robot
from wbplan.taskfile import load_task

Array = NDArray[np.float64]
row = partial(Row, "MANA")

#: Angles are prescribed, so the servos are as good as rigid.
STIFF = Servo(error=0.002, lag=0.002)
STEP = 0.001  #: of the simulator [s]
#: "Identical" and "near", for place [mm] and turn [deg] of the body; the paper draws, without numbers.
IDENTICAL, NEAR = (0.5, 0.5), (5.0, 5.0)


@final
@dataclass(frozen=True, eq=False)
class Comparison:
    """The body of MANA along a task, prescribed and simulated.

    Attributes:
        time: (K,) [s].
        prescribed: (K, 6) place [mm] and rotation vector [deg] of the body, world.
        joints: (K, 6) likewise, feet as ball joints.
        rolling: (K, 6) likewise, feet as balls of 15 mm that roll.
    """

    time: Array
    prescribed: Array
    joints: Array
    rolling: Array

    def worst(self, feet: Feet) -> tuple[float, float]:
        """Largest distance [mm] and turn [deg] of the body from what is prescribed."""
        off = (self.joints if feet == "joint" else self.rolling) - self.prescribed
        return tuple(float(np.linalg.norm(part, axis=1).max()) for part in (off[:, :3], off[:, 3:]))  # type: ignore[return-value]


@cache
def compare(task: str) -> Comparison:
    """Plans and simulates a task of MANA, `body_helix` or `body_sway`, with both kinds of feet.

    Errors count from the pose that the robot has settled in: a ball's centre is 7.5 mm above the ground.
    """
    found = load_task(task)
    robot = load_robot(found.robot)
    made = plan(robot, found.script(robot, {}), task=task)
    trajectory = made.bundle.trajectory
    off = {}
    feet: Feet
    for feet in ("joint", "ball"):
        done = made.simulate(Options(feet=feet, servo=STIFF, dt=STEP))
        m = done.measures
        error = np.hstack([1e3 * m.position, np.degrees(m.rotation)])
        off[feet] = error - error[0]
        time = m.time
    turn = np.array([pin.log3(pin.Quaternion(q[3:7]).matrix()) for q in trajectory.q])
    known = np.hstack([1e3 * trajectory.q[:, :3], np.degrees(turn)])
    prescribed = np.array([np.interp(time, trajectory.time, column) for column in known.T]).T
    return Comparison(time, prescribed, prescribed + off["joint"], prescribed + off["ball"])


def figures_8_to_10_simulated() -> list[Row]:
    """Section 5.3: with ball joints identical to theory, with rolling feet near to it."""
    rows = []
    for figure, task, name in (("Fig 8", "body_helix", "helix"), ("Figs 9, 10", "body_sway", "combined")):
        done = compare(task)
        for feet, word, bounds in (("joint", "identical", IDENTICAL), ("ball", "near", NEAR)):
            place, turn = done.worst(feet)  # type: ignore[arg-type]
            said = word if place < bounds[0] and turn < bounds[1] else "off"
            kind = "feet as ball joints" if feet == "joint" else "feet that roll"
            why = f"{place:.2f} mm, {turn:.2f} deg at worst"
            rows.append(row(figure, f"{name}, {kind}: beside theory", word, said, why=why))
    return rows


TABLES = (figures_8_to_10_simulated,)
