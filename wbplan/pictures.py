"""Figures without pyplot, which is one state for a whole process: shown by a notebook, or kept as PNG."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from wbplan.errors import BundleError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 110  #: dots an inch


def blank(width: float, height: float) -> Figure:
    """An empty figure of so many inches, which shows itself in a notebook."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that needs no pyplot to be shown."""

        def _repr_png_(self) -> bytes:
            return png(self)

    return Picture(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")


@contextmanager
def unruffled() -> Iterator[None]:
    """Absurd numbers are drawn as well as can be: their labels leave no room, their scales overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        yield


@unruffled()
def png(drawing: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    file, canvas = io.BytesIO(), cast(Any, FigureCanvasAgg(drawing))
    canvas.print_png(file, metadata={"Software": None})  # without the version: the same file each time
    return file.getvalue()


def write(drawing: Figure, path: str | Path) -> Path:
    """Put a figure into a PNG file.

    Raises:
        BundleError: the file cannot be written.
    """
    path = Path(path)
    try:
        path.write_bytes(png(drawing))
    except OSError as error:
        raise BundleError(f"{path}: cannot be written: {error.strerror or error}") from error
    return path
