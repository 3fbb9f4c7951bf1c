"""What a URDF's links look like, as coloured triangles in each link's own frame."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
import yourdfpy
from numpy.typing import NDArray

from wbplan.errors import ModelError, ViewError
from wbplan.robot.reading import is_file
from wbplan.robot.urdf_links import mesh_places

Array = NDArray[np.float64]

#: Colour of a shape whose material says nothing.
PLAIN = (0.70, 0.73, 0.77, 1.0)
#: Faces that meet at less than this angle [rad] are shaded as one round surface.
ROUND = np.radians(35.0)
#: Larger meshes are shaded as they come: parting them at their edges takes too long.
MOST_PARTED = 60_000
#: trimesh's own colour (grey 102) for a mesh that has none.
_TRIMESH_GREY = 102


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """Triangles of one link that are drawn in one go.

    Attributes:
        link: name of the link.
        vertices: (V, 3) [m], in the link's frame.
        faces: (F, 3), indices of vertices.
        colours: (V, 3), red green blue from 0 to 1.
        opacity: 1 is solid.
    """

    link: str
    vertices: Array
    faces: NDArray[np.int64]
    colours: Array
    opacity: float


def robot_meshes(
    urdf_text: str,
    *,
    urdf_dir: Path | None = None,
    package_dirs: Sequence[str | Path] = (),
    collisions: bool = False,
) -> list[LinkMesh]:
    """The visual shapes of every link; the collision shapes where the robot has no visual ones at all.

    Args:
        urdf_text: content of the URDF.
        urdf_dir: folder from which relative mesh names count; the working folder if absent.
        package_dirs: where `package://` names and relative ones are looked for as well.
        collisions: the collision shapes in any case.

    Raises:
        ModelError: the text is not a URDF, or a shape is not one.
        ViewError: a mesh file is missing or cannot be read.
    """
    robot, capsules = _parse(urdf_text)
    colours = _named_colours(robot)
    folders = [urdf_dir or Path(), *(Path(folder) for folder in package_dirs)]
    seen = not collisions and any(link.visuals for link in robot.links)
    kind = "visuals" if seen else "collisions"
    meshes: list[LinkMesh] = []
    for link in robot.links:
        parts: dict[float, list[tuple[Any, Array]]] = {}
        for i, shape in enumerate(getattr(link, kind)):
            capsule = capsules.get((link.name, kind, i))
            for mesh, rgba in _coloured(shape, link.name, colours, folders, capsule):
                parts.setdefault(round(float(rgba[3]), 3), []).append((mesh, rgba[:3]))
        meshes += [_joined(link.name, part, opacity) for opacity, part in parts.items() if opacity > 0.0]
    return meshes


def _parse(urdf_text: str) -> tuple[Any, dict[tuple[str | None, str, int], Any]]:
    """The robot, and its capsules: see `_as_cylinders`."""
    settings = {"build_scene_graph": False, "load_meshes": False}
    try:
        text, capsules = _as_cylinders(urdf_text)
        return yourdfpy.URDF.load(io.BytesIO(text.encode("utf-8")), **settings).robot, capsules
    except Exception as error:
        raise ModelError(f"view: the robot's URDF cannot be read: {error}") from error


def _as_cylinders(urdf_text: str) -> tuple[str, dict[tuple[str | None, str, int], Any]]:
    """The URDF with cylinders for capsules, which yourdfpy refuses, and the meshes that stand for these.

    They are named by their link, kind and number among the link's shapes of that kind.
    """
    root, found = ElementTree.fromstring(urdf_text), {}
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for i, shape in enumerate(link.findall(kind)):
                for item in shape.iterfind("geometry/capsule"):
                    radius, length = (float(item.get(key, "0")) for key in ("radius", "length"))
                    found[link.get("name"), f"{kind}s", i] = _capsule(radius, length)
                    item.tag = "cylinder"
    return (ElementTree.tostring(root, encoding="unicode") if found else urdf_text), found


def _capsule(radius: float, length: float) -> Any:
    """About its middle, along z; `length` [m] is that between the balls' centres."""
    mesh = trimesh.creation.capsule(height=length, radius=radius, count=[28, 28])
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


