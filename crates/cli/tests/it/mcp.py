"""An assistant flies by `spf mcp`, with PyPI's client of the protocol, by hand-written messages, and with an operator at the cockpit.

Arguments: the program, and parts of this: clients, stops, strangers, fuzz, tello, asked, px4, inspector.
"""
import sys

# This script has the name of the package that it needs: its own folder is looked at last.
sys.path.append(sys.path.pop(0))

import asyncio
import atexit
import base64
import collections
import io
import json
import math
import os
import pathlib
import pty
import random
import re
import signal
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import cockpit_lab
import httpx2
import jsonschema
from cockpit_lab import LAPTOP, SPF, Program, accessible, complain, page_of, phase, shot, wait
from mcp import Client, StdioServerParameters
from mcp.client.stdio import stdio_client
from mcp.client.streamable_http import streamable_http_client
from mcp.types import ElicitResult
from PIL import Image
from playwright.sync_api import expect, sync_playwright

cockpit_lab.SHOTS = pathlib.Path(os.environ["SPF_MCP_SHOTS"]) if "SPF_MCP_SHOTS" in os.environ else None
OFFICE = ("--scene", "office", "--no-video")
PERSON = "go to the person in the green shirt"
MODES = {"auto": "2026-07-28", "legacy": "2025-11-25"}
TOOLS = {"fly", "get_flight", "hold", "land", "list_flights", "list_scenes", "look", "point", "status", "stop", "take_off", "wait_flight"}
TOO_MANY = "too many calls"
# The clients run beside the script, which does one thing after the other.
LOOP = asyncio.new_event_loop()
threading.Thread(target=LOOP.run_forever, daemon=True).start()


def later(coroutine):
    return asyncio.run_coroutine_threadsafe(coroutine, LOOP)


class Assistant:
    """PyPI's client of a server. Every answer is checked against the schema of its tool."""

    def __init__(self, transport, mode="auto", asks=None):
        self.client = Client(transport, mode=mode, elicitation_callback=asks)
        self.leaving = asyncio.Event()
        self.there = threading.Event()
        self.life = later(self.live())
        wait(lambda: self.there.is_set() or self.life.done(), "a client that is there")
        if self.life.done():
            self.life.result()
        self.tools = {tool.name: tool for tool in later(self.client.list_tools()).result(60).tools}

    async def live(self):
        async with self.client:
            self.there.set()
            await self.leaving.wait()

    def end(self):
        LOOP.call_soon_threadsafe(self.leaving.set)
        self.life.result(60)

    def start(self, tool, told=None, **arguments):
        """A call, whose answer is waited for by nobody yet; `told` gets what is told meanwhile."""
        async def progress(_steps, _of, message):
            (told if told is not None else []).append(message)

        return later(self.client.call_tool(tool, arguments, progress_callback=progress))

    def answer(self, tool, result):
        schema, given = self.tools[tool].output_schema, result.structured_content or {}
        if not result.is_error:
            jsonschema.validate(given, schema)
        words = " ".join(part.text for part in result.content if part.type == "text")
        picture = next((base64.b64decode(part.data) for part in result.content if part.type == "image"), None)
        # What is not known is left out.
        fields = dict.fromkeys(schema["properties"]) | given
        return SimpleNamespace(words=words, refused=result.is_error, picture=picture, **fields)

    def ask(self, tool, **arguments):
        """What a tool answers, whether it does what was asked or not."""
        return self.answer(tool, self.start(tool, **arguments).result(120))

    def call(self, tool, **arguments):
        """What a tool answers that does what was asked."""
        answer = self.ask(tool, **arguments)
        assert not answer.refused, f"{tool}: {answer.words}"
        return answer

    def refused(self, tool, words, **arguments):
        """Asks for what must be refused, in such words."""
        answer = self.ask(tool, **arguments)
        assert answer.refused and re.search(words, answer.words), f"{tool} {arguments}: {answer.words}"

    def until(self, state, seconds=180):
        """The status in which the craft is in this state."""
        return self.seen(lambda status: status.state == state, state, seconds)

    def seen(self, is_so, name, seconds=180):
        """The first status of which something is so. More than a few calls per second are refused."""
        last = None

        def look():
            nonlocal last
            time.sleep(0.2)
            last = self.ask("status")
            return last if not last.refused and is_so(last) else None

        try:
            return wait(look, name, seconds)
        except AssertionError as error:
            raise AssertionError(f"{error}; status: {last}")

    def moving(self):
        """The status of a craft that an instruction moves."""
        return self.seen(lambda status: status.state == "flying" and status.speed_m_s > 0.3, "a flight that moves")


def by_stdio(*args, mode="auto", env=(), asks=None):
    """A client that starts its server, and the file with what that prints; `asks` answers what its user is asked."""
    told = pathlib.Path(f"told-{time.monotonic_ns()}.txt").absolute()
    server = StdioServerParameters(command=SPF, args=["mcp", *args], env=dict(env))
    return Assistant(stdio_client(server, errlog=told.open("w")), mode, asks), told


