"""A Meshcat page served to browsers on this machine, from a thread of this process.

Meshcat's own server is a process of its own that listens on every interface, outlives a killed parent and
takes the next port without a word. This one speaks the same messages to the same page, binds to one address
and one port, and ends with the process.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import threading
from types import TracebackType
from typing import Any, Self

import meshcat
from tornado.httpserver import HTTPServer
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from wbplan.errors import ViewError
from wbplan.view.messages import Command, Store, visualizer
from wbplan.view.page import live_page

#: Ports tried, in this order, when none is asked for; after them whichever is free.
PORTS = range(7000, 7020)
#: A page with this many messages not yet taken is let go: it has stopped reading.
MOST_WAITING = 20_000
#: The drawing side waits for the sending side beyond this many messages.
MOST_QUEUED = 4_000


class Server:
    """Serves one scene to any number of browser pages; never opens a browser itself.

    A page that opens later, or is loaded again, is shown the whole scene. Usable as a context manager.

    Args:
        host: address to listen on; nothing beyond this address can reach the page.
        port: port to listen on; None takes a free one.
        title: of the page.

    Raises:
        ViewError: the port is taken, or the host is not an address of this machine.

    Attributes:
        host: the address listened on.
        port: the port listened on.
        url: what to open in a browser.
        visualizer: Meshcat's own drawing interface, for whatever `Scene` does not draw.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None, *, title: str = "wbplan") -> None:
        listener = _bind(host, port)
        self.host = host
        self.port: int = listener.getsockname()[1]
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"
        self.visualizer: meshcat.Visualizer = visualizer(self)
        self._page = live_page(title)
        self._store = Store()
        self._queue: list[bytes] = []
        self._pages: set[_Socket] = set()
        self._changed = threading.Condition()
        self._stopping = False
        self._started = threading.Event()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(listener)), name=f"wbplan-view-{self.port}", daemon=True
        )
        self._thread.start()
        if not self._started.wait(10.0):
            raise ViewError(f"view: the server at {self.url} did not start")

    def send(self, command: Command) -> None:
        """Draws: keeps the command for later pages and sends it to the open ones.

        Raises:
            ViewError: the server has been stopped.
        """
        with self._changed:
            self._changed.wait_for(lambda: len(self._queue) < MOST_QUEUED or self._stopping)
            if self._stopping:
                raise ViewError(f"the view at {self.url} has been stopped; start a new one")
            self._queue.append(self._store.keep(command))
            if len(self._queue) == 1:
                self._loop.call_soon_threadsafe(self._flush)

    @property
    def pages(self) -> int:
        """How many browser pages are open."""
        return len(self._pages)

    def wait(self) -> None:
        """Blocks until the server is stopped, from another thread or by Ctrl-C (KeyboardInterrupt)."""
        while self._thread.is_alive():
            self._thread.join(0.2)

    def stop(self) -> None:
        """Closes every page and frees the port. Calling it again does nothing."""
        with self._changed:
            if not self._stopping:
                self._stopping = True
                self._loop.call_soon_threadsafe(self._stopped.set)
            self._changed.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join(5.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f"<wbplan view at {self.url}{', stopped' if self._stopping else ''}>"

    # What follows runs in the server's own thread.

    async def _serve(self, listener: socket.socket) -> None:
        self._loop = asyncio.get_running_loop()
        self._stopped = asyncio.Event()
        app = Application(
            [
                (r"/(?:index\.html|static/)?", _Page, {"page": self._page}),
                (r"/messages", _Socket, {"server": self}),
            ],
            log_function=lambda handler: None,
        )
        http = HTTPServer(app)
        http.add_socket(listener)
        self._started.set()
        await self._stopped.wait()
        http.stop()
        for page in list(self._pages):
            page.close(1001, "stopped")
        await asyncio.sleep(0)
        await http.close_all_connections()

    def _flush(self) -> None:
        with self._changed:
            queue, self._queue = self._queue, []
            self._changed.notify_all()
            for page in list(self._pages):
                page.tell(queue)

    def _opened(self, page: _Socket) -> None:
        with self._changed:
            # What is still queued is in the store as well; the page hears it twice, which changes nothing.
            page.tell(self._store.messages())
            self._pages.add(page)

    def _closed(self, page: _Socket) -> None:
        self._pages.discard(page)


class _Page(RequestHandler):  # type: ignore[misc]
    def initialize(self, page: str) -> None:
        self._page = page

    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.write(self._page)


class _Socket(WebSocketHandler):  # type: ignore[misc]
    def initialize(self, server: Server) -> None:
        self._server = server
        self._waiting = 0

    def open(self, *args: str, **kwargs: str) -> None:
        self._server._opened(self)

    def on_close(self) -> None:
        self._server._closed(self)

    def on_message(self, message: str | bytes) -> None:
        """The page has nothing to say."""

    def tell(self, messages: list[bytes]) -> None:
        if self._waiting + len(messages) > MOST_WAITING + len(self._server._store.messages()):
            self._server._closed(self)
            self.close(1013, "too slow")
            return
        for data in messages:
            try:
                sent = self.write_message(data, binary=True)
            except WebSocketClosedError:
                return
            self._waiting += 1
            sent.add_done_callback(self._sent)

    def _sent(self, sent: Any) -> None:
        self._waiting -= 1
        if not sent.cancelled():
            sent.exception()  # a page that went away in between is no error; asking marks it as seen


def _bind(host: str, port: int | None) -> socket.socket:
    """A listening socket on one address: at the port asked for, or the first free one."""
    if port is not None and not 0 < port < 65536:
        raise ViewError(f"view: port has to be from 1 to 65535, found {port}; leave it out for a free one")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for wanted in [port] if port is not None else [*PORTS, 0]:
        try:
            listener = socket.create_server((host, wanted), family=family, backlog=64)
        except (OSError, UnicodeError) as error:
            if port is None and getattr(error, "errno", None) == errno.EADDRINUSE:
                continue
            raise _refusal(host, wanted, error) from error
        listener.setblocking(False)
        return listener
    raise ViewError(f"view: no free port on {host}")


def _refusal(host: str, port: int | None, error: Exception) -> ViewError:
    number = getattr(error, "errno", None)
    reason = getattr(error, "strerror", None) or error
    if number == errno.EADDRINUSE:
        return ViewError(
            f"view: port {port} on {host} is taken by another program; choose another port, or give none for "
            "a free one"
        )
    if number == errno.EACCES:
        return ViewError(
            f"view: port {port} on {host} may not be used by this account; choose one above 1023"
        )
    return ViewError(
        f"view: host '{host}' cannot be listened on ({reason}); it has to be an address of this machine, "
        "for example 127.0.0.1"
    )
