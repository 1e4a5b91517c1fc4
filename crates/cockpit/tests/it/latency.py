"""Reads the clock in the live picture at every animation frame. Arguments: the cockpit's address, and `film` or `jpeg`.

With `flight` instead: prints which frame of a flight was seen when, milliseconds since 1970, as JSON."""
import json
import sys

from playwright.sync_api import sync_playwright

URL, FORMAT = sys.argv[1:]
COUNT = 150

LOOK = """(count) => new Promise((done) => {
    const canvas = document.getElementById("picture");
    const context = canvas.getContext("2d");
    const ages = [];
    let last = 0;
    function look() {
        const row = context.getImageData(0, Math.round(12 * canvas.height / 720), canvas.width, 1).data;
        let clock = 0;
        for (let bit = 31; bit >= 0; bit--) {
            const x = Math.round((96 + 24 * bit + 12) * canvas.width / 960);
            clock = clock * 2 + (row[4 * x] > 127 ? 1 : 0);
        }
        if (clock !== last) {
            last = clock;
            const age = Date.now() % 2 ** 32 - clock;
            // A picture that was replaced while it was read.
            if (age >= 0 && age < 10000) ages.push(age);
        }
        if (ages.length < count) requestAnimationFrame(look);
        else done({ ages, format: canvas.dataset.format, size: canvas.width });
    }
    look();
})"""

# The frame's number is set when its pixels are drawn; from then on an animation frame shows them.
FRAMES = """(seconds) => new Promise((done) => {
    const canvas = document.getElementById("picture");
    const [seen, began] = [[], performance.now()];
    let last;
    function look() {
        if (canvas.dataset.frame !== last) {
            last = canvas.dataset.frame;
            seen.push([Number(last), Date.now() % 2 ** 32, Number(canvas.dataset.latency)]);
        }
        if (performance.now() - began < 1000 * seconds) requestAnimationFrame(look);
        else done({ seen, format: canvas.dataset.format, size: canvas.width, rate: seen.length / seconds });
    }
    look();
})"""

with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    if FORMAT == "jpeg":
        page.add_init_script("delete globalThis.VideoDecoder")
    page.goto(URL)
    page.wait_for_selector("#empty", state="hidden")
    if FORMAT == "flight":
        # Chromium compiles and warms up.
        page.wait_for_timeout(5000)
        print(json.dumps(page.evaluate(FRAMES, 12)))
        browser.close()
        sys.exit()
    # Chromium compiles and warms up.
    page.evaluate(LOOK, 60)
    seen = page.evaluate(LOOK, COUNT)
    ages = sorted(seen["ages"])
    print(f"{FORMAT}, {seen['size']} px wide: {ages[len(ages) // 2]} ms median, {ages[len(ages) * 95 // 100]} ms 95th percentile of {len(ages)} pictures")
    assert seen["format"] == FORMAT, seen["format"]
    assert ages[len(ages) // 2] < 500, ages
    browser.close()
