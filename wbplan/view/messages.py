"""What is said to a Meshcat page, and what has to be said again to a page that opens later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import meshcat
import numpy as np
import umsgpack
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: MessagePack's extension code by which Meshcat's page makes a Float32Array.
FLOAT32 = 0x17


class Command(Protocol):
    """A Meshcat command: anything that lowers itself to the page's message."""

    def lower(self) -> dict[str, Any]:
        """The page's message, with its "type" and "path"."""


class Window(Protocol):
    """Where commands go; Meshcat's own ViewerWindow is one."""

    def send(self, command: Command) -> None:
        """Takes a command."""


def floats(values: ArrayLike) -> Any:
    """Numbers as the page's Float32Array: 4 bytes each, and decoded without a loop."""
    return umsgpack.Ext(FLOAT32, np.ascontiguousarray(values, dtype="<f4").tobytes())


@dataclass(frozen=True)
class SetProperty:
    """Sets one property of a node. (Meshcat's own command makes the property's name lower case.)

    Attributes:
        path: the node, "/wbplan/com".
        key: name of the property.
        value: anything MessagePack can carry.
    """

    path: str
    key: str
    value: Any

    def lower(self) -> dict[str, Any]:
        """The page's message."""
        return {"type": "set_property", "path": self.path, "property": self.key, "value": self.value}


@dataclass(frozen=True)
class Track:
    """One property of one node over time.

    Attributes:
        path: the node.
        key: "position", "quaternion" (x y z w), "scale" or "visible".
        times: (K,) [s], rising.
        values: (K, 3), (K, 4) or (K,) of bool.
    """

    path: str
    key: str
    times: Array
    values: NDArray[Any]

    def lower(self) -> dict[str, Any]:
        """The track inside its node's clip."""
        kind = {"quaternion": "quaternion", "visible": "bool"}.get(self.key, "vector3")
        values = self.values.tolist() if kind == "bool" else floats(self.values)
        return {"name": f".{self.key}", "type": kind, "times": floats(self.times), "values": values}


@dataclass(frozen=True)
class SetAnimation:
    """All tracks of a scene, in seconds, played round and round.

    Meshcat's own Animation writes one small map a key and frame, which takes seconds to pack for a minute
    of motion; the page also understands whole arrays.

    Attributes:
        tracks: any number, at most one for each node and property.
        duration: of every clip [s]; the page repeats each clip on its own, so they have to agree.
    """

    tracks: Sequence[Track]
    duration: float

    def lower(self) -> dict[str, Any]:
        """The page's message."""
        nodes: dict[str, list[Track]] = {}
        for track in self.tracks:
            nodes.setdefault(track.path, []).append(track)
        clips = [
            {
                "path": path,
                "clip": {
                    "fps": 1.0,
                    "name": "plan",
                    "duration": self.duration,
                    "tracks": [track.lower() for track in tracks],
                },
            }
            for path, tracks in nodes.items()
        ]
        options = {"play": True, "repetitions": 1e9}
        return {"type": "set_animation", "path": "", "animations": clips, "options": options}


@dataclass
class Store:
    """The state of a scene: for every node and property, the last message about it.

    Also a `Window`, so that a scene can be drawn into it without any server.
    """

    _kept: dict[tuple[str, ...], bytes] = field(default_factory=dict)
    _animation: bytes | None = None

    def send(self, command: Command) -> None:
        """Takes a command."""
        self.keep(command)

    def keep(self, command: Command) -> bytes:
        """Takes a command and returns it packed."""
        lowered = command.lower()
        data: bytes = umsgpack.packb(lowered)
        kind, path = lowered["type"], lowered["path"].rstrip("/")
        if kind == "delete":
            gone = [key for key in self._kept if key[0] == path or key[0].startswith(path + "/")]
            for key in gone:
                del self._kept[key]
        elif kind == "set_animation":
            self._animation = data
        elif kind == "set_property":
            self._kept[path, kind, lowered["property"]] = data
        elif kind in ("set_object", "set_transform"):
            self._kept[path, kind] = data
        return data

    def messages(self) -> list[bytes]:
        """All that a fresh page has to be told, in order; the animation, which binds to nodes, last."""
        return [*self._kept.values(), *([self._animation] if self._animation is not None else [])]


def visualizer(window: Window) -> meshcat.Visualizer:
    """Meshcat's own drawing interface on any window."""
    return meshcat.Visualizer(window=window)
