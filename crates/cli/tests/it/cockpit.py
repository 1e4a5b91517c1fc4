"""Flies in the cockpit with a browser: instruct, watch, hold, point, hand over, lose the connection, land; looks at recorded flights.

Arguments: the program, and optionally a folder for pictures of every state.
"""
import os
import pathlib
import re
import signal
import time

from cockpit_flights import clicks, tello
from cockpit_gestures import alarms, closing, cutting, stalled, touching
from cockpit_lab import ACROSS, LAPTOP, PHONE, Program, accessible, complain, page_of, phase, shot, wait
from playwright.sync_api import expect, sync_playwright


def fly(browser):
    program = Program("cockpit", "--cockpit=127.0.0.1:0", "--vlm", "oracle:perfect", "--seed", "3")
    page = page_of(browser)
    page.goto(program.url)
    assert "#" in program.url and "#" not in page.url, "the address shows no secret"
    phase(page, "ready")
    expect(page.locator("#role")).to_have_text("You fly")
    shot(page, "laptop-dark-ready")
    accessible(page, "ready")

    # What is not understood is not flown.
    page.get_by_label("Instruction").fill("qwertzuiop")
    page.keyboard.press("Enter")
    expect(page.locator("#reading")).to_contain_text("unknown word")

    page.get_by_label("Instruction").fill("fly to the red crane")
    page.keyboard.press("Enter")
    phase(page, "taking off")
    phase(page, "flying")
    page.wait_for_timeout(500)
    wait(lambda: page.locator("#list button").count() > 0, "a decision")
    wait(lambda: page.evaluate("document.getElementById('empty').hidden"), "a picture")
    shot(page, "laptop-dark-flying")
    assert page.evaluate("document.getElementById('picture').dataset.format") == "film"
    took = sorted(sample(page) for _ in range(30))
    print(f"from a frame's arrival to its pixels: median {took[15]} ms, greatest {took[-1]} ms of 30")
    accessible(page, "flying")
    assert "m" in page.locator("#height").inner_text()

    # Space holds, wherever the focus is, and the text box keeps its spaces.
    page.locator("#list button").first.focus()
    began = time.monotonic()
    page.keyboard.press("Space")
    phase(page, "held", 2)
    print(f"held {1000 * (time.monotonic() - began):.0f} ms after the key, {page.locator('#ack').inner_text()!r}")
    shot(page, "laptop-dark-held")
    accessible(page, "held")
    # The newest answer with a point: one that misses the target has none.
    answers = page.locator("#list button")
    for answer in range(answers.count()):
        answers.nth(answer).click()
        expect(page.locator("#opened-detail")).to_contain_text("Prompt")
        page.wait_for_timeout(300)
        if "White cross" in page.locator("#opened-picture p").inner_text():
            break
        page.get_by_role("button", name="Close", exact=True).click()
    # The point of the answer, and what is flown to: what the list says, and what the live picture shows.
    expect(page.locator("#opened-picture p")).to_contain_text("White cross")
    expect(page.locator("#opened-picture p")).to_contain_text("as in the live picture")
    page.wait_for_timeout(400)
    shot(page, "laptop-dark-decision")
    accessible(page, "decision opened")
    page.get_by_role("button", name="Close", exact=True).click()

    # A click that changes where it goes: the left edge, whatever the model wants.
    before = page.locator("#list button").count()
    page.get_by_role("button", name="Not that one, this").click()
    box = page.locator("#picture").bounding_box()
    page.mouse.click(box["x"] + 0.15 * box["width"], box["y"] + 0.5 * box["height"])
    wait(lambda: page.locator("#list button").count() > before, "the decision by the click", page=page)
    decided = page.locator("#list button").first.inner_text()
    print("by the click:", decided)
    assert re.search(r"at \(0\.[0-3]", decided), decided
    shot(page, "laptop-dark-pointed")

    avoid(page)
    page.get_by_label("Instruction").fill("fly to the church")
    page.keyboard.press("Enter")
    expect(page.locator("#reading")).to_contain_text("church")
    # What is sent with it for a drone that holds is nothing to warn of.
    page.wait_for_timeout(300)
    assert page.locator("#list .warning", has_text="ignored").count() == 0, page.locator("#list").inner_text()
    broken(page)
    spectate(browser, program, page)
    lose(program, page)

    # By hand: as long as a key is held.
    page.get_by_text("Fly by hand").click()
    page.locator("#list-title").click()
    page.keyboard.down("KeyD")
    phase(page, "by hand", 3)
    page.wait_for_timeout(300)
    shot(page, "laptop-dark-by-hand")
    accessible(page, "by hand")
    page.keyboard.up("KeyD")
    page.get_by_role("button", name="Resume").first.click()
    phase(page, "flying", 5)

    # Cutting the motors is offered for four seconds.
    page.get_by_role("button", name="Cut motors").click()
    expect(page.locator("#ring")).to_be_visible()
    expect(page.locator("#ring")).to_be_hidden(timeout=8000)

    # Escape lands.
    page.locator("#list-title").click()
    page.keyboard.press("Escape")
    phase(page, "landing", 3)
    expect(page.locator("#ended")).to_be_visible(timeout=30000)
    expect(page.locator("#ended-lines")).to_contain_text("operator")
    settled(page)
    shot(page, "laptop-dark-ended")
    accessible(page, "ended")
    page.get_by_role("button", name="Close", exact=True).click()
    phase(page, "ready")
    # The list of flights opens in a tab of its own, which gets the right to delete, and whose address shows nothing.
    addresses = []
    with page.context.expect_page() as opened:
        page.locator("#past").click()
    tab = opened.value
    tab.on("framenavigated", lambda frame: addresses.append(frame.url))
    wait(lambda: tab.evaluate("sessionStorage.getItem('key')"), "the right to delete")
    session = page.evaluate("sessionStorage.getItem('session')")
    assert session and not any(session in address for address in [tab.url, *addresses]) and "ask" not in tab.url, addresses
    tab.close()
    complain("flight", "Failed to load resource")
    assert program.end() == 5
    expect(page.locator("#alarm")).to_contain_text("ended")
    page.context.close()