def _named_colours(robot: Any) -> dict[str, Any]:
    """Colours by material name: the robot's own list, then those that a first use defines in place."""
    named = [
        visual.material for link in robot.links for visual in link.visuals if visual.material is not None
    ]
    found: dict[str, Any] = {}
    for material in [*robot.materials, *named]:
        if material.name and material.color is not None:
            found.setdefault(material.name, material.color.rgba)
    return found


def _coloured(
    shape: Any, link: str, colours: dict[str, Any], folders: Sequence[Path], capsule: Any = None
) -> list[tuple[Any, Array]]:
    """The meshes of one URDF shape in its link's frame, each with its red, green, blue and opacity."""
    material = getattr(shape, "material", None)
    asked = None
    if material is not None:
        asked = material.color.rgba if material.color is not None else colours.get(material.name)
    found = []
    for mesh in _triangles(shape.geometry, link, folders) if capsule is None else [capsule]:
        if shape.origin is not None:
            mesh.apply_transform(shape.origin)
        rgba = asked if asked is not None else _own_colour(mesh)
        found.append((_parted(mesh), np.asarray(rgba, dtype=np.float64)))
    return found


def _triangles(geometry: Any, link: str, folders: Sequence[Path]) -> list[Any]:
    create = trimesh.creation
    if geometry.box is not None:
        return [create.box(extents=geometry.box.size)]
    if geometry.cylinder is not None:
        return [create.cylinder(geometry.cylinder.radius, geometry.cylinder.length, sections=28)]
    if geometry.sphere is not None:
        return [create.icosphere(subdivisions=3, radius=geometry.sphere.radius)]
    if geometry.mesh is not None:
        return _loaded(geometry.mesh, link, folders)
    raise ModelError(f"view: link '{link}' has a shape without a box, cylinder, sphere or mesh")


def _loaded(mesh: Any, link: str, folders: Sequence[Path]) -> list[Any]:
    places = [place for folder in folders for place in mesh_places(mesh.filename, folder, folders[1:])]
    path = next((place for place in places if is_file(place)), None)
    if path is None:
        looked = ", ".join(dict.fromkeys(str(place) for place in places)) or "no folder"
        raise ViewError(
            f"view: link '{link}' has the mesh '{mesh.filename}', which was not found (looked at {looked}); "
            "name the folder that holds it in package_dirs"
        )
    try:
        scene = trimesh.load_scene(path)
    except Exception as error:
        raise ViewError(f"view: link '{link}': mesh {path} cannot be read: {error}") from error
    loaded = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    if not loaded:
        raise ViewError(f"view: link '{link}': mesh {path} cannot be read: it holds no triangles")
    for part in loaded:
        if mesh.scale is not None:
            part.apply_scale(mesh.scale)
    return loaded


def _own_colour(mesh: Any) -> Sequence[float]:
    """The colour that a mesh file brings along, one for the whole mesh."""
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None) if material is not None else None
    if colour is None:
        colour = mesh.visual.main_color if mesh.visual.kind in ("face", "vertex") else None
    if colour is None:
        return PLAIN
    rgba = np.asarray(colour, dtype=np.float64)
    rgba = rgba / 255.0 if np.asarray(colour).dtype.kind in "ui" or rgba.max() > 1.0 else rgba
    if np.allclose(rgba[:3] * 255.0, _TRIMESH_GREY, atol=1.0):
        return PLAIN
    whole: list[float] = [*rgba[:3], rgba[3] if len(rgba) > 3 else 1.0]
    return whole


def _parted(mesh: Any) -> Any:
    """The mesh with its vertices doubled along sharp edges, since the page shades across shared ones."""
    if len(mesh.faces) > MOST_PARTED:
        return mesh
    return trimesh.graph.smooth_shade(mesh, angle=ROUND, facet_minarea=None)


def _joined(link: str, parts: Sequence[tuple[Any, Array]], opacity: float) -> LinkMesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh, _ in parts)])
    return LinkMesh(
        link=link,
        vertices=np.vstack([mesh.vertices for mesh, _ in parts]),
        faces=np.vstack([mesh.faces + start for (mesh, _), start in zip(parts, starts, strict=False)]),
        colours=np.vstack([np.tile(rgb, (len(mesh.vertices), 1)) for mesh, rgb in parts]),
        opacity=opacity,
    )
