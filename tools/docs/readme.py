"""Fills the tables of README.md from the results in build/run/: `make readme` runs what they need first."""

import importlib
import json
import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
README = ROOT / "README.md"
PICTURES = {"run/demo/speed.png": "demo-speed.png", "run/demo/field_weakening.png": "demo-field-weakening.png",
            "tune-fw/hurst_dmb0224c10002/over_speed.png": "tuning-fw.png", "run/robust/margins.png": "tuning-margins.png"}


def result(name: str, folder: str = "run", command: str = "make readme") -> dict:
    path = ROOT / "build" / folder / name / "summary.json"
    try:
        return json.loads(path.read_text())
    except OSError:
        sys.exit(f"foc33: no results, {path.relative_to(ROOT)}: run `{command}`, which makes them")


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def demo() -> str:
    rows = [[m["name"], f"{m['reference_rpm']:.0f}", f"{m['speed_rpm']:.1f}", f"{m['speed_error_percent']:+.2f} %",
             f"{m['current_rms_a']:.2f} A", f"{m['angle_error_mean_deg']:+.1f}°", f"{m['angle_error_rms_deg']:.1f}°",
             f"{m['voltage_percent']:.0f} %"] for m in result("demo")["measures"]]
    return table(["step", "reference rpm", "true rpm", "error", "phase current RMS", "angle error mean", "angle error RMS",
                  "share of the voltage limit"], rows)


def table2() -> str:
    rows = [[f"{r['reference_rpm']:.0f} rpm", f"{r['torque_nm_set']:.3f} N·m", f"{r['note_rpm']:.0f}", f"{r['speed_rpm']:.0f}",
             f"{r['note_current_a']:.2f} A", f"{r['current_rms_a']:.2f} A", f"{r['angle_error_rms_deg']:.1f}°", f"{r['voltage_percent']:.0f} %"]
            for r in result("table2")["rows"]]
    return table(["reference", "torque", "AN1292: rpm", "ours", "AN1292: current RMS", "ours", "angle error RMS", "share of the voltage limit"], rows)


def motors() -> str:
    """A line for each motor of tuning/motors: what it was measured to do with its own header."""
    by_motor: dict[str, list[dict]] = {}
    for row in result("motors")["rows"]:
        by_motor.setdefault(row["motor"], []).append(row)
    rows = []
    for motor, cases in by_motor.items():
        held = [case for case in cases if case["torque_nm_set"] > 0.0]
        found = {row["name"].split(" [")[0]: row["error_percent"] for row in result(motor, "identify")["rows"]}
        rows.append([motor, " / ".join(f"{case['speed_rpm']:.0f}" for case in held), f"{max(abs(case['speed_error_percent']) for case in held):.2f} %",
                     f"{max(case['angle_error_rms_deg'] for case in held):.1f}°", f"{max(case['speed_rpm'] for case in cases):.0f}",
                     " / ".join(f"{found[name]:+.1f}" for name in ("R winding", "Ld", "Lq", "Kphi", "J", "friction at rated speed"))])
    return table(["motor", "rpm at 20 / 50 / 100 % of rated speed, half the rated torque", "worst speed error", "worst angle error RMS", "top rpm, no load",
                  "IDENTIFY: error of R / Ld / Lq / Kphi / J / friction in %"], rows)


def of_motor(name: str, motor: str) -> dict:
    """What a table of many runs left for a motor; the table's own one has no name there."""
    own = result(name)
    return own if Path(own["motor"]).stem == motor else result(f"{name}-{motor}")


def held(data: dict) -> str:
    return f"{sum(e['ok'] for e in data['expectations'])} of {len(data['expectations'])}"


def loadsteps() -> str:
    """A line for each speed and torque, a dip for each Kphi."""
    rows: dict[tuple, list[dict]] = {}
    for row in result("loadsteps")["rows"]:
        rows.setdefault((row["reference_rpm"], row["torque_nm"]), []).append(row)

    def dip(case: dict) -> str:
        return f"{case['dip_percent']:.0f} %" + (" (out of reach)" if case["beyond"] else "")

    def back(cases: list[dict], edge: str) -> str:
        found = [case[edge] for case in cases if not (edge == "on_back_s" and case["beyond"])]
        return "out of reach" if not found else "never" if None in found else f"{max(found):.3f} s"
    return table(["speed", "torque"] + [f"dip, true Kphi x{case['kphi']:g}" for case in next(iter(rows.values()))]
                 + ["back within 2 %, on", "off", "angle error, at most"],
                 [[f"{rpm:.0f} rpm", f"{torque:.2f} N·m", *map(dip, cases), back(cases, "on_back_s"), back(cases, "off_back_s"),
                   f"{max(case['angle_error_max_deg'] for case in cases):.0f}°"]
                  for (rpm, torque), cases in rows.items()])


