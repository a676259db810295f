"""make cycles and make pil around the simulator: classes of interrupts, figures, budgets, texts, and what a user sees."""

import json
import re
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
import support
from sample_image import hex_text
from test_image_build import compiler_free_path, our_lines
from xc16 import make

from tools.bench import cycles, pil, pil_command
from tools.common import paths
from tools.common.checksum import checksum
from tools.common.errors import UserError
from tools.image.budget import Budget, CycleLimits, Limits
from tools.image.profile import Counts, Profile
from tools.image.size import write_json

BUDGET = Budget(Limits(0, 0), Limits(0, 0, 512), CycleLimits(600, 600, 800, 700, 960, 700, 500, 300, 745, 1949, ("demo",)), [], [], (), (), [])
WORDS = {0: 0x040200, 2: 0, 0x200: 0, 0x202: 0x37FFFF}
SLOW = 200
NO_CYCLES = pil.Cycles(*[0.0] * len(pil.Cycles.__dataclass_fields__))


def spread(values) -> cycles.Spread:
    return cycles.Spread.of(np.array(values))


def found(name: str, without: list[int], weakening: list[int], latency: tuple[int, ...] = (700,), stack: int = 100,
          differences: int = 0) -> cycles.Found:
    """A scenario with these control interrupts in closed loop, each with SLOW cycles of slow work."""
    def by_name(slow: int) -> dict[str, cycles.Spread]:
        lists = {"STOPPED": [], "CLOSED": without + weakening, cycles.WITHOUT: without, cycles.WITH: weakening}
        return {key: spread([value + slow for value in values]) for key, values in lists.items()}

    everything = by_name(SLOW)
    return cycles.Found(by_name(0), everything, spread(latency), Counts({0x200: 1}, {0x200: everything["CLOSED"].sum}), stack, differences, 10,
                        "tick 3, P1DC1" if differences else "", {name: (max(without + weakening), 1.5, "CLOSED")}, 967, 2.0, 1.0, 5e6)


def report(item: cycles.Found, budget: Budget | None = BUDGET) -> cycles.Report:
    total = sum(item.counts.cycles.values())
    result = cycles.Report("foc33.elf", item, Profile(Counter(pi=total), Counter(_ADC1Interrupt=total),
                           {"_ADC1Interrupt": (9, 10)}, total), budget, [["ENTRY", "4", "cycles of an entry", "interrupts"]])
    result.broken = cycles.broken(result)
    return result


# ---- figures -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("one, figures", [
    (spread([5, 7, 7, 9, 12]), (5, 5, 8.0, 12)), (cycles.added([spread([3]), spread([100, 2])]), (3, 2, 35.0, 100)),
    (cycles.Spread(), (0, 0, 0.0, 0))])
def test_number_least_mean_and_most(one, figures):
    assert tuple(one.data().values()) == figures


def classes(states: list[int], reference: list[float]) -> dict[str, list[bool]]:
    return {name: which.tolist() for name, which in cycles.classes(np.array(states), support.STATES, np.array(reference), 2640.0).items()}


def test_every_interrupt_belongs_to_one_state_bridge_off_to_neither_figure_and_field_weakening_is_closed_loop_above_its_first_speed():
    result = classes(list(range(8)), [0.0] * 8)
    assert all(result[name] == [i == number for i in range(8)] for number, name in support.STATES.items())
    off = classes([0, 1, 2, 7], [3000.0] * 4)
    assert not any(off[cycles.WITH] + off[cycles.WITHOUT])
    result = classes([4, 5, 5, 5, 6, 6], [4000.0, 2600.0, 2640.0, -5500.0, 3000.0, 900.0])
    assert result[cycles.WITH] == [False, False, True, True, True, False]
    assert result[cycles.WITHOUT] == [True, True, False, False, False, True]


def test_scenarios_are_put_together():
    whole = cycles.merged([found("demo", [400], [500], stack=90), found("stop", [300], [450], latency=(800,), stack=110)])
    assert (min(whole.spreads[cycles.WITHOUT]), whole.spreads[cycles.WITH].most) == (300, 500)
    assert (whole.latency.most, whole.stack_bytes, set(whole.longest), whole.counts.cycles) == (800, 110, {"demo", "stop"}, {0x200: 1650 + 4 * SLOW})
    assert (min(whole.periods[cycles.WITHOUT]), whole.periods[cycles.WITH].most) == (300 + SLOW, 500 + SLOW)


# ---- budgets -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("item, budget, lines", [
    (found("demo", [500], [490, 510]), BUDGET, []),
    (found("demo", [500], [500, 510]), BUDGET, ["mean period with field weakening: 705.0 cycles of both interrupts, over the budget of 700"]),
    (found("demo", [400], [390, 601]), BUDGET, ["longest period: 801 cycles of both interrupts, over the budget of 800",
                                                 "longest control interrupt: 601 cycles, 1 over the budget of 600 (demo at 1.5000 s, CLOSED)"]),
    (found("demo", [400], [400], latency=(961,), stack=513), BUDGET,
     ["trigger to duties: 961 cycles, over the budget of 960", "stack: 513 bytes, over the budget of 512"]),
    (found("demo", [400], [400], latency=(967,)), None,
     ["trigger to duties: 967 cycles, but the duties load 967 cycles after the trigger"]),
    (found("demo", [400], [400], differences=2), None, ["target and PC differ in 2 interrupts, the first: tick 3, P1DC1"]),
    (found("smoke", [400], []), None, ["no scenario ran with and without field weakening: the figures are not those of the table"])])
