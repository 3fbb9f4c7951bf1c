"""Distances between the robot's links, what they carry and what stands in the world, as rows of the tick."""

from wbplan.collision.clearance import CAPACITY, SHARE, Clearance
from wbplan.collision.model import CollisionModel, Thing, collision_model, has_shapes, sole

__all__ = [
    "CAPACITY",
    "SHARE",
    "Clearance",
    "CollisionModel",
    "Thing",
    "collision_model",
    "has_shapes",
    "sole",
]
