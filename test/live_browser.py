"""A plugin of pytest: the browser for the tests of make live's page, and the page as a user sees it."""

import itertools
import subprocess
import time

import pytest

SIZE = (1400, 900)
PATIENCE_S = 60.0
"""For what comes at once on a quiet machine; a busy one needs many times as long."""
CONTROLS = "button, select, input, summary, a[href], .push, #pot, [tabindex='0']"
PLACES = f"""[...document.querySelectorAll("{CONTROLS}")].filter((e) => e.getClientRects().length).map((e) => {{
    const r = e.getBoundingClientRect(); return [e.id || e.dataset.fault || e.dataset.button || e.dataset.mode || e.name || e.tagName, r.left, r.top + scrollY, r.right, r.bottom + scrollY]; }})"""
"""Of the controls that are seen: name, left, top, right, bottom."""


@pytest.fixture(scope="module")
def chromium(tmp_path_factory, pytestconfig):
    """The browser, and the folder where it saves."""
    done = subprocess.run(["make", "-s", "setup-browser"], cwd=pytestconfig.rootpath.parent, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        pytest.fail(done.stdout, pytrace=False)
    from tools.live import browser # needs what has just been installed
    folder = tmp_path_factory.mktemp("saved")
    driver = browser.start(folder)
    browser.resize(driver, *SIZE)
    yield driver, folder
    driver.quit()


@pytest.fixture(scope="module")
def server():
    """make live with the default firmware."""
    from live_support import served # builds the firmware
    with served() as running:
        yield running


class Page:
    """What a user sees and does. A page that is open stays open: to draw it costs more than what the tests do with it."""

    def __init__(self, driver, url: str) -> None:
        self.driver = driver
        if driver.current_url != url:
            driver.get(url)
        self.wait("return window.eval('foc33.frames') > 2", "no frames come")

    def run(self, script: str, *arguments):
        return self.driver.execute_script(script, *arguments)

    def frame(self) -> dict:
        return self.run("return window.eval('foc33.frame')")

    def wait(self, script: str, what: str, seconds: float = PATIENCE_S):
        end_s = time.monotonic() + seconds
        while not (value := self.run(script)):
            assert time.monotonic() < end_s, f"{what}: {self.run('return document.body.innerText')[:600]}"
            time.sleep(0.02)
        return value

    def one(self, selector: str):
        return self.driver.find_element("css selector", selector)

    def text(self, selector: str) -> str:
        return self.one(selector).text

    def state(self, name: str) -> None:
        self.wait(f"return document.querySelector('#states .now')?.dataset.state === '{name}'", f"the state is not {name}")

    def click(self, selector: str) -> None:
        element = self.one(selector)
        self.run("arguments[0].scrollIntoView({ block: 'center' })", element) # of what is half in sight the middle may be another part's
        element.click()

    def axe(self, root) -> tuple[int, list[str]]:
        """Rules of accessibility that hold, and what breaks one."""
        script, = (root / "build/setup").glob("axe-core-*.js")
        self.run(script.read_text(encoding="utf-8"))
        return self.driver.execute_async_script("""const done = arguments[arguments.length - 1];
            axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }).then(({ violations, passes }) => done([passes.length,
                violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.html.slice(0, 100)}`))]), (error) => done([0, [String(error)]]))""")

    def slide(self, key: str, value: float) -> None:
        self.run("arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", self.one(f'input[name="{key}"]'), value)


def dark(page: Page, on: bool) -> None:
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark" if on else "light"}]})


def resized(page: Page, width: int, height: int = 800) -> None:
    from tools.live import browser
    browser.resize(page.driver, width, height)
    page.wait(f"return innerWidth === {width}", "size")
    page.run("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


SEEN = pytest.mark.parametrize("on, width", [pytest.param(on, width, id=f"{'dark' if on else 'light'} {width}", marks=[] if (on, width) in ((False, 1280), (True, 390)) else [pytest.mark.release])
                                             for width in (360, 390, 768, 1280, 2560) for on in (False, True)])
"""As a page is looked at for accessible()."""


def accessible(page: Page, root, on: bool, width: int | None = None, prepare=lambda: None) -> None:
    """Nothing breaks a rule of accessibility, in these colours and this width, after what prepares the page."""
    dark(page, on)
    if width is not None:
        resized(page, width)
    prepare()
    holding, breaks = page.axe(root)
    dark(page, False)
    assert breaks == [] and holding > 10


def inside(page: Page, script: str, *arguments):
    """Runs it where the page's own names are known, and no frame of the board comes between."""
    return page.run(f"return window.eval({script!r})", *arguments)


def overlapping(places: list) -> list[tuple[str, str]]:
    """Pairs of controls that share more than their edges, without those that hold one another."""
    def shared(a, b) -> bool:
        return min(a[3], b[3]) - max(a[1], b[1]) > 1.5 and min(a[4], b[4]) - max(a[2], b[2]) > 1.5

    def holds(a, b) -> bool:
        return a[1] <= b[1] and a[2] <= b[2] and a[3] >= b[3] and a[4] >= b[4]
    return [(a[0], b[0]) for a, b in itertools.combinations(places, 2) if shared(a, b) and not holds(a, b) and not holds(b, a)]
