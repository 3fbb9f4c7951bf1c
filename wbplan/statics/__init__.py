"""Forces: friction cones, the region where contacts hold the robot, what each contact and servo gives."""

from wbplan.statics.cones import axes_of, faces, friction_use, rays
from wbplan.statics.forces import ForceQP, grasp_map
from wbplan.statics.grip import Squeeze, force_closure, smallest_squeeze
from wbplan.statics.planned import PlanForces, Stance, plan_forces, promised
from wbplan.statics.region import (
    Region,
    TorqueLimits,
    equilibrium_region,
    hull_is_exact,
    support_region,
)
from wbplan.statics.robust import WrenchCone, tilt
from wbplan.statics.stance import ease_of_pushes, push_load, support

__all__ = [
    "ForceQP",
    "PlanForces",
    "Region",
    "Squeeze",
    "Stance",
    "TorqueLimits",
    "WrenchCone",
    "axes_of",
    "ease_of_pushes",
    "equilibrium_region",
    "faces",
    "force_closure",
    "friction_use",
    "grasp_map",
    "hull_is_exact",
    "plan_forces",
    "promised",
    "push_load",
    "rays",
    "smallest_squeeze",
    "support",
    "support_region",
    "tilt",
]
