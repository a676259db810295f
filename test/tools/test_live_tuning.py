"""Parameters that are tuned live: what is written to the board is what a build would have, and what cannot work or needs a build is said."""

import contextlib
import ctypes
import functools
import re
import shutil
from pathlib import Path

import pytest
from live_browser import PATIENCE_S, SIZE, Page, accessible
from live_support import KEPT_DEFINES, kept_parts, parts, served, until
from support import refusal

from tools.bench import command_common
from tools.bench.board import Board, Library
from tools.common import board_file, motor_file, paths
from tools.common.param_rows import parameters, texts_of, with_values
from tools.live import board
from tools.live.pace import Pacemaker
from tools.live.real_board import RealBoard
from tools.live.recording import Origin
from tools.live.symbols import Symbols
from tools.live.tuning import BOARD, LATER, NOWHERE, Tuning, others_of, tuned
from tools.live.virtual_board import VirtualBoard
from tuning.constants import number_of
from tuning.design import design

HEADER = paths.ROOT / "userparams.h"
DEFINES = [*KEPT_DEFINES.replace("-D", "").split(), board.SCOPE]
CTRL_A, CTRL_Z, ENTER = "\ue009a", "\ue009z", "\ue007"


@functools.cache
def symbols() -> Symbols:
    return Symbols.read(kept_parts().symbols)


def bytes_of(library: Library) -> bytes:
    """The parameters of the PC's firmware as they lie in its memory."""
    items = [item for name, item in symbols().variables.items() if name.startswith("board_params.")]
    first, last = min(item.address for item in items), max(item.address + item.bytes for item in items)
    return bytes((ctypes.c_ubyte * (last - first)).in_dll(library.c, "board_params"))


class Bench:
    """A virtual board in a thread, and the page's side of it."""

    def __init__(self) -> None:
        made_of = kept_parts()
        self.tuning = Tuning.of(HEADER, DEFINES, symbols(), symbols())
        self.board = VirtualBoard(made_of.library, Origin(made_of.motor, made_of.board, DEFINES, {}), symbols(), self.tuning)
        self.messages: list[dict] = []
        self.maker = Pacemaker(self.board, lambda frame: None)
        self.board.start(self.messages.append)
        self.maker.start()

    def close(self) -> None:
        self.board.end()
        self.maker.end()
        assert self.maker.error is None

    def do(self, **command) -> None:
        self.maker.call(lambda: self.board.act(command)).result(5)

    def frame(self) -> dict:
        return self.maker.call(self.board.frame).result(5)

    def memory(self) -> bytes:
        return self.maker.call(lambda: bytes_of(self.board.library)).result(5)

    def change(self, name: str, text: str) -> None:
        """Until the board has it."""
        self.tuning.ask([name, text])
        self.written()

    def written(self) -> None:
        until(lambda: not self.tuning.todo, "it is not written")

    def logs(self, text: str) -> None:
        until(lambda: (self.frame(), any(line["text"] == text for line in list(self.board.log)))[1], lambda: f"{text}: {[line['text'] for line in self.board.log]}")


@pytest.fixture(scope="module")
def living():
    with contextlib.closing(Bench()) as item:
        yield item


@pytest.fixture
def bench(living):
    """With the header's values."""
    while living.tuning.before:
        living.tuning.ask("undo")
    living.written()
    return living


def header_with(folder: Path, **values: str) -> Path:
    (folder / "userparams.h").write_text(with_values(HEADER.read_text(encoding="utf-8"), values), encoding="utf-8")
    return folder


def test_what_is_written_is_what_a_build_with_these_values_has(bench, tmp_path):
    values = {"SPEED_BANDWIDTH_HZ": "9.5", "IDREF_SPEED4": "-0.61", "UNDER_VOLTAGE_V": "14"}
    before = bench.memory()
    for name, text in values.items():
        bench.change(name, text)
    built = board.parts(defines=KEPT_DEFINES, userparams=str(header_with(tmp_path, **values))).library
    assert bench.memory() == bytes_of(built) != before
    assert bench.tuning.told() == {"changed": {name: {"text": text, "place": BOARD} for name, text in values.items()}, "undo": 3, "lost": False, "foreign": 0}
    assert texts_of(bench.tuning.saved().decode()) == texts_of(HEADER.read_text(encoding="utf-8")) | values
    for name, text in values.items():
        bench.logs(f"{name} {text}")


