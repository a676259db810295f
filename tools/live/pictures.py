"""docs/live-*.png: the page of make live as a real browser shows it, after what a user would do."""

import contextlib
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

from tools.common import command_line, paths
from tools.common.errors import UserError
from tools.common.progress import waiting

from . import browser

SIZE, SMALL = (1400, 900), (1000, 700)
LONGEST_S = 30.0


@contextlib.contextmanager
def _page(driver: Any) -> Iterator[None]:
    """A board of its own, and the page."""
    command = [sys.executable, "-m", "tools.live", "--library", "build/host/libvboard.so", "--listen", "0"]
    with subprocess.Popen(command, cwd=paths.ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            driver.get(process.stdout.readline().split()[1])
            yield
        finally:
            process.terminate()


def _until(driver: Any, condition: str) -> None:
    """Waits for something about the frame `f`."""
    end_s = time.monotonic() + LONGEST_S
    while not driver.execute_script(f"const f = window.eval('foc33.frame'); return Boolean(f && ({condition}))"):
        if time.monotonic() > end_s:
            raise UserError(f"the page never came to {condition}", "make live-pictures", "look at it with make live")
        time.sleep(0.05)


def _slide(driver: Any, key: str, value: float) -> None:
    slider = driver.find_element("css selector", f'input[name="{key}"]')
    driver.execute_script("arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", slider, value)


def _running(driver: Any) -> None:
    """2000 rpm, then a load."""
    _until(driver, "f.t > 1")
    driver.find_element("id", "pot").send_keys("\ue00e" * 6 + "\ue013" * 9) # PageUp, arrow up
    driver.find_element("css selector", "[data-button=S2]").click()
    _until(driver, "f.state === 'CLOSED' && !f.limits.length && f.now.speed_rpm > 1900")
    _slide(driver, "load.constant_nm", 0.05)
    time.sleep(2.0)


def _faulty(driver: Any) -> None:
    """The load stays, and a wire breaks."""
    driver.find_element("css selector", "[data-fault=open_b]").click()
    _until(driver, "f.state === 'FAULT'")
    time.sleep(1.0)


def _write() -> int:
    driver = browser.start()
    try:
        with waiting("the page's pictures"), _page(driver):
            browser.resize(driver, *SIZE)
            for name, prepare, size in (("live-running", _running, SIZE), ("live-fault", _faulty, SMALL)):
                prepare(driver)
                browser.resize(driver, *size)
                time.sleep(0.6)
                driver.save_screenshot(str(paths.ROOT / "docs" / f"{name}.png"))
    finally:
        driver.quit()
    return 0


if __name__ == "__main__":
    sys.exit(command_line.run(_write))