def test_each_broken_budget_is_a_line(item, budget, lines):
    assert report(item, budget).broken == lines


def test_a_profile_that_misses_cycles_is_an_error():
    item = found("demo", [400], [400])
    item.counts.cycles[0x200] = 700
    assert "the profile has 700 cycles, the interrupts took 1200" in report(item, None).broken[0]
    long = found("demo", [400000], [400000])
    long.counts.cycles[0x200] += 75 # one interrupt is still under way at the end
    assert report(long, None).broken == []
    long.counts.cycles[0x200] += 25 # what the background executes is none of the interrupt's
    assert "the profile has 800500 cycles, the interrupts took 800400" in report(long, None).broken[0]


def test_budget_file_has_the_limits():
    limits = Budget.read().cycles
    assert limits.isr_max < limits.period_mean < 946 and limits.period_max < 2000 # AN1292's longest, and the period
    assert "demo" in limits.scenarios and len(limits.scenarios) > 3


# ---- output --------------------------------------------------------------------------------------------------------------
def test_table_has_cycles_us_load_and_the_notes_figures(tmp_path):
    lines = cycles.text(report(found("demo", [400, 600], [500]))).splitlines()
    alone, both = (line.split() for line in lines if line.startswith(cycles.WITHOUT) and "%" in line)
    assert alone == "without field weakening 2 400 500.0 600 10.00 12.50 15.00 25.0 %".split()
    assert both == "without field weakening 2 600 700.0 800 15.00 17.50 20.00 35.0 % 14.725 / 20.8 / 21.4".split()
    assert any("ENTRY" in line and "cycles of an entry" in line for line in lines)


LONGEST = {"bounds": [{"handler": "_ADC1Interrupt", "to": "third duty", "bound": 464, "observed": 424},
                      {"handler": "_ADC1Interrupt", "to": "return", "bound": 494, "observed": 450},
                      {"handler": "_T2Interrupt", "to": "return", "bound": 900, "observed": None}], "latency": 658, "period": 1465}


def test_the_readme_tells_the_proven_bound_before_the_longest_seen(tmp_path):
    data = json.loads(write_json(cycles.summary(report(found("demo", [400], [440, 480]))), tmp_path, "cycles").read_text())
    head, rows = cycles.readme_table(data, LONGEST)
    assert all(len(row) == len(head) for row in rows)
    assert rows[:2] == [["longest control interrupt: proven / seen", "", "494 / 450", "12.35 / 11.25"],
                        ["longest slow work: proven / seen", "", "900 / 0", "22.50 / 0.00"]]
    assert ["control interrupt with field weakening: min / mean / max", "", "440 / 460 / 480", "11.00 / 11.50 / 12.00"] in rows
    assert ["with its slow work, with field weakening: min / mean / max", "14.975 / 23.325 / 23.65", "640 / 660 / 680", "16.00 / 16.50 / 17.00"] in rows
    assert cycles.short_table(data)[1][0] == ["control interrupt", "400 / 440 / 480", "10.00 / 11.00 / 12.00"]


@pytest.mark.parametrize("arguments, has", [([], True), (["demo"], False), (["--no-budget"], False), (["--image", "a.elf"], False)])
def test_only_a_complete_measurement_of_the_delivered_image_says_what_it_is_of(arguments, has):
    options = cycles.parser_of("cycles", "", lambda _: 0).parse_args(arguments)
    assert cycles.sources_of(options) == ({"sources": checksum("chip")} if has else {})


@pytest.mark.parametrize("ticks, differences, first, defines, has_names, ok, got", [
    (100, 0, "", [], True, True, ""), (0, 0, "", [], True, False, ""), (0, 0, "", ["IDENTIFY"], True, True, ""),
    (0, 0, "", [], False, True, "a HEX file"),
    (100, 4, "tick 7 (0.1 s), P1DC2: target 1, host 2", [], True, False,
     "100 interrupts, 4 differ; first: tick 7 (0.1 s), P1DC2: target 1, host 2")])
def test_comparison_with_the_pc(ticks, differences, first, defines, has_names, ok, got):
    run = support.run()
    run.scenario.defines += defines
    outcome = pil_command.comparison(pil.PilRun(run, NO_CYCLES, ticks, differences, first, has_names=has_names))
    assert outcome.ok == ok and got in outcome.got


