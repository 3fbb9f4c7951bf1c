"""wbplan: whole-body plans for legged robots that also manipulate."""

from wbplan import gaits
from wbplan.bundle import Bundle, Trajectory
from wbplan.checks import CheckReport, check
from wbplan.errors import (
    BundleError,
    CheckFailed,
    GaitError,
    ModelError,
    Relaxation,
    SolveError,
    SpecError,
    ViewError,
    WbplanError,
)
from wbplan.explain.active import Active
from wbplan.explain.why import Reason, Why
from wbplan.obstacles import Box, Cylinder, Ground, HeightField, Mesh, Obstacle, Sphere, Terrain
from wbplan.paths import AS_IS, Curve, Hold, Line, Live, MinJerk, Path, Swing, Waypoints
from wbplan.planner import Plan, plan
from wbplan.problem.bodies import Body, Carried, Grip
from wbplan.problem.contacts import Contact, Push
from wbplan.problem.limits import Forces, JointLimits, Obstacles, SelfCollision, SupportPolygon
from wbplan.problem.objectives import BalanceTask, ManipulabilityTask
from wbplan.problem.script import Phase, Script
from wbplan.problem.tasks import (
    ComTask,
    DampingTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Task,
)
from wbplan.robot import Robot, load_robot
from wbplan.state import State
from wbplan.tick import Loop, Tick
from wbplan.version import VERSION as __version__

__all__ = [
    "AS_IS",
    "Active",
    "BalanceTask",
    "Body",
    "Box",
    "Bundle",
    "BundleError",
    "Carried",
    "CheckFailed",
    "CheckReport",
    "ComTask",
    "Contact",
    "Curve",
    "Cylinder",
    "DampingTask",
    "Forces",
    "GaitError",
    "Grip",
    "Ground",
    "HeightField",
    "Hold",
    "JointLimits",
    "Line",
    "Live",
    "Loop",
    "ManipulabilityTask",
    "Mesh",
    "MinJerk",
    "ModelError",
    "Obstacle",
    "Obstacles",
    "OrientationTask",
    "Path",
    "Phase",
    "Plan",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "Push",
    "Reason",
    "RelativePoseTask",
    "Relaxation",
    "Robot",
    "Script",
    "SelfCollision",
    "SolveError",
    "SpecError",
    "Sphere",
    "State",
    "SupportPolygon",
    "Swing",
    "Task",
    "Terrain",
    "Tick",
    "Trajectory",
    "ViewError",
    "Waypoints",
    "WbplanError",
    "Why",
    "__version__",
    "check",
    "gaits",
    "load_robot",
    "plan",
]
