"""An assistant flies by `spf mcp`, with PyPI's client of the protocol, by hand-written messages, and with an operator at the cockpit.

Arguments: the program, and parts of this: clients, stops, strangers, fuzz, tello, px4, inspector.
"""
import sys

# This script has the name of the package that it needs: its own folder is looked at last.
sys.path.append(sys.path.pop(0))

import asyncio
import atexit
import base64
import io
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import threading
import time
import urllib.error
import urllib.request
from types import SimpleNamespace

import cockpit_lab
import httpx2
import jsonschema
from cockpit_lab import LAPTOP, SPF, Program, accessible, complain, page_of, phase, shot, wait
from mcp import Client, StdioServerParameters
from mcp.client.stdio import stdio_client
from mcp.client.streamable_http import streamable_http_client
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

    def __init__(self, transport, mode="auto"):
        self.client = Client(transport, mode=mode)
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
        words = " ".join(part.text for part in result.content if part.type == "text")
        if not result.is_error:
            jsonschema.validate(result.structured_content, self.tools[tool].output_schema)
        pictures = [base64.b64decode(part.data) for part in result.content if part.type == "image"]
        return SimpleNamespace(words=words, refused=result.is_error, picture=next(iter(pictures), None), **(result.structured_content or {}))

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

    def until(self, state, seconds=60):
        """The status in which the craft is in this state."""
        return self.seen(lambda status: status.state == state, state, seconds)

    def seen(self, is_so, name, seconds=60):
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
        return self.seen(lambda status: status.state == "flying" and (status.speed_m_s or 0) > 0.3, "a flight that moves")


def by_stdio(*args, mode="auto", folder=".", env=()):
    """A client that starts its server, and the file with what that prints."""
    told = pathlib.Path(f"told-{time.monotonic_ns()}.txt").absolute()
    server = StdioServerParameters(command=SPF, args=["mcp", *args], cwd=folder, env=dict(env))
    return Assistant(stdio_client(server, errlog=told.open("w")), mode), told


def by_http(server, mode="auto"):
    """One more client of a server."""
    headers, patience = {"Authorization": f"Bearer {server.token}"}, httpx2.Timeout(30, read=300)
    client = httpx2.AsyncClient(headers=headers, timeout=patience, trust_env=False)
    return Assistant(streamable_http_client(server.url, http_client=client), mode)


def http_server(*args, **options):
    server = Program("mcp", "--http", "127.0.0.1:0", *args, ready=r"MCP: (http\S+)", **options)
    server.token = wait(lambda: next((line.split()[-1] for line in server.lines if line.startswith("Token: ")), None), "a token")
    return server


class Wire:
    """A client of a server over standard input and output, by hand-written messages."""

    def __init__(self, *args):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen([SPF, "mcp", *args], **pipes)
        atexit.register(self.process.kill)
        self.answers, self.notes, self.strange, self.told, self.number = {}, [], [], [], 0
        for work in (self.read, self.drain):
            threading.Thread(target=work, daemon=True).start()
        client = {"protocolVersion": MODES["legacy"], "capabilities": {}, "clientInfo": {"name": "wire", "version": "1"}}
        self.ask("initialize", client)
        self.send({"jsonrpc": "2.0", "method": "notifications/initialized"})

    def read(self):
        for line in self.process.stdout:
            self.take(line)

    def take(self, line):
        try:
            message = json.loads(line)
            assert message["jsonrpc"] == "2.0"
            if "method" in message:
                self.notes.append(message)
                return
            assert ("result" in message) != ("error" in message)
            assert "result" in message or isinstance(message["error"]["code"], int) and isinstance(message["error"]["message"], str)
            self.answers.setdefault(json.dumps(message["id"]), []).append(message)
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
