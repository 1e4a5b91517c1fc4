"""What the cockpit's browser tests share: programs, pages, pictures of them, checks."""
import atexit
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

# On a machine that does other things too everything takes longer.
expect.set_options(timeout=20000)
SPF = sys.argv[1]
SHOTS = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
LAPTOP, PHONE, ACROSS = {"width": 1280, "height": 800}, {"width": 390, "height": 844}, {"width": 844, "height": 390}


class Program:
    """A running `spf`, its lines, and the address that it prints."""

    def __init__(self, *args, ready=r"open (https?://\S+)", env=(), within=()):
        quiet = {"stdout": subprocess.DEVNULL, "stdin": subprocess.DEVNULL}
        self.process = subprocess.Popen([*within, SPF, *args], stderr=subprocess.PIPE, text=True, env={**os.environ, **dict(env)}, **quiet)
        # However the test ends.
        atexit.register(self.process.kill)
        self.lines = []
        threading.Thread(target=self.read, daemon=True).start()
        found = lambda: next((m for m in (re.search(ready, line) for line in self.lines) if m), None)
        try:
            self.url = wait(found, "an address")[1]
        except AssertionError:
            raise AssertionError(f"never: {ready} in {self.lines}")

    def read(self):
        for line in self.process.stderr:
            self.lines.append(line.rstrip())

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=30)


def wait(what, name, seconds=120, page=None):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = what()
        if found:
            return found
        time.sleep(0.05)
    told = page and page.evaluate("['ack', 'phase', 'list'].map((id) => document.getElementById(id).innerText.slice(0, 900))")
    raise AssertionError(f"never: {name}; the page shows {told}")


complaints = []


def ours(request):
    """Everything comes from the program: the page works in a field without a network."""
    if not re.match(r"(blob|data):|(http|ws)s?://(127\.0\.0\.1|rebound\.example):", request.url):
        complaints.append(f"asked elsewhere: {request.url}")


def page_of(browser, size=LAPTOP, scheme="dark", **options):
    page = browser.new_context(viewport=size, color_scheme=scheme, reduced_motion="reduce", **options).new_page()
    page.on("console", lambda message: complaints.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", ours)
    return page


def shot(page, name):
    if SHOTS:
        SHOTS.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=SHOTS / f"{name}.png")


def accessible(page, state):
    results = Axe().run(page)
    found = [(violation["id"], violation["nodes"][0]["html"]) for violation in results.response["violations"]]
    assert not found, f"{state}: {found}"


def phase(page, words, seconds=60):
    expect(page.locator("#phase")).to_have_text(re.compile(words), timeout=1000 * seconds)


def complain(state, allowed=""):
    """No console error, no violation of the content security policy and nothing asked elsewhere so far."""
    found = [text for text in complaints if not (allowed and re.search(allowed, text))]
    complaints.clear()
    assert not found, f"{state}: {found}"
