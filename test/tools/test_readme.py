"""make readme: tables filled from results, rows that know their firmware, and a check that a wrong figure does not pass."""

import json
import os
import re
import time

import pytest
from support import command, refused

from tools.common import checksum, paths
from tools.common.errors import UserError
from tools.docs import figures, readme
from tools.docs.figures import BLOCKS, Part
from tools.docs.readme import SOURCES, Row, Source

NOW, TODAY = {"pc": "aaaaaaaa", "chip": "cccccccc", "image": "bbbbbbbb"}, "2030-01-02"


@pytest.fixture
def result(tmp_path, monkeypatch):
    """Writes what a run of the tests leaves."""
    (tmp_path / "build/test").mkdir(parents=True)
    (tmp_path / "build/coverage").mkdir()
    (tmp_path / "build/coverage/summary.json").write_text('{"line_percent": 100, "branch_percent": 99.6}')
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    monkeypatch.setattr(readme, "ROOT", tmp_path)

    def write(passed: int, failed: int, skipped: int) -> None:
        (tmp_path / "build/test/summary.json").write_text(json.dumps({"passed": passed, "failed": failed, "skipped": skipped}))
    return write


# ---- what the tables show ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("numbers, row", [((3, 0, 1), ["unit, board and closed-loop tests (1 more were skipped)", "3", "`make test`"]),
                                          ((1, 0, 0), ["unit, board and closed-loop tests, with those that need XC16", "1", "`make test`"])])
def test_a_complete_run_gives_its_numbers(result, numbers, row):
    result(*numbers)
    assert figures.tests()[1][0] == row


def test_a_failed_test_keeps_the_readme_as_it_is(result):
    result(0, 1, 0)
    with pytest.raises(UserError, match=r"^1 tests failed, build/test/summary.json: repair them"):
        figures.tests()


STEP = {"reference_rpm": 500.0, "torque_nm": 0.05, "kphi": 1.0, "dip_percent": 47.6, "on_back_s": 0.03, "off_back_s": 0.04, "beyond": "",
        "angle_error_max_deg": 5.2}


def left(tmp_path, name: str, motor: str, rows: list[dict], **more) -> None:
    (tmp_path / "build/run" / name).mkdir(parents=True)
    data = {"motor": f"tuning/motors/{motor}.toml", "rows": rows, "expectations": [{"ok": row.get("ok", True)} for row in rows], **more}
    (tmp_path / "build/run" / name / "summary.json").write_text(json.dumps(data))


@pytest.mark.parametrize("changes, cells", [
    ({}, "48 % | 0.030 s | 0.040 s | 5°"), ({"on_back_s": None}, "48 % | never | 0.040 s | 5°"),
    ({"beyond": "needs 14 V", "on_back_s": None}, "48 % (out of reach) | out of reach | 0.040 s | 5°")])
def test_a_load_step_is_told_with_its_dip_and_its_return(result, tmp_path, changes, cells):
    left(tmp_path, "loadsteps", "own", [STEP | changes])
    assert figures.loadsteps()[1] == [f"500 rpm | 0.05 N·m | {cells}".split(" | ")]


def test_every_motor_has_its_line_of_load_steps_and_low_speeds(result, tmp_path):
    (tmp_path / "tuning/motors").mkdir(parents=True)
    lowest = [{"lowest_rpm": 120.4}, {"lowest_rpm": None}]
    for motor, end in (("own", ""), ("other", "-other")):
        (tmp_path / f"tuning/motors/{motor}.toml").touch()
        left(tmp_path, f"loadsteps{end}", motor, [STEP, STEP | {"kphi": 0.8, "dip_percent": 90.0, "off_back_s": 0.2, "ok": not end}])
        left(tmp_path, f"lowspeed{end}", motor, [{"asked_rpm": 151.2}], lowest=lowest)
    assert figures.stiffness()[1] == [["other", "1 of 2", "48 %", "0.200 s", "1 of 1", "151", "120 / -"],
                                      ["own", "2 of 2", "48 %", "0.200 s", "1 of 1", "151", "120 / -"]]


