"""Set-up on a machine that lacks things: says what it installs before it does, how to do it without root, and that it still runs."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tools.common.paths import ROOT

TOOLS = ("sh", "mkdir", "cat", "echo", "sed", "tr", "grep", "tail", "cut", "sleep", "touch", "env", "rm", "head", "cp", "mv", "ln")
VENV = "python3 -m venv build/setup/venv && build/setup/venv/bin/python -m pip install numpy matplotlib tqdm"
PACKAGES = "python3 python3-numpy python3-matplotlib python3-tqdm"


class Machine:
    """A folder as root of the project, with the set-up's scripts and a PATH of its own: a compiler, but no Python until apt-get was there."""

    def __init__(self, folder: Path) -> None:
        self.root, self.bin = folder / "a project", folder / "bin"
        self.bin.mkdir()
        for script in (*ROOT.glob("tools/setup/*.sh"), ROOT / "test/static/need.sh"):
            (target := self.root / script.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(script, target)
            target.write_text(target.read_text(encoding="utf-8").replace(" /usr/bin/python3 ", " "), encoding="utf-8") # this machine's own
        for name in TOOLS:
            (self.bin / name).symlink_to(shutil.which(name))
        self.program("gcc", "exit 0")
        self.program("ar", "exit 0")
        self.program("id", "echo 0")
        self.program("apt-get", f"""
            echo "$@" >>calls; cp out seen; echo "Unpacking $2"
            case $* in *install*) ln -sf {shutil.which('true')} '{self.bin}/python3'; ln -sf {shutil.which('true')} '{self.bin}/cppcheck';; esac""")

    def program(self, name: str, body: str) -> None:
        path = self.bin / name
        path.unlink(missing_ok=True)
        path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
        path.chmod(0o755)

    def run(self, line: str = "tools/setup/prepare.sh run", **environment: str) -> tuple[int, str]:
        """Exit code and what was said, both streams in one."""
        with open(self.root / "out", "w", encoding="utf-8") as out:
            code = subprocess.run(line.split(), cwd=self.root, env={"PATH": str(self.bin), **environment}, stdin=subprocess.DEVNULL, stdout=out,
                                  stderr=subprocess.STDOUT, check=False).returncode
        return code, (self.root / "out").read_text(encoding="utf-8")

    def read(self, name: str) -> str:
        path = self.root / name
        return path.read_text(encoding="utf-8") if path.exists() else ""


NPM = 'd=$3/node_modules/axe-core; mkdir -p "$d"; echo axe >"$d/axe.min.js"' # npm install --prefix <folder>


@pytest.fixture
def machine(tmp_path) -> Machine:
    return Machine(tmp_path)


def test_what_is_installed_and_how_to_do_without_root_is_said_before(machine):
    code, said = machine.run()
    assert code == 0 and machine.read("calls").count("\n") == 2 and machine.read("build/setup/python") == "python3\n"
    assert said == machine.read("seen") == f"foc33: installing Debian packages as root, a minute or two: {PACKAGES} (log: build/setup/apt.log)\n" \
                                           f"  without root instead: stop here (Ctrl-C), then {VENV}\n"
    assert machine.run() == (0, "") and machine.read("calls").count("\n") == 2, "what is there is not installed again"


@pytest.mark.parametrize("environment, id_, sudo", [({"INSTALL": "no"}, "0", ""), ({}, "1000", ""), ({}, "1000", "exit 1")],
                         ids=["not allowed", "no sudo", "sudo asks for a password"])
def test_without_the_right_to_install_one_line_tells_both_ways(machine, environment, id_, sudo):
    machine.program("id", f"echo {id_}")
    if sudo:
        machine.program("sudo", sudo)
    code, said = machine.run(**environment)
    assert (code, machine.read("calls")) == (2, "")
    assert said == f"foc33: set-up, missing: Python 3.11 or newer with numpy matplotlib: as root: apt-get install {PACKAGES}; without root: {VENV}\n"


def test_a_compiler_and_ruby_are_for_root_only(machine):
    (machine.bin / "gcc").unlink()
    code, said = machine.run("tools/setup/prepare.sh test", INSTALL="no")
    assert code == 2 and said.count("\n") == 1
    assert re.search(r"; without root: python3 -m venv .* pip install numpy matplotlib openpyxl pyelftools intelhex pyserial aiohttp tomlkit pytest tqdm; "
                     r"ask whoever is root for gcc libc6-dev binutils ruby$", said.strip())
    machine.program("python3", "exit 0")
    assert machine.run(INSTALL="no")[1].endswith("without root: ask whoever is root for gcc libc6-dev binutils\n")


def test_modules_in_the_project_s_own_environment_are_found_first_and_need_no_root(machine):
    (machine.root / "build/setup/venv/bin").mkdir(parents=True)
    (machine.root / "build/setup/venv/bin/python").symlink_to(shutil.which("true"))
    machine.program("python3", "exit 0")
    assert machine.run() == (0, "") and machine.read("build/setup/python") == "build/setup/venv/bin/python\n"


@pytest.mark.parametrize("line, title", [
    ("tools/setup/prepare.sh run", "installing packages"), ("test/static/need.sh cppcheck=cppcheck", "installing packages"),
    ("tools/setup/gems.sh 1.2.1 stamp", "installing the gem"), ("tools/setup/axe.sh 4.10.3 axe.js", "installing axe-core")])
def test_a_long_installation_says_now_and_then_what_it_does(machine, line, title):
    machine.program("apt-get", "echo Fetched $2; case $* in *install*) sleep 2.5; ln -sf /bin/true \"$BIN/python3\";; esac")
    machine.program("gem", "echo Fetched ceedling; sleep 2.5")
    machine.program("npm", f"{NPM}; echo Fetched axe; sleep 2.5")
    code, said = machine.run(line, FOC33_BEAT_S="1", BIN=str(machine.bin))
    assert code == 0 and re.findall(rf"(?m)^  {title}: (\d) s, Fetched \S+$", said) == ["1", "2"], said
    assert "  " + title not in machine.run(line, FOC33_BEAT_S="1", FOC33_QUIET="1", BIN=str(machine.bin))[1]


def test_a_failed_installation_is_one_line_with_the_reason_and_the_way_without_root(machine):
    machine.program("apt-get", "echo 'E: Unable to locate package'; exit 100")
    code, said = machine.run()
    assert code == 2 and said.splitlines()[-1] == f"foc33: set-up, apt-get install {PACKAGES}: failed (E: Unable to locate package); " \
                                                  f"see build/setup/apt.log, or without root: {VENV}"


def test_dygraphs_are_installed_as_root_and_asked_for_once(machine):
    prepare = machine.root / "tools/setup/prepare.sh"
    prepare.write_text(prepare.read_text(encoding="utf-8").replace("/usr/share/javascript", "/nowhere"), encoding="utf-8")
    machine.program("python3", "exit 0")
    machine.program("id", "echo 1000")
    machine.program("sudo", 'test "$1" = -n || exec "$@"')
    machine.program("apt-get", 'echo "$@" >>calls; case $* in *install*) exit 100;; esac')
    code, said = machine.run()
    assert code == 0 and said.splitlines()[-1].endswith("foc33: set-up, libjs-dygraphs: cannot be installed, see build/setup/apt.log; pages show no curves")
    assert machine.read("calls").endswith("install --no-install-recommends libjs-dygraphs\n") and machine.read("calls").count("\n") == 2
    assert machine.run() == (0, "") and machine.read("calls").count("\n") == 2


def test_the_checks_tools_are_told_likewise(machine):
    assert machine.run("test/static/need.sh cppcheck=cppcheck", INSTALL="no") == (
        2, "foc33: set-up, missing: tools of the checks: as root: apt-get install cppcheck; without root: make test-quick, which needs none of them\n")
    code, said = machine.run("test/static/need.sh module:selenium=python3-selenium", INSTALL="no")
    assert code == 2 and said.startswith("foc33: set-up, missing: tools of the checks: as root: apt-get install python3-selenium; ") and said.count("\n") == 1
    code, said = machine.run("test/static/need.sh cppcheck=cppcheck")
    assert code == 0 and said.startswith("foc33: installing Debian packages as root, a minute or two: cppcheck (log: ")


def test_the_gem_needs_no_root_and_is_refused_where_nothing_may_be_installed(machine):
    machine.program("gem", "exit 0")
    assert machine.run("tools/setup/gems.sh 1.2.1 stamp") == (
        0, "foc33: installing the ceedling gem 1.2.1 (Unity and CMock) into build/gems; no root is needed\n")
    code, said = machine.run("tools/setup/gems.sh 1.2.1 stamp", INSTALL="no")
    assert code == 2 and re.fullmatch(r"foc33: set-up, missing: the ceedling gem 1\.2\.1: [^\n]+\n", said)


def test_axe_needs_no_root_and_is_refused_where_nothing_may_be_installed_or_can_be(machine):
    machine.program("npm", NPM)
    assert machine.run("tools/setup/axe.sh 4.10.3 build/setup/axe-core-4.10.3.js") == (
        0, "foc33: installing axe-core 4.10.3 into build/setup; no root is needed\n")
    assert machine.read("build/setup/axe-core-4.10.3.js") == "axe\n"
    code, said = machine.run("tools/setup/axe.sh 4.10.3 axe.js", INSTALL="no")
    assert code == 2 and re.fullmatch(r"foc33: set-up, missing: axe-core 4\.10\.3: [^\n]+\n", said)
    machine.program("npm", "echo 'npm error code ENOTFOUND'; exit 1")
    code, said = machine.run("tools/setup/axe.sh 4.10.3 axe.js")
    assert code == 2 and said.splitlines()[-1].startswith("foc33: set-up, axe-core 4.10.3: cannot be installed (npm error code ENOTFOUND); check the network")
    assert [item.name for item in (machine.root / "build/setup").iterdir() if item.is_dir()] == [] # nothing is left


def test_make_passes_the_wish_on():
    shown = subprocess.run(["make", "-pn", "INSTALL=no", "help"], cwd=ROOT, capture_output=True, text=True, check=False,
                           env={name: value for name, value in os.environ.items() if name != "MAKEFLAGS"}).stdout
    assert re.search(r"(?m)^export .*\bINSTALL\b|^INSTALL = no$", shown)
