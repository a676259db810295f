"""The sweep over the numbers chosen by trial: a changed row reaches the build, and what moves, fails or does neither is told as that."""

import json
import subprocess
from pathlib import Path

import pytest
from support import command, refused

from tools.bench import sensitivity
from tools.bench.sensitivity import NOTHING, SAME, Found, Probe, Sensitivity, Table, Variant, build_all, edges, moved, nothing_moves, own_of
from tools.common import paths
from tools.common.tuned_rows import TABLE, tuned, with_value
from tools.common.x_macro import run_compiler

TEXT = (paths.TABLES / "sensitivity.toml").read_text(encoding="utf-8")
LARGE, TURN = tuned()["GATE_SHARE"], tuned()["DEAD_EACH_TURN"]
STEP, START, STALL = Probe("step", (500.0, 0.04)), Probe("start", (0.0, 90.0)), Probe("fault_stall")
BEFORE = [Found(STEP, 1, "", {"dip_percent": 20.0, "angle_deg": 5.0}), Found(START, 2, "", {"start_s": 1.3}), Found(STALL, 3)]


def summed(variant, found):
    return Sensitivity(None).summed(variant, found, BEFORE)


def table():
    return Table.read(paths.TABLES / "sensitivity.toml")


def test_a_variant_is_told_against_the_same_probes_as_they_stand():
    row = summed(Variant(LARGE, "0.104"), [Found(STEP, 7, "", {"dip_percent": 23.5, "angle_deg": 4.0})])
    assert (row["name"], row["dip_percent_told"], row["angle_deg_told"]) == ("GATE_SHARE 0.13 -> 0.104", "23.50 +3.50", "4.00 -1.00")
    assert row["moved"] == [STEP.name] and row["verdict"] == "" and row["starts"] is None and row["start_s"] is None
    assert summed(Variant(), BEFORE)["verdict"] == "ok" and summed(Variant(), BEFORE)["starts"] == "1/1"


def test_what_fails_with_a_changed_number_and_not_as_it_stands_is_an_edge():
    row = summed(Variant(LARGE, "0.104"), [BEFORE[0], Found(START, 9, "start 0 90: no closed loop"), BEFORE[2]])
    assert (row["verdict"], row["why"]) == ("edge", "start 0 90: no closed loop") and row["starts"] == "0/1"
    known = [*BEFORE[:2], Found(STALL, 3, "fault_stall: late")]
    assert Sensitivity(None).summed(Variant(LARGE, "0.1"), [*BEFORE[:2], Found(STALL, 8, "fault_stall: late")], known)["verdict"] == ""
    rows = [{"number": "A", "verdict": "edge"}, {"number": "A", "verdict": ""}, {"number": "B", "verdict": "does not build"}, {"number": "C", "verdict": NOTHING}]
    assert edges(rows) == ["A", "B"]


def test_a_number_moves_nothing_only_where_it_does_neither_less_nor_more():
    assert summed(Variant(LARGE, "0.1"), BEFORE)["verdict"] == NOTHING and summed(Variant(TURN, "0.1", said=SAME), [])["verdict"] == SAME
    assert moved([Found(STEP, 1), Found(START, 5)], BEFORE) == [START.name]
    rows = [{"number": name, "verdict": verdict} for name, verdict in
            (("A", NOTHING), ("A", SAME), ("B", NOTHING), ("B", ""), ("C", ""), ("C", "edge"), ("D", SAME), ("D", SAME))]
    assert nothing_moves(rows) == ["A", "D"]


def test_every_row_has_probes_that_are_like_its_command():
    sweep = Sensitivity(table())
    probes = sweep.probes()
    assert len(set(probes)) == len(probes)
    own = {row.command: own_of(row, probes) for row in tuned().values()}
    assert {probe.kind for probe in own["loadsteps"]} == {"step"} and {probe.kind for probe in own["starts"]} == {"start"}
    assert [probe.name for probe in own["run SCENARIO=fault_stall"]] == ["fault_stall"] and [probe.other for probe in own["robust"]].count(True) == 1
    assert own["table2"] == probes # there is none like it: all of them


def test_the_numbers_asked_for_are_changed_in_both_directions():
    sweep = Sensitivity(table())
    assert len(sweep.variants()) == 1 + 2 * len(tuned())
    sweep.only = ("GATE_SHARE", "SPEED_TRIM_SHIFT")
    assert [variant.name for variant in sweep.variants()] == [
        "as it stands", "SPEED_TRIM_SHIFT 8 -> 7", "SPEED_TRIM_SHIFT 8 -> 9", "GATE_SHARE 0.13 -> 0.104", "GATE_SHARE 0.13 -> 0.156"]


