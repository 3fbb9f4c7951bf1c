"""Forces: friction cones, the region where contacts hold the robot, what each contact and servo gives."""

from wbplan.statics.cones import axes_of, faces, friction_use, rays
from wbplan.statics.region import (
    Region,
    TorqueLimits,
    equilibrium_region,
    hull_is_exact,
    support_region,
)
from wbplan.statics.stance import push_load, support

__all__ = [
    "Region",
    "TorqueLimits",
    "axes_of",
    "equilibrium_region",
    "faces",
    "friction_use",
    "hull_is_exact",
    "push_load",
    "rays",
    "support",
    "support_region",
]
