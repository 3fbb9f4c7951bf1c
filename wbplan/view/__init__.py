"""The Meshcat view: live (`Server`, `Scene`), played back (`serve`, `play`), as a file or in a notebook."""

from __future__ import annotations

from wbplan.view.ghost import Ghost
from wbplan.view.playback import inline, page, play, serve, write_html
from wbplan.view.scene import Scene
from wbplan.view.server import Server

__all__ = ["Ghost", "Scene", "Server", "inline", "page", "play", "serve", "write_html"]