def test_a_row_that_there_is_not_and_a_wrong_table_are_one_line(tmp_path, monkeypatch):
    refused(command("sensitivity", "--only", "LARGE_SHARES"), "no number 'LARGE_SHARES'", "control/tuned.h", "GATE_SHARE")
    monkeypatch.setattr(paths, "TABLES", tmp_path)
    for old, new, said in (("step_nm = [0.04, 0.05]", "step_nm = [0.04]", "columns of different lengths"), ("[1.4, 1.3, 0.85]", "[1.4]", "other_factors are three")):
        assert old in TEXT
        (tmp_path / "sensitivity.toml").write_text(TEXT.replace(old, new), encoding="utf-8")
        refused(command("sensitivity"), said, "sensitivity.toml")


def test_the_table_of_another_motor_has_its_shares_and_what_follows_its_header():
    class Motor:
        name, rated_speed_rpm, rated_torque_nm, start_torque_nm = "other", 5600.0, 0.16, 0.06
    other = table().for_motor(Motor, {"MINIMUM_SPEED_RPM": 300.0, "MAXIMUM_SPEED_RPM": 4000.0})
    own = table()
    assert other.motor == "other" and other.step_rpm[0] == 2 * own.step_rpm[0] and other.step_rpm[1] == 4000.0
    assert other.step_nm == [2 * torque for torque in own.step_nm] and min(other.low_rpm) >= 120.0 and "rated" in other.scenarios


# ---- a changed row reaches the build ---------------------------------------------------------------------------------------
def gate_erpm(folder: Path) -> int:
    source = '#include <stdio.h>\n#include "drive/param_init.h"\nstatic const drive_params_t p = DRIVE_PARAMS_INIT;\nint main(void) { printf("%d", p.observer.gate_erpm); return 0; }'
    done = run_compiler(["-w", f"-I{folder}", f"-I{paths.ROOT}/include", f"-I{paths.ROOT}", "-o", f"{folder}/program"], source)
    assert done.returncode == 0, done.stderr
    return int(subprocess.run([f"{folder}/program"], capture_output=True, check=True).stdout)


def test_a_folder_before_the_others_has_the_changed_row(tmp_path):
    stands = gate_erpm(tmp_path)
    (tmp_path / "control").mkdir()
    (tmp_path / "control/tuned.h").write_text(with_value(TABLE.read_text(encoding="utf-8"), LARGE, "0.26"), encoding="utf-8")
    assert gate_erpm(tmp_path) == pytest.approx(2 * stands, abs=1)


def test_a_library_is_built_with_a_changed_row_and_one_that_changes_nothing_is_known(tmp_path, monkeypatch):
    monkeypatch.setattr(sensitivity, "FOLDER", tmp_path / "sensitivity")
    variants = [Variant(), Variant(LARGE, "0.2"), Variant(TURN, "0.04"), Variant(LARGE, "no_number")]
    build_all(variants, paths.ROOT, ("PARAMS_IN_RAM",), True)
    assert [variant.library is not None for variant in variants] == [True, True, False, False]
    assert variants[2].said == SAME and variants[3].said.startswith("does not build: ")


def test_the_command_finds_what_moves_and_leaves_table_summary_and_picture(tmp_path, monkeypatch):
    short = TEXT
    for old, new in (("step_rpm = [500, 2500]", "step_rpm = [1000]"), ("step_nm = [0.04, 0.05]", "step_nm = [0.05]"), ("low_nm = [0, 0.06]", "low_nm = [0]"),
                     ("150, 130, 115, 100, 88, 77, 68, 60, 54, 50", "150, 130"), ("[0, 100, 190, 280]", "[0]"), ("start_nm = [0, 0.03]", "start_nm = [0]"),
                     ("smoke fault_stall fault_stall_running fault_open_phase fault_lost_lock catch_backward stop_from_top brake_without_sink rare_paths", "fault_offset")):
        assert old in short
        short = short.replace(old, new)
    monkeypatch.setattr(paths, "TABLES", tmp_path)
    monkeypatch.setattr(sensitivity, "FOLDER", tmp_path / "sensitivity")
    (tmp_path / "sensitivity.toml").write_text(short, encoding="utf-8")
    code, out, error = command("sensitivity", "--only", "PARAM_FAST_GAIN", "SALIENCE_LEAST_SHIFT", "--out", str(tmp_path / "out"), "--quiet")
    assert (code, error) == (0, "") and "\nmoves nothing: SALIENCE_LEAST_SHIFT\non an edge: none\n" in out, out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"index.html", "summary.json", "sensitivity.csv", "sensitivity.png"}
    data = json.loads((tmp_path / "out/summary.json").read_text(encoding="utf-8"))
    less = next(row for row in data["rows"] if row["name"] == "PARAM_FAST_GAIN 1.8 -> 1.44")
    assert less["dip_percent"] > less["dip_percent_before"] > 5.0 and data["nothing"] == ["SALIENCE_LEAST_SHIFT"] and data["edges"] == []