def by_http(server, mode="auto"):
    """One more client of a server."""
    headers, patience = {"Authorization": f"Bearer {server.token}"}, httpx2.Timeout(30, read=300)
    # The server takes 64 connections, of all its clients.
    client = httpx2.AsyncClient(headers=headers, timeout=patience, limits=httpx2.Limits(max_connections=20), trust_env=False)
    return Assistant(streamable_http_client(server.url, http_client=client), mode)


def http_server(*args):
    """A server for clients that come and go, and its token."""
    server = Program("mcp", "--http", "127.0.0.1:0", *args, ready=r"MCP: (http\S+)")
    server.token = wait(lambda: next((line.split()[-1] for line in server.lines if line.startswith("Token: ")), None), "a token")
    return server


class Wire:
    """A client of a server over standard input and output, by hand-written messages."""

    def __init__(self, *args):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen([SPF, "mcp", *args], **pipes)
        atexit.register(self.process.kill)
        self.answers, self.strange, self.told, self.number = {}, [], [], 0
        for work in (self.read, self.drain):
            threading.Thread(target=work, daemon=True).start()
        client = {"protocolVersion": MODES["legacy"], "capabilities": {}, "clientInfo": {"name": "wire", "version": "1"}}
        self.ask("initialize", client)
        self.send({"jsonrpc": "2.0", "method": "notifications/initialized"})

    def read(self):
        for line in self.process.stdout:
            self.take(line)

    def take(self, line):
        """Keeps an answer by its number, and every line that is no message."""
        try:
            message = json.loads(line, parse_constant=int)
            assert message["jsonrpc"] == "2.0"
            if "method" in message:
                return
            assert ("result" in message) != ("error" in message)
            if "error" in message:
                assert isinstance(message["error"]["code"], int) and isinstance(message["error"]["message"], str)
            # The protocol has errors without a number, about what had none.
            number = message.get("id") if "error" in message else message["id"]
            self.answers.setdefault(json.dumps(number), []).append(message)
        except (AssertionError, KeyError, TypeError, ValueError):
            self.strange.append(line[:300])

    def drain(self):
        for line in self.process.stderr:
            self.told.append(line.decode())

    def write(self, line):
        self.process.stdin.write(line + b"\n")
        self.process.stdin.flush()

    def send(self, message):
        self.write(json.dumps(message).encode())

    def request(self, method, params):
        self.number += 1
        self.send({"jsonrpc": "2.0", "id": self.number, "method": method, "params": params})
        return self.number

    def answer(self, number, seconds=60):
        return wait(lambda: self.answers.get(json.dumps(number)), f"an answer to {number}", seconds)[0]

    def ask(self, method, params, seconds=60):
        return self.answer(self.request(method, params), seconds)

    def call(self, tool, **arguments):
        return self.ask("tools/call", {"name": tool, "arguments": arguments})["result"]

    def until(self, state):
        """The status in which the craft is in this state. More than a few calls per second are refused."""
        def look():
            time.sleep(0.2)
            status = self.call("status").get("structuredContent", {})
            return status if status.get("state") == state else None

        return wait(look, state)


def clients():
    """By both revisions and both transports: the same tools, and a flight with all of them."""
    with ThreadPoolExecutor(2) as both:
        runs = [both.submit(run) for run in (clients_by_stdio, clients_by_http, fulfilled)]
        lists = [names for run in runs for names in run.result()]
    assert set(lists[0]) == TOOLS and all(names == lists[0] for names in lists), lists


def clients_by_stdio():
    return [flown(by_stdio(*OFFICE, "--out", "stdio", mode=mode)[0], mode, f"stdio, {mode}") for mode in MODES]


def clients_by_http():
    server = http_server(*OFFICE, "--out", "http")
    lists = [flown(by_http(server, mode), mode, f"HTTP, {mode}") for mode in MODES]
    assert server.end() == 0, server.lines[-5:]
    return lists


def flown(assistant, mode, name):
    """A flight by points, then by an instruction. The names of the tools."""
    began = time.monotonic()
    assert assistant.client.protocol_version == MODES[mode], assistant.client.protocol_version
    described(assistant)
    assert assistant.call("status").state == "on_ground"
    assert assistant.call("take_off").state == "holding"
    looked = assistant.call("look")
    assert picture_size(looked.picture) == tuple(looked.size), looked
    pointed(assistant)
    flight = instructed(assistant)
    wrong(assistant)
    landed(assistant, flight)
    assistant.end()
    print(f"{name}: {time.monotonic() - began:.0f} s")
    return list(assistant.tools)


def fulfilled():
    """An instruction that is flown to its end, after which the craft hovers: what is asked then does not interrupt what it is told."""
    near = ("--start=-6.6,2.8,0,130", "--vlm", "oracle:perfect", "--out", "fulfilled")
    assistant, _ = by_stdio(*OFFICE, *near)
    chair = "go to the blue chair"
    flight = assistant.call("fly", instruction=chair, wait_s=90)
    assert flight.ended and flight.outcome == "reached" and flight.state == "hovering", flight.words
    begun = asked_beside(assistant, "fly", instruction=chair, wait_s=0)
    assert not begun.refused, begun.words
    # Again, and without being held by what was asked.
    again = assistant.call("wait_flight", flight_id=flight.flight_id, wait_s=90)
    assert again.ended and again.outcome == "reached" and again.decisions > flight.decisions, again.words
    asked_beside(assistant, "land")
    down = assistant.call("wait_flight", flight_id=flight.flight_id)
    assert down.state == "on_ground" and down.outcome == "reached" and down.verified, down.words
    assistant.end()
    return [list(assistant.tools)]


