"""Shapes of obstacles, each in its own frame."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from wbplan.errors import SpecError
from wbplan.paths import POINT, checked, kind_of, number, numeric

Array = NDArray[np.float64]

LENGTH = "a finite positive length [m]"

#: Steps of a height field's grid may differ by this share.
EVEN = 1e-6


@final
@dataclass(frozen=True)
class Box:
    """A box around the origin.

    Args:
        size: (3,) edge lengths [m] along x, y, z.
    """

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        value = checked(self.size, "Box.size")
        if kind_of(value) != POINT or not (value > 0).all():
            raise SpecError(f"Box.size: expected three positive lengths [m], got {self.size!r}")
        object.__setattr__(self, "size", tuple(float(x) for x in value))


@final
@dataclass(frozen=True)
class Sphere:
    """A ball around the origin.

    Args:
        radius: [m].
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number(self.radius, "Sphere.radius", LENGTH, above=0.0))


@final
@dataclass(frozen=True)
class Cylinder:
    """A cylinder around the origin, its axis along z.

    Args:
        radius: [m].
        length: [m], of all of it.
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number(self.radius, "Cylinder.radius", LENGTH, above=0.0))
        object.__setattr__(self, "length", number(self.length, "Cylinder.length", LENGTH, above=0.0))


@final
@dataclass(frozen=True, eq=False)
class Mesh:
    """The convex hull of a mesh; a hollow or bent thing is given as several.

    Args:
        vertices: (V, 3) [m].
        faces: (F, 3) whole numbers, the corners of each triangle; only drawn. By default the hull's.
        file: a mesh file (STL, OBJ, DAE, ...) instead of both.
        scale: of a file's numbers to metres.

    Raises:
        SpecError: neither or both are given, the file cannot be read, or the points have no volume.
    """

    vertices: Any = None
    faces: Any = None
    file: str | PathLike[str] | None = None
    scale: float = 1.0

    def __post_init__(self) -> None:
        scale = number(self.scale, "Mesh.scale", "a finite positive number", above=0.0)
        if (self.file is None) == (self.vertices is None):
            raise SpecError("Mesh: expected either vertices or a file")
        vertices, faces = (self.vertices, self.faces) if self.file is None else _loaded(self.file)
        points = numeric(vertices)
        if points is None or points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise SpecError(f"Mesh.vertices: expected finite numbers (V, 3) [m], got {vertices!r}")
        points = np.ascontiguousarray(points * scale)
        try:
            hull = ConvexHull(points)
        except (QhullError, ValueError) as error:
            raise SpecError(
                f"Mesh: its {len(points)} vertices enclose no volume ({str(error).split(chr(10))[0]})"
            ) from None
        triangles = _outward(hull) if faces is None else _triangles(faces, len(points))
        planes = np.unique(np.round(hull.equations, 12), axis=0)
        for name, value in (("vertices", points), ("faces", triangles), ("_hull", hull.vertices)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_planes", planes)
        object.__setattr__(self, "_hull_faces", _outward(hull))
        object.__setattr__(self, "file", None)
        object.__setattr__(self, "scale", 1.0)

    @property
    def hull(self) -> tuple[Array, NDArray[np.int64]]:
        """The hull's corners (H, 3) [m] and its triangles (F, 3), outward counter-clockwise."""
        corners: NDArray[np.intp] = self._hull  # type: ignore[attr-defined]
        where = np.zeros(len(self.vertices), dtype=np.int64)
        where[corners] = np.arange(len(corners))
        return self.vertices[corners], where[self._hull_faces]  # type: ignore[attr-defined]

    @property
    def hull_faces(self) -> NDArray[np.int64]:
        """(F, 3): the hull's triangles by their corners among `vertices`."""
        found: NDArray[np.int64] = self._hull_faces  # type: ignore[attr-defined]
        return found

    @property
    def planes(self) -> Array:
        """(P, 4): outward unit normal n and offset b of each face of the hull, n x + b <= 0 inside."""
        found: Array = self._planes  # type: ignore[attr-defined]
        return found


@final
@dataclass(frozen=True, eq=False)
class HeightField:
    """Ground whose height is given on a grid; between its points two triangles to a cell.

    A cell's diagonal runs from (x[i], y[j]) to (x[i + 1], y[j + 1]). It is solid downward.

    Args:
        x: (I,) [m], rising in even steps; I is 2 or more.
        y: (J,) [m], likewise.
        heights: (I, J) [m], heights[i, j] at (x[i], y[j]).

    Raises:
        SpecError: a grid is not even, or the shapes do not fit.
    """

    x: Any
    y: Any
    heights: Any

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            grid = numeric(getattr(self, name))
            if grid is None or grid.ndim != 1 or len(grid) < 2 or not np.isfinite(grid).all():
                raise SpecError(
                    f"HeightField.{name}: expected 2 or more finite numbers [m], got {getattr(self, name)!r}"
                )
            steps = np.diff(grid)
            if not steps[0] > 0.0 or np.ptp(steps) > EVEN * steps[0]:
                raise SpecError(f"HeightField.{name}: expected even, rising steps [m], got {grid}")
            grid.setflags(write=False)
            object.__setattr__(self, name, grid)
        heights = numeric(self.heights)
        expected = (len(self.x), len(self.y))
        if heights is None or heights.shape != expected or not np.isfinite(heights).all():
            found = "no numbers" if heights is None else f"shape {heights.shape}"
            raise SpecError(f"HeightField.heights: expected finite numbers {expected} [m], got {found}")
        heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)


@final
@dataclass(frozen=True)
class Ground:
    """Everything below a plane: z <= 0 in the obstacle's own frame.

    Args:
        normal: (3,) of the plane through the origin, pointing out of the ground; scaled to length 1.
    """

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        normal = checked(self.normal, "Ground.normal")
        if kind_of(normal) != POINT or np.linalg.norm(normal) < 1e-9:
            raise SpecError(f"Ground.normal: expected three numbers, not all zero, got {self.normal!r}")
        length = float(np.linalg.norm(normal))
        unit = normal if abs(length - 1.0) < 1e-12 else normal / length
        object.__setattr__(self, "normal", tuple(float(x) for x in unit))


Shape = Box | Sphere | Cylinder | Mesh | HeightField | Ground
SHAPES: tuple[type, ...] = (Box, Sphere, Cylinder, Mesh, HeightField, Ground)


def _loaded(file: str | PathLike[str]) -> tuple[Any, Any]:
    import trimesh

    try:
        mesh = trimesh.load(str(file), force="mesh")
        return np.array(mesh.vertices), np.array(mesh.faces)
    except (
        OSError,
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        IndexError,
        NotImplementedError,
    ) as error:
        raise SpecError(f"Mesh.file: '{file}' cannot be read: {error}") from None


def _triangles(faces: Any, count: int) -> NDArray[np.int64]:
    table = numeric(faces)
    good = table is not None and table.ndim == 2 and table.shape[1:] == (3,) and np.isfinite(table).all()
    if table is None or not good or (table != np.floor(table)).any():
        raise SpecError("Mesh.faces: expected whole numbers (F, 3)")
    if len(table) and not (table.min() >= 0 and table.max() < count):
        raise SpecError(f"Mesh.faces: expected corners from 0 to {count - 1}, got {table.max():g}")
    return table.astype(np.int64)


def _outward(hull: ConvexHull) -> NDArray[np.int64]:
    """The hull's triangles, counter-clockwise seen from outside."""
    faces = hull.simplices.astype(np.int64)
    a, b, c = (hull.points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.ascontiguousarray(faces)