def settled(page):
    """After the flight the figures are those of the result, and nothing warns of a drone that has landed."""
    lines = page.locator("#ended-lines").inner_text()
    flown, time_is = re.search(r"([0-9.]+ m) flown", lines)[1], re.search(r"Flight time until then: ([0-9:]+)", lines)[1]
    assert (page.locator("#flown").inner_text(), page.locator("#time").inner_text()) == (flown, time_is), lines
    page.wait_for_timeout(1500)
    for figure in ("link", "picture-age", "speed"):
        assert page.locator(f"#{figure}").inner_text() == "–", figure
    assert page.locator("dd.bad, dd.warn").count() == 0 and not page.locator("#age").is_visible()


def steady(page, what, place):
    """The picture, in which somebody may be aiming, is where it was, and as large."""
    now = page.locator("#picture").bounding_box()
    assert all(abs(now[side] - place[side]) < 0.5 for side in now), f"{what}: {place}, then {now}"


def avoid(page):
    """Places to keep away from: drawn with the mouse, and with the keyboard; removed. The picture stays where it is."""
    box = page.locator("#picture").bounding_box()
    for button in ("Not that one, this", "Keep away from"):
        page.get_by_role("button", name=button).click()
        for label in (1, 10, 5):
            page.locator("#distance").fill(str(label))
            steady(page, f"{button}, label {label}", box)
        page.get_by_role("button", name=button).click()
    at = lambda u, v: (box["x"] + u * box["width"], box["y"] + v * box["height"])
    page.mouse.move(*at(0.35, 0.3))
    page.mouse.down()
    page.mouse.move(*at(0.5, 0.5), steps=4)
    steady(page, "drawing", box)
    shot(page, "laptop-dark-drawing")
    page.mouse.move(*at(0.6, 0.7), steps=4)
    page.mouse.up()
    remove = page.get_by_role("button", name="Remove place 1")
    expect(remove).to_be_visible(timeout=5000)
    page.get_by_role("button", name="Keep away from").click()
    page.locator("#picture").focus()
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Shift+ArrowDown")
    page.evaluate("document.getElementById('manual').open = true")
    page.keyboard.press("Enter")
    expect(page.get_by_role("button", name="Remove place 2")).to_be_visible(timeout=5000)
    expect(page.locator("#ack")).to_contain_text("Place 2 is kept away from")
    # The arrow that comes too late flies nothing.
    expect(page.locator("#mark")).to_be_focused()
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(200)
    assert page.locator("#phase").inner_text() != "by hand"
    page.evaluate("document.getElementById('manual').open = false")
    # The buttons stay the same while their texts change.
    page.evaluate("globalThis.kept = document.querySelector('#marked-list button')")
    page.wait_for_timeout(600)
    assert page.evaluate("globalThis.kept === document.querySelector('#marked-list button') && globalThis.kept.isConnected")
    page.wait_for_timeout(300)
    shot(page, "laptop-dark-marked")
    steady(page, "marked", box)
    accessible(page, "places marked")
    for number in (1, 2):
        page.get_by_role("button", name=f"Remove place {number}").click()
        expect(page.locator("#ack")).to_contain_text(f"Place {number} removed")
    expect(page.locator("#marked")).to_be_hidden(timeout=5000)
    steady(page, "removed", box)


