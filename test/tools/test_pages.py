"""README and pages: what they name exists. Links, paths, make targets, scenarios, motors; one version in header and changelog."""

import re
import subprocess

import pytest

from tools.common.paths import ROOT
from tools.docs import tables

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


# What a page names by this pattern is there, or is one of the words that stand for any.
NAMED = {
    "path": (rf"(?<![\w/.-])((?:{TOPS})/[\w./*<>-]*[\w/*>])", is_there),
    "make target": (r"(?:`|^|\| )make ([a-z][\w-]*)", set(re.findall(r"^([a-z0-9-]+):", makefiles(), re.MULTILINE)).__contains__),
    "scenario": (r"SCENARIO=([a-z]\w*)\b(?!/)", lambda name: name == "name" or is_there(f"tools/bench/scenarios/**/{name}.toml")),
    "motor": (r"MOTOR=([a-z]\w*)\b(?!/)", lambda name: name in ("name", "all", "my_motor") or is_there(f"tuning/motors/{name}.toml")),
    "AN1292 by its name": (r"\b([Tt]he note(?:'s)?)\b", lambda name: False),
}


@pytest.mark.parametrize("pattern, good", NAMED.values(), ids=NAMED)
def test_what_a_page_names_exists(pattern, good):
    assert [] == [(page, name) for page, text in pages().items() for name in re.findall(pattern, text) if not good(name)]


def test_every_link_leads_somewhere():
    for page, text in pages().items():
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if not target.startswith("http"):
                file, _, anchor = target.partition("#")
                path = (ROOT / page).parent / file if file else ROOT / page
                assert path.exists(), (page, target)
                assert not anchor or anchor in anchors(path.read_text(encoding="utf-8")), (page, target)


def test_from_the_readme_links_lead_to_every_page():
    known, found = pages(), {"README.md"}
    while new := {str(path) for page in found for target in re.findall(r"\]\(([^)\s#]+)", known[page])
                  if (path := (ROOT / page).parent.joinpath(target).resolve()).suffix == ".md" and path.is_relative_to(ROOT)
                  and (path := path.relative_to(ROOT)) and str(path) not in found}:
        found |= new
    assert set(known) - found == set()


def test_every_name_is_in_the_file_beside_it():
    rows = re.findall(r"^\| ([^|]*) \| ([^|]*`include/[^|]*|[^|]*`firmware/[^|]*) \| ([^|]*) \|$", pages()["docs/architecture.md"], re.MULTILINE)
    for _, file, name in rows:
        text = "".join((ROOT / path).read_text(encoding="utf-8") for path in re.findall(r"`([\w/]+\.[ch])`", file))
        assert [] == [word for word in re.findall(r"`([A-Za-z]\w+)", name) if text and not re.search(rf"\b{word}", text)], file


def test_the_newest_version_is_the_headers():
    version = re.search(r'FOC33_VERSION "(\d+\.\d+\.\d+)"', (ROOT / "include/board/status.h").read_text(encoding="utf-8"))[1]
    newest = re.search(r"^## \[(\d\S*)\] - \d{4}-\d\d-\d\d$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)[1]
    told = {number for page, text in pages().items() if page != "CHANGELOG.md" for number in re.findall(r"foc33 (\d+\.\d+\.\d+)", text)}
    assert version == newest and told <= {version}


def test_the_readme_is_for_a_reader_in_a_hurry_the_guarantees_are_its_one_table_of_results():
    text = pages()["README.md"]
    assert text.count("\n") <= 180
    assert re.findall(r"<!-- (?!end)([a-z]\w*) -->", text) == ["guarantees"]


MOST_WORDS = 25


def sentences(text: str) -> list[str]:
    """The sentences of a page's paragraphs and lists, an inline code as one word; without code, tables, headings, pictures and marks."""
    text = re.sub(r"```.*?```|<!--.*?-->", "\n\n", text, flags=re.DOTALL)
    parts = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) |\||#)", text)
    plain = (re.sub(r"^\s*(?:[-*]|\d+\.) |(?<=\])\([^)]*\)", "", re.sub(r"`[^`]*`", "code", part)) for part in parts if not re.match(r"\s*(?:\||#|!\[)|    ", part))
    return [sentence for part in plain for sentence in re.split(r"(?<=[.!?])[\")*]*\s+(?=\W*[A-Z0-9]|code|\[)|:\s+(?=[A-Z])", " ".join(part.split()))
            if sentence]


def words(sentence: str) -> int:
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def test_sentences_are_counted_as_a_reader_does():
    text = "# A heading\n\nOne `a b c` [two three](x.md).  Four: five; six\nseven. Eight!\n\n- nine\n- ten eleven\n1. 12\n\n| a | b |\n|---|---|\n\n    x = 1\n"
    assert [words(sentence) for sentence in sentences(text)] == [4, 4, 1, 1, 2, 1]
    assert words(sentences("a " * 30)[0]) == 30


@pytest.mark.parametrize("page", [page for page in pages() if page.startswith("docs/") or page in ("README.md", "CONTRIBUTING.md")])
def test_no_sentence_is_longer_than_a_reader_s_breath(page):
    text = pages()[page].partition("## What must hold between them")[0] # messages of a header
    assert [] == [(words(sentence), sentence) for sentence in sentences(text) if words(sentence) > MOST_WORDS]


def test_make_lists_every_target_in_a_group():
    listed = re.findall(r"^([a-z0-9-]+):.*## (?:\[(.*?)\])?", makefiles(), re.MULTILINE)
    assert [] == [name for name, group in listed if group not in GROUPS]
    shown = subprocess.run(["make", "-s"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert sorted(name for name, _ in listed) == sorted(re.findall(r"^  make ([\w-]+) ", shown, re.MULTILINE))


def test_the_workflow_runs_what_a_push_runs():
    workflow = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    assert "- run: .ci/run" in re.sub(r"- name: .*\n\s+run", "- run", workflow)


def test_the_schedule_counts_the_slots_of_the_halves_that_call_a_function():
    lines = {line.split("`")[1]: line for line in tables.schedule().splitlines() if line.startswith("| `")}
    assert "| 2; 10 by `limit_and_learn` | 16 periods |" in lines["limit_currents"]
    assert "| 3, 11 | 16 periods |" in lines["follow_speed"]
    assert "| 2; 10 by `limit_and_learn` | 16 periods |" in lines["limit_currents"]
    assert "| 14 | 32 periods |" in lines["check_model"]
