"""Mutations of text, XML and JSON: structure first, then the bytes."""

from __future__ import annotations

import contextlib
import copy
import json
import random
from typing import Any
from xml.etree import ElementTree as ET

NASTY_TEXT = (
    "", " ", "0", "-0.0", "-1", "nan", "inf", "-Infinity", "1e308", "-1e308", "1e-320", "1e999", "0x10",
    "1_0", "1,5", "1 2", "1 2 3", "1 2 3 4", "0 0 0", "nan 0 0", "1e200 1e200 1e200", "\u0661", "\uff11 0 0",
    "true", "None", "universe", "root_joint", "world", "%s%n", "{}", "../../x", "package://x/y.stl",
    "file:///x.stl",
    "http://x/y.stl", "\u202eabc", "\U0001f600", "a\nb", "a" * 5000, "'\"<&", "\ufeff", "\x7f",
    "fixed", "revolute", "continuous", "floating", "planar", "prismatic", "leg", "arm", "feet", "hands",
    ".", "..", "/",
)  # fmt: skip
NASTY_JSON: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 10**400, -(10**18), 2**63, 1e308, -1e308, 1e-320, 0.5, 1e9, -1e9, "", "x",
    "nan", "\ud800", "\x00", "a" * 5000, [], {}, [[]], [None], {"": None}, [0, 0, 0], [1e308] * 3, [0] * 7,
    [1.0] * 7,
    [[0, 0], [1, 0], [0, 1]], ["base"], "universe", "root_joint", "base", "../x", {"frame": "base"},
)  # fmt: skip


def chance(rng: random.Random, share: float) -> bool:
    return rng.random() < share


def scarred(rng: random.Random, data: bytes) -> bytes:
    """Bytes cut off, doubled, dropped or changed."""
    if not data:
        return b"\x00"
    at, upto = sorted((rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)))
    kind = rng.randrange(8)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + data[at : at + min(upto - at, 500)] + data[at:]
    if kind == 2:
        return data[:at] + data[at + min(upto - at, 50) :]
    if kind == 3:
        changed = bytearray(data)
        for _ in range(rng.randrange(1, 9)):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        return bytes(changed)
    if kind == 4:
        return (
            data[:at]
            + rng.choice([b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"]]>", b"<!--", b'"', b"\r"])
            + data[at:]
        )
    if kind == 5:
        return rng.choice(
            [b"", b"\n", b"\xef\xbb\xbf", b"\x00" * 64, data.decode("utf-8", "replace").encode("utf-16")]
        )
    if kind == 6:
        return data + rng.choice([data, b"\x00", b"<x/>", b"trailing"])
    return data[at:upto]


# ---------------------------------------------------------------------------------------------------- XML


def mutate_xml(rng: random.Random, text: str) -> bytes:
    """A few structural mutations, rarely also one of the text."""
    if chance(rng, 0.08):
        return scarred(rng, text.encode())
    root = ET.fromstring(text)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 6, 20))):
        _change_tree(rng, root)
    data = ET.tostring(root, encoding="utf-8")
    if chance(rng, 0.04):
        data = scarred(rng, data)
    if chance(rng, 0.01):  # nested as no writer could
        tag = rng.choice([b"link", b"group", b"origin"])
        data = data.replace(b"</robot>", b"<" + tag + b">") + b"<a>" * 5000
        data += rng.choice([b"", b"</a>" * 5000 + b"</" + tag + b"></robot>"])
    if chance(rng, 0.03):
        laughs = b'<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'
        data = (
            rng.choice([laughs, b'<?xml version="1.0" encoding="utf-7"?>', b"<!DOCTYPE r SYSTEM 'x'>"]) + data
        )
    return data