def broken(page):
    """An order to stop is sent and its answer shown, whatever fails on the page; here everything that is drawn over the picture."""
    # An expression whose value is a function would be called.
    page.evaluate("""() => {
        globalThis.clip = CanvasRenderingContext2D.prototype.clip;
        CanvasRenderingContext2D.prototype.clip = () => { throw new Error("broken on purpose"); };
    }""")
    if page.get_by_role("button", name="Resume").first.is_visible():
        page.get_by_role("button", name="Resume").first.click()
        phase(page, "flying", 5)
    page.get_by_role("button", name="Hold", exact=True).click()
    expect(page.locator("#ack")).to_contain_text("Hold: received", timeout=3000)
    phase(page, "held", 3)
    page.evaluate("() => { CanvasRenderingContext2D.prototype.clip = globalThis.clip; }")
    page.wait_for_timeout(200)
    complain("broken", "broken on purpose")


def sample(page):
    page.wait_for_timeout(60)
    return int(page.evaluate("document.getElementById('picture').dataset.latency"))


def spectate(browser, program, pilot):
    """Another page watches, asks, and gets the controls by consent."""
    other = page_of(browser, PHONE, "light", is_mobile=True, has_touch=True)
    other.goto(program.url.split("#")[0])
    expect(other.locator("#role")).to_have_text("Watching")
    assert not other.locator("#hold").is_visible() and not other.locator("#instruction").is_visible()
    wait(lambda: other.evaluate("document.getElementById('empty').hidden"), "a picture for the spectator")
    shot(other, "phone-light-watching")
    accessible(other, "watching")
    other.get_by_role("button", name="Ask for the controls").click()
    expect(pilot.locator("#handover")).to_be_visible()
    shot(pilot, "laptop-dark-handover")
    accessible(pilot, "handover")
    pilot.get_by_role("button", name="Hand over").click()
    expect(other.locator("#role")).to_contain_text("You fly")
    expect(pilot.locator("#role")).to_have_text("Watching")
    phase(other, "held")
    for stop in ("#hold", "#land", "#cut"):
        size = other.locator(stop).bounding_box()
        assert size["height"] >= 44 and size["width"] >= 44, (stop, size)
    wide = other.evaluate("document.documentElement.scrollWidth")
    assert wide <= PHONE["width"], f"the page is {wide} px wide on a phone"
    shot(other, "phone-light-flying")
    accessible(other, "phone")
    other.set_viewport_size(ACROSS)
    other.wait_for_timeout(300)
    shot(other, "phone-light-across")
    other.get_by_role("button", name="Resume").first.tap()
    # And back.
    pilot.get_by_role("button", name="Ask for the controls").click()
    other.get_by_role("button", name="Hand over").tap()
    expect(pilot.locator("#role")).to_contain_text("You fly")
    other.context.close()
    pilot.get_by_role("button", name="Resume").first.click()


