"""Who may come in, what is served, and that nonsense and floods harm nobody."""

import asyncio
import contextlib
import json
import socket
import time

import aiohttp
import pytest

from cassie_teleop import page_server
from cassie_teleop.page_messages import Beat, Press
from cassie_teleop.page_server import MAX_PAGES, MAX_RATE, PageServer, is_loopback

TOKEN = "correct-horse"
BEAT = json.dumps({"echo": 1, "visible": True, "forward": 0, "left": 0, "turn": 0})


class FakePages:
    """Keeps what pages do."""

    def __init__(self, mesh=None):
        self.present, self.heard = set(), []
        self.is_late = False
        self._mesh = mesh

    def join(self, page, address):
        self.present.add(page)
        return {"page": page}

    def leave(self, page):
        self.present.remove(page)

    def hear(self, page, message):
        self.heard.append((page, message))
        return "told" if isinstance(message, Press) else ""

    def late(self, page):
        return self.is_late

    def links(self):
        return [{"name": "base"}]

    def mesh(self, index):
        return self._mesh if index == 0 else None


def serve(test, token="", host="127.0.0.1", pages=None):
    """Run `test(server, pages, session)` beside a server."""
    pages = pages or FakePages()

    async def run():
        server = PageServer(host, 0, token, pages)
        jar = aiohttp.CookieJar(unsafe=True)
        async with server.serving(), aiohttp.ClientSession(cookie_jar=jar) as session:
            await asyncio.wait_for(test(server, pages, session), 60)

    asyncio.run(run())


def url(server, path="/"):
    return f"http://127.0.0.1:{server.port}{path}"


def connect(server, session, **kwargs):
    headers = {"Origin": f"http://127.0.0.1:{server.port}"} | kwargs.pop("headers", {})
    return session.ws_connect(url(server, "/socket"), headers=headers, **kwargs)


async def until(condition):
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        await asyncio.sleep(0.01)


def test_the_page_its_libraries_the_robot_and_its_meshes_are_served(tmp_path):
    mesh = tmp_path / "a.stl"
    mesh.write_bytes(b"solid")

    async def test(server, pages, session):
        files = ("/", "/web/console.js", "/web/console.css")
        libraries = ("/lib/scene/index.js", "/lib/joystick/index.js", "/lib/echart/index.js")
        for path in (*files, *libraries, "/robot.json", "/mesh/0.stl"):
            async with session.get(url(server, path)) as answer:
                assert answer.status == 200, path
                assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
        for path in (
            "/mesh/1.stl",
            "/web/../console.py",
            "/web/%2e%2e/console.py",
            "/x",
            "/lib/scene/",
        ):
            async with session.get(url(server, path)) as answer:
                assert answer.status in (403, 404), path

    serve(test, pages=FakePages(mesh))


def test_what_is_no_http_is_refused_without_a_word_in_the_log(caplog):
    async def test(server, pages, session):
        for garbage in (b"\x16\x03\x01\xff", b"GET / HTTP/1.1\r\nHost: \xff\x00\r\n\r\n"):
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write(garbage)
            writer.write_eof()
            assert b"200" not in await asyncio.wait_for(reader.read(100), 10)
            writer.close()
        async with session.get(url(server)) as answer:
            assert answer.status == 200

    serve(test)
    assert caplog.records == []


def test_the_libraries_hold_what_the_page_imports():
    folders = page_server._library_folders()
    for name, words in {
        "scene": ("OrbitControls", "STLLoader", "as THREE"),
        "joystick": ("as nipplejs",),
        "echart": ("as echarts",),
    }.items():
        text = (folders[name] / "index.js").read_text()
        assert all(word in text for word in words), name


def test_without_the_token_nothing_is_served_and_with_it_a_cookie_is_set():
    async def test(server, pages, session):
        for path in ("/", "/robot.json", "/web/console.js", "/?token=", "/?token=wrong", "/none"):
            async with session.get(url(server, path)) as answer:
                assert answer.status == 403 and TOKEN not in await answer.text()
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await connect(server, session)
        async with session.get(url(server, f"/?token={TOKEN}")) as answer:
            assert answer.status == 200 and "token" not in str(answer.url)
        async with connect(server, session) as socket:
            assert (await socket.receive_json())["page"] == 1

    serve(test, TOKEN, "0.0.0.0")


def test_one_browser_may_have_pages_of_two_consoles():
    async def test(server, pages, session):
        other = PageServer("0.0.0.0", 0, "battery-staple", FakePages())
        async with other.serving():
            for each, token in ((server, TOKEN), (other, "battery-staple")):
                async with session.get(url(each, f"/?token={token}")) as answer:
                    assert answer.status == 200
            for each in (server, other):
                async with session.get(url(each)) as answer:
                    assert answer.status == 200

    serve(test, TOKEN, "0.0.0.0")


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this computer has no IPv6")
def test_all_addresses_of_ipv6_are_those_of_ipv4_as_well():
    async def test(server, pages, session):
        async with session.get(url(server, f"/?token={TOKEN}")) as answer:
            assert answer.status == 200

    serve(test, TOKEN, "::")


@pytest.mark.parametrize(
    "origin", ["", "null", "http://evil.example", "http://127.0.0.1:1", "http://[::", "127.0.0.1"]
)
def test_a_socket_from_another_page_is_refused(origin):
    async def test(server, pages, session):
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            await connect(server, session, headers={"Origin": origin})
        assert refusal.value.status == 403 and not pages.present

    serve(test)


