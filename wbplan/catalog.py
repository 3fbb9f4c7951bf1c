"""The robots and tasks that ship with wbplan: where they are, by name.

An installed wheel carries them in `wbplan/_data/{urdf,tasks}`; a source checkout has them in the folders
`urdf/` and `tasks/` beside the package.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def data_root() -> Path:
    """The folder that holds `urdf/` and `tasks/`."""
    installed = _PACKAGE / "_data"
    return installed if installed.is_dir() else _PACKAGE.parent


def robots() -> dict[str, Path]:
    """Shipped robots: folder name -> its URDF, `urdf/<name>/<name>.urdf`, sorted by name."""
    return {
        folder.name: urdf
        for folder in _entries(data_root() / "urdf")
        if (urdf := folder / f"{folder.name}.urdf").is_file()
    }


def tasks() -> dict[str, Path]:
    """Shipped tasks: name -> its Python file, `tasks/<name>.py`, sorted by name."""
    return {
        file.stem: file for file in _entries(data_root() / "tasks") if file.suffix == ".py" and file.is_file()
    }


def _entries(folder: Path) -> list[Path]:
    """What a folder holds, sorted, without what is private or hidden; nothing where there is no folder."""
    if not folder.is_dir():
        return []
    return sorted(entry for entry in folder.iterdir() if not entry.name.startswith(("_", ".")))
