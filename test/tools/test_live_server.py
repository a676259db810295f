"""The server of make live: on this machine only, for the token's owner, and the same board for all tabs."""

import asyncio
import http.client
import json
import os
import re
import socket
import time
from pathlib import Path

import aiohttp
import pytest
from live_support import parts, served
from support import command, document, refused

from tools.bench import scenario_file
from tools.live.__main__ import main


@pytest.fixture(scope="module")
def server():
    with served() as running:
        yield running


def answer(server, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Status, headers and text of a GET with these headers instead of the usual ones."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    headers = {"Host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=headers)
    got = connection.getresponse()
    return got.status, dict(got.getheaders()), got.read().decode()


async def messages(tab, wanted, seconds: float = 10.0):
    """Reads until a message pleases, and shows each at once."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        message = json.loads((await tab.receive(seconds)).data)
        await tab.send_json({"seen": True})
        if wanted(message):
            return message
    raise AssertionError("no such message")


def with_tabs(server, work, tabs: int = 1):
    """Runs `work` with so many open tabs."""
    async def live():
        async with aiohttp.ClientSession() as session:
            opened = [await session.ws_connect(server.url.replace("http", "ws").replace("/?", "/board?")) for _ in range(tabs)]
            for tab in opened:
                assert (await messages(tab, lambda message: "hello" in message))["hello"]["virtual"] is True
            result = await work(*opened)
            for tab in opened:
                await tab.close()
            return result
    return asyncio.run(live())


def test_the_page_is_one_text_that_loads_nothing_from_elsewhere(server):
    status, headers, text = answer(server, f"/?token={server.token}")
    assert status == 200 and "default-src 'none'" in headers["Content-Security-Policy"] and headers["Referrer-Policy"] == "no-referrer"
    assert not re.search(r"""(?:src|href)=["'](?!data:)[^"']+["']""", re.sub(r"(?s)<script.*?</script>", "", text)) and "@import" not in text


@pytest.mark.parametrize("path", ["/?", "/board?", "/save/csv?", "/save/scenario?", "/nothing?"])
@pytest.mark.parametrize("headers, token, reason", [
    ({}, "", "without the token"), ({}, "wrong", "without the token"), ({}, "ä", "without the token"), ({"Host": "evil.example"}, None, "another host"),
    ({"Host": "127.0.0.1:1"}, None, "another host"), ({"Origin": "http://evil.example"}, None, "from elsewhere"), ({"Origin": "null"}, None, "from elsewhere"),
    ({"Origin": "https://127.0.0.1"}, None, "from elsewhere")])
def test_nobody_gets_in_without_the_token_by_another_name_or_from_another_page(server, path, headers, token, reason):
    token = server.token if token is None else token.encode().hex() if not token.isascii() else token
    status, _, text = answer(server, f"{path}token={token}", **headers)
    assert status == 403 and reason in text and text.startswith("foc33: ") and text.count("\n") == 1


def test_this_page_and_localhost_are_let_in(server):
    for name in ("127.0.0.1", "localhost"):
        host = f"{name}:{server.port}"
        assert answer(server, f"/?token={server.token}", Host=host, Origin=f"http://{host}")[0] == 200


def test_it_listens_on_the_loopback_address_only(server):
    listening = [line.split()[1] for name in ("tcp", "tcp6") if Path(f"/proc/net/{name}").exists()
                 for line in Path(f"/proc/net/{name}").read_text(encoding="ascii").splitlines()[1:] if line.split()[3] == "0A"]
    assert [address for address in listening if int(address.rpartition(":")[2], 16) == server.port] == [f"0100007F:{server.port:04X}"]


def test_each_start_has_a_token_of_its_own(server):
    with served() as other:
        assert other.token != server.token and len(other.token) >= 20
        assert answer(other, f"/?token={server.token}")[0] == 403


def test_all_tabs_see_the_same_board(server):
    async def work(one, other):
        await one.send_json({"set": ["load.constant_nm", 0.012]})
        await other.send_json({"press": "S3"})
        seen = [await messages(tab, lambda m: m.get("settings", {}).get("load.constant_nm") == 0.012 and m["buttons"]["S3"] == 1) for tab in (one, other)]
        await other.close() # its button comes up
        await messages(one, lambda m: "buttons" in m and m["buttons"]["S3"] == 0)
        return seen
    one, other = with_tabs(server, work, 2)
    assert one["run"] == other["run"]


@pytest.mark.parametrize("text, part", [
    pytest.param("{", "no JSON, page: ", id="half"), pytest.param("[" * 2000, "no JSON, page: ", id="deep"), ("pot", "no JSON, page: "),
    ('{"press": "S9"}', "no button 'S9'"), ('{"set": ["input.pot", NaN]}', "impossible"), ('{"pace": 3}', "no pace '3'"),
    ('{"pace": true}', "no pace"), ('{"pace": 1, "power": true}', "no such command")])
def test_nonsense_is_refused_to_the_tab_that_sent_it_and_the_board_goes_on(server, text, part):
    async def work(one, other):
        await one.send_str(text)
        refused = await messages(one, lambda message: "refused" in message)
        return refused["refused"], [await messages(other, lambda message: True) for _ in range(4)]
    refused, heard = with_tabs(server, work, 2)
    assert part in refused and "\n" not in refused and not [message for message in heard if "refused" in message]


def test_a_tab_that_does_not_keep_up_gets_nothing_twice_nothing_old_and_misses_nothing(server):
    async def work(tab):
        await asyncio.sleep(1.0) # it shows nothing
        got = []
        while len(got) < 6:
            message = json.loads((await tab.receive(10)).data)
            if "t" in message:
                got.append(message)
                await tab.send_json({"seen": True})
        return got
    got = with_tabs(server, work)
    times = [row[0] for message in got for row in message["strip"]]
    assert all(0.009 < later - earlier < 0.011 for earlier, later in zip(times, times[1:]))
    assert max(later["t"] - earlier["t"] for earlier, later in zip(got, got[1:])) > 0.5 # one frame for all that time


def test_a_message_that_is_too_long_ends_the_tab_only(server):
    async def work(one, other):
        await one.send_str(" " * 10000)
        assert (await messages_until_closed(one)) and await messages(other, lambda message: "t" in message)
        return True

    async def messages_until_closed(tab):
        while (await tab.receive(10)).type not in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED):
            pass
        return True
    assert with_tabs(server, work, 2)


def test_real_time_and_twenty_frames_a_second_take_less_than_half_a_core(server):
    def processor_s() -> float:
        fields = Path(f"/proc/{server.process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")

    async def work(tab):
        await tab.send_json({"set": ["input.pot", 0.5]})
        await tab.send_json({"press": "S2"})
        await tab.send_json({"release": "S2"})
        first = await messages(tab, lambda m: m.get("state") == "CLOSED")
        begin_s, frames = processor_s(), 0
        while (last := await messages(tab, lambda m: "t" in m))["t"] < first["t"] + 1.0:
            frames += 1
        return frames, last, processor_s() - begin_s
    frames, last, used_s = with_tabs(server, work)
    assert 19 <= frames <= 21 and last["measured"] > 0.0 and used_s < 0.5


def test_a_scenario_and_a_csv_are_saved_or_refused_in_one_line(server):
    with_tabs(server, lambda tab: tab.send_json({"power": True}))
    time.sleep(0.5)
    status, headers, text = answer(server, f"/save/scenario?token={server.token}")
    assert status == 200 and headers["Content-Disposition"] == 'attachment; filename="recorded.toml"'
    assert scenario_file.read(document(text)).duration_s > 0.3
    assert answer(server, f"/save/csv?token={server.token}")[2].startswith("time_s,plant.speed_rpm,")
    assert answer(server, f"/save/nothing?token={server.token}")[0] == 404


# ---- command line ----------------------------------------------------------------------------------------------------------
def said(*arguments: str) -> tuple[int, str, str]:
    return command("--library", str(parts().library.path), *arguments, main=main)


@pytest.mark.parametrize("arguments, part", [
    (("--pace", "2"), "no pace '2', PACE: choose one of 1, 0.1, 0.01, 0.001"), (("--listen", "page"), "'page' is no port, LISTEN"),
    (("--listen", "70000"), "no port"), (("--elf", "foc33.elf"), "PORT=/dev/ttyUSB0"), (("--port", "/dev/nothing", "--elf", "no.elf"), "no.elf"),
    (("--board", "mclv9"), "no board 'mclv9'"), (("--defines", "TUNING"), "no mode 'TUNING'"), (("rest",), "command line")])
def test_bad_input_is_one_line(arguments, part):
    refused(said(*arguments), part)


def test_a_port_in_use_is_one_line(server):
    refused(said("--listen", str(server.port)), f"cannot listen on port {server.port} (Address already in use), LISTEN: choose another one")


def test_ctrl_c_ends_it_with_open_tabs():
    with served() as running, socket.create_connection(("127.0.0.1", running.port)):
        async def work(tab):
            begin_s = time.monotonic()
            assert await asyncio.get_running_loop().run_in_executor(None, running.end) == (0, "")
            return time.monotonic() - begin_s
        assert with_tabs(running, work) < 5.0