def test_undo_brings_the_last_value_back_one_by_one(bench):
    header = bench.memory()
    bench.change("SPEED_BANDWIDTH_HZ", "9.5")
    once = bench.memory()
    bench.change("SPEED_BANDWIDTH_HZ", "8")
    bench.change("SPEED_BANDWIDTH_HZ", "8") # no change, and nothing to undo
    for wanted in (once, header):
        bench.tuning.ask("undo")
        bench.written()
        assert bench.memory() == wanted
    assert bench.tuning.told()["changed"] == {} and bench.tuning.saved() == HEADER.read_bytes()
    refusal(lambda: bench.tuning.ask("undo"), "nothing to undo")


def test_a_value_that_is_the_header_s_again_is_no_change(bench):
    bench.change("INVKFI_SPEED3", "7000")
    assert list(bench.tuning.told()["changed"]) == ["INVKFI_SPEED3"]
    bench.change("INVKFI_SPEED3", "NORM_INVKFIBASE")
    assert bench.tuning.told()["changed"] == {} and bench.tuning.wanted == {}


def test_a_header_whose_comments_are_not_utf_8_or_whose_lines_end_as_a_windows_editor_ends_them_is_saved_as_it_is(tmp_path):
    content = HEADER.read_bytes().replace(b"\n", b"\r\n", 20) + b"/* 25 \xb0C, \xb5s */\n"
    (tmp_path / HEADER.name).write_bytes(content)
    tuning = Tuning.of(tmp_path / HEADER.name, DEFINES, symbols(), symbols())
    with contextlib.ExitStack() as stack:
        stack.callback(tuning.end)
        assert tuning.saved() == content
        tuning.ask(["SPEED_BANDWIDTH_HZ", "9.5"])
        changed = [(old, new) for old, new in zip(content.splitlines(True), tuning.saved().splitlines(True), strict=True) if old != new]
        assert tuning.wanted and len(changed) == 1 and changed[0][1].split()[:3] == [b"#define", b"SPEED_BANDWIDTH_HZ", b"9.5"]


def test_a_folder_that_somebody_has_cleaned_is_made_again_and_one_that_cannot_be_written_is_told(bench, tmp_path):
    folder = bench.tuning.compiler.folder
    shutil.rmtree(folder)
    bench.change("SPEED_BANDWIDTH_HZ", "9.25")
    (tmp_path / "file").write_text("")
    before = bench.tuning.told()
    bench.tuning.compiler.folder = tmp_path / "file" / "folder"
    try:
        refusal(lambda: bench.tuning.ask(["SPEED_BANDWIDTH_HZ", "9.125"]), "Not a directory", str(tmp_path / "file" / "folder"), "nothing has changed")
    finally:
        bench.tuning.compiler.folder = folder
    assert bench.tuning.told() == before


def test_a_turning_motor_follows_the_changed_ramp(bench):
    bench.do(power=True)
    until(lambda: bench.frame()["state"] == "STOPPED", "not STOPPED")
    bench.do(press="S2")
    bench.do(release="S2")
    until(lambda: bench.frame()["state"] == "CLOSED", "does not turn")
    bench.change("SPEEDREFRAMP_RPM_PER_S", "300")
    until(lambda: bench.frame()["now"]["reference_rpm"] < 152.0, "not at its lowest speed")
    bench.do(set=["input.pot", 1.0])
    seen = []
    until(lambda: (seen.append(bench.frame()), seen[-1]["t"] > seen[0]["t"] + 1.0)[1], "no time passes")
    slope = (seen[-1]["now"]["reference_rpm"] - seen[0]["now"]["reference_rpm"]) / (seen[-1]["t"] - seen[0]["t"])
    assert slope == pytest.approx(300.0, rel=0.1)
    bench.do(set=["input.pot", 0.0])
    bench.do(press="S2")
    bench.do(release="S2")


