"""make import: a header of AN1292 becomes files that the tuner takes and a motor that turns; nothing is written after a mistake, nothing is overwritten."""

import re
import shutil
from types import SimpleNamespace

import pytest
from import_support import HEADER, LATER, changed
from support import command as bench_command
from support import refusal, refused
from tune_support import CHECK, build, command

from tools.common import board_file, motor_file, paths
from tools.common.toml_file import Document
from tuning import an1292, c_header, cli, fw_tables, import_header
from tuning.design import design


class Project:
    """Folders of motors, boards, tables and results as the project has them, elsewhere."""

    def __init__(self, root, patch: pytest.MonkeyPatch) -> None:
        self.root, self.header = root, root / "pump.h"
        for name in ("motors", "boards", "tables", "tune"):
            (root / name).mkdir()
        shutil.copy(paths.BOARDS / "mclv.toml", root / "boards")
        for owner, name, folder in ((paths, "MOTORS", "motors"), (paths, "BOARDS", "boards"), (paths, "TUNED", "tune"), (fw_tables, "FOLDER", "tables")):
            patch.setattr(owner, name, root / folder)

    def run(self, text: str = HEADER, *words: str) -> tuple[int, str, str]:
        self.header.write_text(text, encoding="utf-8")
        return command("import", str(self.header), *words)

    def files(self) -> list[str]:
        return sorted(str(path.relative_to(self.root)) for path in self.root.rglob("*") if path.is_file() and path not in (self.header, self.root / "boards/mclv.toml"))

    def written(self, name: str) -> str:
        return (self.root / name).read_text(encoding="utf-8")


@pytest.fixture
def project(tmp_path, monkeypatch):
    return Project(tmp_path, monkeypatch)


@pytest.fixture(scope="module")
def pump(tmp_path_factory):
    """The whole result of one header."""
    with pytest.MonkeyPatch.context() as patch:
        project = Project(tmp_path_factory.mktemp("import"), patch)
        code, out, error = project.run(HEADER, "inertia=8e-6", "friction=0.004", "--name", "pump")
        assert (code, error) == (0, ""), error
        motor = motor_file.load("pump")
        board = board_file.load(*board_file.named(motor))
        yield SimpleNamespace(project=project, out=out, motor=motor, board=board, design=design(motor, board), header=project.written("tune/pump/userparams.h"))


# ---- what is written ---------------------------------------------------------------------------------------------------------
def test_the_motor_file_is_the_header_s_motor_with_the_line_of_each_number(pump):
    motor = pump.motor
    assert (motor.rs_ohm, motor.lq_h, motor.kphi_v_per_krpm) == (pytest.approx(1.1, rel=1e-3), pytest.approx(0.9e-3, rel=1e-3), pytest.approx(5.8, rel=1e-3))
    assert (motor.pole_pairs, motor.rated_speed_rpm, motor.maximum_speed_rpm, motor.inertia_kgm2, motor.coulomb_nm) == (4, 3200.0, 5200.0, 8e-6, 0.004)
    assert motor.maximum_current_a == pytest.approx(0x5000 * 0.00018, rel=1e-4)
    rows = HEADER.splitlines()
    for key, name in (("resistance", "NORM_RS"), ("inductance", "NORM_LSDTBASE"), ("kphi", "NORM_INVKFIBASE"), ("pole_pairs", "NOPOLESPAIRS"), ("speed", "NOMINAL_SPEED_RPM")):
        line, named = re.fullmatch(r"pump\.h:(\d+) (\w+)", motor.quantities[key].source).groups()
        assert named == name and rows[int(line) - 1].startswith(f"#define {name} ")
    assert motor.quantities["torque"].unchecked and not motor.quantities["inertia"].unchecked


