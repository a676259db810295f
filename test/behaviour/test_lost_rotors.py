"""Motors with light rotors, whose rotor a load step stops within milliseconds, or a hand: they are found and go on, none is called a stall."""

import argparse

import pytest

from tools.bench import build, command_common, held_sweep, loadsteps, start_sweep
from tools.bench.held_sweep import Case
from tools.common import board_file, motor_file, paths
from tuning import design, header

TRINAMIC, IPM, DMA0204 = "trinamic_qbl4208_41_04_006", "ipm_4pp_24v_2000", "hurst_dma0204024b101"


def sweep(kind, module, name, folder):
    values = motor_file.load(name)
    (folder / build.HEADER).write_text(header.write(design.design(values, board_file.load("mclv"))), encoding="utf-8")
    table = module.Table.read(paths.TABLES / f"{kind.name}.toml")
    options = argparse.Namespace(motor=name, board="mclv", userparams=str(folder), library=None)
    motor, board, library, _ = command_common.set_up(table, options, [])
    return kind(table.for_motor(values, library.params), motor, board, library)


@pytest.mark.parametrize("name", [TRINAMIC, IPM])
def test_a_rotor_that_a_load_step_stops_is_back_whatever_its_flux(name, tmp_path):
    steps = sweep(loadsteps.LoadSteps, loadsteps, name, tmp_path)
    lowest = min(steps.table.speeds_rpm)
    rows = steps.run([item for item in steps.cases() if item.rpm == lowest], name)
    assert len(rows) == 9 and max(row["dip_percent"] for row in rows) > 95.0
    assert {row["name"] + f", Kphi x{row['kphi']:g}": row["verdict"] for row in rows if row["verdict"] != "ok"} == {}


@pytest.mark.parametrize("name, item", [
    (TRINAMIC, Case(400.0, 0.0, 1.0, 0.03, 90.0)), # let go while the answer waits
    (TRINAMIC, Case(400.0, 0.0, 9.0, 0.2, 180.0)),
    (IPM, Case(400.0, 0.0725, 36.0, 0.01, 90.0))], ids=str)
def test_a_shaft_that_is_let_go_is_not_thrown_backwards(name, item, tmp_path):
    held = sweep(held_sweep.Held, held_sweep, name, tmp_path)
    row, = held.run([item], name)
    assert [outcome.got for outcome in held.check(item, row) if not outcome.ok] == [] and row["backwards_rpm"] <= held.most_back_rpm


def test_a_brake_that_takes_300_rpm_a_millisecond_drives_no_current_over_its_limit(tmp_path):
    held, item = sweep(held_sweep.Held, held_sweep, DMA0204, tmp_path), Case(2100.0, 0.0, 1.0, 0.08, 0.0, brake_nm=0.546)
    row, = held.run([item], DMA0204)
    assert row["fault"] is None and row["backwards_rpm"] == 0.0 and row["back_s"] < 0.2


def test_a_salient_motor_with_less_flux_and_inductance_than_its_header_says_starts_under_load(tmp_path):
    starts = sweep(start_sweep.Starts, start_sweep, IPM, tmp_path)
    items = [item for item in starts.table.box(full=True) if (item.L, item.Kphi) == (0.75, 0.8)]
    rows = starts.run(items, IPM)
    assert len(rows) == 40 and [f"{outcome.row}: {outcome.got}" for item, row in zip(items, rows) for outcome in starts.check(item, row) if not outcome.ok] == []
