"""README and pages: what they name exists. Links, paths, make targets, scenarios, motors; one version in header and changelog."""

import re
import subprocess
import unittest
from pathlib import Path

from tools.common.paths import ROOT

TOPS = "firmware|include|tools|tuning|test|docs|examples"
GROUPS = {"run", "your motor", "your board", "tests", "simulator", "upkeep"}


def pages() -> dict[str, str]:
    """Text of every page by its path."""
    files = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("examples/*.md")]
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in sorted(files)}


def makefiles() -> str:
    return "".join(path.read_text(encoding="utf-8") for path in [ROOT / "Makefile", *ROOT.glob("tools/make/*.mk")])


def anchors(text: str) -> set[str]:
    """What #... of a link can be: the headings in lower case with hyphens."""
    return {re.sub(r"[^\w -]", "", head.lower()).strip().replace(" ", "-") for head in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}


def is_there(name: str) -> bool:
    """A path of the repository, or one that make writes; * and NAME stand for anything."""
    return any(ROOT.glob(re.sub(r"NAME|<\w+>", "*", name).rstrip("/")))


class Pages(unittest.TestCase):
    def each(self, pattern: str, what, good) -> None:
        """No page has a match of the pattern that is not good."""
        for page, text in pages().items():
            with self.subTest(page=page):
                self.assertEqual([], sorted({name for name in re.findall(pattern, text) if not good(name)}), what)

    def test_every_link_leads_somewhere(self):
        for page, text in pages().items():
            for target in re.findall(r"\]\(([^)\s]+)\)", text):
                if not target.startswith("http"):
                    file, _, anchor = target.partition("#")
                    path = (ROOT / page).parent / file if file else ROOT / page
                    with self.subTest(page=page, target=target):
                        self.assertTrue(path.exists())
                        self.assertTrue(not anchor or anchor in anchors(path.read_text(encoding="utf-8")))

    def test_every_path_exists(self):
        self.each(rf"(?<![\w/.-])((?:{TOPS})/[\w./*<>-]*[\w/*>])", "no such file", is_there)

    def test_every_make_target_exists(self):
        known = set(re.findall(r"^([a-z0-9-]+):", makefiles(), re.MULTILINE))
        self.each(r"(?:`|^|\| )make ([a-z][\w-]*)", "no such target", known.__contains__)

    def test_every_scenario_and_motor_exists(self):
        self.each(r"SCENARIO=([a-z]\w*)\b(?!/)", "no such scenario", lambda name: name == "name" or is_there(f"tools/bench/scenarios/**/{name}.toml"))
        self.each(r"MOTOR=([a-z]\w*)", "no such motor", lambda name: name in ("name", "all", "my_motor") or is_there(f"tuning/motors/{name}.toml"))

    def test_every_name_is_in_the_file_beside_it(self):
        for _, file, name in re.findall(r"^\| ([^|]*) \| ([^|]*`include/[^|]*|[^|]*`firmware/[^|]*) \| ([^|]*) \|$", pages()["docs/architecture.md"], re.MULTILINE):
            text = "".join((ROOT / path).read_text(encoding="utf-8") for path in re.findall(r"`([\w/]+\.[ch])`", file))
            for word in re.findall(r"`([A-Za-z]\w+)", name):
                with self.subTest(file=file, name=word):
                    self.assertTrue(not text or re.search(rf"\b{word}", text))

    def test_AN1292_is_called_by_its_name(self):
        self.each(r"\b([Tt]he note(?:'s)?)\b", "write AN1292", lambda name: False)


class Facts(unittest.TestCase):
    def test_the_newest_version_is_the_headers(self):
        version = re.search(r'FOC33_VERSION "(\d+\.\d+\.\d+)"', (ROOT / "include/version.h").read_text(encoding="utf-8"))[1]
        newest = re.search(r"^## \[(\d\S*)\] - \d{4}-\d\d-\d\d$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)[1]
        self.assertEqual(version, newest)
        for page, text in pages().items():
            if page != "CHANGELOG.md":
                self.assertEqual(set(), set(re.findall(r"foc33 (\d+\.\d+\.\d+)", text)) - {version}, page)

    def test_make_lists_every_target_in_a_group(self):
        listed = re.findall(r"^([a-z0-9-]+):.*## (?:\[(.*?)\])?", makefiles(), re.MULTILINE)
        self.assertEqual([], [name for name, group in listed if group not in GROUPS])
        shown = subprocess.run(["make", "-s"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        self.assertEqual(sorted(name for name, _ in listed), sorted(re.findall(r"^  make ([\w-]+) ", shown, re.MULTILINE)))

    def test_the_workflow_runs_what_a_push_runs(self):
        self.assertIn("- run: .ci/run", re.sub(r"- name: .*\n\s+run", "- run", Path(ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")))