def test_the_board_file_measures_what_the_header_s_constant_says(pump):
    assert pump.board.name == "pump" and pump.board.current_full_scale_a == pytest.approx(32768 * 0.00018, rel=1e-4)
    assert (pump.board.pwm_period_s, pump.board.nominal_bus_v, pump.board.current_gain) == (50e-6, 24.0, -0.5)
    line = HEADER[:HEADER.index("#define NORM_CURRENT_CONST")].count("\n") + 1
    assert f"pump.h:{line} NORM_CURRENT_CONST" == pump.board.quantities["shunt.amplifier_gain"].source


def test_the_header_s_choices_and_tables_are_those_of_userparams_h(pump):
    params = pump.design.params
    assert pump.design.tuned_by_machine and "pump.h" in pump.design.tables_from
    assert [params[f"IDREF_SPEED{i}"] for i in (0, 1, 9, 17)] == ["0.00", "-0.30", "-2.15", "-2.60"]
    assert (params["INVKFI_SPEED0"], float(params["INVKFI_SPEED10"])) == ("NORM_INVKFIBASE", pytest.approx(7945 + 3000, abs=2))
    assert [float(params[f"INVKFI_SPEED{i}"]) for i in (15, 16, 17)] == [pytest.approx(7945 + 4500, abs=2), *[pytest.approx(1.6 * 7945, abs=2)] * 2]
    assert (float(params["LS_OVER2LS0_SPEED4"]), params["FW_START_SPEED_RPM"]) == (pytest.approx(0.42), "3200")
    assert {name: pump.motor.tune[name] for name in ("Q_CURRENT_REF_OPENLOOP", "SPEEDREFRAMP_RPM_PER_S")} == {"Q_CURRENT_REF_OPENLOOP": 1.8, "SPEEDREFRAMP_RPM_PER_S": 5000.0}
    constants = {item.name: item.q_value for item in pump.design.constants}
    assert [constants[name] for name in ("NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE")] == [7991, 1022, 7945]


def test_the_firmware_builds_with_the_userparams_h_that_was_written(pump):
    assert build(pump.header, *CHECK) == ""
    values = dict(re.findall(r"^#define (\w+) +(\S+)", pump.header, re.MULTILINE))
    assert {name: values[name] for name in pump.design.params} == pump.design.params


def test_the_imported_motor_turns_on_the_virtual_board(pump, tmp_path):
    code, out, error = bench_command("run", "rated", "--motor", "pump", "--out", str(tmp_path / "run"), "--quiet")
    assert code == 0, out + error
    assert re.search(r"(\d+) of \1 expectations hold", out)


def test_everything_is_told_value_line_place_branch_reason_and_estimate(pump):
    for words in (r"line +name +header +is +goes to", r" 25 +NORM_RS +7991 +1\.1 ohm +\[electrical\] resistance", r"3 +3968 rpm +-0\.85 A \(line \d+\) +5\.21\d* V/krpm \(line \d+\) +0\.792\d mH",
                  r"line \d+ INITOFFSET_TRANS_OPEN_CLSD \(45 degrees\): the hand-over measures", r"line \d+ PUMP_COLOUR: no name of AN1292's header",
                  r"line 9: #ifdef TUNING is not taken", r'line 5: #include "general\.h" is not read', r"torque 0\.08\d+ N m: torque constant times current",
                  r"SNAPSHOT +a mode +DEFINES=-DSNAPSHOT", r"next: make run MOTOR=pump"):
        assert re.search(words, pump.out), words
    anew, _, none = pump.out.partition("chosen anew, what takes its place is named:")[2].partition("no counterpart:")
    assert "D_CURRCNTR_PTERM (" in anew and "[tune] CURRENT_BANDWIDTH_HZ keeps yours" in anew and "INITOFFSET" not in anew and "_CURRCNTR_PTERM" not in none
    assert "inertia" not in pump.out.partition("estimated (")[2].partition(":\n")[2].partition("wrote")[0] and "contradictions:" not in pump.out


