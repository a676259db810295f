"""What a user sees of a design: a short table on the terminal, and a folder with the header, a self-contained page and the numbers."""

import html
import json
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tools.common import output, paths, units

from . import header
from .constants import Constant
from .design import Design
from .loops import LoopDesign
from .start import CALM_SHARE

HEADER = "userparams.h"
REPORT = "report.html"
NUMBERS = "tuning.json"


# ---- terminal ------------------------------------------------------------------------------------------------------------------

def text(design: Design) -> str:
    """A dozen lines and the warnings."""
    d, m, s = design, design.motor, design.start_up
    value = d.value
    ls = f"{m.lq_h * 1e3:.4g} mH" if not m.salient else f"Ld {m.ld_h * 1e3:.4g} mH, Lq {m.lq_h * 1e3:.4g} mH"
    bridge = f" and {d.bridge_ohm:.2g} ohm of the bridge" if d.bridge_ohm else ""
    rows = [("motor", f"{m.rs_ohm - d.bridge_ohm:.4g} ohm{bridge}, {ls} (phase of the star), {m.pole_pairs} pole pairs, {value('MOTOR_INERTIA_KGM2'):.3g} kg m2"),
            ("Kphi", units.kphi_forms(m.kphi_v_per_krpm, m.pole_pairs)),
            ("rated", f"{m.rated_torque_nm:.3g} N m at {m.rated_speed_rpm:g} rpm and {m.rated_current_a:.3g} A peak ({d.board.title})"),
            ("speeds", f"{value('MINIMUM_SPEED_RPM'):g} .. {value('NOMINAL_SPEED_RPM'):g} rpm, up to {value('MAXIMUM_SPEED_RPM'):g} rpm with S3"),
            ("current loop", _margin_text(d.current_loop)), ("speed loop", _margin_text(d.speed_loop) + (f"; load observer {d.speed_loop.load_hz:g} Hz" if d.speed_loop else ""))]
    if s:
        rows += [("start", f"{s.current_a:g} A, lock {value('LOCK_TIME') * d.board.pwm_period_s:.2g} s, {s.acceleration_rpm_s:.0f} rpm/s to {s.end_speed_rpm:g} rpm; "
                           f"pull-out torque {s.pull_out_nm:.3g} N m, needed {s.needed_nm:.3g} N m")]
    deepest = min(value(f"IDREF_SPEED{i}") for i in _entries_in_use(d))
    rows += [("field weakening", f"from {value('FW_START_SPEED_RPM'):g} rpm, Id to {deepest:g} A, feedback to {value('FW_TRIM_CURRENT_A'):g} A more; "
                                 f"{d.tables_from}"),
             ("limits", f"{value('MAXIMUM_CURRENT_A'):g} A, trips at {value('OVER_CURRENT_THRESHOLD_A'):g} A of {d.board.current_full_scale_a:.3g} A"),
             ("constants", ", ".join(f"{item.name} {item.q_value}" for item in _an1292_constants(d)))]
    lines = [f"{m.title}: {paths.shown(m.path)}"] + [f"  {name:<16}{what}" for name, what in rows]
    return "\n".join(lines + [f"  warning: {warning}" for warning in d.warnings])


def brief(design: Design) -> str:
    """One line, and the warnings."""
    d = design
    loops = [(name, loop.worst) for name, loop in (("current", d.current_loop), ("speed", d.speed_loop)) if loop]
    margins = "phase margins at least " + " and ".join(f"{worst.phase_deg:.0f}" for _, worst in loops) + " degrees"
    unstable = " and ".join(f"{name} loop" for name, worst in loops if not worst.stable)
    line = (f"{d.motor.name}: {d.value('MINIMUM_SPEED_RPM'):g} .. {d.value('MAXIMUM_SPEED_RPM'):g} rpm, {f'{unstable} unstable at worst' if unstable else margins}, "
            f"start with {d.value('Q_CURRENT_REF_OPENLOOP'):g} A")
    return "\n".join([line] + [f"  warning: {warning}" for warning in d.warnings])


def _entries_in_use(design: Design) -> range:
    span = (design.value("MAXIMUM_SPEED_RPM") - design.value("FW_START_SPEED_RPM")) * design.motor.pole_pairs / 1024.0
    return range(min(18, max(1, int(span) + 2)))


def _an1292_constants(design: Design) -> list[Constant]:
    return [design.constant(name) for name in ("NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE", "NORM_DELTAT", "D_ILIMIT_HS", "D_ILIMIT_LS")]


def _margin_text(loop: LoopDesign | None) -> str:
    if loop is None:
        return "-"
    nominal = f"phase margin {loop.nominal.phase_deg:.1f} degrees" if loop.nominal.stable else "unstable"
    if not loop.worst.stable:
        return f"{loop.bandwidth_hz:g} Hz, {nominal}, unstable at worst ({loop.worst_case})"
    return (f"{loop.bandwidth_hz:g} Hz, {nominal}, {loop.worst.phase_deg:.1f} at worst ({loop.worst_case}; "
            f"{loop.worst.asked_deg:.0f} are asked there), gain margin {loop.nominal.gain_db:.0f} dB, {loop.worst.gain_db:.0f} at worst")