def test_a_difference_after_a_late_application_names_it(monkeypatch):
    run = support.run()
    monkeypatch.setattr(type(run), "raised", lambda self: [(20, 0.001, "APPLICATION")])
    late = pil_command.comparison(pil.PilRun(run, NO_CYCLES, 100, 4, "tick 7")).got
    assert late.endswith("the application took longer than APP_LATE_MS on the chip (fault APPLICATION), and a PC does not count its time")
    assert "APP_LATE_MS" not in pil_command.comparison(pil.PilRun(run, NO_CYCLES, 100, 0, "")).got


# ---- for the user --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("target", ["pil", "cycles", "wcet", "test-target"])
def test_without_the_compiler_each_command_says_so_in_one_line(tmp_path, target):
    done = make(target, path=compiler_free_path(tmp_path, "ruby", "gem", "dpkg", "date", "tr", "ld", "as"))
    assert (done.returncode, len(our_lines(done))) == (2, 1), done.stderr
    assert "no xc16-gcc, not on PATH: install Microchip's MPLAB XC16" in our_lines(done)[0]


@pytest.mark.parametrize("word, expected", [("MOTOR=hurst_dmb0224c10002", "make cycles has no MOTOR"), ("BOARD=mclv", "no BOARD"),
                                            ("USERPARAMS=/nowhere", "no userparams.h")])
def test_what_cycles_cannot_do_is_one_line(word, expected):
    done = make("cycles", "IMAGE=/nowhere", word)
    assert (done.returncode, len(our_lines(done))) == (2, 1), done.stderr
    assert expected in our_lines(done)[0] and "No such file" not in done.stderr


@pytest.mark.parametrize("room, arguments, words", [
    *((room, ["--image", "/no/such.elf"], "no image '/no/such.elf', --image: build one with make firmware, or name a file that is there")
      for room in (cycles, pil_command)), *((room, ["--nonsense"], "--nonsense") for room in (cycles, pil_command)),
    (cycles, ["--image", "{}/text.elf"], "text.elf"), (cycles, ["--image", "{}/alone.hex"], "name the ELF file"),
    (cycles, ["--image", "{}/huge.elf"], "cannot be read"),
    (pil_command, ["--image", "{}/huge.elf", "smoke", "--out", "{}/out"], "cannot be read"),
    (pil_command, ["demmo", "--image", "{}/text.elf"], "did you mean 'demo'?"), (pil_command, ["demo", "smoke", "--out", "{}"], "--out")])
def test_bad_input_is_one_line(tmp_path, room, arguments, words):
    (tmp_path / "text.elf").write_text("hello", encoding="utf-8")
    (tmp_path / "alone.hex").write_text(hex_text(WORDS), encoding="utf-8")
    with (tmp_path / "huge.elf").open("wb") as file:
        file.write(b"\x7fELF")
        file.truncate(5 << 30)
    support.refused(support.command(*(word.format(tmp_path) for word in arguments), main=room.main), words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words, macros, names", [
    ([], [], ()), (["--app", "panel"], [], ()), (["--app", "analog"], ["APP=analog"], ("app_analog",)),
    (["--app", "examples/my_app.c"], [f"APP={paths.ROOT}/examples/my_app.c"], ("app_any",)), (["demo", "--app", "analog"], ["APP=analog"], ("demo",))])
def test_another_application_is_measured_in_its_own_scenario(words, macros, names):
    options = cycles.parser_of("cycles", "", print).parse_args(words)
    assert (cycles.macros_of(options), cycles.scenarios_of(options)) == (macros, names)
    assert cycles.sources_of(options) == {} or not words


def test_a_scenario_of_another_application_than_the_image_s_is_refused():
    with pytest.raises(UserError, match=r"scenario 'app_rc' is for another image \(APP=rc\).*APP=name"):
        cycles.jobs_of(("app_rc",), None, ["APP=analog"])


def test_pil_runs_an_application_s_own_scenario_on_its_image(monkeypatch):
    asked = []
    monkeypatch.setattr(pil_command, "image_for", lambda macros, folder, given: asked.append(macros))
    monkeypatch.setattr(pil_command.pil, "library", lambda macros, folder: asked.append(macros) or sys.exit(7))
    with pytest.raises(SystemExit):
        pil_command.main(["--app", "analog"])
    assert asked == [["APP=analog"]] * 2


@pytest.mark.parametrize("given", [[], ["--out", "{}"]])
def test_table2_goes_where_out_says(tmp_path, monkeypatch, given):
    (tmp_path / "x.hex").write_text(hex_text(WORDS), encoding="utf-8")
    asked = []
    monkeypatch.setattr(pil_command.table2.Table2, "command", classmethod(lambda _, options: asked.append(options.out) or 0))
    pil_command.main(["table2", "--image", str(tmp_path / "x.hex"), *(word.format(tmp_path) for word in given)])
    assert asked == [tmp_path if given else paths.RESULTS / "pil-table2"]


@pytest.mark.parametrize("name", ["tools.bench.cycles", "tools.bench.pil_command"])
def test_modules_run_from_the_command_line(name):
    done = subprocess.run([sys.executable, "-m", name, "--help"], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert re.search("--image", done.stdout + done.stderr)