def test_every_motor_has_its_line_of_flying_starts_and_stops(result, tmp_path):
    (tmp_path / "tuning/motors").mkdir(parents=True)
    (tmp_path / "tuning/motors/own.toml").touch()
    start = {"rpm": -2000.0, "rotor_deg": 10.0, "verdict": "ok", "control_s": 0.03, "current_max_a": 2.5, "bus_max_v": 33.0, "stop_s": None}
    stop = {"rpm": 5500.0, "rotor_deg": None, "verdict": "ok", "control_s": None, "current_max_a": 2.8, "bus_max_v": 28.6, "stop_s": 1.39}
    left(tmp_path, "catch", "own", [start, start | {"rpm": 3400.0, "control_s": 0.061, "verdict": "angle"}, stop, stop | {"stop_s": None}])
    assert figures.catches()[1] == [["own", "-2000 .. 3400", "1 of 2", "0.061 s", "2.80 A", "5500 rpm", "1.39 / never s", "28.6 V"]]


@pytest.fixture
def one_motor(tmp_path):
    (tmp_path / "tuning/motors").mkdir(parents=True)
    (tmp_path / "tuning/motors/own.toml").touch()


def test_every_motor_has_its_line_of_holds(result, tmp_path, one_motor):
    back = {"backwards_rpm": 40.4, "fault": None, "fault_s": None, "back_s": 0.4}
    stop = {"backwards_rpm": 112.0, "fault": "STALL", "fault_s": 0.21, "back_s": None}
    left(tmp_path, "held", "own", [back, back | {"back_s": 0.61}, stop, stop | {"fault_s": -0.2, "ok": False}, stop | {"fault": "LOST_LOCK"}])
    assert figures.helds()[1] == [["own", "4 of 5", "112 rpm", "2", "0.61 s", "1 LOST_LOCK, 2 STALL", "0.21 s"]]


def test_every_motor_has_its_line_of_pulsing_loads(result, tmp_path, one_motor):
    ok = {"beyond": "", "fault": None, "speed_error_percent": -0.21, "swing_limit": "0.50", "swing_share": 0.4}
    left(tmp_path, "pulse", "own", [ok, ok | {"speed_error_percent": 0.1, "swing_limit": "-", "swing_share": 1.4}, ok | {"beyond": "mean needs", "fault": "STALL"},
                                    ok | {"fault": "CURRENT_SENSOR", "speed_error_percent": None, "swing_share": None, "ok": False}])
    assert figures.pulses()[1] == [["own", "3 of 4", "1", "1 CURRENT_SENSOR", "0.21 %", "0.40"]]


def test_every_motor_has_its_line_of_starts_in_the_box_and_drawn_and_the_plain_ones_do_not_count(result, tmp_path, one_motor):
    plain = {"is_off": False, "beyond": "", "fault": None, "inertia": 1.0, "back_rpm": 100.0, "hand_over_rpm": 250.0}
    off = plain | {"is_off": True, "back_rpm": 400.0, "hand_over_rpm": None}
    left(tmp_path, "starts", "own", [plain, plain, off, off | {"fault": "STALL", "ok": False}])
    left(tmp_path, "starts-draw-1", "own", [off, off, off | {"fault": "STALL", "beyond": "needs"}])
    assert figures.boxes()[1] == [["own", "1 of 2", "3 of 3", "1", "2 STALL"]]
    assert figures.starts() == "2 of 2; 100 rpm; 250 rpm"


@pytest.fixture
def long_draws(result, tmp_path):
    """What a campaign and a soak leave, with numbers changed."""
    def write(cases: int = 1990, hours: float = 24.2, wrong: int = 0) -> None:
        for folder, data in (("campaign", {"classes": {"no effect": cases, "ridden through": 10, "wrong and silent": 0}}),
                             ("soak", {"motor_hours": hours, "wrong": wrong, "held": 40, "wrong_held": wrong})):
            (tmp_path / "build" / folder / "seed-1").mkdir(parents=True)
            (tmp_path / "build" / folder / "seed-1/summary.json").write_text(json.dumps(data))
    return write


