"""The page's server: on this machine only, for those who have the token; all tabs see the same board."""

import asyncio
import contextlib
import json
import os
import re
import secrets
import signal
from typing import Any

from aiohttp import WSMsgType, web

from tools.common.errors import UserError

from . import page
from .pace import PACES, Pacemaker

ADDRESS = "127.0.0.1"
NAMES = (ADDRESS, "localhost")
USUAL_PORT = 8033
AHEAD = 4
"""Messages that a tab may have without having said that it has shown them; what comes meanwhile is joined to one frame."""
MOST_ROWS, MOST_LINES = 2000, 200
"""Of curves and log in such a frame."""
LONGEST_MESSAGE = 4096
UNSAFE = r"[^A-Za-z0-9_.-]"
"""In a file's name."""
MOTOR = "motor"
"""To be saved, too: its name is the motor's own."""
SAVED = {"scenario": ("recorded.toml", "application/toml"), "csv": ("recorded.csv", "text/csv"), "header": ("userparams.h", "text/x-c"),
         "loop": ("loop.csv", "text/csv"), "step": ("step.csv", "text/csv")}


class Tab:
    """One connection. A tab that cannot keep up, or is not in sight, gets fewer frames, and never old ones."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self.socket = socket
        self.waiting: dict[str, dict[str, Any]] = {}
        """the newest message of each kind"""
        self.unseen = 0
        self.news = asyncio.Event()

    def put(self, message: dict[str, Any]) -> None:
        """Something to be sent."""
        kind = "frame" if "t" in message else next(iter(message))
        self.waiting[kind] = joined(self.waiting[kind], message) if kind == "frame" and kind in self.waiting else message
        self.news.set()

    def seen(self) -> None:
        """The tab has shown a message."""
        self.unseen = max(self.unseen - 1, 0)
        self.news.set()

    async def send(self) -> None:
        """Until the connection ends."""
        with contextlib.suppress(ConnectionError):
            while True:
                await self.news.wait()
                self.news.clear()
                while self.waiting and self.unseen < AHEAD:
                    self.unseen += 1
                    await self.socket.send_json(self.waiting.pop(next(iter(self.waiting))))


def joined(older: dict[str, Any], newer: dict[str, Any]) -> dict[str, Any]:
    """One frame of two: what has happened in both, and how things stand now. After a power-up the older one counts no more."""
    if older["run"] != newer["run"]:
        return newer
    return newer | {"strip": (older["strip"] + newer["strip"])[-MOST_ROWS:], "log": (older["log"] + newer["log"])[-MOST_LINES:]}


class Server:
    """Give its `publish` to the pacemaker."""

    def __init__(self, bench: Any, pace: float) -> None:
        self.bench = bench
        self.token = secrets.token_urlsafe(16)
        self.nonce = secrets.token_urlsafe(16)
        self.tabs: set[Tab] = set()
        self.port = 0
        self.loop = asyncio.get_running_loop()
        self.over = asyncio.Event()
        self.tasks: set[asyncio.Task] = set()
        self.pacemaker = Pacemaker(bench, self.publish, pace)
        bench.start(self.publish)
        bench.paced(pace)

    @property
    def url(self) -> str:
        return f"http://{ADDRESS}:{self.port}/?token={self.token}"

    def publish(self, frame: dict[str, Any]) -> None:
        """From the board's thread, or the scope's: a message for every tab."""
        with contextlib.suppress(RuntimeError): # the loop has ended before the board
            self.loop.call_soon_threadsafe(self._deal, frame)

    def _deal(self, message: dict[str, Any]) -> None:
        for tab in self.tabs:
            tab.put(message)
        if "ended" in message:
            self.over.set()

    def application(self) -> web.Application:
        app = web.Application(middlewares=[self._guard], client_max_size=LONGEST_MESSAGE)
        app.router.add_get("/", self._page)
        app.router.add_get("/board", self._socket)
        app.router.add_get("/save/{what}", self._save)
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Nobody gets in from another page or under another name: that page's scripts could work the board."""
        hosts = [f"{name}:{self.port}" for name in NAMES]
        if request.host not in hosts:
            raise web.HTTPForbidden(text="foc33: another host's name: open the address that make live has printed\n")
        if request.headers.get("Origin") not in (None, f"http://{request.host}"):
            raise web.HTTPForbidden(text="foc33: a page from elsewhere\n")
        if not secrets.compare_digest(request.query.get("token", "").encode(), self.token.encode()):
            raise web.HTTPForbidden(text="foc33: without the token: open the address that make live has printed\n")
        return await handler(request)

    async def _page(self, request: web.Request) -> web.Response:
        policy = (f"default-src 'none'; script-src 'nonce-{self.nonce}'; style-src 'unsafe-inline'; img-src data:; "
                  f"connect-src 'self' ws://{request.host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
        return web.Response(text=page.text(self.nonce), content_type="text/html", headers={
            "Content-Security-Policy": policy, "Referrer-Policy": "no-referrer", "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"})

    async def _ask(self, work: Any) -> Any:
        """Done in the board's thread."""
        return await asyncio.wrap_future(self.pacemaker.call(work))

    async def _socket(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(heartbeat=20.0, max_msg_size=LONGEST_MESSAGE)
        tab = Tab(socket)
        await socket.prepare(request)
        self.tabs.add(tab) # first, so that no frame is missed; the page leaves out what it has twice
        await socket.send_json({"hello": await self._ask(self.bench.hello) | {"paces": PACES}})
        sender = asyncio.create_task(tab.send())
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    await self._take(message.data, tab)
        finally:
            self.tabs.discard(tab)
            sender.cancel()
            await self._ask(lambda: self.bench.left(tab))
        return socket

    async def _take(self, text: str, tab: Tab) -> None:
        """One command; what is wrong with it goes back to this tab only."""
        try:
            command = _command(text)
            if command == {"seen": True}:
                tab.seen()
            elif isinstance(command, dict) and set(command) == {"scope"} and self.bench.scope is not None:
                self.bench.scope.ask(command["scope"])
            elif isinstance(command, dict) and set(command) == {"tune"} and self.bench.tuning is not None:
                task = asyncio.create_task(self._tune(command["tune"], tab)) # the compiler takes its time: what else this tab asks does not wait
                self.tasks.add(task)
                task.add_done_callback(self.tasks.discard)
            elif isinstance(command, dict) and set(command) == {"pace"}:
                await self._ask(lambda: self._set_pace(command["pace"]))
            else:
                await self._ask(lambda: self.bench.act(command, tab))
        except UserError as error:
            await tab.socket.send_json({"refused": str(error)})

    async def _tune(self, wish: Any, tab: Tab) -> None:
        try:
            await self.loop.run_in_executor(None, self.bench.tuning.ask, wish)
        except UserError as error:
            with contextlib.suppress(ConnectionError):
                await tab.socket.send_json({"refused": str(error)})

    def _set_pace(self, pace: Any) -> None:
        if pace not in PACES or isinstance(pace, bool):
            raise UserError(f"no pace '{pace}'", "page", f"choose one of {', '.join(map(str, PACES))}")
        self.pacemaker.set_pace(float(pace))

    async def _save(self, request: web.Request) -> web.Response:
        what = request.match_info["what"]
        if what not in (*SAVED, MOTOR):
            raise web.HTTPNotFound(text="foc33: nothing to save by this name\n")
        try:
            if what == MOTOR: # the tuner takes its time: the board does not wait
                name, saved = await self.loop.run_in_executor(None, self.bench.motor)
                kind = "application/toml"
            else:
                name, kind = SAVED[what]
                saved = await self._ask(getattr(self.bench, what))
        except UserError as error:
            return web.Response(status=409, text=f"foc33: {error}\n")
        name = re.sub(UNSAFE, "_", name)
        body = saved if isinstance(saved, bytes) else saved.encode("utf-8")
        return web.Response(body=body, content_type=kind, charset="utf-8", headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _command(text: str) -> Any:
    """What a tab has sent."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise UserError("no JSON", "page", "send one command, such as {\"press\": \"S2\"}") from None


async def serve(make_bench: Any, port: int | None, pace: float, tell: Any) -> None:
    """Until Ctrl-C, a signal to end, or the board's own end; `tell` gets the address. Without a port: the usual one, or a free one."""
    server = Server(make_bench(), pace)
    for name in (signal.SIGINT, signal.SIGTERM):
        server.loop.add_signal_handler(name, server.over.set)
    runner = web.AppRunner(server.application(), access_log=None)
    await runner.setup()
    try:
        site = await _listen(runner, port)
        server.port = site._server.sockets[0].getsockname()[1]
        server.pacemaker.start()
        tell(server.url)
        await server.over.wait()
        await asyncio.sleep(0.1) # the tabs hear of the board's end
        for tab in list(server.tabs):
            await tab.socket.close()
        for part in (server.bench, server.pacemaker):
            await server.loop.run_in_executor(None, part.end)
    finally:
        await runner.cleanup()
    if server.pacemaker.error is not None:
        raise UserError("the board has stopped", "make live", str(server.pacemaker.error))


async def _listen(runner: web.AppRunner, port: int | None) -> web.TCPSite:
    for choice in ([USUAL_PORT, 0] if port is None else [port]):
        site = web.TCPSite(runner, ADDRESS, choice, shutdown_timeout=1.0)
        try:
            await site.start()
            return site
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            await site.stop() if site in runner.sites else None
    raise UserError(f"cannot listen on port {port} ({reason})", "LISTEN", "choose another one, or leave it out")