def lose(program, page):
    """A program that says nothing is noticed within a second."""
    for attempt in range(3):
        page.evaluate("""() => {
            const alarm = document.getElementById("alarm");
            globalThis.noticed = new Promise((tell) => {
                new MutationObserver(() => alarm.hidden || tell(Date.now())).observe(alarm, { attributes: true });
            });
        }""")
        began = time.time()
        program.process.send_signal(signal.SIGSTOP)
        noticed = page.evaluate("globalThis.noticed") / 1000 - began
        print(f"lost connection shown after {noticed:.2f} s")
        if attempt == 0:
            shot(page, "laptop-dark-lost")
            accessible(page, "lost")
        program.process.send_signal(signal.SIGCONT)
        expect(page.locator("#alarm")).to_be_hidden(timeout=8000)
        # Once more if the machine was busy with something else.
        if noticed < 1:
            break
    assert noticed < 1, noticed
    page.wait_for_timeout(1500)
    if page.get_by_role("button", name="Resume").first.is_visible():
        page.get_by_role("button", name="Resume").first.click()


def point(browser):
    """See, Point, Fly without a model: a phone, in the light, by tapping only."""
    program = Program("fly", "fly to the church", "--cockpit=127.0.0.1:0", "--vlm", "human", "--no-video")
    page = page_of(browser, PHONE, "light", is_mobile=True, has_touch=True)
    page.goto(program.url)
    expect(page.locator("#question")).to_be_visible(timeout=30000)
    wait(lambda: page.evaluate("document.getElementById('empty').hidden"), "a picture to tap on")
    shot(page, "phone-light-question")
    accessible(page, "question")
    # A page that was busy with that for too long counts as lost, and the drone holds.
    page.wait_for_timeout(1000)
    if page.locator("#resume").is_visible():
        page.locator("#resume").tap()
        expect(page.locator("#resume")).to_be_hidden()
    expect(page.locator("#question")).to_be_visible(timeout=30000)
    box = page.locator("#picture").bounding_box()
    page.touchscreen.tap(box["x"] + 0.7 * box["width"], box["y"] + 0.5 * box["height"])
    wait(lambda: page.locator("#list button").count() > 0, "a decision", page=page)
    assert re.search(r"0\.7", page.locator("#list button").first.inner_text())
    expect(page.locator("#question")).to_be_visible(timeout=30000)
    # With the keyboard: aim, and point.
    page.locator("#picture").focus()
    for _ in range(5):
        page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Enter")
    wait(lambda: page.locator("#list button").count() > 1, "a decision by keys")
    shot(page, "phone-light-tapped")
    page.locator("#land").tap()
    phase(page, "landing", 3)
    assert program.process.wait(timeout=90) == 5
    complain("by tapping")
    page.context.close()