def test_a_name_that_was_pointed_at_this_computer_is_refused():
    async def test(server, pages, session):
        for host in ("evil.example", f"evil.example:{server.port}", "[", ""):
            async with session.get(url(server), headers={"Host": host}) as answer:
                assert answer.status in (400, 403), host
        async with session.get(url(server), headers={"Host": f"localhost:{server.port}"}) as answer:
            assert answer.status == 200

    serve(test)


def test_loopback_is_told_from_other_addresses():
    for host in ("127.0.0.1", "127.8.9.1", "::1", "localhost", "LOCALHOST"):
        assert is_loopback(host)
    for host in ("0.0.0.0", "::", "10.0.0.1", "example.org", "127.0.0.1.example.org", ""):
        assert not is_loopback(host)


def test_messages_reach_the_console_and_answers_the_page():
    async def test(server, pages, session):
        async with connect(server, session) as socket:
            assert await socket.receive_json() == {"page": 1}
            await socket.send_str(BEAT)
            await socket.send_str('{"echo": 1, "press": "walk"}')
            assert await socket.receive_json() == {"told": "told"}
            kinds = [type(message) for _, message in pages.heard]
            assert kinds == [Beat, Press]
        await until(lambda: not pages.present)

    serve(test)


def test_frames_reach_every_page_and_the_status_once():
    async def test(server, pages, session):
        async with connect(server, session) as one, connect(server, session) as two:
            for socket in (one, two):
                await socket.receive_json()
            for frame in ("1", "2"):
                server.show(frame, "status")
                got = [(await socket.receive()).data for socket in (one, two)]
                if frame == "1":
                    assert got == ["status", "status"]
                    got = [(await socket.receive()).data for socket in (one, two)]
                assert got == [frame, frame]

    serve(test)


def test_a_page_that_answers_nothing_gets_few_frames():
    async def test(server, pages, session):
        pages.is_late = True
        async with connect(server, session) as socket:
            await socket.receive_json()
            end = time.monotonic() + 1.2
            while time.monotonic() < end:
                server.show("frame", "")
                await asyncio.sleep(0.01)
            count = 0
            with contextlib.suppress(asyncio.TimeoutError):
                while True:
                    await socket.receive(timeout=0.2)
                    count += 1
            assert 1 <= count <= 4

    serve(test)


@pytest.mark.parametrize(
    "send",
    [
        lambda socket: socket.send_str("nonsense"),
        lambda socket: socket.send_str("[" * 1000),
        lambda socket: socket.send_str("x" * 100_000),
        lambda socket: socket.send_bytes(b"\0\xff" * 10),
        lambda socket: socket.send_str('{"echo": 1, "press": "reboot"}'),
    ],
)
def test_a_page_that_talks_nonsense_is_put_out_and_the_others_stay(send):
    async def test(server, pages, session):
        async with connect(server, session) as good, connect(server, session) as bad:
            await bad.receive_json()
            await send(bad)
            while not bad.closed:
                last = await bad.receive()
            # The reason fits into a closing frame: a longer one made the frame an illegal one.
            assert last.type is aiohttp.WSMsgType.CLOSE and len(last.extra.encode()) <= 123
            await until(lambda: len(pages.present) == 1)
            await good.receive_json()
            await good.send_str(BEAT)
            await until(lambda: pages.heard)

    serve(test)


def test_a_page_that_floods_is_put_out():
    async def test(server, pages, session):
        async with connect(server, session) as socket:
            with contextlib.suppress(ConnectionError, aiohttp.ClientError):
                for _ in range(3 * MAX_RATE):
                    await socket.send_str(BEAT)
            await until(lambda: not pages.present)
        assert len(pages.heard) <= 2 * MAX_RATE

    serve(test)


def test_more_pages_than_permitted_are_refused(monkeypatch):
    monkeypatch.setattr(page_server, "MAX_PAGES", 3)

    async def test(server, pages, session):
        sockets = [await connect(server, session) for _ in range(3)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            await connect(server, session)
        assert refusal.value.status == 503
        await sockets[0].close()
        await until(lambda: len(pages.present) == 2)
        await connect(server, session)

    serve(test)
    assert MAX_PAGES >= 50


def test_raw_nonsense_on_the_wire_harms_nobody():
    junk = [
        b"\0" * 1000,
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /" + b"a" * 100_000,
        b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 20_000,
        b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        b"GET /socket HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    ]

    async def test(server, pages, session):
        for data in junk:
            _, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write(data)
            with contextlib.suppress(ConnectionError):
                await writer.drain()
            writer.close()
        async with connect(server, session) as socket:
            assert (await socket.receive_json())["page"] >= 1
            raw = socket.get_extra_info("transport") or socket._response.connection.transport
            raw.write(b"\xff\xff\xff\xff\xff")  # no frame of a WebSocket
            await until(lambda: not pages.present)
        async with session.get(url(server)) as answer:
            assert answer.status == 200

    serve(test)


def test_a_port_in_use_is_an_error_of_the_system():
    async def test(server, pages, session):
        with pytest.raises(OSError, match="in use"):
            PageServer("127.0.0.1", server.port, "", pages)

    serve(test)
