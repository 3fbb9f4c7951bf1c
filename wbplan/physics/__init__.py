"""Plans replayed with contact, friction and servos, in MuJoCo (extra "physics")."""

from wbplan.physics.disturbance import Disturbance, Push
from wbplan.physics.ghosts import ghost_of
from wbplan.physics.options import Bounds, Options, Servo
from wbplan.physics.simulate import PICTURE, REPORT, Simulation, simulate
from wbplan.physics.trials import KINDS, Spread, Survival, Trial, wilson
from wbplan.physics.verdict import Measures, Verdict

__all__ = [
    "KINDS",
    "PICTURE",
    "REPORT",
    "Bounds",
    "Disturbance",
    "Measures",
    "Options",
    "Push",
    "Servo",
    "Simulation",
    "Spread",
    "Survival",
    "Trial",
    "Verdict",
    "ghost_of",
    "simulate",
    "wilson",
]