def asked_beside(assistant, tool, **arguments):
    """What a call answers beside which others ask how it is."""
    call, *asked = [assistant.start(tool, **arguments), *(assistant.start("status") for _ in range(6))]
    for status in asked:
        status.result(60)
    return assistant.answer(tool, call.result(60))


def described(assistant):
    """What a client learns before it flies."""
    for name, tool in assistant.tools.items():
        hints = tool.annotations
        given = (hints.read_only_hint, hints.destructive_hint, hints.idempotent_hint, hints.open_world_hint)
        assert None not in given and tool.output_schema and tool.description, f"{name}: {tool}"
    client = assistant.client
    prompts = later(client.list_prompts()).result(60).prompts
    assert {prompt.name for prompt in prompts} == {"inspect", "patrol", "find"}, prompts
    [message] = later(client.get_prompt("find", {"what": "the blue chair"})).result(60).messages
    assert "the blue chair" in message.content.text, message
    names = listed(client)
    assert {"spf://scene", "spf://docs/guide/tello"} <= names, names
    assert read(client, "spf://docs/guide/tello").startswith("# ")
    scene = json.loads(read(client, "spf://scene"))
    assert scene["scene"] == "office" and any(thing["name"] == "green person" for thing in scene["things"]), scene


def listed(client):
    return {resource.uri for resource in later(client.list_resources(cache_mode="bypass")).result(60).resources}


def read(client, uri):
    return later(client.read_resource(uri)).result(60).contents[0].text


def picture_size(jpeg):
    """The size of a picture, which models need not make smaller."""
    picture = Image.open(io.BytesIO(jpeg))
    assert picture.format == "JPEG" and max(picture.size) <= 768, picture
    return picture.size


def pointed(assistant):
    """One step ahead moves the craft, and shows what it sees then."""
    before = assistant.call("status").east_north_m
    step = assistant.call("point", u=0.5, v=0.5, depth=3)
    moved = math.dist(before, assistant.call("status").east_north_m)
    assert step.flown and step.state == "holding" and moved > 0.5, f"{moved} m: {step}"
    picture_size(step.picture)


def instructed(assistant):
    """Of instructions given at once one is flown; a wait tells how it goes. The flight."""
    began = time.monotonic()
    both = [assistant.start("fly", instruction=PERSON, wait_s=0) for _ in range(2)]
    begun, other = sorted((assistant.answer("fly", call.result(60)) for call in both), key=lambda answer: answer.refused)
    assert not begun.refused and not begun.ended and time.monotonic() - began < 5, begun
    assert other.refused and begun.flight_id in other.words, other
    # It was told to fly: an assistant must not be told that it goes on holding.
    assert "stays in the air" not in begun.words, begun.words
    assistant.refused("fly", begun.flight_id, instruction=PERSON)
    told = []
    waited = assistant.answer("wait_flight", assistant.start("wait_flight", told, flight_id=begun.flight_id, wait_s=4).result(60))
    assert waited.flight_id == begun.flight_id and told and all(told), f"{told}: {waited.words}"
    return begun.flight_id


def wrong(assistant):
    """What is wrong with arguments is told to the model: the name of the argument, or what was expected instead."""
    point = {"u": 0.5, "v": 0.5, "depth": 3}
    for tool, arguments, name in (
        ("fly", {}, "instruction"), ("fly", {"instruction": 3}, "expected a string"), ("fly", {"instruction": PERSON, "wait_s": -1}, "wait_s"),
        ("fly", {"instruction": PERSON, "speed": 3}, "speed"), ("point", point | {"u": "left"}, "left.*expected"),
        ("point", point | {"u": 1.5}, r"\bu\b"), ("point", point | {"depth": 300}, "300"), ("point", point | {"depth": 1.5}, "1.5"),
        ("look", {"size": 1}, "size"), ("wait_flight", {"flight_id": "nowhere"}, "nowhere"),
        ("get_flight", {"flight_id": "nowhere"}, "nowhere"),
    ):
        assistant.refused(tool, name, **arguments)


def landed(assistant, flight):
    """Down, and what was recorded."""
    assistant.call("land")
    down = assistant.call("wait_flight", flight_id=flight)
    assert down.state == "on_ground" and down.ended and down.outcome == "aborted", down.words
    details = assistant.call("get_flight", flight_id=flight)
    assert details.summary["outcome"] == "aborted" and len(details.path_m) > 1 and details.decisions, details
    assert flight in {row["flight_id"] for row in assistant.call("list_flights").flights}
    drawing = f"spf://flights/{flight}/trajectory.svg"
    assert drawing in details.files and drawing in listed(assistant.client)
    assert read(assistant.client, drawing).startswith("<svg")
    assistant.refused("take_off", "nowhere", scene="nowhere")