# ---- folder --------------------------------------------------------------------------------------------------------------------

def write(design: Design, target: Path, anew: bool = True) -> None:
    """userparams.h, report.html, tuning.json. An unchanged header keeps its time, so that make does not build anew; with `anew` False
    a page about the same numbers is kept as well."""
    with output.ResultFolder(target) as folder:
        new, old = folder.work / HEADER, target / HEADER
        new.write_text(header.write(design), encoding="utf-8")
        if old.is_file() and old.read_bytes() == new.read_bytes():
            shutil.copystat(old, new)
        numbers = data(design)
        (folder.work / NUMBERS).write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        if not anew and (target / REPORT).is_file() and _same(target / NUMBERS, folder.work / NUMBERS):
            shutil.copy2(target / REPORT, folder.work / REPORT)
        else:
            from . import plots
            (folder.work / REPORT).write_text(_page(design, plots.draw(design)), encoding="utf-8")
        output.write_summary(folder.work, {"command": "tune", "motor": numbers["motor"], "board": numbers["board"], "warnings": design.warnings})


def _same(one: Path, other: Path) -> bool:
    return one.is_file() and one.read_bytes() == other.read_bytes()


def data(design: Design) -> dict[str, Any]:
    """Everything that a program may want to know."""
    d = design
    loop = {}
    for name, item in (("current", d.current_loop), ("speed", d.speed_loop)):
        if item:
            loop[name] = {"bandwidth_hz": item.bandwidth_hz, "nominal": _margins(item.nominal), "worst": _margins(item.worst), "worst_case": item.worst_case,
                          "rates": {rate: _margins(worst) for rate, (worst, _) in item.at_rates.items()}}
    s = d.start_up
    return {"title": d.motor.title, "motor": str(paths.shown(d.motor.path)), "board": str(paths.shown(d.board.path)), "params": d.params,
            "why": {name: choice.why for name, choice in d.choices.items()}, "loops": loop, "warnings": d.warnings, "tables_from": d.tables_from,
            "start": {} if s is None else {name: getattr(s, name) for name in ("natural_hz", "damping", "pull_out_nm", "needed_nm", "error_v", "emf_v", "follows")},
            "constants": [{"name": c.name, "value": c.value, "unit": c.unit, "format": c.q_format, "count": c.q_value, "error_percent": c.error_percent}
                          for c in d.constants]}


def _margins(margins: Any) -> dict[str, float | None]:
    return {"phase_deg": margins.phase_deg, "gain_db": margins.gain_db,
            "crossover_hz": margins.crossover_hz if margins.crossover_hz == margins.crossover_hz else None}


