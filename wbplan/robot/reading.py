"""Reads XML and the numbers in it without trusting either."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from wbplan.errors import ModelError

MOST = 1e12
"""No length, mass, force or speed of a robot comes near this; squares of larger numbers overflow."""

# Other scripts' digits, too, are digits to Python; to the parsers behind Pinocchio they are not.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class XmlError(ValueError):
    """A text is not XML that we take."""


def read_text(path: Path, kind: str) -> str:
    """Text of a file.

    Args:
        path: the file.
        kind: what it should be ("URDF", "SRDF"), for the message.

    Raises:
        ModelError: there is no such file, it is a folder, or it is not UTF-8 text.
    """
    if is_folder(path):
        inside = sorted(path.glob(f"*.{kind.lower()}"))
        hint = f"; did you mean '{inside[0]}'?" if inside else ""
        raise ModelError(f"{kind} '{path}' is a folder, expected a .{kind.lower()} file{hint}")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise ModelError(f"{kind} '{path}' does not exist") from None
    except OSError as error:
        raise ModelError(f"{kind} '{path}' cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ModelError(f"{kind} '{path}' is not UTF-8 text (byte {error.start})") from None


def is_folder(path: Path) -> bool:
    """Whether there is such a folder."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def is_file(path: Path) -> bool:
    """Whether there is such a file; a name that no file could have means there is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def brief(text: str, most: int = 80) -> str:
    """A text for a message, cut off where it is long."""
    return text if len(text) <= most else f"{text[:most]} ..."


def parse_xml(text: str) -> Element:
    """Root element of an XML text; its texts between tags are dropped (URDF and SRDF have none).

    Entities are refused where they are declared, before one could be expanded ("billion laughs") or
    fetched from elsewhere.

    Raises:
        XmlError: empty, not well-formed, or entities declared.
    """
    if not text.strip():
        raise XmlError("the file is empty")
    builder = TreeBuilder()
    parser = expat.ParserCreate()

    def refuse(name: str, *_: object) -> None:
        raise XmlError(f"line {parser.CurrentLineNumber}: declares entity '{name}', entities are refused")

    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.EntityDeclHandler = refuse

    def declared(version: str, encoding: str | None, standalone: int) -> None:
        # The text was read as UTF-8, whatever it says; other readers would believe what it says.
        if encoding and encoding.lower() not in ("utf-8", "utf8", "us-ascii", "ascii"):
            raise XmlError(f"declares the encoding '{brief(encoding)}', expected UTF-8")

    parser.XmlDeclHandler = declared
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise XmlError(f"not well-formed XML: {error}") from None
    except UnicodeEncodeError as error:
        raise XmlError(f"not text: {error}") from None
    return builder.close()


@dataclass(frozen=True)
class Findings:
    """What an examination found.

    Attributes:
        problems: what makes the file unusable, one line each.
        warnings: what deserves a look.
    """

    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


class Reader:
    """Collects every problem while elements are read, in the order in which they are met.

    Attributes:
        problems: one line each, naming the element.
        warnings: what deserves a look, but does no harm.
    """

    def __init__(self) -> None:
        self.problems: list[str] = []
        self.warnings: list[str] = []

    def problem(self, where: str, what: str) -> None:
        """Notes one problem of the element `where`; what was noted before is not repeated."""
        if (line := f"{where}: {what}") not in self.problems:
            self.problems.append(line)

    def warn(self, where: str, what: str) -> None:
        """Notes one warning about the element `where`."""
        self.warnings.append(f"{where}: {what}")

    def findings(self) -> Findings:
        """All that was noted so far."""
        return Findings(tuple(self.problems), tuple(self.warnings))

    def named(self, root: Element, tag: str) -> dict[str, Element]:
        """The children called `tag`, by name; nameless ones and repeated names are problems."""
        found: dict[str, Element] = {}
        count: dict[str, int] = {}
        for number, element in enumerate(root.findall(tag), start=1):
            name = element.get("name", "")
            if not name.strip():
                self.problem(f"{tag} number {number}", "no name")
                continue
            found.setdefault(name, element)
            count[name] = count.get(name, 0) + 1
        for name, times in count.items():
            if times > 1:
                self.problem(f"{tag} '{name}'", f"the name is used {times} times, expected once")
        return found

    def numbers(self, where: str, what: str, text: str | None, count: int) -> tuple[float, ...] | None:
        """The `count` finite numbers of an attribute; None, and a problem noted, where they are not that."""
        parts = (text or "").split()
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        if text is None:
            self.problem(where, f"{what} is missing, expected {expected}")
            return None
        values = [float(part) if _NUMBER.fullmatch(part) else math.nan for part in parts]
        if len(values) != count or not all(math.isfinite(value) for value in values):
            self.problem(where, f"{what} is '{brief(text)}', expected {expected}")
            return None
        if max(map(abs, values)) > MOST:
            self.problem(where, f"{what} is '{brief(text)}', expected nothing beyond {MOST:g}")
            return None
        return tuple(values)

    def number(self, where: str, what: str, text: str | None) -> float | None:
        """One finite number; None, and a problem noted, where it is not that."""
        values = self.numbers(where, what, text, 1)
        return None if values is None else values[0]

    def optional(self, where: str, element: Element | None, attributes: Iterable[tuple[str, int]]) -> None:
        """Checks attributes (name, how many numbers) that may be absent, of an element that may be."""
        if element is None:
            return
        for attribute, count in attributes:
            if element.get(attribute) is not None:
                self.numbers(where, f"{element.tag} {attribute}", element.get(attribute), count)
