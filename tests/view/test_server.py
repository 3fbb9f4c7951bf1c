from __future__ import annotations

import asyncio
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
import umsgpack
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from wbplan.errors import ViewError
from wbplan.view import Server


def listening() -> set[tuple[str, int]]:
    """Addresses that this process listens on, from the kernel."""
    sockets = set()
    for link in Path("/proc/self/fd").iterdir():
        try:
            found = re.match(r"socket:\[(\d+)\]", str(link.readlink()))
        except FileNotFoundError:
            continue
        if found:
            sockets.add(found[1])
    heard = set()
    for table in ("tcp", "tcp6"):
        path = Path(f"/proc/self/net/{table}")
        for line in path.read_text().splitlines()[1:] if path.exists() else ():
            fields = line.split()
            if fields[3] == "0A" and fields[9] in sockets:
                address, port = fields[1].split(":")
                host = socket.inet_ntoa(bytes.fromhex(address)[::-1]) if table == "tcp" else address
                heard.add((host, int(port, 16)))
    return heard


def children() -> set[str]:
    return set(Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split())


def view_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("wbplan-view")]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def hear(url: str, count: int, origin: str | None = None) -> list[dict]:
    """The first messages that a page is sent."""

    async def listen() -> list[dict]:
        headers = {"Origin": origin} if origin else {}
        request = HTTPRequest(url.replace("http:", "ws:") + "messages", headers=headers)
        connection = await websocket_connect(request)
        heard = [umsgpack.unpackb(await connection.read_message()) for _ in range(count)]
        connection.close()
        return heard

    return asyncio.run(asyncio.wait_for(listen(), 10.0))


linux = pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="reads Linux's /proc")


@linux
def test_listens_on_loopback_alone_and_starts_no_process():
    before, family = listening(), children()
    with Server() as server:
        assert listening() - before == {("127.0.0.1", server.port)}
        assert children() == family
    assert listening() == before


@linux
def test_listens_on_the_address_asked_for():
    before = listening()
    with Server("127.0.0.3") as server:
        assert listening() - before == {("127.0.0.3", server.port)}
        assert server.url == f"http://127.0.0.3:{server.port}/"


def test_a_taken_port_is_named_with_the_remedy():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ViewError, match=rf"port {port} on 127\.0\.0\.1 is taken.*choose another port"):
            Server(port=port)
    assert view_threads() == []


def test_without_a_port_each_server_finds_its_own():
    with Server() as first, Server() as second:
        assert first.port != second.port


@pytest.mark.parametrize("host", ["203.0.113.7", "no host"])
def test_a_host_that_is_not_here_is_named(host):
    with pytest.raises(ViewError, match=f"host '{host}' cannot be listened on"):
        Server(host)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_out_of_range_is_refused(port):
    with pytest.raises(ViewError, match=f"found {port}"):
        Server(port=port)


def test_stop_frees_the_port_and_ends_the_thread():
    port = free_port()
    for _ in range(3):
        server = Server(port=port)
        assert view_threads() == [f"wbplan-view-{port}"]
        server.stop()
        server.stop()
        assert view_threads() == []
    with pytest.raises(ViewError, match="has been stopped"):
        server.visualizer["/a"].set_property("visible", False)


def test_an_error_inside_with_stops_it():
    with pytest.raises(KeyError), Server():
        raise KeyError("in between")
    assert view_threads() == []


def test_wait_returns_when_stopped_elsewhere():
    server = Server()
    threading.Timer(0.3, server.stop).start()
    server.wait()
    assert view_threads() == []


def test_a_process_that_never_stops_it_still_ends():
    script = "from wbplan.view import Server; s = Server(); print(s.port, flush=True)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", int(done.stdout))) != 0


def test_serves_one_page_that_loads_nothing_from_elsewhere():
    with Server(title="a <plan> & more") as server:
        with urllib.request.urlopen(server.url, timeout=10) as answer:
            text = answer.read().decode("utf-8")
            assert answer.headers["Content-Type"].startswith("text/html")
        assert "<title>a &lt;plan&gt; &amp; more</title>" in text
        assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=[\"'](?!data:)", text)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(server.url + "etc/passwd", timeout=10)
        assert refused.value.code == 404
        refused.value.close()


def test_a_page_that_opens_late_is_told_the_present():
    with Server() as server:
        for shown in (True, False, True, False):
            server.visualizer["/a"].set_property("visible", shown)
        server.visualizer["/b"].set_property("visible", True)
        heard = hear(server.url, 2)
    assert [(m["path"], m["property"], m["value"]) for m in heard] == [
        ("/a", "visible", False),
        ("/b", "visible", True),
    ]


def test_what_was_deleted_is_not_told():
    with Server() as server:
        for path in ("/a", "/a/b", "/ab"):
            server.visualizer[path].set_property("visible", True)
        server.visualizer["/a"].delete()
        assert [m["path"] for m in hear(server.url, 1)] == ["/ab"]


def test_a_foreign_web_site_cannot_listen():
    with Server() as server:
        server.visualizer["/a"].set_property("visible", True)
        with pytest.raises(HTTPClientError) as refused:
            hear(server.url, 1, origin="http://elsewhere.example")
    assert refused.value.code == 403


def test_a_page_that_stops_reading_does_not_hold_up_the_drawing():
    with Server() as server, socket.create_connection(("127.0.0.1", server.port)) as page:
        handshake = (
            f"GET /messages HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n"
        )
        page.sendall(handshake.encode())
        assert page.recv(12) == b"HTTP/1.1 101"
        node = server.visualizer["/a"]
        for i in range(30_000):
            node.set_property("text", f"{i:0400d}")
        assert len(hear(server.url, 1)) == 1
        for _ in range(100):  # the page that heard needs a moment to be gone, too
            if server.pages == 0:
                break
            time.sleep(0.05)
        assert server.pages == 0
