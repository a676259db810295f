"""A headless Chromium for the page's tests and pictures."""

import os
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.chrome.service import Service

from tools.common.errors import UserError

DRIVER, PROGRAM = "/usr/bin/chromedriver", "/usr/bin/chromium"


def start(downloads: Path | None = None) -> Any:
    """Debian's Chromium; what the page saves goes to the folder `downloads`."""
    options = webdriver.ChromeOptions()
    options.binary_location = PROGRAM
    flags = ["--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", "--no-first-run", "--disable-background-networking"]
    for flag in flags + ["--no-sandbox"] * (os.geteuid() == 0): # Chromium's sandbox does not work for root
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    if downloads is not None:
        options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
    try:
        return webdriver.Chrome(options=options, service=Service(DRIVER))
    except WebDriverException as error:
        raise UserError("Chromium does not start", PROGRAM, f"{error.msg}; Debian's packages are chromium and chromium-driver") from None


def resize(driver: Any, width: int, height: int) -> None:
    """The page's inner size."""
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})