def stiffness() -> str:
    """A line for each motor: load steps and low speeds that hold, with the worst numbers."""
    rows = []
    for motor in sorted(path.stem for path in (ROOT / "tuning/motors").glob("*.toml")):
        steps, slow = of_motor("loadsteps", motor), of_motor("lowspeed", motor)
        back = [row[edge] for row in steps["rows"] for edge in ("on_back_s", "off_back_s") if not (edge == "on_back_s" and row["beyond"])]
        lowest = ["-" if item["lowest_rpm"] is None else f"{item['lowest_rpm']:.0f}" for item in slow["lowest"]]
        rows.append([motor, held(steps), f"{max(row['dip_percent'] for row in steps['rows'] if row['kphi'] == 1.0):.0f} %",
                     "never" if None in back else f"{max(back):.3f} s", held(slow), f"{slow['rows'][0]['asked_rpm']:.0f}", " / ".join(lowest)])
    return table(["motor", "load steps that hold", "largest dip, true Kphi x1", "slowest return", "low speeds that hold", "lowest asked for, rpm",
                  "lowest held, rpm: no load / light / heavy"], rows)


def catches() -> str:
    """A line for each motor: flying starts in control, and stops on a supply that takes nothing back."""
    rows = []
    for motor in sorted(path.stem for path in (ROOT / "tuning/motors").glob("*.toml")):
        data = of_motor("catch", motor)
        starts, stops = ([row for row in data["rows"] if (row["rotor_deg"] is None) == is_stop] for is_stop in (False, True))
        taken = [row["control_s"] for row in starts]
        rows.append([motor, f"{min(row['rpm'] for row in starts):.0f} .. {max(row['rpm'] for row in starts):.0f}",
                     f"{sum(row['verdict'] == 'ok' for row in starts)} of {len(starts)}", "never" if None in taken else f"{max(taken):.3f} s",
                     f"{max(row['current_max_a'] for row in data['rows']):.2f} A", f"{stops[0]['rpm']:.0f} rpm",
                     " / ".join("never" if row["stop_s"] is None else f"{row['stop_s']:.2f}" for row in stops) + " s",
                     f"{max(row['bus_max_v'] for row in stops):.1f} V"])
    return table(["motor", "rotor at S2, rpm", "in control", "slowest, after S2", "largest current", "stop from", "inertia x1 / x9 / x36", "bus, at most"], rows)


def drawn() -> list[list[str]]:
    """What the long draws found: faults, and hours without one. `make readme` does not run them, for they take an hour."""
    faults, hours = result("seed-1", "campaign", "make campaign"), result("seed-1", "soak", "make soak")
    classes = {name: count for name, count in faults["classes"].items() if count}
    cases = sum(classes.values())
    if cases < 2000 or hours["motor_hours"] < 24.0:
        sys.exit("foc33: a campaign or a soak of less than the README promises: run `make campaign` and `make soak`")
    return [
        [f"{cases} injected faults: each is ridden through or ends in a named stop", "; ".join(f"{count} {name}" for name, count in classes.items()),
         "`make campaign`"],
        ["24 motor hours of random commands, loads, temperatures, sags, noise on all motors: no fault, no drift, no lost lock",
         f"{hours['wrong']} wrong in {hours['motor_hours']:.1f} h", "`make soak`"]]