@pytest.mark.parametrize("wish, parts_", [
    (["SPEED_BANDWIDTH_HZ", "9000"], ["SPEED_BANDWIDTH_HZ = 9000 is outside 0.2 .. 60 Hz", "nothing has changed"]),
    (["IDREF_SPEED5", "-9"], ["IDREF_SPEED5 = -9 must not exceed MAXIMUM_CURRENT_A"]),
    (["SPEED_BANDWIDTH_HZ", "fast"], ["SPEED_BANDWIDTH_HZ: 'fast' is no number", "Hz"]),
    (["SPEED_BANDWIDTH_HZ", "9 /* */\n#include <x>"], ["is no number"]),
    (["SPEED_BANDWITH_HZ", "9"], ["no parameter 'SPEED_BANDWITH_HZ'", "SPEED_BANDWIDTH_HZ"]),
    (["SPEED_BANDWIDTH_HZ", 9], ["no such change"]), ("redo", ["no such change"]), (None, ["no such change"])])
def test_what_cannot_work_is_refused_in_one_line_and_changes_nothing(bench, wish, parts_):
    before, told, count = bench.memory(), bench.tuning.told(), len(bench.messages)
    refusal(lambda: bench.tuning.ask(wish), *parts_)
    assert bench.memory() == before and bench.tuning.told() == told and not bench.tuning.todo
    assert {"tuning": told} in bench.messages[count:], "the page shows the old value again"


@pytest.mark.parametrize("name, text, place, said", [
    ("MAXIMUM_SPEED_RPM", "5000", LATER, "needs a build"), ("RETRY_COUNT", "3", LATER, "needs a build"), ("NOMINAL_BUS_V", "23", LATER, "needs a build"),
    ("MOTOR_NTC_OHM", "9000", NOWHERE, "this build does not ask for it")])
def test_what_a_running_board_cannot_have_goes_into_the_saved_header_alone(bench, name, text, place, said):
    before = bench.memory()
    bench.change(name, text)
    assert bench.memory() == before and bench.tuning.told()["changed"] == {name: {"text": text, "place": place}}
    assert texts_of(bench.tuning.saved().decode())[name] == text
    bench.logs(f"{name} {text}: {said}")


def test_beside_a_value_that_needs_a_build_others_are_still_written(bench):
    bench.change("UNDER_VOLTAGE_V", "14")
    alone = bench.memory()
    bench.tuning.ask("undo")
    own = others_of("#define TORQUE_MODE /* x */\n# define MY_GAIN 3\n/* #define TUNING */\n#define SCOPE 1\n#define USERPARAMS_H\n")
    assert own == {"TORQUE_MODE": "", "MY_GAIN": "3"}
    bench.change("NOMINAL_BUS_V", "23")
    bench.change("UNDER_VOLTAGE_V", "14")
    assert [row["place"] for row in bench.tuning.told()["changed"].values()] == [LATER, BOARD]
    assert bench.memory() == alone
    refusal(lambda: bench.tuning.ask(["OVER_VOLTAGE_V", "13"]), "OVER_VOLTAGE_V")


def test_a_board_that_was_switched_off_has_lost_them_and_gets_them_again(bench):
    header = bench.memory()
    bench.change("SPEED_BANDWIDTH_HZ", "9.5")
    changed = bench.memory()
    bench.do(power=True)
    until(lambda: bench.tuning.told()["lost"], "nobody says it")
    assert bench.memory() == header
    bench.logs("the board has lost the changed parameters")
    bench.tuning.ask("again")
    until(lambda: not bench.tuning.told()["lost"], "still lost")
    assert bench.memory() == changed
    assert {"tuning": bench.tuning.told()} in bench.messages


def test_a_reset_brings_the_header_s_values_back_without_kept_ones_too():
    board = Board(command_common.library_for(["PARAMS_IN_RAM"], None, None))
    board.power_up()
    start = board.parameter("IDREF_SPEED5")
    board.write_parameter("IDREF_SPEED5", start - 0.5)
    assert board.parameter("IDREF_SPEED5") == pytest.approx(start - 0.5, abs=1e-3)
    board.power_up()
    assert board.parameter("IDREF_SPEED5") == start
    board.close()


