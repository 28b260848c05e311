"""Pages that come and go, and what is none: noise for a console, as a process of its own.

    python noisy_pages.py ADDRESS SEED

It goes on until its input is closed, and prints how many links were opened and refused.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import threading
import time

import aiohttp
import numpy as np

from cassie_teleop.page_messages import BUTTONS, SLIDERS

CLIENTS = 50
_WILD = (float("nan"), float("inf"), -1e308, 1e9, -1.0, 0.0, 3.0)
_PERMITTED = ("stop", "record", "drive")
"""Buttons that work for whoever looks on: everybody may stop the robot, record, and ask for the
lease, which is free where the one who drives is held up for half a second."""


class Pages:
    """Clients of a console.

    Attributes:
        opened, refused: Links that the server let in, and those it did not.
    """

    def __init__(self, address: str, rng: np.random.Generator) -> None:
        self._address, self._rng = address, rng
        self._stopped = threading.Event()
        self.opened = self.refused = 0

    def run(self) -> None:
        """Make noise until nobody listens to the input any more."""
        threading.Thread(target=self._wait, daemon=True).start()
        asyncio.run(self._all())

    def _wait(self) -> None:
        sys.stdin.read()
        self._stopped.set()

    async def _all(self) -> None:
        async with aiohttp.ClientSession() as session:
            await asyncio.gather(*(self._client(session) for _ in range(CLIENTS)))

    async def _client(self, session: aiohttp.ClientSession) -> None:
        rng = self._rng
        while not self._stopped.is_set():
            with contextlib.suppress(aiohttp.ClientError, OSError, asyncio.TimeoutError):
                if rng.random() < 0.2:
                    await self._garbage()
                else:
                    await asyncio.wait_for(self._page(session), 10.0)
            await asyncio.sleep(float(rng.uniform(0.0, 0.5)))

    async def _garbage(self) -> None:
        """Bytes that are no HTTP, or the beginning of a request that does not go on."""
        port = int(self._address.rsplit(":", 1)[1].strip("/"))
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        start = b"" if self._rng.random() < 0.5 else b"GET /socket HTTP/1.1\r\nUpgrade: web"
        writer.write(start + self._rng.bytes(int(self._rng.integers(1, 500))))
        await writer.drain()
        await asyncio.sleep(0.1)
        writer.close()

    async def _page(self, session: aiohttp.ClientSession) -> None:
        ours = self._rng.random() < 0.8
        origin = self._address.strip("/") if ours else "http://example.org"
        try:
            link = await session.ws_connect(
                f"{self._address.strip('/')}/socket", headers={"Origin": origin}
            )
        except aiohttp.WSServerHandshakeError:
            self.refused += 1
            return
        assert ours
        self.opened += 1
        async with link:
            for _ in range(int(self._rng.integers(1, 30))):
                if link.closed:
                    return
                if self._rng.random() < 0.1:
                    await link.send_bytes(self._rng.bytes(50))
                else:
                    await link.send_str(self._message())
                await asyncio.sleep(0.02)

    def _message(self) -> str:
        """What a page could say, or nearly."""
        rng = self._rng
        wild = float(rng.choice(_WILD))
        sticks = {name: float(rng.choice((-1.0, 1.0))) for name in ("forward", "left", "turn")}
        buttons = [name for name in BUTTONS if name not in _PERMITTED]
        messages = (
            {"echo": time.time(), "visible": True, **sticks},
            {"echo": time.time(), "press": str(rng.choice(buttons))},
            {"echo": time.time(), "slide": str(rng.choice(SLIDERS)), "value": wild},
            {"echo": wild, "visible": True, **sticks},
            {"echo": 0.0, "visible": "yes", "forward": wild, "left": [], "turn": {}},
            {"press": "moon"},
            [[]],
        )
        text = json.dumps(messages[int(rng.integers(len(messages)))])
        return text if rng.random() < 0.9 else text[: int(rng.integers(len(text)))]


def main() -> None:
    """Run as a script."""
    pages = Pages(sys.argv[1], np.random.default_rng(int(sys.argv[2])))
    pages.run()
    print(json.dumps({"opened": pages.opened, "refused": pages.refused}))


if __name__ == "__main__":
    main()
