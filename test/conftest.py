"""What pytest knows beyond Python tests: Unity executables (unity_suites.py), suites side by side, as make test shows them (side_by_side.py), and a browser
(live_browser.py)."""

import os
import subprocess

import pytest

os.environ["FOC33_QUIET"] = "1" # what a command says on stderr does not depend on how long it takes
os.environ.pop("ASKED_BY", None) # a command that a test calls names its own options

pytest_plugins = ["unity_suites", "side_by_side", "live_browser"]


@pytest.fixture
def terminals() -> None:
    """Skips a test where the machine has no pseudo-terminals (a container without devpts)."""
    try:
        for end in os.openpty():
            os.close(end)
    except OSError as error:
        pytest.skip(f"this machine has no pseudo-terminals: {error}")


@pytest.fixture
def make(pytestconfig: pytest.Config):
    """Runs a make target that is a test by itself; what it says is the failure's text."""
    def run(target: str) -> None:
        done = subprocess.run(["make", "-s", target], cwd=pytestconfig.rootpath.parent, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              check=False)
        if done.returncode != 0:
            pytest.fail(done.stdout, pytrace=False)
    return run
