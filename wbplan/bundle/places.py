"""What two processes need to write into one folder: locks, an exchange of folders, and a broom.

A lock is the operating system's (flock), held on a folder itself: it ends with the process that holds it,
however that ends. Where a file system has no locks, everything works but for two runs at the very same time.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

PART, OLD = ".part", ".old"  #: of folders being filled; of folders waiting to be removed

#: An empty folder may be somebody's who has not locked it yet: it is left alone for so long [s].
FRESH = 60.0


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Holds the lock of a folder, and waits for it; where there are no locks it holds nothing."""
    handle = None
    try:
        with contextlib.suppress(OSError):  # a folder that may not be listed, a file system without locks
            handle = os.open(folder, os.O_RDONLY)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _abandoned(folder: Path) -> bool:
    """Whether nobody holds the lock of a folder."""
    try:
        if not any(folder.iterdir()) and time.time() - folder.stat().st_mtime < FRESH:
            return False
        handle = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    except OSError:
        return False
    finally:
        os.close(handle)


def sweep(target: Path) -> None:
    """Removes what runs that were killed left beside a target; a bundle they had set aside comes back.

    Args:
        target: the folder that they wanted to write.
    """
    left = [p for p in target.parent.glob(f".{target.name}.????????.*") if p.suffix in (PART, OLD)]
    for folder in sorted(left):
        if not folder.is_dir() or folder.is_symlink() or not _abandoned(folder):
            continue
        if folder.suffix == OLD and not target.exists():
            folder.rename(target)
        else:
            shutil.rmtree(folder, ignore_errors=True)


def exchange(one: Path, other: Path) -> bool:
    """Two folders swap their names in one step; False where the system cannot do that."""
    libc = ctypes.CDLL(None, use_errno=True)
    try:
        if sys.platform == "darwin":
            done = libc.renamex_np(os.fsencode(one), os.fsencode(other), 2)
        else:
            here = -100  # AT_FDCWD
            done = libc.renameat2(here, os.fsencode(one), here, os.fsencode(other), 2)
    except AttributeError:  # an old C library
        return False
    return bool(done == 0)