def test_the_long_draws_are_told_with_their_shares(long_draws):
    long_draws()
    assert [figures.campaign(), figures.soak()] == ["1990 no effect; 10 ridden through", "0 wrong in 24.2 h; in 40 segments the shaft is held"]


@pytest.mark.parametrize("less, told", [({"cases": 1989}, figures.campaign), ({"hours": 23.9}, figures.soak), ({"wrong": 1}, figures.soak)])
def test_less_than_the_readme_promises_is_refused(long_draws, less, told):
    long_draws(**less)
    with pytest.raises(UserError, match=r"^(less than the README promises|1 segments end wrong), make (campaign|soak): "):
        told()


def test_a_result_that_is_missing_is_one_line_with_its_command(result):
    with pytest.raises(UserError, match=r"^no results, build/campaign/seed-1/summary.json: run `make campaign`"):
        figures.campaign()


@pytest.mark.parametrize("cpu_s, cell", [(1.0, "at least 20 times"), (0.4, "at least 20 times"), (2.0, "15 times")])
def test_the_speed_of_the_board_is_no_figure_of_one_machine(result, tmp_path, monkeypatch, cpu_s, cell):
    waits = []
    monkeypatch.setattr(figures.time, "sleep", waits.append)
    (tmp_path / "build/run/demo").mkdir(parents=True)
    (tmp_path / "build/run/demo/summary.json").write_text(json.dumps({"motor_seconds": 30.0, "cpu_seconds": cpu_s}))
    assert figures.real_time(lambda: {"motor_seconds": 30.0, "cpu_seconds": 2.5}) == cell
    assert sum(waits) == (0.0 if cell == "at least 20 times" else 120.0) # a machine that is busy for a minute is asked again
    slow = {"motor_seconds": 30.0, "cpu_seconds": 2.5}
    runs = iter([slow, slow, {"motor_seconds": 30.0, "cpu_seconds": 1.4}])
    assert figures.real_time(lambda: next(runs)) == "at least 20 times" # the best of a few counts


# ---- which firmware ------------------------------------------------------------------------------------------------------
SOURCE = '#define A 1 /* one */\nint f(void)\n{\n    return A + 2; // "sum"\n}\nchar *s = "/* no comment */";\n'


@pytest.fixture
def tree(tmp_path):
    """The sources of a small firmware. @return its checksum with one file changed"""
    for name in (*checksum.FIRMWARE[:2], *checksum.BOARD, "tools/cpu_33f", "tools/make"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "tools/make/image.mk").write_text("# flags\nOPT ?= -O2\ntarget_flags = -g\n")

    def of(kind: str = "pc", file: str = "firmware/a.c", text: str = SOURCE) -> str:
        for name, old in (("firmware/a.c", SOURCE), ("userparams.h", "#define R 1.0\n"), ("tools/plant/p.c", SOURCE), ("tools/cpu_33f/i.c", SOURCE)):
            (tmp_path / name).write_text(text if name == file else old)
        if file == "tools/make/image.mk":
            (tmp_path / file).write_text(text)
        return checksum.checksum(kind, tmp_path)
    return of


@pytest.mark.parametrize("text", [SOURCE.replace("/* one */", "/* the first */"), SOURCE.replace("    return A + 2;", "  return A+2;\n\n"),
                                  SOURCE.replace("#define A 1", "#define  A \\\n 1"), SOURCE.replace('// "sum"', "/* it's */"), SOURCE.replace("\n", "\r\n")])
def test_comments_and_white_space_are_no_other_firmware(tree, text):
    assert tree(text=text) == tree()


@pytest.mark.parametrize("text", [SOURCE.replace("A 1", "A 2"), SOURCE.replace("A + 2", "A - 2"), SOURCE.replace("/* no comment */", "/* */"),
                                  SOURCE.replace("A 1 ", "A (1) "), SOURCE.replace("A 1 /* one */\n", "A\n1\n"), "/* " + SOURCE])