# ---- page ----------------------------------------------------------------------------------------------------------------------

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b1f24; background: #fff; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.15rem; margin-top: 2rem; border-bottom: 1px solid #d0d7de; padding-bottom: .2rem; }
table { border-collapse: collapse; font-size: .86rem; margin: .6rem 0; } th, td { text-align: left; padding: .2rem .7rem .2rem 0; vertical-align: top; border-bottom: 1px solid #eaeef2; }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; } code { font-size: .85rem; }
.warning { background: #fff8c5; border-left: 4px solid #d4a72c; padding: .4rem .8rem; margin: .4rem 0; } .bad { background: #ffebe9; }
svg { width: 100%; height: auto; } .quiet { color: #57606a; }
"""


def _page(design: Design, plots: dict[str, str]) -> str:
    d, m = design, design.motor
    parts = [f"<h1>{html.escape(m.title)}</h1>",
             f'<p class="quiet">{html.escape(str(paths.shown(m.path)))} on {html.escape(d.board.title)} ({html.escape(str(paths.shown(d.board.path)))}). '
             f"Made by <code>make tune MOTOR={html.escape(header.wanted(m))}</code>; the header is {HEADER} beside this page.</p>"]
    parts += [f'<p class="warning">{html.escape(warning)}</p>' for warning in d.warnings]
    parts += ["<h2>Speed and torque</h2>", _limits_text(d), plots["torque"], plots["current"],
              "<h2>Current loop</h2>", _loop_text(d.current_loop, "Kp = 2&pi;f L, Ki = 2&pi;f R; the controller's zero cancels the winding's pole. A vector "
                                                  "acts from half a period after its sample for one period. Dashed: negative frequencies, which differ when the rotor turns."),
              plots["current_loop"],
              "<h2>Speed loop</h2>", _loop_text(d.speed_loop, "Kp = 2&pi;f J/Kt on the observed speed, and the observed load, at each rate of the load observer: quiet, loaded, quick after a load "
                                                "step. In the loop, opened at the estimated speed: hold over a slow step, closed current loop, inertia, back-EMF filter with "
                                                "the estimator's own feedback (it is as fast as the motor turns), computing. R and L that the estimator has wrong reach "
                                                "the speed through the q current: that is the worst case."),
              plots["speed_loop"], "<h2>Start</h2>", _start_text(d), plots["start"],
              "<h2>Parameters</h2>", _table(("parameter", "value", "why"), ((f"<code>{c.name}</code>", c.text, html.escape(c.why)) for c in d.choices.values()
                                                                          if not _is_later_entry(c.name)), numbers=(1,)),
              "<h2>Constants</h2>", _constants(d), "<h2>Inputs</h2>", _inputs(d)]
    return (f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(m.title)}</title><style>{STYLE}</style></head>\n<body>\n'
            + "\n".join(parts) + "\n</body></html>\n")


def _is_later_entry(name: str) -> bool:
    return name.startswith(("INVKFI_SPEED", "LS_OVER2LS0_SPEED", "IDREF_SPEED")) and not name.endswith("SPEED0")


def _limits_text(d: Design) -> str:
    m, e = d.motor, d.envelope
    return (f"<p>The voltage circle has {e.circle_v:.2f} V phase amplitude ({d.board.nominal_bus_v:g} V/&radic;3, less {2e6 * d.board.sample_window_s:.2g} &micro;s of "
            f"{1e6 * d.board.pwm_period_s:g} &micro;s for the shunts). Base speed is {e.base_speed(0.0):.0f} rpm without load and {e.base_speed(m.rated_torque_nm):.0f} rpm at rated "
            f"torque; field weakening starts at {d.value('FW_START_SPEED_RPM'):g} rpm. Tables: {html.escape(d.tables_from)}.</p>")


def _loop_text(loop: LoopDesign | None, how: str) -> str:
    if loop is None:
        return ""
    verdict = "" if loop.reached else ' class="bad"'
    rows = [("nominal", loop.nominal, ""), *((f"worst, {rate}", *found) for rate, found in loop.at_rates.items())]
    rows += [] if loop.at_rates else [("worst of the parameter set", loop.worst, loop.worst_case)]
    table = _table(("case", "phase margin", "gain margin", "crossover", ""),
                   ((name, f"{x.phase_deg:.1f}&deg;" if x.stable else "unstable", f"{x.gain_db:.1f} dB" if x.stable else "&ndash;", f"{x.crossover_hz:.4g} Hz", html.escape(case)) for name, x, case in rows), numbers=(1, 2, 3))
    return (f"<p>{how}</p><p{verdict}>Bandwidth {loop.bandwidth_hz:g} Hz; asked for are {loop.worst.asked_deg:.0f}&deg; and {loop.worst.asked_db:.0f} dB in the worst case of the parameter set "
            f"(R &minus;10 .. +30 %, L &plusmn;20 %, flux &plusmn;10 %, and the published spread if that is wider).</p>{table}")


def _start_text(d: Design) -> str:
    s = d.start_up
    if s is None:
        return ""
    rows = (("pull-out torque Kt I", f"{s.pull_out_nm:.4g} N m", "current of lock and ramp"),
            ("needed at the end of the ramp", f"{s.needed_nm:.4g} N m", "load while starting, friction, J d&omega;/dt"),
            ("swing of the locked rotor", f"{s.natural_hz:.1f} Hz", "&radic;(P Kt I/J)/2&pi;"),
            ("its damping", f"{s.damping:.4f}", "friction and the current loop's own; dry friction does the rest"),
            ("back-EMF at the hand-over", f"{s.emf_v:.2f} V", f"its error {s.error_v:.2f} V"),
            ("swing left at the hand-over", f"{s.trial.swing_rpm:.0f} rpm", f"at most {CALM_SHARE:.0%} of {s.end_speed_rpm:g} rpm are asked for"),
            ("rotor follows", "yes" if s.follows else "no", f"{int(s.trial.followed.sum())} of {len(s.trial.labels)} start angles and loads" if s.trial else ""))
    return _table(("", "", ""), rows, numbers=(1,))


def _constants(d: Design) -> str:
    rows = ((f"<code>{c.name}</code>", f"{c.value:.5g}", c.unit, str(c.q_value), html.escape(c.q_format), f"{c.error_percent:+.3f}", html.escape(c.meaning))
            for c in d.constants if "[" not in c.name)
    return _table(("constant", "value", "unit", "count", "format", "rounding %", "meaning"), rows, numbers=(1, 3, 5))


def _inputs(d: Design) -> str:
    m = d.motor
    rows = [(name, html.escape(q.given), f"{q.value_si:.6g} {html.escape(q.si_unit)}", html.escape(q.source))
            for name, q in [*m.quantities.items(), *d.board.quantities.items()]]
    return (_table(("quantity", "as written", "converted, star phase", "source"), rows, numbers=(2,))
            + f"<p>Kphi at 25 &deg;C: {html.escape(units.kphi_forms(m.kphi_v_per_krpm, m.pole_pairs))}; V s/rad alone is the flux of a star phase.</p>")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], numbers: tuple[int, ...] = ()) -> str:
    lines = ["<table>"]
    if any(head):
        lines.append("<tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>")
    for row in rows:
        lines.append("<tr>" + "".join(f'<td class="n">{cell}</td>' if i in numbers else f"<td>{cell}</td>" for i, cell in enumerate(row)) + "</tr>")
    return "\n".join([*lines, "</table>"])