def _change_tree(rng: random.Random, root: ET.Element) -> None:
    elements = list(root.iter())
    element, other = rng.choice(elements), rng.choice(elements)
    kind = rng.randrange(13)
    if kind == 0 and len(element):
        element.remove(rng.choice(list(element)))
    elif kind == 1 and len(element):
        element.append(rng.choice(list(element)))
    elif kind == 2 and len(element) > 1:
        i, j = rng.sample(range(len(element)), 2)
        element[i], element[j] = element[j], element[i]
    elif kind == 3 and len(other):
        element.append(copy.deepcopy(rng.choice(list(other))))
    elif kind == 4:
        element.tag = rng.choice([other.tag, "x", "xacro:macro", "group", "mesh", "sphere", "mimic"])
    elif kind == 5 and element.attrib:
        del element.attrib[rng.choice(list(element.attrib))]
    elif kind == 6:
        element.attrib.update(other.attrib)
    elif kind == 7:
        element.text = rng.choice(NASTY_TEXT)
    elif kind == 8 and chance(rng, 0.1):
        inner = element
        for _ in range(50):
            inner = ET.SubElement(inner, element.tag, dict(element.attrib))
    else:
        _change_attribute(rng, elements, element)


def _change_attribute(rng: random.Random, elements: list[ET.Element], element: ET.Element) -> None:
    for _ in range(20):
        if element.attrib:
            break
        element = rng.choice(elements)
    else:
        return
    key = rng.choice(list(element.attrib))
    kind = rng.randrange(4)
    if kind == 0:
        element.set(key, rng.choice(NASTY_TEXT))
    elif kind == 1:  # the same attribute as somebody else's: names twice, links in circles
        element.set(key, rng.choice([e.get(key, "") for e in elements if key in e.attrib]))
    elif kind == 2:
        element.set(
            rng.choice(["name", "link", "value", "xyz", "rpy", "filename", "x"]), element.attrib.pop(key)
        )
    else:
        element.set(key, _other_numbers(rng, element.get(key, "")))


def _other_numbers(rng: random.Random, text: str) -> str:
    parts = text.split() or ["0"]
    k = rng.randrange(len(parts))
    factor = rng.choice((-1.0, 0.0, 1e-12, 1e-3, 10.0, 1e6, 1e150, float("nan"), float("inf")))
    try:
        parts[k] = repr(float(parts[k]) * factor)
    except ValueError:
        parts[k] += rng.choice(["_", " ", "2", "\u00e9"])
    return " ".join(parts)


# --------------------------------------------------------------------------------------------------- JSON


def mutate_json(rng: random.Random, value: Any) -> bytes:
    """A few changes of the structure, written with what Python's writer lets through (NaN, Infinity)."""
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 8))):
        value = _change_json(rng, value)
    text = json.dumps(value, ensure_ascii=chance(rng, 0.5)).encode("utf-8", "surrogatepass")
    if chance(rng, 0.05):
        text = scarred(rng, text)
    if chance(rng, 0.01):
        text = b'{"plan": ' * 100_000
    return text


def _places(value: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """(container, key) of everything below a value."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        found.append((value, key))
        _places(value[key], found)
    return found


def _change_json(rng: random.Random, value: Any) -> Any:
    places = _places(value, [])
    if not places or chance(rng, 0.005):
        return copy.deepcopy(rng.choice(NASTY_JSON))
    # Long lists (a region's corners) must not take all the attention.
    container, key = rng.choice(places)
    inside, name = rng.choice(places)
    kind = rng.randrange(7)
    if kind == 0:
        del container[key]
    elif kind == 1 and isinstance(container, list):
        container.insert(key, json.loads(json.dumps(container[key])))
    elif kind == 2:
        container[key] = json.loads(json.dumps(inside[name]))
    elif kind == 3 and isinstance(container[key], int | float) and not isinstance(container[key], bool):
        with contextlib.suppress(OverflowError):
            container[key] = container[key] * rng.choice((-1, 0, 1e-9, 0.5, 1.001, 10, 1e300)) + rng.choice(
                (0, 1e-7)
            )
    elif kind == 4 and isinstance(container, dict):
        container[rng.choice(["clearance", "region", "joint_acceleration", "normal", "com", "x", ""])] = (
            copy.deepcopy(rng.choice(NASTY_JSON))
        )
    else:
        container[key] = copy.deepcopy(rng.choice(NASTY_JSON))
    return value
