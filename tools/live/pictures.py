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
LONGEST_S = 120.0


@contextlib.contextmanager
def _program(*command: str) -> Iterator[list[str]]:
    """A program of this project, ended at the end; its first two lines."""
    with subprocess.Popen([sys.executable, "-m", *command], cwd=paths.ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield [process.stdout.readline() for _ in range(2)]
        finally:
            process.terminate()


@contextlib.contextmanager
def _page(driver: Any, *arguments: str) -> Iterator[None]:
    """The page of a board of its own."""
    with _program("tools.live", "--listen", "0", *arguments) as told:
        driver.get(told[0].split()[1])
        yield


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


def _click(driver: Any, selector: str) -> None:
    driver.find_element("css selector", selector).click()


def _choose(driver: Any, name: str, value: str) -> None:
    item = driver.find_element("id", name)
    driver.execute_script("arguments[0].value = arguments[1]; arguments[0].onchange()", item, value)


def _running(driver: Any) -> None:
    """2000 rpm, then a load; the scope starts with the angle."""
    _until(driver, "f.t > 1")
    driver.find_element("id", "pot").send_keys("\ue00e" * 6 + "\ue013" * 9) # PageUp, arrow up
    _click(driver, "[data-button=S2]")
    _until(driver, "f.state === 'CLOSED' && !f.limits.length && f.now.speed_rpm > 1900")
    _slide(driver, "load.constant_nm", 0.05)
    _choose(driver, "scope-trigger", "board_drive.angle")
    _choose(driver, "scope-level", "180")
    _click(driver, "[data-mode=auto]")
    _until(driver, "window.eval('foc33.traces') > 2")
    time.sleep(1.0)


def _measured(driver: Any) -> None:
    """A reference, then more load; cursors."""
    _choose(driver, "scope-factor", "10")
    seen = driver.execute_script("return window.eval('foc33.traces')")
    _until(driver, f"window.eval('foc33.traces') > {seen + 2}")
    _click(driver, "#scope-keep")
    _slide(driver, "load.constant_nm", 0.02)
    time.sleep(2.0)
    _click(driver, "[data-mode=stop]")
    _click(driver, "#scope-cursors")


def _unmeasured(driver: Any) -> None:
    """As before."""
    _click(driver, "#scope-cursors")
    _click(driver, "#scope-keep")
    _slide(driver, "load.constant_nm", 0.05)


def _stepped(driver: Any) -> None:
    """Steps of the speed."""
    _choose(driver, "step-kind", "speed")
    _click(driver, "#measure-step")
    _until(driver, "document.getElementById('step-said').textContent.includes('mean of')")


def _tuned(driver: Any) -> None:
    """Two parameters of the control loops are changed."""
    driver.execute_script("const s = document.getElementById('tuning-subject'); s.value = [...s.options].find((o) => o.text === 'Control loops').value; s.onchange()")
    for name, value in (("SPEED_BANDWIDTH_HZ", "9.5"), ("LOAD_BANDWIDTH_HZ", "100")):
        driver.execute_script("""const row = [...document.querySelectorAll('.parameter')].find((row) => row.querySelector('b').textContent === arguments[0]);
            row.querySelector('input').value = arguments[1]; row.querySelector('input').onchange()""", name, value)
        _until(driver, f"'{name}' in window.eval('views.tuning.told.changed')")


def _faulty(driver: Any) -> None:
    """The load stays, and a wire breaks."""
    _click(driver, "[data-fault=open_b]")
    _until(driver, "f.state === 'FAULT'")
    time.sleep(1.0)


def _remote(driver: Any) -> None:
    """A board at a serial port, started from the page."""
    _until(driver, "f.state === 'STOPPED'")
    driver.execute_script("const t = document.getElementById('target'); t.value = 1500; t.oninput()")
    _click(driver, "#start")
    _until(driver, "f.state === 'CLOSED' && Math.abs(f.now.estimate_rpm - 1500) < 15")
    _click(driver, "[data-mode=auto]")
    _until(driver, "window.eval('foc33.traces') > 2")


def _save(driver: Any, name: str, size: tuple[int, int]) -> None:
    browser.resize(driver, *size)
    driver.execute_script("scrollTo(0, 0)")
    time.sleep(0.6)
    driver.save_screenshot(str(paths.ROOT / "docs" / f"{name}.png"))


def _save_part(driver: Any, name: str, selector: str) -> None:
    browser.resize(driver, SIZE[0], 1600)
    time.sleep(0.6)
    driver.find_element("css selector", selector).screenshot(str(paths.ROOT / "docs" / f"{name}.png"))


def _write() -> int:
    driver = browser.start()
    try:
        browser.resize(driver, *SIZE)
        with waiting("the page's pictures"):
            with _page(driver):
                _running(driver)
                _save(driver, "live-running", SIZE)
                _measured(driver)
                _save_part(driver, "live-scope", "#scope-card")
                _unmeasured(driver)
                _stepped(driver)
                _save_part(driver, "live-step", "#loops-card")
                _faulty(driver)
                _save(driver, "live-fault", SMALL)
            with _page(driver, "--defines=-DPARAMS_IN_RAM"):
                _until(driver, "f.state === 'STOPPED'")
                _tuned(driver)
                _save_part(driver, "live-tuning", "#tuning-card")
            browser.resize(driver, *SIZE)
            with _program("tools.live.board") as told:
                port, elf = (line.replace(",", " ").split()[place] for line, place in zip(told, (2, 1)))
                with _page(driver, "--port", port, "--elf", elf):
                    _remote(driver)
                    _save(driver, "live-port", SIZE)
    finally:
        driver.quit()
    return 0


if __name__ == "__main__":
    sys.exit(command_line.run(_write))
