"""The web page: Meshcat's viewer, with what `page.js` adds, in one file that asks the network for nothing."""

from __future__ import annotations

import base64
import gzip
import html
import re
import struct
from collections.abc import Iterable, Mapping
from importlib import resources
from typing import Any


def live_page(title: str) -> str:
    """The page that a `Server` serves; it draws what the server sends.

    Args:
        title: of the page.
    """
    return _page(title, "followServer();")


def still_page(title: str, messages: Iterable[bytes]) -> str:
    """A page that carries its scene within, for `file://`, a mail or a notebook.

    The messages are joined, each after its length (4 bytes, big-endian), and compressed.

    Args:
        title: of the page.
        messages: the scene, as `Store.messages` gives it.
    """
    block = b"".join(struct.pack(">I", len(message)) + message for message in messages)
    packed = base64.b64encode(gzip.compress(block, 9)).decode("ascii")
    return _page(title, f'playEmbedded("{packed}");')


def _page(title: str, start: str) -> str:
    here = resources.files("wbplan.view")
    meshcat = resources.files("meshcat") / "viewer" / "dist" / "main.min.js"
    parts = {
        "title": html.escape(title),
        "meshcat": meshcat.read_text(encoding="utf-8"),
        "script": (here / "page.js").read_text(encoding="utf-8"),
        "start": start,
    }
    # Pieces between the marks, and the marks' names, in turn: what is put in is not searched again.
    pieces = re.split(r"@(\w+)@", (here / "page.html").read_text(encoding="utf-8"))
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))


def title_of(plan: Mapping[str, Any]) -> str:
    """What a plan is called: its task and its robot."""
    return f"{plan.get('task', 'plan')}, {plan.get('robot', 'robot')}"
