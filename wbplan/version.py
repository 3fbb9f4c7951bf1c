"""The version of wbplan, in one place: the build, the command line and every bundle read it here."""

from __future__ import annotations

VERSION = "0.1.0"
