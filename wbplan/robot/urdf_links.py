"""What has to hold of a URDF's links: mass, inertia, shapes, and the meshes they name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from wbplan.robot.reading import Reader, is_file

TRIANGLE_TOLERANCE = 1e-3
"""Share of the largest principal moment that the others may lack: a thin plate's, rounded to a few digits."""

_SHAPES: dict[str, tuple[tuple[str, int], ...]] = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
}
_ORIGIN = (("xyz", 3), ("rpy", 3))


def check_link(
    reader: Reader, name: str, link: Element, base_dir: Path, package_dirs: Sequence[Path]
) -> float | None:
    """Notes the problems of one link by itself.

    Returns:
        Its mass [kg], 0 where it has no inertial; None where the mass is itself a problem.
    """
    where = f"link '{name}'"
    for kind in ("visual", "collision"):
        for shape in link.findall(kind):
            _check_shape(reader, where, kind, shape, base_dir, package_dirs)
    return _check_inertial(reader, where, link.find("inertial"))


def _check_inertial(reader: Reader, where: str, inertial: Element | None) -> float | None:
    if inertial is None:
        return 0.0
    reader.optional(f"{where} inertial", inertial.find("origin"), _ORIGIN)
    mass_element, inertia_element = inertial.find("mass"), inertial.find("inertia")
    mass = None
    if mass_element is None:
        reader.problem(where, "its inertial has no <mass>")
    else:
        mass = reader.number(where, "mass", mass_element.get("value"))
    if mass is not None and mass < 0:
        reader.problem(where, f"mass {mass:g} kg, expected > 0")
        mass = None
    if inertia_element is None:
        reader.problem(where, "its inertial has no <inertia>")
    else:
        _check_inertia(reader, where, inertia_element, massless=mass == 0)
    return mass


def _check_inertia(reader: Reader, where: str, inertia: Element, *, massless: bool) -> None:
    """Principal moments a <= b <= c [kg m^2] of any real body: a > 0 and a + b >= c."""
    values = [
        reader.number(where, f"inertia {key}", inertia.get(key))
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ]
    numbers = [value for value in values if value is not None]
    if len(numbers) < 6 or (massless and not any(numbers)):
        return
    xx, xy, xz, yy, yz, zz = numbers
    # Divided by the largest number first: neither an overflow nor an underflow then.
    scale = max(abs(value) for value in numbers) or 1.0
    a, b, c = (
        float(m) for m in np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / scale)
    )
    moments = f"principal moments {a * scale:.4g}, {b * scale:.4g}, {c * scale:.4g} kg m^2"
    if a <= 1e-12 * abs(c):
        reader.problem(where, f"inertia is not positive definite ({moments}), expected all > 0")
    elif a + b < c * (1 - TRIANGLE_TOLERANCE):
        reader.problem(
            where,
            f"inertia breaks the triangle inequality ({moments}), expected none above the sum of the others",
        )


def _check_shape(
    reader: Reader, where: str, kind: str, element: Element, base_dir: Path, package_dirs: Sequence[Path]
) -> None:
    inside = f"{where} {kind}"
    reader.optional(inside, element.find("origin"), _ORIGIN)
    material = element.find("material")
    if material is not None:
        reader.optional(inside, material.find("color"), (("rgba", 4),))
    geometry = element.find("geometry")
    if geometry is None or len(geometry) == 0:
        reader.problem(inside, "no geometry")
        return
    shape = geometry[0]
    if shape.tag == "mesh":
        _check_mesh(reader, inside, shape, base_dir, package_dirs)
    elif shape.tag in _SHAPES:
        for attribute, count in _SHAPES[shape.tag]:
            sizes = reader.numbers(inside, f"{shape.tag} {attribute}", shape.get(attribute), count)
            if sizes is not None and min(sizes) <= 0:
                reader.problem(inside, f"{shape.tag} {attribute} is '{shape.get(attribute)}' m, expected > 0")
    else:
        reader.problem(inside, f"unknown shape '{shape.tag}', expected one of {', '.join(_SHAPES)}, mesh")


def _check_mesh(
    reader: Reader, where: str, mesh: Element, base_dir: Path, package_dirs: Sequence[Path]
) -> None:
    scale = mesh.get("scale")
    if scale is not None:
        factors = reader.numbers(where, "mesh scale", scale, 3)
        if factors is not None and 0 in factors:
            reader.problem(where, f"mesh scale is '{scale}', expected none to be 0")
    filename = mesh.get("filename", "").strip()
    if not filename:
        reader.problem(where, "mesh without a filename")
        return
    places = mesh_places(filename, base_dir, package_dirs)
    if any(is_file(place) for place in places):
        return
    looked = f"; looked at {', '.join(str(place) for place in places)}" if places else ""
    hint = ""
    if filename.startswith("package://"):
        hint = f"; give the folder that holds '{_package(filename)[0]}' in package_dirs"
    reader.problem(where, f"mesh '{filename}' does not exist{looked}{hint}")


def mesh_places(filename: str, base_dir: Path, package_dirs: Sequence[Path]) -> list[Path]:
    """Where a mesh that a URDF names may lie, best first.

    `package://name/rest` is looked for in each of `package_dirs` (folders that hold packages, or a package
    itself), then in the folder above the URDF that is called `name`. `file://` and
    absolute names are taken as they are, others from the URDF's folder.
    """
    if filename.startswith("package://"):
        package, rest = _package(filename)
        places = []
        for folder in package_dirs:
            places.append(folder / package / rest)
            if folder.name == package:
                places.append(folder / rest)
        places += [above / rest for above in (base_dir, *base_dir.parents) if above.name == package]
        return places
    if filename.startswith("file://"):
        return [base_dir / unquote(filename.removeprefix("file://"))]
    return [] if "://" in filename else [base_dir / filename]


def _package(filename: str) -> tuple[str, str]:
    package, _, rest = filename.removeprefix("package://").partition("/")
    return package, rest