def test_another_constant_operator_or_text_is_another_firmware(tree, text):
    assert tree(text=text) != tree()


@pytest.mark.parametrize("file, kinds", [("userparams.h", {"pc", "chip", "image"}), ("tools/plant/p.c", {"pc", "chip"}), ("tools/cpu_33f/i.c", {"chip"}),
                                         ("tools/make/image.mk", {"chip", "image"})])
def test_a_result_depends_on_what_it_is_made_of(tree, file, kinds):
    text = "OPT ?= -O1\n" if file.endswith(".mk") else "int other;\n"
    assert {kind for kind in checksum.PARTS if tree(kind, file, text) != tree(kind, "tools/make/image.mk", "# new\nOPT ?= -O2\ntarget_flags = -g\n")} == kinds


# ---- pages ---------------------------------------------------------------------------------------------------------------
PAGE = """text
<!-- one -->
| what | value |
| --- | ---: |
| fast | 1 <!-- 2029-01-01 aaaaaaaa --> |
| long (of 2028-01-01) | 2 <!-- 2028-01-01 99999999 --> |
<!-- end -->
more
"""


@pytest.fixture
def page(tmp_path, monkeypatch):
    """A page with a table of two rows, whose commands give other values now."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text(PAGE)
    for module in (readme, figures):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    gives = {"fast": "1", "long": "3"}
    monkeypatch.setattr(readme, "BLOCKS", {"one": [Part((name,), lambda name=name: (["what", "value"], [[name, gives[name]]]), name) for name in gives]})
    monkeypatch.setattr(readme, "SOURCES", {"fast": Source(("run SCENARIO=fast",), takes="seconds"), "long": Source(("sweep",))})
    monkeypatch.setattr(readme, "checksum", NOW.get)
    made: list[str] = []
    monkeypatch.setattr(readme, "make", lambda command, counts: made.append(command))

    def run(*arguments: str) -> tuple[int, str]:
        return readme.run(readme.parser().parse_args(list(arguments))), (tmp_path / "README.md").read_text()
    run.gives, run.made = gives, made
    return run


def test_a_measured_row_is_filled_and_stamped_and_the_others_stay(page):
    page.gives["fast"] = "7"
    code, text = page("fast")
    assert code == 0 and page.made == ["run SCENARIO=fast"]
    assert re.search(r"\| fast \| 7 <!-- \d{4}-\d\d-\d\d aaaaaaaa --> \|\n\| long \(of 2028-01-01\) \| 2 <!-- 2028-01-01 99999999 --> \|\n", text)
    assert text.startswith("text\n") and text.endswith("more\n")


def test_a_row_of_this_firmware_shows_no_date_and_one_of_an_older_one_does(page, monkeypatch):
    page("long")
    monkeypatch.setattr(readme, "checksum", {kind: "dddddddd" for kind in NOW}.get)
    _, text = page("long")
    assert "| fast (of 2029-01-01) | 1 <!-- 2029-01-01 aaaaaaaa --> |" in text and "| long | 3 <!-- " in text


def test_the_check_finds_the_row_that_differs_and_writes_nothing(page, capsys):
    assert page("--check") == (0, PAGE)
    page.gives["fast"] = "7"
    assert page("--check") == (1, PAGE)
    told = capsys.readouterr()
    assert told.err == 'foc33: README.md, one, fast: says 1, but 7 by `make run SCENARIO=fast`: run `make readme ONLY="fast"`\n'
    assert set(page.made) == {"run SCENARIO=fast"}
    assert "of older firmware, not measured here:\n  one, long: of 2028-01-01 (make readme ONLY=\"long\")\n" in told.out


def test_a_row_too_many_or_too_few_does_not_pass(page, capsys, monkeypatch):
    parts = {"more": [["fast", "1"], ["new", "2"]], "none": []}
    for rows in parts.values():
        monkeypatch.setattr(readme, "BLOCKS", {"one": [Part(("fast",), lambda rows=rows: (["what", "value"], rows), "fast"), readme.BLOCKS["one"][1]]})
        assert page("--check")[0] == 1
    assert re.findall(r"one, (\w+): says (.*?), but (.*?) by .*: run", capsys.readouterr().err) == [
        ("new", "no such row", "new | 2"), ("fast", "fast | 1", "no such row")]


def test_rows_of_one_name_are_compared_one_by_one(page, tmp_path, capsys, monkeypatch):
    rows = [["fast", "1"], ["fast", "2"]]
    monkeypatch.setattr(readme, "BLOCKS", {"one": [Part(("fast",), lambda: (["what", "value"], rows))]})
    (tmp_path / "README.md").write_text(PAGE.replace("| long", "| fast"))
    assert page("--check")[0] == 0
    rows.reverse()
    assert page("--check")[0] == 1
    assert re.findall(r"says (.*?), but (.*?) by .*: run", capsys.readouterr().err) == [("1", "2"), ("2", "1")]


def test_a_command_that_fails_fails_the_check_and_keeps_the_page(page, monkeypatch, capsys):
    def fails(name: str, counts: bool) -> None:
        raise UserError(f"make {name} fails: why")
    monkeypatch.setattr(readme, "make", fails)
    assert page("--check") == (1, PAGE) and "foc33: make run SCENARIO=fast fails: why" in capsys.readouterr().err
    with pytest.raises(UserError):
        page("fast")


def test_a_block_that_is_missing_or_unknown_or_there_twice_is_one_line(page, tmp_path):
    for text, line in ((PAGE.replace("<!-- one -->", ""), "marks '<!-- one -->' and '<!-- end -->' found 0 times"), (PAGE + PAGE, "found 2 times"),
                       (PAGE + PAGE.replace("-- one", "-- two"), "no table 'two', README.md: use one of one")):
        (tmp_path / "README.md").write_text(text)
        with pytest.raises(UserError, match=re.escape(line)):
            page("--check")


def test_a_block_may_stand_in_any_page(page, tmp_path):
    (tmp_path / "docs/results.md").write_text(PAGE)
    (tmp_path / "README.md").write_text("nothing\n")
    page("long")
    assert "| long | 3 <!-- " in (tmp_path / "docs/results.md").read_text() and (tmp_path / "README.md").read_text() == "nothing\n"


def test_a_row_that_nothing_measures_is_refused(page, tmp_path):
    (tmp_path / "README.md").write_text(PAGE.replace("| fast |", "| renamed |"))
    with pytest.raises(UserError, match="^1 rows are no longer measured, table 'one'"):
        page("long")


def test_a_missing_picture_is_one_line_and_nothing_is_written(page, monkeypatch, tmp_path):
    monkeypatch.setitem(readme.SOURCES, "long", Source(("sweep",), pictures=(("run/demo/speed.png", "demo-speed.png"),)))
    with pytest.raises(UserError, match=r"^no picture, build/run/demo/speed.png: run `make readme`"):
        page("long")
    assert (tmp_path / "README.md").read_text() == PAGE


def test_a_result_that_others_left_counts_while_it_is_of_this_firmware(page, monkeypatch, tmp_path):
    path = tmp_path / "build/r.json"
    path.parent.mkdir()
    monkeypatch.setitem(readme.SOURCES, "fast", Source(("cycles",), "chip", "seconds", "r.json"))
    monkeypatch.setattr(readme, "OTHER_INPUT", ("README.md",))
    for data, age_s, runs in (({"sources": NOW["chip"]}, 0, []), ({"sources": "old"}, 0, ["cycles"]), ({}, 0, ["cycles"]),
                              ({"sources": NOW["chip"], "broken": ["deadline"]}, 0, ["cycles"]), ({"sources": NOW["chip"]}, 1e6, ["cycles"])):
        page.made.clear()
        path.write_text(json.dumps(data))
        os.utime(path, (time.time() + 10 - age_s,) * 2)
        page("--check", "--compiler")
        assert page.made == runs, data


def test_without_a_compiler_the_check_says_what_it_leaves_out(page, monkeypatch, capsys):
    monkeypatch.setitem(readme.SOURCES, "fast", Source(("cycles",), "chip", "seconds"))
    assert page("--check")[0] == 0 and page.made == []
    assert "not checked: size, cycles, longest path" in capsys.readouterr().out
    with pytest.raises(UserError, match="^'fast' needs Microchip's compiler"):
        page("fast")


def test_a_sweep_whose_table_counts_what_holds_is_a_result_with_rows_that_do_not(monkeypatch, tmp_path, capsys):
    (tmp_path / "build").mkdir()
    (tmp_path / "Makefile").write_text("pulse:\n\t@echo '43 of 90 expectations hold'; echo 'foc33: pulse: got swing' >&2; exit 1\n"
                                       "broken:\n\t@echo 'foc33: no such motor' >&2; exit 1\n", encoding="utf-8")
    monkeypatch.setattr(readme, "ROOT", tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(paths.ROOT))
    readme.make("pulse", counts=True)
    assert "43 of 90 expectations hold" in capsys.readouterr().out
    (tmp_path / "Makefile").write_text("soak:\n\t@echo '3 of 5 segments are well'; exit 1\n" + (tmp_path / "Makefile").read_text(encoding="utf-8"), encoding="utf-8")
    readme.make("soak", counts=True)
    with pytest.raises(UserError, match="got swing"):
        readme.make("pulse")
    with pytest.raises(UserError, match="no such motor"):
        readme.make("broken", counts=True)
    assert [name for name, source in SOURCES.items() if source.counts] == ["held", "pulse", "soak"], "what the README guarantees must hold: figures.soak() refuses what is wrong without a held shaft"


def test_a_target_that_fails_is_one_line_with_its_own_words_and_knows_nothing_of_this_make(monkeypatch, capsys):
    for name in ("MAKEFLAGS", "MAKELEVEL", "CHECK", "ONLY"):
        monkeypatch.setenv(name, "1")
    with pytest.raises(UserError, match=r"^make find-xc16 XC16=/none fails: no xc16-gcc, XC16=/none has no bin/xc16-gcc: .*, build/readme.log: "):
        readme.make("find-xc16 XC16=/none")
    assert capsys.readouterr().out == "  make find-xc16 XC16=/none\n"
    readme.make("help")


def test_an_unknown_name_is_one_line_with_the_nearest():
    refused(command("demmo", main=readme.main), "no table or measurement 'demmo', ONLY: did you mean 'demo'?")


# ---- the pages as they are -----------------------------------------------------------------------------------------------
def test_every_table_of_the_pages_is_filled_and_every_row_knows_its_firmware():
    texts = readme.pages()
    places = readme.blocks_of(texts)
    for name, path in places.items():
        block = next(match[3] for match in readme.BLOCK.finditer(texts[path]) if match[2] == name)
        head, rows = readme.rows_in(block)
        assert len(rows) >= len(BLOCKS[name]), name
        for row in rows:
            assert len(row.cells) == len(head) and re.fullmatch(r"[0-9a-f]{8}", row.sum) and re.fullmatch(r"\d{4}-\d\d-\d\d", row.date), (name, row)
        assert all(readme.kept(part, rows) for part in BLOCKS[name]), name


def test_every_source_is_shown_and_every_part_has_sources_of_one_kind():
    parts = [part for block in BLOCKS.values() for part in block]
    assert {source for part in parts for source in part.sources} == set(SOURCES)
    assert all(len({SOURCES[source].of for source in part.sources}) == 1 for part in parts)


def test_a_row_reads_back_what_it_wrote():
    row = Row(["name", "1 / 2", ""], "2030-01-01", "12345678")
    assert Row.read(row.text("12345678")) == row == Row.read(row.text("other"))
    assert "(of 2030-01-01)" in row.text("other") and "(of" not in row.text("12345678")