def stops():
    """Whatever happens to an assistant: the craft holds, and lands."""
    with ThreadPoolExecutor(2) as both:
        for done in [both.submit(run) for run in (stopped, leaves, cancelled_by_stdio, cancelled_by_http)]:
            done.result()


def stopped():
    """A stop works in every state, beside a running call, and nothing of the assistant takes it back."""
    assistant, _ = by_stdio(*OFFICE, "--out", "stopped")
    assert "no flight" in assistant.call("stop").done
    assistant.call("take_off")
    running = assistant.start("fly", instruction=PERSON, wait_s=300)
    before = assistant.moving()
    began = time.monotonic()
    assistant.call("stop")
    took = time.monotonic() - began
    assert took < 1, f"{took:.1f} s"
    halted = assistant.seen(lambda status: status.state != "flying" and status.speed_m_s < 0.15, "a craft at rest", 4)
    assert halted.state == "holding", halted
    assert not assistant.answer("fly", running.result(10)).refused, "the call that ran is answered"
    assistant.refused("fly", "stopped", instruction=PERSON)
    assistant.refused("point", "stopped", u=0.5, v=0.5, depth=1)
    assistant.until("landing")
    assistant.refused("point", "stopped", u=0.5, v=0.5, depth=1)
    assistant.until("on_ground")
    assert "no flight" in assistant.call("stop").done
    print(f"stop answered after {1000 * took:.0f} ms, from {before.speed_m_s} m/s")
    # Before it has taken off.
    running = assistant.start("take_off")
    wait(lambda: assistant.call("status").state in ("starting", "taking_off"), "a flight that begins")
    assistant.call("stop")
    # What had not begun did not take place.
    assert assistant.answer("take_off", running.result(60)).words
    assistant.until("on_ground")
    assistant.end()


def cancelled_by_stdio():
    for mode in MODES:
        assistant, _ = by_stdio(*OFFICE, "--out", "cancelled-by-stdio", mode=mode)
        assistant.call("take_off")
        cancelled(assistant, f"stdio, {mode}")
        assistant.end()


def cancelled_by_http():
    """Also of a client that is gone without a word, while another one watches."""
    server = http_server(*OFFICE, "--out", "cancelled-by-http")
    witness = by_http(server)
    for mode in MODES:
        assistant = by_http(server, mode)
        assistant.call("take_off")
        cancelled(assistant, f"HTTP, {mode}")
        assistant.end()
        caller = subprocess.Popen([sys.executable, "-B", __file__, SPF, "caller", server.url, server.token, mode])
        witness.moving()
        caller.kill()
        assert caller.wait() == -signal.SIGKILL
        witness.until("holding", 5)
        down(witness)
    witness.end()
    assert server.end() == 0, server.lines[-5:]


def caller():
    """The part of `stops` that is killed: a call runs."""
    url, token, mode = sys.argv[3:]
    assistant = by_http(SimpleNamespace(url=url, token=token), mode)
    assistant.call("take_off")
    assistant.call("fly", instruction=PERSON, wait_s=300)


def cancelled(assistant, name):
    """A call that is cancelled makes the craft hold."""
    running = assistant.start("fly", instruction=PERSON, wait_s=300)
    assistant.moving()
    began = time.monotonic()
    running.cancel()
    assistant.until("holding", 5)
    print(f"{name}: held {time.monotonic() - began:.1f} s after the call was cancelled")
    down(assistant)


def down(assistant):
    assistant.call("land")
    assistant.until("on_ground")


def leaves():
    """A client by standard input that is gone, whose call still ran, and a signal: the flight is ended, and its files are complete."""
    for name, leave, cause in (
        ("left", lambda wire: wire.process.stdin.close(), "nobody had the controls"),
        ("signalled", lambda wire: wire.process.send_signal(signal.SIGTERM), "operator ended the flight"),
    ):
        wire = Wire(*OFFICE, "--out", name)
        assert not wire.call("take_off")["isError"]
        wire.request("tools/call", {"name": "fly", "arguments": {"instruction": PERSON, "wait_s": 300}})
        before = wire.until("flying")
        leave(wire)
        code = wire.process.wait(120)
        [flight] = pathlib.Path(name).iterdir()
        whole = {"summary.json", "trajectory.svg", "flight.mcap", "decisions.jsonl", "queries.jsonl"}
        assert code == 0 and whole <= set(os.listdir(flight)), f"{code}: {wire.told}"
        summary = json.loads((flight / "summary.json").read_text())
        assert summary["outcome"] == "aborted" and cause in summary["cause"], summary
        # Told with the flight's time: it did not fly on until something noticed.
        ends = [float(line.split()[0]) for line in wire.told if re.search(r"left the controls, hold|operator: land", line)]
        assert ends and ends[0] - before["flight_time_s"] < 3, f"{before['flight_time_s']} s: {wire.told}"
        assert wire.strange == [], wire.strange
        print(f"{name}: ended {ends[0] - before['flight_time_s']:.1f} s later")


