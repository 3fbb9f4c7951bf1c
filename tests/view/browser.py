"""Looks at a page of the view in headless Chromium: for the tests, and for pictures of a saved plan.

python tests/view/browser.py out/clamp/scene.html --time 12.3 picture.png
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
TWO_FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"
KINDS = ("ground", "robot", "contacts", "support", "com", "com_ground", "targets", "bodies", "trails")


def why_not() -> str | None:
    """Why no page can be looked at here, or None if one can."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "playwright is not installed (pip install playwright)"
    if shutil.which("chromium") is None:
        return "chromium is not installed (apt-get install chromium)"
    return None


class View:
    """One open page.

    Attributes:
        page: Playwright's page.
        complaints: what the page wrote to the console as an error or warning, and its uncaught errors.
        requests: every address that the page asked for.
    """

    def __init__(self, context, address: str) -> None:
        self.page = context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._said)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("websocket", lambda socket: self.requests.append(socket.url))
        self.page.goto(address)
        self.page.wait_for_function("() => window.wbplanReady === true", timeout=60_000)

    def _said(self, message) -> None:
        # Chromium's own words on software drawing are about this machine, not about the page.
        if message.type in ("error", "warning") and "GL Driver Message" not in message.text:
            self.complaints.append(f"{message.type}: {message.text}")

    def wait_for(self, node: str) -> None:
        """Waits until something is drawn at a node, "robot/base"."""
        script = """(path) => {
            let at = viewer.scene_tree;
            for (const name of ["wbplan", ...path.split("/")]) if (!(at = at.children[name])) return false;
            let drawn = false;
            at.object.traverse((o) => { drawn = drawn || Boolean(o.geometry); });
            return drawn;
        }"""
        self.page.wait_for_function(script, arg=node, timeout=30_000)

    def seek(self, time: float) -> None:
        """Stops the animation at a time [s]."""
        self.page.evaluate("(t) => { viewer.animator.pause(); viewer.animator.seek(t); }", time)
        self.page.evaluate(TWO_FRAMES)

    def only(self, *kinds: str) -> None:
        """Hides the background and all but some kinds of things: alpha is 0 where nothing is."""
        self.page.evaluate(
            """([all, kept]) => {
                viewer.set_property(["Background"], "visible", false);
                for (const kind of all) viewer.set_property(["wbplan", kind], "visible", kept.includes(kind));
                viewer.set_dirty();
            }""",
            [list(KINDS), list(kinds)],
        )

    def picture(self) -> NDArray[np.uint8]:
        """The drawing alone, (height, width, RGBA)."""
        self.page.evaluate(TWO_FRAMES)
        data = self.page.evaluate("() => viewer.capture_image()")
        return np.array(Image.open(io.BytesIO(base64.b64decode(data.split(",", 1)[1]))).convert("RGBA"))

    def close(self) -> None:
        self.page.close()


@contextlib.contextmanager
def chromium(width: int = 960, height: int = 600, scale: float = 1.0) -> Iterator:
    """A headless browser; `View(it, address)` opens a page."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as profile, sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            profile,
            executable_path=shutil.which("chromium"),
            headless=True,
            args=FLAGS,
            viewport={"width": width, "height": height},
            device_scale_factor=scale,
        )
        try:
            yield context
        finally:
            context.close()


def main() -> None:
    reader = argparse.ArgumentParser(description="Takes a picture of a scene.html at a time.")
    reader.add_argument("scene", help="a scene.html, or the address of a served plan")
    reader.add_argument("picture", type=Path)
    reader.add_argument("--time", type=float, default=0.0, help="[s]")
    reader.add_argument("--size", default="1280x800")
    reader.add_argument("--scale", type=float, default=1.0, help="pixels per pixel of the page")
    reader.add_argument("--bare", action="store_true", help="without label, time bar and controls")
    asked = reader.parse_args()
    width, height = (int(n) for n in asked.size.split("x"))
    address = asked.scene if "://" in asked.scene else Path(asked.scene).resolve().as_uri()
    with chromium(width, height, asked.scale) as context:
        view = View(context, address)
        if asked.bare:
            view.page.add_style_tag(content=".panel, .dg { display: none !important; }")
        view.seek(asked.time)
        view.page.screenshot(path=str(asked.picture))
        for complaint in view.complaints:
            print(complaint)


if __name__ == "__main__":
    main()