def test_values_of_the_board_that_are_not_the_header_s_are_counted(tmp_path):
    tuning = Tuning.of(header_with(tmp_path, SPEED_BANDWIDTH_HZ="9.5", UNDER_VOLTAGE_V="14") / "userparams.h", DEFINES, symbols(), symbols())
    own = Tuning.of(HEADER, DEFINES, symbols(), symbols())
    memory = own.built.params
    first = min(item.address for name, item in symbols().variables.items() if name.startswith("board_params."))

    class Wire:
        written = 0

        def read(self, address: int, n: int) -> bytes:
            return memory[address - first:address - first + n]

        def write(self, address: int, data: bytes) -> None:
            self.written += 1

    wire = Wire()
    with contextlib.closing(contextlib.ExitStack()) as stack:
        stack.callback(own.end)
        stack.callback(tuning.end)
        tuning.ask(["DERATE_BELOW_V", "16"])
        tuning.beat(wire)
        differs = sum(value != tuning.members(own.built)[name] for name, value in tuning.members(tuning.built).items())
        assert tuning.told()["foreign"] == differs >= 2 and wire.written > 0


def test_the_motor_file_of_changed_values_makes_the_same_header(bench, tmp_path):
    values = {"SPEED_BANDWIDTH_HZ": "9.5", "IDREF_SPEED4": "-0.61", "MOTOR_INERTIA_KGM2": "0.000006"}
    for name, text in values.items():
        bench.change(name, text)
    name, text = bench.tuning.motor()
    (tmp_path / name).write_text(text, encoding="utf-8")
    motor = motor_file.load(str(tmp_path / name))
    made = design(motor, board_file.load(*board_file.named(motor))).params
    saved = texts_of(bench.tuning.saved().decode())
    assert name == "hurst_dmb0224c10002.toml" and {key: (made[key], value) for key, value in saved.items() if made[key] != value and number_of(made[key]) != number_of(value)} == {}
    assert saved == texts_of(HEADER.read_text(encoding="utf-8")) | values
    own = others_of("#define TORQUE_MODE /* x */\n# define MY_GAIN 3\n/* #define TUNING */\n#define SCOPE 1\n#define USERPARAMS_H\n")
    assert own == {"TORQUE_MODE": "", "MY_GAIN": "3"}
    bench.change("NOMINAL_BUS_V", "23")
    assert "# Not in it: NOMINAL_BUS_V 23 (a board file says it).\n" in bench.tuning.motor()[1]
    bench.logs("not in the motor file: NOMINAL_BUS_V 23 (a board file says it)")


def test_a_header_that_names_no_motor_file_has_none_to_save_unless_one_is_given(tmp_path):
    header = tmp_path / "userparams.h"
    header.write_text(re.sub(r"Made from .*", "My own.", HEADER.read_text(encoding="utf-8")), encoding="utf-8")
    refusal(Tuning.of(header, DEFINES, symbols(), symbols()).motor, "names no motor file", "MOTOR=name")
    gone = tmp_path / "gone.h"
    gone.write_text(HEADER.read_text(encoding="utf-8").replace("tuning/motors/hurst_dmb0224c10002.toml", "tuning/motors/gone.toml"), encoding="utf-8")
    refusal(Tuning.of(gone, DEFINES, symbols(), symbols()).motor, "the header's file is not there, tuning/motors/gone.toml", "MOTOR=name")
    files = (paths.MOTORS / "hurst_dmb0224c10002.toml", paths.BOARDS / "mclv.toml")
    assert Tuning.of(header, DEFINES, symbols(), symbols(), files).motor() == Tuning.of(HEADER, DEFINES, symbols(), symbols()).motor()


def test_what_was_built_is_removed_in_the_end():
    tuning = Tuning.of(HEADER, DEFINES, symbols(), symbols())
    folders = [tuning.compiler.folder, tuning.compiler.results]
    tuning.ask(["SPEED_BANDWIDTH_HZ", "9.5"])
    assert all(folder.is_dir() for folder in folders)
    tuning.end()
    assert not any(folder.exists() for folder in folders)


def test_every_parameter_of_the_header_is_told_by_subject_with_unit_range_header_s_value_and_meaning(bench):
    rows = {row["name"]: (subject, row) for subject, group in bench.tuning.hello()["subjects"].items() for row in group}
    assert set(rows) == set(texts_of(HEADER.read_text(encoding="utf-8"))) and len(rows) > 100
    for name, (subject, row) in rows.items():
        item = parameters()[name]
        assert (subject, row["unit"], row["low"], row["high"], row["meaning"]) == (item.section, item.unit, item.low, item.high, item.meaning)