def strangers():
    """Who has no token, comes from elsewhere or calls too often; and a second client, which may stop what another one flies."""
    for flags, env, why in (
        (("127.0.0.1:0",), {"SPF_MCP_TOKEN": "short"}, "at least 16 characters"),
        (("0.0.0.0:0",), {}, "this machine only"),
    ):
        run = subprocess.run([SPF, "mcp", "--http", *flags], env={**os.environ, **env}, capture_output=True, text=True, timeout=60)
        assert run.returncode == 2 and why in run.stderr, run
    server = http_server(*OFFICE)
    refused_requests(server)
    first, second = by_http(server), by_http(server, "legacy")
    first.call("take_off")
    running = first.start("fly", instruction=PERSON, wait_s=300)
    seen = second.moving()
    assert seen.flight_id == first.call("status").flight_id
    assert "zero velocity" in second.call("stop").done
    assert not first.answer("fly", running.result(10)).refused
    first.until("on_ground")
    flooded(first, second)
    for assistant in (first, second):
        assistant.end()
    assert server.end() == 0 and not any(server.token in line for line in server.lines if "Token" not in line)
    # A token of the user's own is not printed.
    own = "a-token-of-my-own"
    server = Program("mcp", "--http", "127.0.0.1:0", *OFFICE, ready=r"MCP: (http\S+)", env={"SPF_MCP_TOKEN": own})
    assistant = by_http(SimpleNamespace(url=server.url, token=own))
    assert assistant.call("status").state == "on_ground"
    assistant.end()
    assert server.end() == 0 and not any(own in line or "Token" in line for line in server.lines), server.lines


