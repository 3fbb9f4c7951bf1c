"""Figures without pyplot, which is one state for a whole process: shown by a notebook, or kept as PNG."""

from __future__ import annotations

import io
import warnings
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


def png(drawing: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    file, canvas = io.BytesIO(), cast(Any, FigureCanvasAgg(drawing))
    with warnings.catch_warnings():  # labels of absurd numbers leave no room
        warnings.simplefilter("ignore", UserWarning)
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
