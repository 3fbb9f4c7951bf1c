"""The least that a robot.urdf has to be before Pinocchio sees it: its parser crashes on some that are not."""

from __future__ import annotations

import math
from xml.etree import ElementTree

from wbplan.errors import BundleError

_NUMBERS = {
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
}


def require_readable(text: str, where: str) -> None:
    """Refuse a URDF that is not XML, or whose numbers are none.

    Raises:
        BundleError: naming the element.
    """
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # no XML, no text, no such encoding
        raise BundleError(f"{where}: is no URDF that can be read: {error}") from None
    for element in root.iter():
        _require_numbers(element, where)


def _require_numbers(element: ElementTree.Element, where: str) -> None:
    for key in _NUMBERS.get(element.tag, ()):
        for word in element.get(key, "").split():
            try:
                good = math.isfinite(float(word))
            except ValueError:
                good = False
            if not good:
                raise BundleError(
                    f"{where}: <{element.tag} {key}>: expected finite numbers, found {word[:80]!r}"
                )
    if element.tag == "mass" and not element.get("value", "").strip():
        raise BundleError(f"{where}: <mass>: expected a value, found none")