def look(browser):
    program = Program("cockpit", "--view", "flights", "--cockpit=127.0.0.1:0")
    for size, scheme in ((LAPTOP, "light"), (PHONE, "dark")):
        page = page_of(browser, size, scheme)
        page.goto(program.url)
        name = f"{'laptop' if size is LAPTOP else 'phone'}-{scheme}"
        expect(page.locator(".card").first).to_be_visible()
        page.wait_for_timeout(1500)
        shot(page, f"{name}-flights")
        accessible(page, "flights")
        # Named after its first instruction; the later ones follow.
        card = page.locator(".card").filter(has_text="then: fly to the church").first
        expect(card.locator("strong")).to_have_text("fly to the red crane")
        facts = card.inner_text()
        card.click()
        expect(page.locator("#title")).to_have_text("fly to the red crane → fly to the church")
        flown = page.locator("#facts dt", has_text="flown").locator("+ dd").inner_text()
        assert flown in facts, (flown, facts)
        # The map shows where somebody marked places, and the controls of the film hide none of its image.
        map_text = page.evaluate("fetch(document.getElementById('map-image').src).then((answer) => answer.text())")
        assert "keep away 1: from" in map_text and "keep away 2: from" in map_text
        film = page.locator("#film").bounding_box()
        assert film["height"] >= 0.75 * film["width"] + 70, film
        expect(page.locator("#steps button").first).to_be_visible()
        page.locator("#steps button").last.click()
        page.wait_for_timeout(1200)
        at = page.evaluate("document.getElementById('film').currentTime")
        assert at > 1, f"the film is at {at} s"
        page.get_by_role("button", name="Replay it").click()
        expect(page.locator("#replayed")).to_contain_text("No difference", timeout=60000)
        page.evaluate("scrollTo(0, 0)")
        shot(page, f"{name}-flight")
        accessible(page, "a flight")
        page.context.close()
    # Deleted only by who has the key, and only if they are sure.
    count = len(list(pathlib.Path("flights").iterdir()))
    page = page_of(browser, LAPTOP, "dark")
    page.goto(program.url.split("#")[0])
    page.locator(".card").first.click()
    expect(page.locator("#steps")).to_be_visible()
    expect(page.locator("#delete")).to_be_hidden()
    assert page.evaluate("fetch('/flight/' + location.hash.slice(1), { method: 'DELETE' }).then((answer) => answer.status)") == 403
    expect(page.locator("#again")).to_be_hidden()
    complain("delete", "403")
    page.goto(program.url)
    page.reload()
    page.locator(".card").first.click()
    page.get_by_role("button", name="Delete this flight").click()
    page.get_by_role("button", name="Keep it").click()
    page.get_by_role("button", name="Delete this flight").click()
    shot(page, "laptop-dark-delete")
    accessible(page, "delete a flight")
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.locator("#told")).to_contain_text("deleted")
    assert len(list(pathlib.Path("flights").iterdir())) == count - 1
    page.context.close()
    complain("flights")
    assert program.end() == 0


def strange(browser):
    """Another site's page, a rebound name: refused; a second tab only watches."""
    program = Program("cockpit", "--cockpit=127.0.0.1:0", "--scene", "yard")
    port = re.search(r":(\d+)/", program.url)[1]
    page = browser.new_context().new_page()
    assert page.goto(f"http://rebound.example:{port}/").status == 403
    page.goto("about:blank")
    told = page.evaluate(f"""new Promise((tell) => {{
        const socket = new WebSocket("ws://127.0.0.1:{port}/control");
        socket.onopen = () => tell("open");
        socket.onerror = () => tell("refused");
    }})""")
    assert told == "refused", told
    page.context.close()
    hidden(browser, program)
    program.end()


def hidden(browser, program):
    """A hidden tab, whose timers a browser slows down to one in a second or in a minute, is not lost: its socket answers."""
    page = browser.new_context().new_page()
    page.add_init_script("""{
        const slow = (timer) => (then, after, ...rest) => timer(then, Math.max(60000, after ?? 0), ...rest);
        [globalThis.setInterval, globalThis.setTimeout] = [slow(globalThis.setInterval), slow(globalThis.setTimeout)];
        Object.defineProperty(document, "hidden", { get: () => true });
    }""")
    page.goto(program.url)
    expect(page.locator("#role")).to_have_text("You fly")
    other = browser.new_context().new_page()
    other.goto(program.url.split("#")[0])
    expect(other.locator("#role")).to_have_text("Watching")
    # A second tab with the whole address does not take the controls either.
    second = browser.new_context().new_page()
    second.goto(program.url)
    expect(second.locator("#role")).to_have_text("Watching")
    assert not second.locator("#hold").is_visible()
    for _ in range(10):
        other.wait_for_timeout(250)
        # "Take the controls" would be offered.
        assert other.locator("#ask").inner_text() == "Ask for the controls"
    for opened in (page, other, second):
        opened.context.close()


