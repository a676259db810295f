"""The sweeps' engine, with a sweep of its own as short as one can be: from its table to rows, verdicts, printed table, folder and exit code."""

import csv
import json
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from support import LIBRARY, command, refused

from tools.bench import case, cli, draws, search, simulate, sweep
from tools.bench.expect import Outcome
from tools.common import paths
from tools.common.board_keys import Values


@dataclass(kw_only=True)
class Table(sweep.Table):
    volts_where: str
    volts: list[float] = sweep.within(1.0, 60.0)
    names: list[float] = sweep.within(0.0)
    least_v: float = sweep.within(0.0)

    def __post_init__(self):
        self.same_lengths("volts", "names")


class Supply(sweep.Sweep):
    """Each of the table's supplies for 50 ms: what stands on the bus?"""

    name, about, kind_of_table = "supply", "supplies", Table
    columns, keys = (("bus_v", "bus\nV", "{:.1f}"), ("verdict", "\nverdict", "{}")), ("volts", "bus_v", "verdict")

    def cases(self):
        return self.table.volts

    def job(self, item):
        plant = Values({"supply.voltage_v": item}, {"supply.voltage_v": self.table.where})
        return simulate.prepare(case.scenario(f"{item:g} V", self.table.title, [], 0.0, 0.04, 0.05, plant=plant), self.library, self.motor, self.board)

    def measured(self, run, item):
        return {"volts": item, "bus_v": run.measures[case.MEASURE]["bus_v"]}

    def row(self, item, job, result):
        return {"name": job.scenario.name, **result}

    def verdict(self, item, row):
        return "ok" if row["bus_v"] >= self.table.least_v else "low"

    def check(self, item, row):
        return [Outcome(row["name"], row["verdict"] == "ok", f"{row['bus_v']:.1f} V", f"at least {self.table.least_v:g} V")]


@pytest.fixture(name="run")
def _run(tmp_path, monkeypatch):
    """The command with this list of supplies and names."""
    monkeypatch.setattr(cli, "SWEEPS", (Supply,))
    monkeypatch.setattr(paths, "TABLES", tmp_path)

    def run(volts, *more, names="[1, 2]"):
        (tmp_path / "supply.toml").write_text(f'title = "Supplies"\nmotor = "hurst_dmb0224c10002"\nboard = "mclv"\nvolts = {volts}\nnames = {names}\nleast_v = 20\n',
                                              encoding="utf-8")
        return command("supply", "--library", str(LIBRARY), "--out", str(tmp_path / "out"), "--quiet", *more)
    return run


def test_a_sweep_runs_its_cases_in_order_and_leaves_rows_verdicts_page_and_an_exit_code(run, tmp_path):
    code, out, error = run("[24, 18]")
    assert (code, error) == (1, "foc33: supply: 18 V: got 18.0 V, allowed at least 20 V\n")
    assert out.startswith("Supplies\n\nmotor   tuning/motors/hurst_dmb0224c10002.toml") and "\n24 V  24.0       ok\n18 V  18.0      low\n" in out
    assert out.endswith("/out/: index.html\n1 of 2 expectations hold\n")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"index.html", "summary.json", "supply.csv"}
    data = json.loads((tmp_path / "out/summary.json").read_text(encoding="utf-8"))
    assert not data["passed"] and [row["verdict"] for row in data["rows"]] == ["ok", "low"] and len(data["expectations"]) == 2
    with (tmp_path / "out/supply.csv").open(encoding="utf-8") as file:
        assert [row["volts"] for row in csv.DictReader(file)] == ["24.0", "18.0"]
    assert run("[24, 24]")[0] == 0


def test_what_a_sweep_cannot_do_is_one_line_and_leaves_nothing(run, tmp_path):
    refused(run("[24, 100]"), "'volts' = 100 is impossible", "supply.toml")
    refused(run("[24]"), "columns of different lengths", "supply.toml", "give volts and names as many numbers each")
    refused(run("[24, 18]", "--motor", "no_such"), "no motor 'no_such'")
    assert not (tmp_path / "out").exists()


def test_of_long_runs_two_at_once_have_room_whatever_the_processors(monkeypatch):
    monkeypatch.setattr(sweep.workers, "processors", lambda: 16)
    runs = {seconds: [SimpleNamespace(scenario=SimpleNamespace(duration_s=seconds))] * 3 for seconds in (1.0, 20.0, 60.0, 3000.0)}
    assert {seconds: sweep.side_by_side(jobs) for seconds, jobs in runs.items()} == {1.0: 16, 20.0: 6, 60.0: 2, 3000.0: 2}
    monkeypatch.setattr(sweep.workers, "processors", lambda: 1)
    assert sweep.side_by_side(runs[3000.0]) == sweep.side_by_side([]) == 1


def test_searches_share_the_runs_of_their_group_and_go_on_until_each_knows_its_end():
    ends = {("a", True): 1.7, ("a", False): 0.4, ("b", True): 9.0}
    searches = {key: search.Search(key[1], lambda row: row["holds"], 1.0) for key in ends}
    seen = []

    def run(number, wanted):
        seen.extend((number, *item) for item in wanted)
        return [{"holds": ends.get((name, False), 0.0) < value < ends[name, True], "verdict": "no"} for name, value in wanted]
    search.in_rounds([(name, value) for name in "ab" for value in (0.25, 1.0, 4.0)], searches, lambda key: key[0], 2.0, run)
    for (name, upwards), end in ends.items():
        found = searches[name, upwards]
        assert (found.bad, found.good) == (None, 4.0) if name == "b" else abs(found.good / end - 1.0) < 0.02 and abs(found.bad / end - 1.0) < 0.02
    assert len({item[1:] for item in seen}) == len(seen) and {item[1] for item in seen if item[0] > 1} == {"a"}


def test_a_kind_of_sweep_and_of_series_has_its_command():
    assert {kind.name for kind in cli.SWEEPS} == {"table2", "starts", "rated", "loadsteps", "lowspeed", "catch", "pulse", "held", "robust", "bringup", "sensitivity"}
    assert all(kind.about and kind.keys for kind in (*cli.SWEEPS, *draws.Series.__subclasses__()))