# ---- other headers -----------------------------------------------------------------------------------------------------------
def planned(text: str, tmp_path, *words: str, tuned: bool = True) -> import_header.Plan:
    """What would be written of a header; `tuned`: with the tuner's design."""
    (tmp_path / "pump.h").write_text(text, encoding="utf-8")
    told, base = import_header.given(list(words)), board_file.load("mclv")
    supply_v = float(told.board.get("supply.voltage", base.nominal_bus_v))
    found = an1292.read(c_header.read(tmp_path / "pump.h"), supply_v, base.dead_time_s, told.divisors)
    return (import_header.planned if tuned else import_header.prepared)("pump", found, base, told)


def motor_of(plan: import_header.Plan) -> motor_file.Motor:
    return motor_file.read(Document(plan.motor_path, plan.motor_text))


def test_a_header_that_measures_as_the_board_does_needs_no_board_file(project, tmp_path):
    plan = planned(changed(("NORM_CURRENT_CONST 0.00018", "NORM_CURRENT_CONST 0.0001342773")), tmp_path, tuned=False)
    assert plan.board_text == "" and motor_of(plan).board == "mclv"


def test_another_period_dead_time_supply_and_polarity_are_the_board_file_s(project, tmp_path):
    text = changed(("LOOPTIME_SEC 0.00005", "LOOPTIME_SEC 0.0000625"), ("DEADTIME_SEC 0.000002", "DEADTIME_SEC 0.0000025"), ("KCURRA Q15(-0.5)", "KCURRA Q15(0.5)"))
    board = planned(text, tmp_path, "supply=30", tuned=False).board
    assert (board.pwm_period_s, board.dead_time_s, board.nominal_bus_v, board.current_gain) == (62.5e-6, 2.5e-6, 30.0, 0.5)
    assert board.over_voltage_v == pytest.approx(42.0) and board.sample_window_s >= 2.0e-6


def test_the_form_of_2022_is_the_same_motor(project, tmp_path):
    motor = motor_of(planned(LATER, tmp_path, tuned=False))
    assert motor.rs_ohm == pytest.approx(1.1, rel=1e-3) and motor.tune["SPEEDREFRAMP_RPM_PER_S"] == 1250.0


def test_flat_tables_keep_the_d_current_only(project, tmp_path):
    tables = planned(HEADER, tmp_path, "tables=flat").tables
    assert {entry.ls_ratio for entry in tables.entries} == {0.5} and {entry.inv_kfi for entry in tables.entries} == {tables.inv_kfi_base} and tables.entries[9].idref_a == -2.15


def test_a_choice_that_cannot_work_is_the_tuner_s_and_the_reason_is_told(project, tmp_path):
    plan = planned(changed(("END_SPEED_RPM 600", "END_SPEED_RPM 60"), ("OPENLOOP_RAMPSPEED_INCREASERATE 8", "OPENLOOP_RAMPSPEED_INCREASERATE 3000")), tmp_path)
    assert not {"END_SPEED_RPM", "OPENLOOP_RAMPSPEED_INCREASERATE"} & set(plan.tune) and float(plan.design.params["END_SPEED_RPM"]) > 100.0
    assert any(text.startswith("END_SPEED_RPM = 60: the tuner chooses (") for text in plan.dropped)
    assert any("OPENLOOP_RAMPSPEED_INCREASERATE = 3000 is outside 1 .. 2000" in text for text in plan.dropped)


def test_d_currents_beyond_the_largest_current_end_there(project, tmp_path):
    plan = planned(changed(("SPEEDCNTR_OUTMAX 0x5000", "SPEEDCNTR_OUTMAX 0x7FFF"), ("IDREF_SPEED17 NORM_CURRENT(-2.6)", "IDREF_SPEED17 NORM_CURRENT(-5.8)")), tmp_path)
    most_a = plan.design.value("MAXIMUM_CURRENT_A")
    assert plan.tables.entries[17].idref_a == pytest.approx(-most_a, abs=0.01) and any("IDREF_SPEED beyond MAXIMUM_CURRENT_A" in text for text in plan.dropped)


