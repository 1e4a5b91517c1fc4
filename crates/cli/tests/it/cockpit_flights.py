"""Whole flights in the cockpit: of a drone over sockets, and by clicks alone."""
import math
import re
import socket

from cockpit_lab import LAPTOP, PHONE, Program, accessible, complain, page_of, phase, shot, wait
from playwright.sync_api import expect


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def tello(browser):
    """The virtual Tello over its own protocol: an instruction typed, a click that changes where it goes, hold, land."""
    port = free_port()
    served = Program("sim", "serve", "--tello", "--listen", "127.0.0.161", "--scene", "office", "--vlm", "--vlm-listen",
                     f"127.0.0.1:{port}", ready=r"(http://127\S+)")
    program = Program("cockpit", "--cockpit=127.0.0.1:0", "--drone", "tello@127.0.0.161", "--no-vlm-check", "--no-video",
                      "--vlm", f"openai@http://127.0.0.1:{port}/v1", env={"OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": "127.0.0.162"})
    page = page_of(browser, LAPTOP, "light")
    page.goto(program.url)
    phase(page, "ready")
    page.get_by_label("Instruction").fill("go to the person in the green shirt")
    page.keyboard.press("Enter")
    phase(page, "flying", 60)
    wait(lambda: page.locator("#list button").count() > 0, "a decision")
    assert page.evaluate("document.getElementById('picture').dataset.format") == "film"
    shot(page, "laptop-light-tello")
    before = page.locator("#list button").count()
    heading = int(page.locator("#heading").inner_text()[:3])
    page.get_by_text("Not that one, this").click()
    box = page.locator("#picture").bounding_box()
    page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + 0.5 * box["height"])
    wait(lambda: any(re.search(r"at \(0\.[89]|at \(1", text) for text in page.locator("#list button").all_inner_texts()[:3]), "the decision by the click")
    turned = lambda: (int(page.locator("#heading").inner_text()[:3]) - heading + 180) % 360 - 180
    wait(lambda: turned() >= 8, "it turns to the right")
    print(f"decisions before the click: {before}; it turned by {turned()}° to the right")
    page.keyboard.press("Space")
    phase(page, "held", 3)
    shot(page, "laptop-light-tello-held")
    page.keyboard.press("Escape")
    phase(page, "landing", 3)
    expect(page.locator("#ended")).to_be_visible(timeout=40000)
    shot(page, "laptop-light-tello-ended")
    complain("tello")
    program.end()
    served.end()
    page.context.close()


# The red things in the picture: where they are, and how wide the mast is.
RED = """() => {
    const canvas = document.getElementById("picture");
    const { width, height } = canvas;
    const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
    const columns = new Array(width).fill(0);
    let count = 0, rows = 0;
    for (let y = 0; y < height; y += 2) {
        for (let x = 0; x < width; x += 2) {
            const at = 4 * (y * width + x);
            const [r, g, b] = [data[at], data[at + 1], data[at + 2]];
            if (r > 80 && r > 1.9 * g && r > 1.9 * b) { columns[x] += 1; count += 1; rows += y; }
        }
    }
    const most = Math.max(...columns);
    const tall = columns.flatMap((n, x) => (n > 0.45 * most ? [x] : []));
    if (count < 30) return { count };
    return { count, u: tall[tall.length >> 1] / width, v: rows / count / height, wide: (tall[tall.length - 1] - tall[0]) / width };
}"""


def clicks(browser):
    """See, Point, Fly without a model, to the end: somebody sees the red crane, clicks on it, and says when it is reached."""
    program = Program("fly", "fly to the red crane", "--cockpit=127.0.0.1:0", "--vlm", "human", "--no-video")
    page = page_of(browser, LAPTOP, "dark")
    page.goto(program.url)
    made = 0
    for _ in range(40):
        wait(lambda: page.locator("#question").is_visible() or page.locator("#ended").is_visible(), "a question", 40)
        if page.locator("#ended").is_visible():
            break
        page.wait_for_timeout(300)
        red = page.evaluate(RED)
        made += 1
        if red["count"] < 30:
            page.get_by_role("button", name="It is to the right").click()
        else:
            # The mast is 2 m wide, and half of the picture as wide as it is far.
            away = 1 / max(red["wide"], 0.004)
            if away < 5.5:
                page.get_by_role("button", name="We are there").click()
            else:
                label = max(1, min(10, round(1 + 4.5 * math.log10(away))))
                page.locator("#distance").fill(str(label))
                box = page.locator("#picture").bounding_box()
                page.mouse.click(box["x"] + red["u"] * box["width"], box["y"] + min(0.55, red["v"]) * box["height"])
                if made == 3:
                    shot(page, "laptop-dark-clicks")
            print(f"{made}: {red['u']:.2f}, {red['v']:.2f}, mast {red['wide']:.3f} wide, {away:.1f} m")
        page.wait_for_timeout(500)
    expect(page.locator("#ended-lines")).to_contain_text("reached", timeout=40000)
    shot(page, "laptop-dark-clicks-ended")
    accessible(page, "reached by clicks")
    print("by clicks:", page.locator("#ended-lines").inner_text().replace("\n", " | "), f"after {made} clicks")
    assert program.process.wait(timeout=60) == 0, program.lines[-5:]
    complain("by clicks")
    page.context.close()