def test_where_parameters_are_constants_the_page_says_what_to_build():
    plain = Symbols.read(parts().symbols)
    assert Tuning.of(HEADER, [board.SCOPE], plain, plain) is None and Tuning.of(HEADER, DEFINES, symbols(), plain) is None
    page = object.__new__(RealBoard)
    page.tuning = None
    for what in (page.header, lambda: tuned(page.tuning)):
        refusal(what, "constants of this firmware", "DEFINES=-DPARAMS_IN_RAM")


# ---- in the browser ---------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def server():
    with served(f"--defines={KEPT_DEFINES}", made_of=kept_parts()) as running:
        yield running


@pytest.fixture
def page(chromium, server) -> Page:
    page = Page(chromium[0], server.url)
    page.wait("return window.eval('foc33.frame') !== null", "no frame")
    while not page.run("return document.getElementById('tuning-undo').disabled"):
        left = page.run("return window.eval('views.tuning.told.undo')")
        page.run("document.getElementById('tuning-undo').click()")
        waits(page, f"window.eval('views.tuning.told.undo') === {left - 1}", "no undo")
    return page


def field(page: Page, subject: str, name: str):
    """A parameter's field, its subject chosen."""
    page.run("const s = document.getElementById('tuning-subject'); s.value = arguments[0]; s.dispatchEvent(new Event('change'))", subject)
    return page.driver.execute_script("return [...document.querySelectorAll('.parameter')].find((row) => row.querySelector('b').textContent === arguments[0]).querySelector('input')", name)


def waits(page: Page, script: str, what: str) -> None:
    """The compiler takes its time."""
    page.wait(f"return {script}", what, 4 * PATIENCE_S)


def typed(page: Page, name: str, text: str) -> None:
    item = field(page, parameters()[name].section, name)
    item.send_keys(CTRL_A)
    item.send_keys(text + ENTER)


def test_a_value_that_is_typed_is_in_the_board_unsaved_undone_by_one_key_and_saved_as_a_header(page):
    typed(page, "SPEED_BANDWIDTH_HZ", "9.5")
    waits(page, "document.getElementById('tuning-text').textContent === 'unsaved: SPEED_BANDWIDTH_HZ'", "not changed")
    item = field(page, parameters()["SPEED_BANDWIDTH_HZ"].section, "SPEED_BANDWIDTH_HZ")
    assert item.get_attribute("value") == "9.5" and "changed" in item.get_attribute("class")
    text = page.run("return fetch(`/save/header${location.search}`).then((answer) => answer.text())")
    assert texts_of(text)["SPEED_BANDWIDTH_HZ"] == "9.5"
    name, text = page.run("return fetch(`/save/motor${location.search}`).then(async (answer) => [answer.headers.get('Content-Disposition'), await answer.text()])")
    assert name == 'attachment; filename="hurst_dmb0224c10002.toml"' and "\n[tune]\nSPEED_BANDWIDTH_HZ = 9.5\n" in text
    page.wait("return window.eval('foc33.frame.kept').unsaved > 0", "the board does not have it") # as the firmware itself counts
    item.send_keys(CTRL_Z)
    waits(page, "document.getElementById('tuning-text').textContent === 'nothing is changed'", "not undone")
    assert item.get_attribute("value") == texts_of(HEADER.read_text(encoding="utf-8"))["SPEED_BANDWIDTH_HZ"]
    page.wait("return window.eval('foc33.frame.kept').unsaved === 0", "the board still has it")


def test_ctrl_z_beside_the_card_undoes_too_and_in_a_field_of_another_card_it_does_not(page):
    typed(page, "SPEED_BANDWIDTH_HZ", "9.5")
    waits(page, "document.getElementById('tuning-text').textContent === 'unsaved: SPEED_BANDWIDTH_HZ'", "not changed")
    press = "document.activeElement.blur(); %s.dispatchEvent(new KeyboardEvent('keydown', { key: 'z', ctrlKey: true, bubbles: true, cancelable: true }))"
    assert page.run("return " + press.replace("document.activeElement.blur(); ", "") % "document.querySelector('#scope-card input')")
    assert not page.run("document.activeElement.blur(); return " + press.split("; ", 1)[1] % "document.body") # the browser's own undo would change the field
    waits(page, "document.getElementById('tuning-text').textContent === 'nothing is changed'", "not undone")
    item = field(page, parameters()["SPEED_BANDWIDTH_HZ"].section, "SPEED_BANDWIDTH_HZ")
    assert item.get_attribute("value") == texts_of(HEADER.read_text(encoding="utf-8"))["SPEED_BANDWIDTH_HZ"]