# ---- refusals ------------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("words, parts", [
    (("inrtia=3",), ["unknown key 'inrtia'", "did you mean 'inertia'?"]), (("inertia=-1",), ["inertia = -1 kg m2 is impossible"]), (("inertia=heavy",), ["inertia = 'heavy' is not a number"]),
    (("rs_divisor=3",), ["rs_divisor = 3 is no power of two"]), (("tables=none",), ["'tables=none' is unknown"]), (("supply=400",), ["supply.voltage = 400 V is impossible"]),
    (("supply=48",), ["do not rise in this order", "pump.h and SET"]), (("--name", "a/b"), ["'a/b' is no name for a motor", "NAME"]), (("--name", "all"), ["'all' is no name"]),
    (("--board", "nix"), ["no board 'nix'", "BOARD"]), (("--defines=TUNING",), ["'TUNING' is no -DNAME", "DEFINES"]), (("current=90",), ["the rated current needs 171 V", "pump.h:25 NORM_RS"]),
    (("inertia=7",), ["in 2.85e+04 s", "given to make import", "check the unit of inertia"])])
def test_a_mistake_of_the_command_line_is_one_line_and_writes_nothing(project, words, parts):
    refused(project.run(HEADER, *words), *parts)
    assert project.files() == []


@pytest.mark.parametrize("text, parts", [
    (changed(("NORM_RS 7991", "NORM_RS 07991")), ["'07991' is octal in C", "pump.h:25"]), ("no header\n", ["no #define in the file", "pump.h"]),
    (changed(("#define NORM_LSDTBASE 1022\n", "")), ["NORM_LSDTBASE is missing", "pump.h"]), (changed(("LOOPTIME_SEC 0.00005", "LOOPTIME_SEC 1/0")), ["division by zero", "pump.h:13"])])
def test_a_mistake_of_the_header_is_one_line_and_writes_nothing(project, text, parts):
    refused(project.run(text), *parts)
    assert project.files() == []


def test_what_was_taken_for_more_than_the_header_says_is_told_where_the_tuner_refuses_it(project):
    code, out, error = project.run(changed(("#define LOCK_TIME", "#define SPEEDREFRAMP_COUNT 3\n#define LOCK_TIME")), "current=90")
    assert code == 2 and "the rated current needs" in error and "pump.h: look at\n  " in out and "rs_divisor" in out, out + error
    assert project.files() == []


def test_without_a_header_the_command_says_how_to_name_one():
    refused(command("import"), "no header", "make import HEADER=userparms.h")


@pytest.mark.parametrize("kind, name", [("motor", "motors/pump.toml"), ("board", "boards/pump.toml"), ("tables", "tables/pump.toml")])
def test_a_file_that_is_there_stays_as_it_is(project, kind, name):
    (project.root / name).write_text("mine", encoding="utf-8")
    refused(project.run(), f"the {kind} file is there already", "give another name")
    assert project.files() == [name] and project.written(name) == "mine"


def test_what_was_written_is_gone_again_where_the_tuner_cannot_write_its_header(project, monkeypatch):
    (project.root / "tune").rmdir()
    (project.root / "tune").write_text("a file in its place", encoding="utf-8")
    code, out, error = project.run()
    assert code == 2 and len(error.splitlines()) == 1 and project.files() == ["tune"]


def test_a_folder_that_cannot_be_written_is_one_line(project, monkeypatch):
    shutil.rmtree(project.root / "motors")
    refused(project.run(), "cannot write the file")
    assert project.files() == []


def test_the_command_is_one_of_the_tuner_s():
    assert "import" in cli._parser().format_help()
    assert "NORM_RS" in refusal(lambda: import_header.given(["NORM_RS=3"]))
