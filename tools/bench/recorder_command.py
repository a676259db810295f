"""`make recorder`, and what a run leaves of the fault recorder: tables and pictures.

    python3 -m tools.bench recorder [LOG]
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import drive_tables, output, paths
from tools.common.errors import UserError
from . import command_common, page, plots, recorder
from .run import Run

LOG = "uart.txt"
"""What a run's board has sent, in the run's folder."""
CSV = ("time_ms", "i_a_a", "i_b_a", "i_c_a", "v_d_v", "v_q_v", "angle_deg", "bus_v", "speed_rpm", "state")


def write(records: list[recorder.Record], params: Mapping[str, float], states: Mapping[int, str], folder: Path) -> list[str]:
    """recorder.csv and recorder.png of the last record, recorder_1 ... of those before it; the names of the pictures."""
    pictures = []
    for number, record in enumerate(records, 1):
        name = "recorder" if number == len(records) else f"recorder_{number}"
        rows = recorder.scaled(record, params, states)
        columns = (rows.time_ms, rows.i_a, rows.i_b, rows.i_c, rows.v_d, rows.v_q, rows.angle_deg, rows.bus_v, rows.speed_rpm)
        output.write_csv(folder / f"{name}.csv", list(CSV), [["" if np.isnan(value) else f"{value:.6g}" for value in line] + [state]
                                                             for *line, state in zip(*columns, rows.state)])
        pictures.append(plots.write_record(rows, recorder.title(record, rows), folder, name))
    return pictures


def of_run(run: Run, folder: Path) -> list[str]:
    """What the fault recorder has sent in a run, if anything: the text, and write()."""
    records = recorder.of_text(run.sent)
    if records:
        (folder / LOG).write_text(run.sent, encoding="latin-1", newline="")
    return write(records, run.params, run.states, folder)


def command(options: argparse.Namespace) -> int:
    """Draws the records of a log."""
    path = Path(options.log) if options.log else _newest()
    try:
        text = path.read_bytes().decode("latin-1").replace("\0", "")
    except OSError as error:
        raise UserError(f"cannot read '{path}' ({error.strerror})", "LOG", "name the file that a terminal program has logged") from None
    records = recorder.parse(text, str(paths.shown(path)))
    userparams = command_common.header_for(options)
    library = command_common.library_for([], options.library, userparams)
    target = options.out or paths.RESULTS / "recorder"
    with output.ResultFolder(target) as folder:
        pictures = write(records, library.params, library.states, folder.work)
        data = {"log": str(paths.shown(path)), "header": command_common.header_name(options.library, userparams), "plots": pictures}
        data["records"] = [recorder.title(record, recorder.scaled(record, library.params, library.states)) for record in records]
        output.write_summary(folder.work, data)
        _write_page(folder.work, records, data)
    print("\n".join([f"log     {data['log']}", f"header  {data['header']}", *data["records"]]))
    print(f"results in {paths.shown(target)}/: index.html")
    return 0


def _newest() -> Path:
    """What the last run's board has sent, of those that ended in a fault."""
    logs = sorted(paths.RESULTS.glob(f"*/{LOG}"), key=lambda path: path.stat().st_mtime)
    if not logs:
        raise UserError("no run has left a record", "LOG", "make run SCENARIO=fault_stall makes one; LOG=file draws what your board has sent")
    return logs[-1]


def _write_page(folder: Path, records: list[recorder.Record], data: dict[str, Any]) -> None:
    known = {row.code: row for row in drive_tables.faults()}
    rows = [page.Row([known[record.fault].name, known[record.fault].cause, known[record.fault].remedy], True) for record in records]
    files = sorted(file.name for file in folder.iterdir())
    page.write(folder, page.Page("fault recorder", True, "; ".join(data["records"]), [f"log {data['log']}", f"header {data['header']}"],
                                 [page.Table("Faults", ["fault", "cause", "remedy"], rows)], images=data["plots"], files=files))
