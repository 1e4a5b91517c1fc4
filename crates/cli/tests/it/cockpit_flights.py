"""Whole flights in the cockpit: of a drone over sockets, and by clicks alone."""
import math
import re

from cockpit_lab import LAPTOP, PHONE, Program, accessible, complain, page_of, phase, shot, wait
from playwright.sync_api import expect


def resumed(page):
    """Resumes if the drone holds. A page that a busy machine has kept from answering for 0.7 s counts as lost."""
    if page.locator("#resume").is_visible():
        page.locator("#resume").click()
    return True


def tello(browser):
    """The virtual Tello over its own protocol: an instruction typed, a click that changes where it goes, hold, land."""
    served = Program("sim", "serve", "--tello", "--listen", "127.0.0.201", "--scene", "office", "--quality", "draft",
                     "--vlm", "--vlm-listen", "127.0.0.1:0", ready=r"(http://127[^\s/]+)/v1")
    program = Program("cockpit", "--cockpit=127.0.0.1:0", "--drone", "tello@127.0.0.201", "--no-vlm-check", "--no-video",
                      "--vlm", f"openai@{served.url}/v1", env={"OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": "127.0.0.202"})
    page = page_of(browser, LAPTOP, "light")
    page.goto(program.url)
    phase(page, "ready")
    page.get_by_label("Instruction").fill("go to the person in the green shirt")
    page.keyboard.press("Enter")
    wait(lambda: resumed(page) and page.locator("#list button").count() > 0, "a decision", seconds=120, page=page)
    assert page.evaluate("document.getElementById('picture').dataset.format") == "film"
    shot(page, "laptop-light-tello")
    before = page.locator("#list button").count()
    heading = int(page.locator("#heading").inner_text()[:3])
    # Every heading that the page shows: the model answers again at once, and the craft turns back.
    page.evaluate("""() => {
        const shown = document.getElementById("heading");
        window.headings = [];
        new MutationObserver(() => window.headings.push(shown.innerText))
            .observe(shown, { childList: true, characterData: true, subtree: true });
    }""")
    turns = lambda: [(int(text[:3]) - heading + 180) % 360 - 180 for text in page.evaluate("window.headings")]
    turned = lambda: max(turns(), default=0)
    rows = lambda: page.locator("#list button").all_inner_texts()
    by_click = lambda: next((row for row in rows() if re.search(r"at \(0\.8", row)), None)
    # A drone that holds takes no click.
    for _ in range(4):
        resumed(page)
        page.get_by_role("button", name="Not that one, this").click()
        # So near that no chair is in the way, around which the step would lead.
        page.locator("#distance").fill("2")
        box = page.locator("#picture").bounding_box()
        page.mouse.click(box["x"] + 0.85 * box["width"], box["y"] + 0.5 * box["height"])
        try:
            decided = wait(by_click, "the decision by the click", seconds=15, page=page)
            break
        except AssertionError as error:
            decided = str(error)
    # By its own step, or to where the target is estimated to be by all replies so far.
    assert "yaw +" in decided or "target estimated" in decided, decided
    # What the model flies to stands a little to the left, and it answers again.
    wait(lambda: resumed(page) and turned() >= 3, "it turns to the right", page=page)
    print(f"decisions before the click: {before}; by it: {decided!r}; it turned by {turned()}° to the right")
    page.keyboard.press("Space")
    phase(page, "held", 10)
    shot(page, "laptop-light-tello-held")
    page.keyboard.press("Escape")
    phase(page, "landing", 10)
    expect(page.locator("#ended")).to_be_visible(timeout=40000)
    shot(page, "laptop-light-tello-ended")
    complain("tello")
    program.end()
    served.end()
    page.context.close()


# The mast in the picture, the tallest red thing: where its middle is, and how wide it is, as parts of the picture.
RED = """() => {
    const canvas = document.getElementById("picture");
    const { width, height } = canvas;
    const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
    const columns = new Array(width).fill(0);
    for (let y = 0; y < height; y += 1) {
        for (let x = 0; x < width; x += 1) {
            const at = 4 * (y * width + x);
            const [r, g, b] = [data[at], data[at + 1], data[at + 2]];
            if (r > 110 && r - g > 55 && r - b > 40 && Math.abs(g - b) < 45) columns[x] += 1;
        }
    }
    const most = Math.max(...columns);
    const gap = width / 60;
    let left = columns.indexOf(most), right = left;
    for (let x = left; x >= 0 && left - x <= gap; x--) if (columns[x] > 0.15 * most) left = x;
    for (let x = right; x < width && x - right <= gap; x++) if (columns[x] > 0.15 * most) right = x;
    return { tall: most / height, u: (left + right) / 2 / width, wide: (right - left + 1) / width };
}"""


def clicks(browser):
    """See, Point, Fly without a model, to the end: somebody sees the red crane, clicks on it, and says when it is reached."""
    program = Program("fly", "fly to the red crane", "--cockpit=127.0.0.1:0", "--vlm", "human", "--no-video")
    page = page_of(browser, LAPTOP, "dark")
    page.goto(program.url)
    made = 0
    for _ in range(40):
        # It hovers when the instruction has ended.
        over = lambda: page.locator("#phase").inner_text() in ("hovering", "landing", "ended")
        wait(lambda: resumed(page) and (page.locator("#question").is_visible() or over()), "a question", page=page)
        if over():
            break
        page.wait_for_timeout(300)
        red = page.evaluate(RED)
        made += 1
        # The mast is 2 m wide, and half of the picture as wide as it is far.
        away = 1 / red["wide"]
        print(f"{made}: mast at {red['u']:.2f}, {red['wide']:.3f} wide, {red['tall']:.2f} tall: {away:.1f} m")
        if red["tall"] < 0.08:
            page.get_by_role("button", name="It is to the right").click()
        elif away < 4:
            page.get_by_role("button", name="We are there").click()
        else:
            label = max(1, min(10, round(1 + 4.5 * math.log10(away))))
            page.locator("#distance").fill(str(label))
            box = page.locator("#picture").bounding_box()
            page.mouse.click(box["x"] + red["u"] * box["width"], box["y"] + 0.38 * box["height"])
            if made == 3:
                shot(page, "laptop-dark-clicks")
        page.wait_for_timeout(500)
    shot(page, "laptop-dark-hovering")
    page.get_by_role("button", name="Land").click()
    expect(page.locator("#ended-lines")).to_contain_text("reached", timeout=40000)
    shot(page, "laptop-dark-clicks-ended")
    accessible(page, "reached by clicks")
    print("by clicks:", page.locator("#ended-lines").inner_text().replace("\n", " | "), f"after {made} clicks")
    assert program.process.wait(timeout=60) == 0, program.lines[-5:]
    # Of the browser about reading the picture, as only this script does.
    complain("by clicks", "willReadFrequently")
    page.context.close()
