"""Serves the browser page and its link by HTTP and WebSocket, with access checks.

On a loopback address, a request must name a loopback host. This refuses a page of another site
whose name resolves to this computer. On any other address, a request must have the token. A
WebSocket must come from a page of this server (Origin).
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import json
import logging
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

from aiohttp import WSCloseCode, WSMessage, WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from cassie_teleop.page_messages import Beat, MessageError, Press, Slide, read_message

MAX_PAGES = 64
"""Largest number of pages at a time; further ones are refused."""

MAX_RATE = 200
"""Messages from one page within a second, above which the page is disconnected."""

PAUSE_WHEN_LATE = 0.5
"""Longest wait for the answer of a page with a late link, before the next frame. In s."""

_WEB = Path(__file__).with_name("web")
_LIBRARIES = {"scene": "scene/dist", "joystick": "joystick/dist", "echart": "echart/dist"}
_LONGEST_REASON = 123  # bytes of a closing frame's text
_LONGEST = 2000  # bytes of a WebSocket message; messages of a page are shorter
_SHUTDOWN = 1.0  # s
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data: blob:; "
    "style-src 'self' 'unsafe-inline'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Pages(Protocol):
    """Interface to the node behind the server."""

    def join(self, page: int, address: str) -> dict[str, Any]:
        """Take in that a page was opened; returns the first message for it."""

    def leave(self, page: int) -> None:
        """Take in that a page is gone."""

    def hear(self, page: int, message: Beat | Press | Slide) -> str:
        """Take in a message of a page; returns the text for the page, empty for none."""

    def late(self, page: int) -> bool:
        """Whether the link to a page is late."""

    def links(self) -> list[dict[str, Any]]:
        """Links of the robot; empty while the robot is not known."""

    def mesh(self, index: int) -> Path | None:
        """File of a mesh that a link names; None if there is no mesh of that index."""


class PageServer:
    """Server that listens from its construction on and serves within the context `serving`.

    Args:
        host: Address to listen on.
        port: Port to listen on; 0 for any free port.
        token: Token that a browser must show; empty for none.
        pages: The node behind the server.

    Attributes:
        port: Port on which the server listens.

    Raises:
        OSError: if the server cannot listen, such as for a port in use.
    """

    def __init__(self, host: str, port: int, token: str, pages: Pages) -> None:
        self._token, self._pages = token, pages
        try:
            family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            both = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
            self._socket = socket.create_server(
                address[:2], family=family, backlog=128, dualstack_ipv6=both
            )
        except OSError as error:
            # create_server adds the address once more
            reason = str(error.strerror).partition(" (while")[0]
            raise OSError(f"cannot listen on {host}, port {port}: {reason}") from None
        self.port: int = self._socket.getsockname()[1]
        self._names_itself = is_loopback(host)
        # Browsers send a cookie to every port of a host, so each console has a name of its own.
        self._cookie = f"cassie_console_{self.port}"
        self._open: dict[int, web.WebSocketResponse] = {}
        self._number = 0
        self._frame = self._status = ""
        self._come = asyncio.Event()

    @asynccontextmanager
    async def serving(self) -> AsyncIterator[None]:
        """Serve within the context; at its end pages are told that the server ends."""
        app = web.Application(middlewares=[self._door])
        app.router.add_get("/", _index)
        app.router.add_get("/socket", self._on_socket)
        app.router.add_get("/robot.json", self._on_robot)
        app.router.add_get("/mesh/{index:[0-9]{1,4}}.stl", self._on_mesh)
        app.router.add_static("/web", _WEB)
        for name, folder in _library_folders().items():
            app.router.add_static(f"/lib/{name}", folder)
        log = logging.getLogger(__name__)
        log.addFilter(_is_ours)
        runner = web.AppRunner(
            app, handle_signals=False, access_log=None, shutdown_timeout=_SHUTDOWN, logger=log
        )
        await runner.setup()
        await web.SockSite(runner, self._socket).start()
        try:
            yield
        finally:
            for opened in list(self._open.values()):
                with suppress(Exception):
                    await asyncio.wait_for(opened.close(code=WSCloseCode.GOING_AWAY), 0.2)
            await runner.cleanup()

    def show(self, frame: str, status: str) -> None:
        """Send a frame to every page, and the status to each page with another status.

        A slow page gets fewer frames.
        """
        self._frame, self._status = frame, status
        come, self._come = self._come, asyncio.Event()
        come.set()

    @web.middleware
    async def _door(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        if refused := self._refusal(request):
            response: web.StreamResponse = web.Response(status=403, text=f"{refused}\n")
        elif self._token and "token" in request.query:
            response = web.Response(status=302, headers={"Location": "/"})
            response.set_cookie(self._cookie, self._token, httponly=True, samesite="Lax")
        else:
            response = await handler(request)
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    def _refusal(self, request: web.Request) -> str:
        """Why a request is refused; empty if it is not."""
        host = request.headers.get("Host", "")
        if self._names_itself and not is_loopback(_hostname(host)):
            return "this address is not the one of this server"
        if self._token:
            shown = request.query.get("token", "") or request.cookies.get(self._cookie, "")
            if not hmac.compare_digest(shown.encode(), self._token.encode()):
                return "the address that web_console has printed has a token; it is needed here"
        if request.path == "/socket":
            origin = request.headers.get("Origin", "")
            if not host or _netloc(origin).lower() != host.lower():
                return "this is not a page of this server"
        return ""

    async def _on_robot(self, _: web.Request) -> web.StreamResponse:
        return web.json_response(self._pages.links())

    async def _on_mesh(self, request: web.Request) -> web.StreamResponse:
        path = self._pages.mesh(int(request.match_info["index"]))
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path, headers={"Content-Type": "model/stl"})

    async def _on_socket(self, request: web.Request) -> web.StreamResponse:
        if len(self._open) >= MAX_PAGES:
            return web.Response(status=503, text=f"{MAX_PAGES} pages are open already\n")
        opened = web.WebSocketResponse(max_msg_size=_LONGEST, compress=False, timeout=_SHUTDOWN)
        try:
            await opened.prepare(request)
        except ConnectionError:  # the client left before the connection was made
            return opened
        self._number += 1
        page = self._number
        self._open[page] = opened
        hello = self._pages.join(page, request.remote or "")
        frames = asyncio.create_task(self._send_frames(page, opened, hello))
        try:
            with suppress(ConnectionError):  # the client is gone during the answer
                await self._listen(page, opened)
        finally:
            del self._open[page]
            self._pages.leave(page)
            frames.cancel()
        return opened

    async def _listen(self, page: int, opened: web.WebSocketResponse) -> None:
        second, count = 0, 0
        async for message in opened:
            now = int(time.monotonic())
            second, count = now, count + 1 if now == second else 1
            try:
                if count > MAX_RATE:
                    raise MessageError(f"more than {MAX_RATE} messages a second")
                told = self._pages.hear(page, _read(message))
            except MessageError as error:
                await opened.close(code=WSCloseCode.POLICY_VIOLATION, message=_reason(error))
                return
            if told:
                await opened.send_str(json.dumps({"told": told}))

    async def _send_frames(
        self, page: int, opened: web.WebSocketResponse, hello: dict[str, Any]
    ) -> None:
        with suppress(ConnectionError, RuntimeError):  # the page is gone; the listener reports that
            await opened.send_str(json.dumps(hello))
            known = ""
            while not opened.closed:
                await self._come.wait()
                if known != self._status:
                    known = self._status
                    await opened.send_str(known)
                await opened.send_str(self._frame)
                await self._wait_while_late(page)

    async def _wait_while_late(self, page: int) -> None:
        """Give a page time to answer a frame, so that not too many frames are in the queue."""
        deadline = time.monotonic() + PAUSE_WHEN_LATE
        while self._pages.late(page) and time.monotonic() < deadline:
            await asyncio.sleep(PAUSE_WHEN_LATE / 20)


def _reason(error: MessageError) -> bytes:
    """Why a connection is closed, no longer than the protocol permits (RFC 6455)."""
    return str(error).encode()[:_LONGEST_REASON].decode(errors="ignore").encode()


def is_loopback(host: str) -> bool:
    """Whether a host is a loopback address or name."""
    try:
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _is_ours(record: logging.LogRecord) -> bool:
    """Whether an error is one of the server, not of a client that does not send valid HTTP."""
    kind = record.exc_info[0] if record.exc_info else None
    return not (kind is not None and issubclass(kind, HttpProcessingError))


async def _index(_: web.Request) -> web.StreamResponse:
    return web.FileResponse(_WEB / "index.html")


def _library_folders() -> dict[str, Path]:
    """Folders of the browser libraries in NiceGUI's wheel; nothing else of NiceGUI is used.

    Raises:
        OSError: if NiceGUI is not installed, or has the libraries in other folders.
    """
    spec = find_spec("nicegui")
    if spec is None or spec.origin is None:
        raise OSError("NiceGUI is not installed: the page needs its browser libraries")
    elements = Path(spec.origin).parent / "elements"
    folders = {name: elements / folder for name, folder in _LIBRARIES.items()}
    for folder in folders.values():
        if not (folder / "index.js").is_file():
            raise OSError(f"NiceGUI has no {folder}: another version of it is needed")
    return folders


def _read(message: WSMessage) -> Beat | Press | Slide:
    if message.type is not WSMsgType.TEXT:
        raise MessageError("no text")
    return read_message(message.data)


def _hostname(host: str) -> str:
    with suppress(ValueError):
        return urlsplit(f"//{host}").hostname or ""
    return ""


def _netloc(origin: str) -> str:
    with suppress(ValueError):
        return urlsplit(origin).netloc
    return ""