def secure(browser):
    """Outside of this machine: encrypted, and the same checks; JPEG where the browser has no decoder."""
    # No file may grow past 12 KiB, as on a full disk.
    program = Program("cockpit", "--cockpit=0.0.0.0:0", "--scene", "yard", "--vlm", "oracle:perfect",
                      within=("sh", "-c", "trap '' XFSZ; ulimit -f 24; exec \"$0\" \"$@\""))
    wait(lambda: any(re.fullmatch(r"\s*([0-9A-F]{2}:){31}[0-9A-F]{2}", line) for line in program.lines), "a fingerprint")
    port = re.search(r":(\d+)/", program.url)[1]
    here = program.url.replace(re.search(r"//([^/:]+)", program.url)[1], "127.0.0.1")
    refused = browser.new_context().new_page()
    try:
        refused.goto(here)
        raise AssertionError("nobody vouches for its certificate")
    except Exception as error:
        assert "ERR_CERT_AUTHORITY_INVALID" in str(error), error
    page = page_of(browser, PHONE, "dark", ignore_https_errors=True, is_mobile=True, has_touch=True)
    assert page.goto(f"https://rebound.example:{port}/").status == 403
    complain("rebound", "403")
    page.goto(here)
    expect(page.locator("#role")).to_have_text("You fly")
    assert page.evaluate("isSecureContext")
    page.get_by_label("Instruction").fill("fly to the vending machine")
    page.keyboard.press("Enter")
    phase(page, "flying")
    wait(lambda: page.evaluate("document.getElementById('picture').dataset.format") == "film", "a picture")
    shot(page, "phone-dark-flying")
    # A spectator's page whose browser cannot decode.
    watch = next(m[1] for m in (re.search(r"To watch only: (\S+)", line) for line in program.lines) if m)
    other = page_of(browser, ACROSS, "dark", ignore_https_errors=True)
    other.add_init_script("delete globalThis.VideoDecoder")
    other.goto(watch.replace(re.search(r"//([^/:]+)", watch)[1], "127.0.0.1"))
    wait(lambda: other.evaluate("document.getElementById('picture').dataset.format") == "jpeg", "a JPEG")
    shot(other, "phone-dark-across-watching")
    page.locator("#land").tap()
    phase(page, "landing", 3)
    expect(page.locator("#ended")).to_be_visible(timeout=30000)
    # What could not be recorded is told: with its cause to who flew, without to who watched.
    expect(page.locator("#ended-lines .problem").first).to_contain_text("recording failed: cannot write")
    shot(page, "phone-dark-not-recorded")
    expect(other.locator("#ended-lines .problem")).to_have_text("The recording of this flight is not complete.")
    # Of the rebound page, whose icon was asked for a little later.
    complain("encrypted", "403")
    program.end()
    page.context.close()
    other.context.close()


with sync_playwright() as playwright:
    browser = playwright.chromium.launch(
        executable_path="/usr/bin/chromium",
        args=["--no-sandbox", "--host-resolver-rules=MAP rebound.example 127.0.0.1", "--autoplay-policy=no-user-gesture-required"],
    )
    only = os.environ.get("SPF_COCKPIT_ONLY", "").split()
    for part in (fly, point, tello, clicks, look, strange, secure, cutting, touching, stalled, closing, alarms):
        if not only or part.__name__ in only:
            began = time.monotonic()
            part(browser)
            print(f"{part.__name__}: {time.monotonic() - began:.1f} s")
    browser.close()