def guarantees() -> str:
    run, top, blocked, starts = result("demo"), result("stop_from_top"), result("fault_stall"), result("starts")
    robust, weakening = result("robust"), result("hurst_dmb0224c10002", "tune-fw")
    hand_over = run["hand_overs"][0]
    worst_speed = max(abs(m["speed_error_percent"]) for m in run["measures"])
    worst_angle = max(m["angle_error_rms_deg"] for m in run["measures"])
    bus = next(e["got"] for e in top["expectations"] if e["row"].startswith("bus"))
    at = {entry["event"]: entry["at_s"] for entry in reversed(blocked["protocol"])}
    fault = f"START_FAILED after {at['fault START_FAILED'] - at['S2 pressed']:.2f} s"
    rows = [
        ["closed loop within 2.0 s after S2", f"{hand_over['after_s2_s']:.2f} s, overshoot {hand_over['overshoot_percent']:.1f} %", "`make run`"],
        ["speed within 0.5 % of the reference, 1000 to 5500 rpm", f"{worst_speed:.2f} %", "`make run`"],
        ["rotor angle error below 2° RMS from 1000 rpm up", f"{worst_angle:.1f}°", "`make run`"],
        ["starts from every rotor angle, loaded with 0, 0.03 and 0.06 N·m, and with 9 and 36 times the inertia; never 300 rpm backwards; hand-over below 300 rpm",
         f"{held(starts)}; {max(row['back_rpm'] for row in starts['rows']):.0f} rpm; "
         f"{max(row['hand_over_rpm'] for row in starts['rows'] if row['inertia'] == 1.0):.0f} rpm", "`make starts`"],
        ["holds the reference in all rows of AN1292's Table 2; rows 2 to 8 take less current",
         f"worst {max(abs(r['speed_error_percent']) for r in result('table2')['rows']):.2f} %", "`make table2`"],
        ["twice the base speed, unloaded", f"{weakening['maximum_speed_rpm']:.0f} rpm", "`make tune-fw`"],
        ["angle within 2° RMS loaded, 4° unloaded with Kphi ±20 % or R -30 .. +50 %, within 1° of the law with L ±30 % or with R and field weakening's d current, "
         "within 10° in every corner",
         held(robust), "`make robust`"],
        ["0.03, 0.05 and 0.08 N·m at once on and off the bare rotor at 500, 1190, 2500 rpm, Kphi ±20 %: never backwards; back within 2 % in 0.3 s where the voltage allows the load",
         held(result("loadsteps")), "`make loadsteps`"],
        ["150 rpm and up held for 10 s with 0, 0.03 and 0.08 N·m: speed within 1 %, angle within 8° RMS", held(result("lowspeed")), "`make lowspeed`"],
        ["flying start at -2500 to 3500 rpm, angle and speed drawn, inertia x1, x9, x36: in control within 0.2 s, current below its maximum and a tenth; "
         "stops from 5500 rpm without a sink, bus below 30 V", held(result("catch")), "`make catch`"],
        ["controlled stop from 5500 rpm, bus below 30 V", bus, "`make run SCENARIO=stop_from_top`"],
        ["a blocked shaft ends in a named fault within 2 s", fault, "`make run SCENARIO=fault_stall`"],
        *drawn(),
        ["virtual board: 20 times real time on one core", f"{run['motor_seconds'] / run['cpu_seconds']:.0f} times", "`make run`"],
    ]
    return table(["guarantee", "measured", "command"], rows)


def of_target(name: str, module: str) -> str | None:
    """What `make size` or `make cycles` left in build/target; None without a compiler for the target."""
    path = ROOT / f"build/target/{name}.json"
    if not path.exists():
        return None
    return table(*importlib.import_module(module).readme_table(json.loads(path.read_text())))


def tests() -> str | None:
    """What `make test`, `make coverage` and `make mutate` left in build/; None while the first two have not been run."""
    coverage, mutants, suites = (ROOT / "build" / name for name in ("coverage/summary.json", "mutate/report.json", "test/summary.json"))
    if not (coverage.exists() and suites.exists()):
        return None
    coverage, suites = json.loads(coverage.read_text()), json.loads(suites.read_text())
    if suites["failed"]:
        sys.exit(f"foc33: {suites['failed']} tests failed, build/test/summary.json: repair them, run `make test`, then `make readme`")
    rows = [
        ["unit, board and closed-loop tests" + (f" ({suites['skipped']} more were skipped)" if suites["skipped"] else ", with those that need XC16"),
         str(suites["passed"]), "`make test`"],
        ["control law: lines / branches that the unit tests reach", f"{coverage['line_percent']:.0f} % / {coverage['branch_percent']:.0f} %", "`make coverage`"],
    ]
    if mutants.exists():
        found = json.loads(mutants.read_text())
        rows.append([f"planted defects noticed ({found['tests']}, {'all' if found['full'] else 'sample of'} {len(found['mutants'])})",
                     f"{found['score']:.1f} %", "`make mutate`"])
    return table(["check", "result", "command"], rows)


def main() -> None:
    for source in PICTURES: # before anything is written
        if not (ROOT / "build" / source).exists():
            sys.exit(f"foc33: no picture, build/{source}: run `make readme`, which makes it")
    text = README.read_text()
    for name, make in (("guarantees", guarantees), ("demo", demo), ("table2", table2), ("motors", motors),
                       ("loadsteps", loadsteps), ("stiffness", stiffness), ("catch", catches),
                       ("size", lambda: of_target("size", "tools.image.size")), ("cycles", lambda: of_target("cycles", "tools.bench.cycles")),
                       ("tests", tests)):
        block = make()
        text, count = re.subn(rf"(<!-- {name} -->\n).*?(<!-- end -->)",
                              lambda m: m[0] if block is None else m[1] + block + "\n" + m[2], text, flags=re.S)
        if count != 1:
            sys.exit(f"foc33: marks '<!-- {name} -->' and '<!-- end -->', README.md: found {count} times, put them in once")
    README.write_text(text)
    for source, target in PICTURES.items():
        shutil.copy(ROOT / "build" / source, ROOT / "docs" / target)


if __name__ == "__main__":
    main()
