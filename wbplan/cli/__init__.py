"""The command line."""

from wbplan.cli.commands import app, main

__all__ = ["app", "main"]
