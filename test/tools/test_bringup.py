"""The `bringup` command: its table, the user who answers, what makes a row fail, and what it refuses."""

import re
from dataclasses import replace

import pytest
from support import command, refusal, refused

from tools.bench import bringup, bringup_user
from tools.bench.bringup_user import Said
from tools.common import paths, x_macro
from tools.common.board_keys import Values

HEADER = "drive/modes/bringup.h"
JOB = bringup.Job(bringup.Variant("x", "a test", Values(), ["BUS_DIVIDER"]), paths.ROOT, {}, 2.75)


def names(table: str, columns: str) -> list[str]:
    return [row[0] for row in x_macro.rows("include", HEADER, table, columns)]


def test_the_table_has_the_right_board_and_more_than_14_miswired_ones_with_findings_that_the_firmware_knows():
    table = bringup.read()
    known = {row[0]: row[1] for row in x_macro.rows("include", HEADER, "BRINGUP_FINDING_TABLE", "#name remedy")}
    found = [finding for variant in table.variants for finding in variant.finds]
    assert [variant.name for variant in table.variants if not variant.finds] == ["right"] and len(table.variants) > 15
    assert len({variant.name for variant in table.variants}) == len(table.variants)
    for finding in found:
        name, _, phase = finding.partition(" ")
        assert name in known and bool(phase) == ("~" in known[name]), finding


def test_every_finding_has_a_board_but_for_those_that_the_unit_tests_cause():
    found = {finding.split()[0] for variant in bringup.read().variants for finding in variant.finds}
    assert set(names("BRINGUP_FINDING_TABLE", "#name remedy")) - found == {"BUTTON_DOWN", "POT_RANGE", "CURRENTS_MIXED", "OVERCURRENT", "FAULT"}


def test_the_user_answers_every_question():
    assert bringup_user.answers() == set(names("BRINGUP_QUESTION_TABLE", "#name text"))


def test_remedies_name_files_and_lines_that_are_there():
    for name, remedy in x_macro.rows("include", HEADER, "BRINGUP_FINDING_TABLE", "#name remedy"):
        assert len(remedy) < 200, name
        for path in re.findall(r"\b(?:include|docs|tuning)/[\w/.*]+\w", remedy):
            assert list(paths.ROOT.glob(path)), (name, path)
        text = "".join((paths.ROOT / path).read_text(encoding="utf-8") for path in ("userparams.h", "include/board/mclv.h"))
        for word in re.findall(r"\b[A-Z]{2,}[A-Z_]*(?:_~|~|[A-Z])(?=\W|$)", remedy):
            assert word.replace("~", "A") in text + "XT USB", (name, word)


@pytest.mark.parametrize("lines, ended, current_a, says", [
    (["FIX BUS_DIVIDER: x"], True, 0.8, "ok"), ([], True, 0.8, "not that"), (["FIX BUS_DIVIDER: x", "FIX OFFSET A: x"], True, 0.8, "not that"),
    (["FIX BUS_DIVIDER: x"], False, 0.8, "no end"), (["FIX BUS_DIVIDER: x"], True, 2.8, "current 2.80 A")])
def test_a_row_fails_by_another_finding_by_no_end_and_by_too_much_current(lines, ended, current_a, says):
    said = Said([(1.0, line) for line in lines], 2.0, current_a, ended)
    assert bringup.verdict(JOB, said) == says
    row = {"said": "x", "current_max_a": current_a, "verdict": says}
    assert bringup.check(JOB, row).ok == (says == "ok")


def test_the_right_board_fails_by_a_value_that_is_called_wrong():
    job = replace(JOB, variant=replace(JOB.variant, finds=[]))
    assert bringup.verdict(job, Said([(1.0, "ok BUS: x")], 2.0, 0.8, True)) == "ok"
    assert bringup.verdict(job, Said([(1.0, "WRONG NOISE A: x")], 2.0, 0.8, True)) == "false alarm NOISE A"


@pytest.mark.parametrize("text, says", [
    ('title = "x"\nmotor = "m"\nboard = "b"\n[[variant]]\nname = "a"\ntitle = "t"\nfind = []', "find"), ('title = "x"', "motor"),
    ('title = "x"\nmotor = "m"\nboard = "b"\n[[variant]]\nname = 3', "name")])
def test_a_wrong_table_is_refused(tmp_path, text, says):
    path = tmp_path / "table.toml"
    path.write_text(text, encoding="utf-8")
    assert says in refusal(lambda: bringup.read(path))


def test_a_variant_that_is_not_there_is_one_line():
    refused(command("bringup", "--variant", "motor_abc"), "no variant 'motor_abc', VARIANT: did you mean motor_")
    refused(command("bringup", "--variant", "17"), "no variant '17', VARIANT: take one of right, motor_ab")
