"""What a push runs: .ci/run with the target compiler and without, and what make test-image says of its checks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools.common.paths import ROOT

SAYS = "#!/bin/sh\necho \"make $* with ${XC16:-nothing}\"; [ \"$1\" = run ] || echo '3 passed, 0 failed'\n"
UNCHECKED = "no target compiler, not checked: image, size, longest path, cycles, target against PC, tests on the chip (XC16=folder)"


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.parametrize("places, used", [
    ((), None), (("beside",), "{}/shared/xc16"), (("path", "beside"), "nothing"), (("variable", "path", "beside"), "/opt/xc16")])
def test_the_compiler_is_the_variable_s_else_that_on_path_else_the_one_beside_the_checkout(tmp_path, places, used):
    (tmp_path / "foc33/.ci").mkdir(parents=True)
    shutil.copy(ROOT / ".ci/run", tmp_path / "foc33/.ci/run")
    for name in ("bash", "dirname", "tee", "grep", "tail", "mkdir", "sh"):
        (tmp_path / "bin").mkdir(exist_ok=True)
        (tmp_path / "bin" / name).symlink_to(shutil.which(name))
    script(tmp_path / "bin/make", SAYS)
    if "path" in places:
        script(tmp_path / "bin/xc-dsc-gcc", "")
    if "beside" in places:
        (tmp_path / "shared/xc16").mkdir(parents=True)
    environment = {"PATH": str(tmp_path / "bin")} | ({"XC16": "/opt/xc16"} if "variable" in places else {})
    done = subprocess.run([tmp_path / "foc33/.ci/run"], env=environment, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line for line in lines if line.startswith("make test-image")] == ([f"make test-image with {used.format(tmp_path)}"] if used else [])
    assert (UNCHECKED in lines) == (used is None)
    assert any(line.startswith("make test XC16=none") for line in lines)


def test_a_compiler_that_is_not_where_the_variable_says_fails(tmp_path):
    done = subprocess.run(["make", "-s", "find-xc16", f"XC16={tmp_path}"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and f"XC16={tmp_path} has no bin/xc16-gcc" in done.stderr


def test_each_check_of_the_image_has_its_line_and_its_time(tmp_path):
    (tmp_path / "image").mkdir()
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = xc16\n", encoding="utf-8")
    shutil.copy(ROOT / "test/image/conftest.py", tmp_path / "image")
    (tmp_path / "image/test_a.py").write_text("import time\ndef test_good_one(): time.sleep(0.3)\ndef test_bad(): assert 0\n", encoding="utf-8")
    (tmp_path / "test_b.py").write_text("def test_no_check(): pass\n", encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "pytest", "-m", "xc16", "-p", "no:cacheprovider", "-p", "no:terminal", "image", "test_b.py"], cwd=tmp_path,
                          env=os.environ | {"PYTEST_ADDOPTS": ""}, capture_output=True, text=True, check=False)
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["check", "good", "one", "passed", "(0.3", "s)"] in lines and ["check", "bad", "failed", "(0.0", "s)"] in lines
    at = lines.index(["times,", "dearest", "first:"])
    assert [line[2:] for line in lines[at + 1:at + 3]] == [["good", "one"], ["bad"]]
    assert "test_no_check" not in done.stdout
