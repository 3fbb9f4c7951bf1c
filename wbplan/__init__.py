"""wbplan: whole-body plans for legged robots that also manipulate."""

from wbplan.active import Active
from wbplan.bodies import Body, Carried
from wbplan.bundle import Bundle, Trajectory
from wbplan.checks import CheckReport, check
from wbplan.contacts import Contact
from wbplan.errors import (
    BundleError,
    CheckFailed,
    ModelError,
    Relaxation,
    SolveError,
    SpecError,
    ViewError,
    WbplanError,
)
from wbplan.limits import JointLimits, SupportPolygon
from wbplan.objectives import BalanceTask, ManipulabilityTask
from wbplan.paths import AS_IS, Curve, Hold, Line, Live, MinJerk, Path, Swing, Waypoints
from wbplan.planner import Plan, plan
from wbplan.robot import Robot, load_robot
from wbplan.script import Phase, Script
from wbplan.state import State
from wbplan.tasks import (
    ComTask,
    DampingTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Task,
)
from wbplan.tick import Loop, Tick
from wbplan.version import VERSION as __version__

__all__ = [
    "AS_IS",
    "Active",
    "BalanceTask",
    "Body",
    "Bundle",
    "BundleError",
    "Carried",
    "CheckFailed",
    "CheckReport",
    "ComTask",
    "Contact",
    "Curve",
    "DampingTask",
    "Hold",
    "JointLimits",
    "Line",
    "Live",
    "Loop",
    "ManipulabilityTask",
    "MinJerk",
    "ModelError",
    "OrientationTask",
    "Path",
    "Phase",
    "Plan",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "RelativePoseTask",
    "Relaxation",
    "Robot",
    "Script",
    "SolveError",
    "SpecError",
    "State",
    "SupportPolygon",
    "Swing",
    "Task",
    "Tick",
    "Trajectory",
    "ViewError",
    "Waypoints",
    "WbplanError",
    "__version__",
    "check",
    "load_robot",
    "plan",
]