def refused_requests(server):
    """Every request needs the token, and comes from no page."""
    right = {"Authorization": f"Bearer {server.token}", "Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
    ping = {"jsonrpc": "2.0", "id": 1, "method": "tools/list", "params": {}}
    wrong_token = right["Authorization"][:-1] + ("0" if server.token[-1] != "0" else "1")
    for name, codes, method, headers, path in (
        ("no token", {401}, "POST", {}, ""), ("a token in the address", {401}, "POST", {}, f"?token={server.token}"),
        ("a wrong token", {401}, "POST", right | {"Authorization": wrong_token}, ""),
        ("half a token", {401}, "POST", right | {"Authorization": right["Authorization"][:-16]}, ""),
        ("another scheme", {401}, "POST", right | {"Authorization": f"Basic {server.token}"}, ""),
        ("a page of another site", {403}, "POST", right | {"Origin": "http://elsewhere.example"}, ""),
        ("a page of a file", {403}, "POST", right | {"Origin": "null"}, ""),
        ("another name of this machine", {403, 421}, "POST", right | {"Host": "elsewhere.example"}, ""),
        ("reading", {400, 405}, "GET", right, ""), ("putting", {405}, "PUT", right, ""),
        ("a form", {415}, "POST", right | {"Content-Type": "text/plain"}, ""),
    ):
        content = None if method == "GET" else json.dumps(ping)
        response = httpx2.request(method, server.url + path, headers=headers, content=content, trust_env=False)
        assert response.status_code in codes, f"{name}: {response.status_code} {response.text}"
        assert "fly" not in response.text and server.token not in response.text, f"{name}: {response.text}"


def flooded(first, second):
    """Calls beyond what can mean anything are refused; in the middle of them a stop works."""
    first.call("take_off")
    poured = time.monotonic()
    flood = [first.start("status") for _ in range(300)]
    wait(lambda: any(call.done() for call in flood), "the first answers")
    began = time.monotonic()
    assert "zero velocity" in second.call("stop").done
    took = time.monotonic() - began
    answers = [first.answer("status", call.result(60)) for call in flood]
    # Ten a second are answered; a busy machine takes long for them all.
    passed = 10 * (time.monotonic() - poured) + 20
    refused = [answer.words for answer in answers if answer.refused]
    print(f"flood: {len(refused)} of {len(flood)} refused; stop answered after {1000 * took:.0f} ms")
    assert took < 1.5 and all(TOO_MANY in words for words in refused), f"{took} s: {refused[:3]}"
    assert len(refused) >= len(flood) - passed, f"{len(refused)} refused, {passed:.0f} may pass"
    second.until("on_ground")


SECRET = "what is elsewhere is nobody's business"
LETTERS = "aZ0 .,-/\\é世🚁\u202e\u0000\u2028\"'{}[]<>%&|;$`\n"


def fuzz():
    """7000 calls and lines of all kinds. Arguments are read before calls are counted, though most of those that can be read are refused."""
    began, chance = time.monotonic(), random.Random(1)
    outside = hidden()
    wire = Wire(*OFFICE)
    asked = set()
    for number in range(7000):
        kind = chance.random()
        if kind < 0.1:
            wire.write(malformed(chance))
            continue
        if kind < 0.2:
            method, params = chance.choice(METHODS), {} if chance.random() < 0.5 else {text(chance): thing(chance)}
        elif kind < 0.3:
            method, params = "resources/read", {"uri": address(chance, outside)}
        elif kind < 0.32:
            method, params = "tools/call", {"name": "stop", "arguments": {}}
        else:
            method, params = "tools/call", {"name": chance.choice([*FIELDS, text(chance)]), "arguments": {}}
            names = FIELDS.get(params["name"], ())
            params["arguments"] = {name: thing(chance) for name in names if chance.random() < 0.9}
            if chance.random() < 0.2:
                params["arguments"][text(chance)] = thing(chance)
        asked.add(wire.request(method, params))
        # As fast as it answers, with some at a time.
        if number % 50 == 0:
            wire.ask("ping", {})
    # What waits for a flight is answered when that is over.
    wire.call("stop")
    wait(lambda: all(json.dumps(number) in wire.answers for number in asked), "every answer", 90)
    assert wire.process.poll() is None and wire.strange == [], wire.strange[:5]
    assert all(len(wire.answers[json.dumps(number)]) == 1 for number in asked), "one answer each"
    counts = collections.Counter(outcome(wire.answers[json.dumps(number)][0]) for number in asked)
    assert SECRET not in json.dumps(list(wire.answers.values()), ensure_ascii=False), "a file outside was read"
    # The way to what may be read is open.
    assert "of ours" in json.dumps(wire.ask("resources/read", {"uri": "spf://flights/ours/summary.json"}))
    wire.until("on_ground")
    wire.process.stdin.close()
    assert wire.process.wait(60) == 0 and not any("panicked" in line for line in wire.told), wire.told[-5:]
    print(f"fuzz: {dict(counts)} in {time.monotonic() - began:.0f} s")


METHODS = [
    "tools/list", "prompts/list", "prompts/get", "resources/list", "resources/templates/list", "ping", "completion/complete",
    "logging/setLevel", "server/discover", "initialize", "tasks/list", "nothing/known", "", "tools/call\u0000",
]
FIELDS = {
    "fly": ("instruction", "wait_s", "scene"), "wait_flight": ("flight_id", "wait_s"), "get_flight": ("flight_id",),
    "take_off": ("scene",), "point": ("u", "v", "depth", "look", "frame"),
    "look": (), "status": (), "hold": (), "land": (), "stop": (), "list_flights": (), "list_scenes": (),
}


def hidden():
    """Files that must not be read, beside one that may, and links to them. Their addresses."""
    flight, outside = pathlib.Path("flights/ours"), pathlib.Path("outside").absolute()
    for folder in (flight, outside):
        folder.mkdir(parents=True)
    (flight / "summary.json").write_text('"of ours"')
    (outside / "summary.json").write_text(SECRET)
    (flight / "trajectory.svg").symlink_to(outside / "summary.json")
    pathlib.Path("flights/link").symlink_to(outside)
    (flight / "notes.txt").write_text(SECRET)
    return outside


def address(chance, outside):
    """Of a resource that is not there, or must not be read."""
    up, file = chance.choice(["..", "%2e%2e", "..%2f", "....//", "..\\", "ours/..", "./.."]), "summary.json"
    return chance.choice([
        f"spf://flights/{up}/outside/{file}", f"spf://flights/{up}/{up}/{outside}/{file}", f"spf://flights/ours/{up}/{up}/outside/{file}",
        f"spf://flights/{outside}/{file}", f"spf://flights//{outside}/{file}", f"spf://flights/link/{file}",
        "spf://flights/ours/trajectory.svg", "spf://flights/ours/notes.txt", f"spf://flights/ours/{file}\u0000",
        f"spf://docs/{up}/{up}/outside/{file}", f"spf://docs/{outside}/{file}", f"spf://scene/{up}", f"file://{outside}/{file}",
        f"{outside}/{file}", f"spf://flights/{text(chance)}/{file}", f"spf://{text(chance)}", text(chance),
    ])


def text(chance):
    return "".join(chance.choices(LETTERS, k=chance.choice([0, 1, 5, 40, 3000])))


def thing(chance):
    """A value of any kind, sometimes one that means something."""
    return chance.choice([
        lambda: None,
        lambda: chance.random() < 0.5,
        lambda: chance.choice([0, 1, -1, 5, 10, 255, 256, 2**31, 2**53 + 1, -2**63, 2**64, 10**40]),
        lambda: chance.choice([0.5, -0.0, 1e-320, 1e308, 1.5, chance.random()]),
        lambda: chance.choice(["NaN", "Infinity", "null", "1", PERSON, "office", "office@99999999999"]),
        lambda: chance.choice(["../outside", "ours", "link", "/etc/passwd", "left"]),
        lambda: text(chance),
        lambda: [thing(chance) for _ in range(chance.randrange(3))],
        lambda: {text(chance): thing(chance)},
    ])()


def malformed(chance):
    """A line that is no message, or that nobody waits for."""
    call = {"name": "status", "arguments": {"a": thing(chance)}}
    whole = json.dumps({"jsonrpc": "2.0", "id": "lost", "method": "tools/call", "params": call})
    return chance.choice([
        lambda: b"",
        lambda: whole[: chance.randrange(len(whole))].encode(),
        lambda: whole.replace('"2.0"', "2.0").encode(),
        lambda: whole.replace('"lost"', "NaN").encode(),
        lambda: chance.randbytes(chance.randrange(200)).replace(b"\n", b""),
        lambda: b"[" * 20000,
        lambda: b"{" + b'"a":{' * 5000,
        lambda: b"x" * 300000,
        lambda: json.dumps(thing(chance)).encode(),
        lambda: b'{"jsonrpc":"2.0","id":{},"method":"ping"}',
        lambda: b'{"jsonrpc":"2.0","id":"lost","result":{}}',
        lambda: b'{"jsonrpc":"2.0","method":"notifications/initialized"}',
        lambda: b'{"jsonrpc":"2.0","method":"notifications/cancelled","params":{"requestId":"never"}}',
    ])()


def outcome(answer):
    """Of what kind an answer is."""
    if "error" in answer:
        return answer["error"]["code"]
    result = answer["result"]
    if not result.get("isError"):
        return "done"
    return "too many" if TOO_MANY in result["content"][0]["text"] else "refused"


HOW = "nobody has armed the assistant"


def tello():
    """A virtual Tello; the operator also arms by typing."""
    served = Program("sim", "serve", "--tello", "--listen", own(1), "--scene", "office", "--quality", "draft", ready="UDP (127[^;]+)")
    real("tello", typed, "--drone", f"tello@{served.url}", env={"SPF_TELLO_LOCAL": own(2)})
    served.end()


def asked():
    """A client that asks its user arms for the words alone, in the revision that can ask."""
    served = Program("sim", "serve", "--tello", "--listen", own(1), "--scene", "office", "--quality", "draft", ready="UDP (127[^;]+)")
    env = {"HOME": str(pathlib.Path("state").absolute()), "SPF_TELLO_LOCAL": own(2)}
    questions, words = [], ["no", "arm tello"]

    async def typed_by_the_user(_context, question):
        questions.append(question.message)
        return ElicitResult(action="accept", content={"words": words[min(len(questions), 2) - 1]})

    args = ("--drone", f"tello@{served.url}", "--vlm", "human", "--no-video")
    for mode, asks_too in (("auto", ()), ("legacy", ("--ask-in-client",))):
        silent, _ = by_stdio(*args, *asks_too, mode=mode, env=env, asks=typed_by_the_user)
        silent.refused("take_off", "armed the assistant")
        silent.end()
    assert not questions, questions
    assistant, _ = by_stdio(*args, "--ask-in-client", env=env, asks=typed_by_the_user)
    assistant.refused("take_off", "did not type")
    assert "arm tello" in questions[0] and "not armed" in assistant.call("status").consent, questions
    assert assistant.call("take_off").state == "holding" and len(questions) == 2, questions
    assistant.call("land")
    assistant.until("on_ground")
    assistant.end()
    served.end()


def px4():
    """A virtual PX4 with a camera by RTSP."""
    link = f"{own(1)}:14540"
    views = ("--scene", "park", "--rtsp=127.0.0.1:0", "--quality", "draft")
    served = Program("sim", "serve", "--mavlink", "px4", "--mavlink-link", f"udpout:{link}", *views,
                     "--mavlink-param", "COM_OBL_RC_ACT=5", ready=r"--camera (rtsp://\S+)")
    camera = ("--camera", served.url, "--camera-fov", "90", "--camera-tilt", "5")
    real("px4", overruled, "--drone", f"mavlink@udpin:{link}", *camera)
    served.end()


def own(number):
    """The first or second address of this machine that is this process's alone."""
    process = os.getpid()
    return f"127.{64 + 64 * number | process >> 16 & 63}.{process >> 8 & 255}.{process & 255}"


def real(name, last, *drone, env=()):
    """A drone that is not the embedded simulator moves only by the consent of its operator, for one flight."""
    env = {**dict(env), "HOME": str(pathlib.Path("state").absolute())}
    assistant, told = by_stdio(*drone, "--cockpit=127.0.0.1:0", "--vlm", "human", "--no-video", env=env)
    address = wait(lambda: re.search(r"open (http\S+)", told.read_text()), "a cockpit")[1]
    unarmed(assistant)
    with sync_playwright() as playwright:
        page = page_of(playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"]), LAPTOP)
        page.goto(address)
        expect(page.locator("#phase")).to_have_text("ready")
        expect(page.get_by_role("button", name="Arm the assistant")).to_be_visible()
        shot(page, f"{name}-unarmed")
        accessible(page, "an assistant that may be armed")
        armed(assistant, page, name)
        unarmed(assistant)
        last(assistant, page, env)
        complain(name)
    assistant.end()


def armed(assistant, page, name):
    """A flight by one consent, which ends when the operator holds, and another one."""
    arms(page, assistant)
    # What cannot be flown uses nothing up.
    assistant.refused("fly", "no vision-language model", instruction=PERSON)
    assert assistant.call("take_off").state == "holding"
    phase(page, "held")
    picture_size(assistant.call("look").picture)
    points(page, assistant)
    shot(page, f"{name}-holding")
    accessible(page, "an assistant that holds")
    assistant.call("hold")
    taken(assistant, page)
    assistant.refused("point", HOW, u=0.5, v=0.5, depth=1)
    arms(page, assistant)
    points(page, assistant)
    assistant.call("land")
    phase(page, "landing")
    landed_and_seen(assistant, page)


def taken(assistant, page):
    """Whoever holds in the cockpit has the controls."""
    page.locator("#list-title").click()
    page.keyboard.press("Space")
    status = assistant.seen(lambda status: status.consent.startswith("not armed"), "a consent that is gone")
    assert status.state == "holding" and status.taken_over, status


def landed_and_seen(assistant, page):
    assistant.until("on_ground", 120)
    expect(page.locator("#ended")).to_be_visible()
    page.locator("#ended-close").click()


def unarmed(assistant):
    """What moves is refused, with what the operator has to do; what does not is answered."""
    status = assistant.call("status")
    assert status.real and status.state == "on_ground" and status.consent.startswith("not armed"), status
    assistant.refused("take_off", f"{HOW}.*Arm the assistant.*spf mcp arm")
    assistant.refused("fly", f"{HOW}|no vision-language model", instruction=PERSON)
    assistant.refused("point", "no flight", u=0.5, v=0.5, depth=1)
    assistant.refused("land", "no flight")
    assert "no flight" in assistant.call("stop").done
    looked = assistant.ask("look")
    # The last picture of the last flight, if there was one.
    assert looked.refused == (status.flight_id is None) and HOW not in looked.words, looked.words


def arms(page, assistant):
    """The operator presses the button: again where a busy machine has kept the page from answering for 0.7 s, so that the consent is lost
    with it."""
    for left in (3, 2, 1, 0):
        page.get_by_role("button", name="Arm the assistant").click()
        try:
            assistant.seen(lambda status: status.consent.startswith("armed"), "a consent", 20)
            return
        except AssertionError:
            if left == 0:
                raise


def points(page, assistant):
    """A short step that is flown. A page that a busy machine has kept from answering for 0.7 s counts as lost, and the consent with it."""
    for _ in range(4):
        step = assistant.ask("point", u=0.5, v=0.5, depth=1)
        if not step.refused and step.flown:
            break
        arms(page, assistant)
    assert not step.refused and step.flown and step.state == "holding", step
    picture_size(step.picture)


def typed(assistant, page, env):
    """Consent by words typed at a terminal, and by nothing else."""
    run = subprocess.run([SPF, "mcp", "arm"], env={**os.environ, **env}, input="arm tello\n", capture_output=True, text=True, timeout=60)
    assert run.returncode == 2 and "a person at a terminal" in run.stderr, run
    code, told = at_terminal("yes", env)
    assert code != 0 and "nothing is changed" in told, told
    unarmed(assistant)
    code, told = at_terminal("arm tello", env)
    assert code == 0 and "Armed for 10 min and one flight" in told, told
    assert assistant.call("status").consent.startswith("armed for one flight")
    assert assistant.call("take_off").state == "holding"
    assert "zero velocity" in assistant.call("stop").done
    assistant.refused("point", "stopped", u=0.5, v=0.5, depth=1)
    landed_and_seen(assistant, page)
    unarmed(assistant)


def overruled(assistant, page, _env):
    """Also of an operator who has the controls an assistant may stop the drone, which lands."""
    arms(page, assistant)
    assert assistant.call("take_off").state == "holding"
    taken(assistant, page)
    assert "zero velocity" in assistant.call("stop").done
    landed_and_seen(assistant, page)


def at_terminal(words, env):
    """Types them when `spf mcp arm` asks. Its exit code and what it says."""
    terminal, theirs = pty.openpty()
    streams = {"stdin": theirs, "stdout": theirs, "stderr": theirs}
    process = subprocess.Popen([SPF, "mcp", "arm"], env={**os.environ, **env}, **streams)
    os.close(theirs)
    said = []

    def listen():
        try:
            while data := os.read(terminal, 4096):
                said.append(data.decode(errors="replace"))
        except OSError:
            # The other side is gone.
            pass

    listener = threading.Thread(target=listen)
    listener.start()
    wait(lambda: "to go on:" in "".join(said) or process.poll() is not None, "the question")
    os.write(terminal, f"{words}\n".encode())
    code = process.wait(60)
    listener.join(60)
    os.close(terminal)
    return code, "".join(said)


def inspector():
    """The reference inspector finds nothing to complain about in the tools, and calls one."""
    program = [os.environ["SPF_MCP_INSPECTOR"], "--cli", SPF, "mcp", "--scene", "office"]
    run = subprocess.run([*program, "--method", "tools/list", "--strict"], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0 and {tool["name"] for tool in json.loads(run.stdout)["tools"]} == TOOLS, run
    found = re.search(r"(\d+) errors?, (\d+) warnings?", run.stderr)
    assert not found or found.groups() == ("0", "0"), run.stderr
    run = subprocess.run([*program, "--method", "tools/call", "--tool-name", "status"], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0 and json.loads(run.stdout)["structuredContent"]["state"] == "on_ground", run


PARTS = {part.__name__: part for part in (clients, stops, strangers, fuzz, tello, asked, px4, inspector)}
if sys.argv[2] == "caller":
    caller()
else:
    for part in sys.argv[2:]:
        began = time.monotonic()
        PARTS[part]()
        print(f"{part}: {time.monotonic() - began:.0f} s", flush=True)
