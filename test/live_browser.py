"""A plugin of pytest: the browser for the tests of make live's page, and the page as a user sees it."""

import subprocess
import time

import pytest

SIZE = (1400, 900)


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

    def wait(self, script: str, what: str, seconds: float = 15.0):
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
        self.one(selector).click()

    def axe(self, root) -> tuple[int, list[str]]:
        """Rules of accessibility that hold, and what breaks one."""
        script, = (root / "build/setup").glob("axe-core-*.js")
        self.run(script.read_text(encoding="utf-8"))
        return self.driver.execute_async_script("""const done = arguments[arguments.length - 1];
            axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }).then(({ violations, passes }) => done([passes.length,
                violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.html.slice(0, 100)}`))]), (error) => done([0, [String(error)]]))""")

    def slide(self, key: str, value: float) -> None:
        self.run("arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", self.one(f'input[name="{key}"]'), value)