def test_what_was_saved_is_no_longer_unsaved_until_it_changes_again(page):
    typed(page, "SPEED_BANDWIDTH_HZ", "9.5")
    waits(page, "document.getElementById('tuning-text').textContent === 'unsaved: SPEED_BANDWIDTH_HZ'", "not changed")
    page.run("document.getElementById('save-header').click()")
    waits(page, "document.getElementById('tuning-text').textContent === 'all changes are saved'", "still unsaved")
    field(page, parameters()["SPEED_BANDWIDTH_HZ"].section, "SPEED_BANDWIDTH_HZ")
    assert page.run("return [...document.querySelectorAll('.place')].map((place) => place.textContent).filter(Boolean)") == ["changed, saved"]
    typed(page, "LOAD_BANDWIDTH_HZ", "100")
    waits(page, "document.getElementById('tuning-text').textContent === 'unsaved: LOAD_BANDWIDTH_HZ'", "not changed")


def test_a_field_that_is_emptied_has_the_header_s_value_again(page):
    typed(page, "LOAD_BANDWIDTH_HZ", "100")
    waits(page, "document.getElementById('tuning-text').textContent === 'unsaved: LOAD_BANDWIDTH_HZ'", "not changed")
    item = field(page, parameters()["LOAD_BANDWIDTH_HZ"].section, "LOAD_BANDWIDTH_HZ")
    item.send_keys(CTRL_A)
    item.send_keys("\ue017" + ENTER)
    waits(page, "document.getElementById('tuning-text').textContent === 'nothing is changed'", "still changed")


def test_a_value_that_is_refused_says_why_and_the_old_one_is_there_again(page):
    typed(page, "SPEED_BANDWIDTH_HZ", "9000")
    waits(page, "document.getElementById('message').textContent.includes('SPEED_BANDWIDTH_HZ = 9000 is outside 0.2 .. 60 Hz')", "not refused")
    item = field(page, parameters()["SPEED_BANDWIDTH_HZ"].section, "SPEED_BANDWIDTH_HZ")
    assert item.get_attribute("value") == texts_of(HEADER.read_text(encoding="utf-8"))["SPEED_BANDWIDTH_HZ"]


def test_what_needs_a_build_says_so_beside_its_field(page):
    typed(page, "MAXIMUM_SPEED_RPM", "5000")
    waits(page, "[...document.querySelectorAll('.place')].some((place) => place.textContent.startsWith('needs a build'))", "nothing is said")


def test_the_board_goes_on_while_the_compiler_works(page):
    """What a tab asks meanwhile does not wait."""
    typed(page, "LOAD_BANDWIDTH_HZ", "100")
    page.run("document.getElementById('power').click()")
    page.wait("return window.eval('foc33.frame.t') < 1.0", "the power-up waits", 10.0)
    waits(page, "window.eval('views.tuning.told.undo') === 1", "not changed")


@pytest.mark.parametrize("on", [False, True], ids=["light", "dark"])
def test_axe_finds_nothing_with_changed_and_refused_values(page, pytestconfig, on):
    typed(page, "MAXIMUM_SPEED_RPM", "5000")
    waits(page, "document.getElementById('tuning-text').textContent.startsWith('unsaved')", "not changed")
    page.run("window.eval('views.tuning.set({ ...views.tuning.told, lost: true, foreign: 3 })')")
    accessible(page, pytestconfig.rootpath.parent, on)


@pytest.mark.parametrize("width", [360, SIZE[0], 2560])
def test_the_card_fits_every_width(page, width):
    from tools.live import browser
    browser.resize(page.driver, width, 800)
    page.wait(f"return innerWidth === {width}", "size")
    field(page, parameters()["SPEED_BANDWIDTH_HZ"].section, "SPEED_BANDWIDTH_HZ")
    wide = page.run("return [...document.querySelectorAll('#tuning-card *')].filter((e) => e.getClientRects().length && e.scrollWidth > e.clientWidth + 1 && "
                    "getComputedStyle(e).display !== 'inline').map((e) => e.id || e.className || e.tagName)")
    assert wide == [] and page.run("return document.documentElement.scrollWidth") <= width
    browser.resize(page.driver, *SIZE)
