"""The MPLAB X project is what the Makefile says: regenerated, well formed, and every file it names exists."""

import io
import re
import xml.etree.ElementTree as ET

import pytest
from xc16 import ROOT, make

from tools.image import project

FOLDER = ROOT / "firmware.X"
TEXT = (FOLDER / project.CONFIGURATIONS).read_text(encoding="utf-8")
TREE = ET.fromstring(TEXT)
UNIT = (FOLDER / project.UNIT).read_text(encoding="utf-8")
FACTS = ["unit firmware/board/a.c", "header include/drive/b.h", "header userparams.h", "flag -O2", "flag -std=gnu99", "flag -Wall",
         "include include", "include .", "link --gc-sections", "link --odd", "device 33FJ32MC204"]


def boxes(tree: ET.Element, tool: str) -> dict[str, str]:
    return {box.get("key"): box.get("value") for box in tree.find(f".//{tool}").iter("property")}


def test_the_committed_project_is_the_generated_one_whatever_one_build_is_asked_for():
    for words in ([], ["OPT=-O1", "USERPARAMS=/tmp", "DEFINES=-DTUNING"]):
        facts = project.read(make("project-facts", *words).stdout.splitlines())
        assert project.updated(TEXT, facts) == TEXT, "run make project"
        assert project.unit(facts) == UNIT, "run make project"


def test_it_has_every_source_and_header_of_the_firmware_and_no_other():
    items = {item.text for item in TREE.iter("itemPath")}
    taken = re.findall('#include "(.*)"', UNIT)
    files = [f"../{path.relative_to(ROOT)}" for pattern in ("firmware/**/*.c", "include/**/*.h", "userparams.h") for path in ROOT.glob(pattern)
             if path.parent != ROOT / "firmware" / "app" or path.name == "panel.c"]
    assert sorted([*items, *(f"../{file}" for file in taken)]) == sorted([*files, "Makefile", "image.c"])
    roots = {"/".join(item.split("/")[:-1][:2]) for item in items - {"Makefile", "image.c"}}
    assert roots == {element.text for element in TREE.iter("Elem")}


def test_the_checks_of_userparams_h_come_first():
    sources = [item.text for item in TREE.find(".//logicalFolder[@name='SourceFiles']").iter("itemPath")]
    assert sources == ["../firmware/drive/param_text.c", "../firmware/drive/param_check.c", "../firmware/app/panel.c", "image.c"]


def test_device_folders_and_flags_are_those_of_make_firmware():
    assert TREE.findtext(".//targetDevice") == "dsPIC33FJ32MC204"
    assert boxes(TREE, "C30")["optimization-level"] == "2" and boxes(TREE, "C30-LD")["remove-unused-sections"] == "true"
    assert all((FOLDER / folder).is_dir() for folder in boxes(TREE, "C30")["extra-include-directories"].split(";"))
    more = TREE.find(".//C30/appendMe").get("value").split()
    assert all(flag in more or flag in project.BOXES for flag in project.read(make("project-facts").stdout.splitlines())["flag"])


def test_the_other_files_are_well_formed():
    tree, space = ET.parse(FOLDER / "nbproject" / "project.xml"), "{http://www.netbeans.org/ns/make-project/1}"
    assert tree.findtext(f".//{space}name") == "foc33"
    assert {item.text for item in tree.iter(f"{space}sourceRootElem")} == {element.text for element in TREE.iter("Elem")}
    assert "include nbproject/Makefile-impl.mk" in (FOLDER / "Makefile").read_text(encoding="utf-8")


def test_what_has_no_box_becomes_an_additional_option_and_odd_characters_stay():
    facts = project.read([*FACTS, "flag -DNAME=\"a<b>&c\"", "header include/drive/a&b.h"])
    tree = ET.fromstring(project.updated(TEXT, facts))
    assert tree.find(".//C30/appendMe").get("value") == '-std=gnu99 -DNAME="a<b>&c"'
    assert tree.find(".//C30-LD/appendMe").get("value") == "--odd"
    assert [item.text for item in tree.iter("itemPath")] == ["../include/drive/a&b.h", "../include/drive/b.h", "../userparams.h", "image.c",
                                                             "Makefile"]
    assert project.unit(facts).splitlines()[1:] == ['#include "firmware/board/a.c"']
    assert "isolate-each-function" not in boxes(tree, "C30") and boxes(tree, "C30")["enable-fatal-warnings"] == "false"


@pytest.mark.parametrize("lines, text, status", [
    (FACTS, TEXT, 0), (FACTS, "<a/>", 2), (FACTS, "no xml", 2), (FACTS, None, 2),
    *((lines, TEXT, 2) for lines in (["nonsense"], ["unit"], [], FACTS[:-1], [*FACTS, "device 33FJ64MC204"]))])
def test_the_command_writes_the_project_or_says_why_not(tmp_path, monkeypatch, capsys, lines, text, status):
    path = tmp_path / project.CONFIGURATIONS
    path.parent.mkdir()
    if text is not None:
        path.write_text(text, encoding="utf-8")
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
    assert project.main(["--out", str(tmp_path)]) == status
    assert len(capsys.readouterr().err.splitlines()) == (1 if status else 0)
    assert (tmp_path / project.UNIT).exists() == (status == 0)
    assert path.exists() == (text is not None) and (status == 0 or text is None or path.read_text(encoding="utf-8") == text)
