"""Serves the browser page and its link: HTTP and WebSocket, with the checks at the door.

On a loopback address whoever names it as such may come in (a page of another site cannot, which
has a name of its own point here); on any other address whoever has the token. A WebSocket must
come from a page of this server (Origin).
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
"""Pages at a time; further ones are refused."""

MAX_RATE = 200
"""Messages from one page within a second, above which it is put out."""

PAUSE_WHEN_LATE = 0.5
"""Longest wait for a page whose link is late to answer, before it gets another frame. In s."""

_WEB = Path(__file__).with_name("web")
_LIBRARIES = {"scene": "scene/dist", "joystick": "joystick/dist", "echart": "echart/dist"}
_COOKIE = "cassie_console"
_LONGEST_REASON = 123  # bytes of a closing frame's text
_LONGEST = 2000  # bytes of a WebSocket message; what a page says is shorter
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
    """What is behind the server."""

    def join(self, page: int, address: str) -> dict[str, Any]:
        """A page was opened; returns what it is told first."""

    def leave(self, page: int) -> None:
        """A page is gone."""

    def hear(self, page: int, message: Beat | Press | Slide) -> str:
        """A page says something; returns what it is told, empty for nothing."""

    def late(self, page: int) -> bool:
        """Whether the link to a page is late."""

    def links(self) -> list[dict[str, Any]]:
        """Links of the robot; none while it is not known."""

    def mesh(self, index: int) -> Path | None:
        """File of a mesh that a link names; None if there is none of that number."""


class PageServer:
    """Listens once it is made, serves while `serving` holds.

    Args:
        host: Address to listen on.
        port: 0 for any that is free.
        token: What a browser must show; empty for nothing.
        pages: What is behind it.

    Attributes:
        port: That it listens on.

    Raises:
        OSError: if it cannot listen, such as for a port in use.
    """

    def __init__(self, host: str, port: int, token: str, pages: Pages) -> None:
        self._token, self._pages = token, pages
        try:
            family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            self._socket = socket.create_server(address[:2], family=family, backlog=128)
        except OSError as error:
            raise OSError(f"cannot listen on {host}, port {port}: {error.strerror}") from None
        self.port: int = self._socket.getsockname()[1]
        self._names_itself = is_loopback(host)
        self._open: dict[int, web.WebSocketResponse] = {}
        self._number = 0
        self._frame = self._status = ""
        self._come = asyncio.Event()

    @asynccontextmanager
    async def serving(self) -> AsyncIterator[None]:
        """Serve meanwhile; at the end pages are told that it ends."""
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
        """Send a frame to every page, and the status to those that have another one.

        A page that is slow gets fewer of them.
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
            response.set_cookie(_COOKIE, self._token, httponly=True, samesite="Lax")
        else:
            response = await handler(request)
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    def _refusal(self, request: web.Request) -> str:
        """Why a request is not answered; empty if it is."""
        host = request.headers.get("Host", "")
        if self._names_itself and not is_loopback(_hostname(host)):
            return "this address is not the one of this server"
        if self._token:
            shown = request.query.get("token", "") or request.cookies.get(_COOKIE, "")
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
        except ConnectionError:  # it left at the door
            return opened
        self._number += 1
        page = self._number
        self._open[page] = opened
        hello = self._pages.join(page, request.remote or "")
        frames = asyncio.create_task(self._send_frames(page, opened, hello))
        try:
            with suppress(ConnectionError):  # it is gone while it is answered
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
        with suppress(ConnectionError, RuntimeError):  # it is gone; the listener tells
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
        """Give a page time to answer a frame, so that not too many are on their way."""
        deadline = time.monotonic() + PAUSE_WHEN_LATE
        while self._pages.late(page) and time.monotonic() < deadline:
            await asyncio.sleep(PAUSE_WHEN_LATE / 20)


def _reason(error: MessageError) -> bytes:
    """Why a connection is closed, no longer than the protocol permits (RFC 6455)."""
    return str(error).encode()[:_LONGEST_REASON].decode(errors="ignore").encode()


def is_loopback(host: str) -> bool:
    """Whether a host is this computer for itself."""
    try:
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _is_ours(record: logging.LogRecord) -> bool:
    """Whether an error is one of the server: who sends what is no HTTP is told so, nobody else."""
    kind = record.exc_info[0] if record.exc_info else None
    return not (kind is not None and issubclass(kind, HttpProcessingError))


async def _index(_: web.Request) -> web.StreamResponse:
    return web.FileResponse(_WEB / "index.html")


def _library_folders() -> dict[str, Path]:
    """Folders of the browser libraries in NiceGUI's wheel, of which nothing else is used.

    Raises:
        OSError: if it is not installed, or has them elsewhere.
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
