"""What stands in the world and does not move: shapes, the ground, and the terrain that they make."""

from wbplan.obstacles.obstacle import Obstacle
from wbplan.obstacles.record import from_record, to_record
from wbplan.obstacles.shapes import Box, Cylinder, Ground, HeightField, Mesh, Shape, Sphere
from wbplan.obstacles.terrain import Terrain

__all__ = [
    "Box",
    "Cylinder",
    "Ground",
    "HeightField",
    "Mesh",
    "Obstacle",
    "Shape",
    "Sphere",
    "Terrain",
    "from_record",
    "to_record",
]
