"""The "Paste" sheet: the lines of userparams.h in its order, numbers with a decimal point in every locale."""

import re
from collections.abc import Iterator

from tuning import header, limits
from tuning.params import parameters

from .book import Book, Page
from .parameters import Rule

WIDTHS = [180, 26, 14, 9, 14, 9, 12, 9, 20]
HEADS = ["userparams.h: copy from the next line to the last one", "Parameter", "Value", "Exponent", "Number", "Digits", "As a whole number", "Zeros",
         "As text"]
POINT = "decimal_sign"
LONGEST = 250  # of a text in a formula; Excel's end is 255
FACTS = {
    "motor": 'motor_title&IF(connection="delta",", delta",", star")', "board": "board_title", "pairs": 'NOPOLESPAIRS&""',
         "step_erpm": f'"{limits.STEP_ERPM:.0f}"',
    "step_rpm": ("step", 1), "full_scale": ("current_full_scale_a", 2), "lock_s": ("lock_s", 2), "emf_v": ("end_emf_v", 2),
         "acceleration": ("ramp_rpm_s", 0),
    "ramp_s": ("ramp_s", 2), "pull_out": ("pull_out_nm", 4), "current_nominal": ("margin_q_standstill", 0),
         "speed_nominal": ("margin_speed_minimum", 0),
    "KFILTER_ESDQ": ("-LN(1-KFILTER_ESDQ/32768)/(2*PI()*LOOPTIME_SEC)", 0),
         "KFILTER_ESDQ_FW": ("-LN(1-KFILTER_ESDQ_FW/32768)/(2*PI()*LOOPTIME_SEC)", 0),
    "KFILTER_VELESTIM": ("-LN(1-KFILTER_VELESTIM/32768)/(2*PI()*LOOPTIME_SEC)", 0)}
"""What the comments' fields {name} become: a formula's text, or a number and its decimals."""


def number(value: str, decimals: int) -> str:
    """A number as text with a point, whatever the locale's decimal sign is."""
    return f'SUBSTITUTE(FIXED({value},{decimals},TRUE),{POINT},".")'


def paste_page(book: Book) -> Page:
    """Builds the sheet."""
    page = book.page("Paste", WIDTHS, "22662F", "The columns to the right make the text; column A is what you copy over everything in userparams.h.")
    sheets = [name for name in book.checks]
    total = "+".join(book.red_checks(name) for name in sheets)
    page.put("B1", "Red checks", "unit")
    page.put("C1", f"={total}", "result", "0")
    page.name("red_checks", "C1")
    page.put("B2", "Decimal sign here", "unit")
    page.put("C2", "=MID(FIXED(1.5,1,TRUE),2,1)", "value")
    page.name(POINT, "C2")
    where = "&".join(f'IF({book.red_checks(name)}>0," {name} ("&({book.red_checks(name)})&")","")' for name in sheets)
    page.status("A3", f'=IF(red_checks=0,"All checks are ok: the lines can be used.","Do not use the lines yet, red checks on:"&{where})')
    page.name("checks_text", "A3")
    page.row = 4
    page.heads(HEADS, freeze=True)
    page.ws.freeze_panes = f"A{page.row}"
    first = page.row
    for line in _lines(page):
        row = page.next_row()
        page.put(f"A{row}", line, "code")
    page.name("paste_lines", f"A{first}:A{page.row - 1}")
    page.ws.print_area = f"A1:A{page.row - 1}"
    return page


def _lines(page: Page) -> Iterator[str]:
    yield "/* Everything a user edits, in engineering units: the motor, the supply, limits, start, control loops and field weakening."
    yield " * Made with tuning/tuning_params.xlsx. Each line states unit, range and meaning; a value outside its range fails the build by name. */"
    yield "#ifndef USERPARAMS_H"
    yield "#define USERPARAMS_H"
    yield '=IF(red_checks=0,"","#error tuning_params.xlsx: "&red_checks&" checks are red, see its sheets")'
    yield _rule_line("Modes: remove the comment marks, or build with -D")
    yield from (f"/* #define {name} */".ljust(36) + f"/* {meaning} */" for name, meaning in header.MODES)
    for title, names in header.SECTIONS:
        yield ""
        yield _rule_line(title)
        for name in names:
            yield _define(page, name)
        if "CURRENT_BANDWIDTH_HZ" in names:
            for name, text in (("D_CURRCNTR_PTERM", "2 pi f Ld: the salient motor's d axis has its own inductance"),
                               ("Q_CURRCNTR_PTERM", "2 pi f Lq")):
                text_cell = _text(page, name)
                yield f'=IF(ld_h<>lq_h,{_left(name, text_cell)}&"/* [V/A, Q15/16] {text} */","")'
    for stem in ("IDREF_SPEED", "INVKFI_SPEED", "LS_OVER2LS0_SPEED"):
        yield ""
        if stem == "INVKFI_SPEED":
            yield from header.INVKFI_TUNED.splitlines()
        yield from (_entry(page, stem, i) for i in range(limits.ENTRIES))
    yield ""
    yield _rule_line("Snapshot")
    yield _define(page, "SNAPDELAY")
    yield _define(page, "DATA_BUFFER_SIZE")
    yield ""
    yield "#endif"


def _quoted(text: str) -> str:
    """A text in a formula, in pieces that are not too long."""
    pieces = [text[i:i + LONGEST] for i in range(0, len(text), LONGEST)] or [""]
    return "&".join('"' + piece.replace('"', '""') + '"' for piece in pieces)


def _filled(text: str) -> str:
    """A comment with fields {name} as a formula's text."""
    parts = re.split(r"\{(\w+)[^}]*\}", text)
    pieces = []
    for i, part in enumerate(parts):
        if i % 2 == 0:
            pieces += [_quoted(part)] if part else []
            continue
        fact = FACTS[part]
        value = f"({limits.STEP_ERPM:g}/NOPOLESPAIRS)" if part == "step_rpm" else fact[0]
        pieces.append(fact if isinstance(fact, str) else number(value, fact[1]))
    return "&".join(pieces)


def _rule_line(title: str) -> str:
    start = f'"/* ---- "&{_filled(title)}&" "'
    return f'={start}&REPT("-",MAX(0,{header.WIDTH}-LEN({start})))&" */"'


def _left(name: str, text_cell: str) -> str:
    before = len(f"#define {name} ")
    return f'"#define {name} "&{text_cell}&REPT(" ",IF({before}+LEN({text_cell})<36,36-{before}-LEN({text_cell}),1))'


def _comment(name: str, meaning: str) -> str:
    p = parameters()[name]
    return _filled(f"/* {('[' + p.unit + ']').ljust(15)} {(p.low + ' .. ' + p.high).ljust(14)} ") + "&" + _filled(meaning) + '&" */"'


def _define(page: Page, name: str) -> str:
    meaning = re.sub(r", \{(current|speed)_worst\} over the parameter set", "", header.MEANINGS[name])
    return f"={_left(name, _text(page, name))}&{_comment(name, meaning)}"


def _entry(page: Page, stem: str, i: int) -> str:
    name = f"{stem}{i}"
    cell = _text(page, name)
    left = f"#define {name}".ljust(len(f"#define {stem}17") + 1)
    start = f'"{left}"&IF(OR(LEFT({cell},1)="-",LEFT({cell},1)="N"),""," ")&{cell}'
    if i:
        return f"={start}"
    return f'={start}&REPT(" ",MAX(0,42-LEN({start})))&{_comment(name, header.MEANINGS[stem])}'


def _text(page: Page, name: str) -> str:
    """Fills the helper cells of the next row and returns the one with the text."""
    row, rule = page.row, page.book.rules[name]
    page.put(f"B{row}", name, "name")
    page.put(f"C{row}", f"={name}", "value", "General")
    if rule.style == "hex":
        page.put(f"I{row}", f'="0x"&DEC2HEX(C{row})', "value")
    elif rule.style == "fixed":
        page.put(f"I{row}", f"={number(f'C{row}', 2)}", "value")
    else:
        _digits(page, row, rule)
        if name.startswith("INVKFI_SPEED"):
            formula = page.ws[f"I{row}"].value[1:]
            page.ws[f"I{row}"].value = f'=IF(C{row}=NORM_INVKFIBASE,"NORM_INVKFIBASE",{formula})'
    return f"I{row}"


def _digits(page: Page, row: int, rule: Rule) -> None:
    """As few digits as the number needs: 5 for 5.00000, 0.00005 for 0.0000500000, 5.5e-6 in the short style."""
    short = rule.style == "short"
    page.put(f"D{row}", f"=IF(AND(C{row}<>0,ABS(C{row})<0.0001),INT(LOG10(ABS(C{row}))),0)" if short else 0, "value", "0")
    page.put(f"E{row}", f"=IF(D{row}=0,C{row},ROUND(C{row}/10^D{row},{rule.digits - 1}))", "value", "General")
    page.put(f"F{row}", f"=IF(E{row}=0,0,MAX(0,{rule.digits - 1}-INT(LOG10(ABS(E{row})))))", "value", "0")
    page.put(f"G{row}", f"=ROUND(ABS(E{row})*10^F{row},0)", "value", "0")
    zeros = "0"
    for count in range(1, 8):
        zeros = f"IF(MOD(G{row},{10 ** count})=0,{count},{zeros})"
    page.put(f"H{row}", f"=MIN(F{row},{zeros})", "value", "0")
    text = f'SUBSTITUTE(FIXED(E{row},F{row}-H{row},TRUE),{POINT},".")'
    if short:
        text += f'&IF(D{row}=0,"","e"&D{row})'
    if rule.style == "real":
        text += f'&IF(F{row}=H{row},".0","")'
    page.put(f"I{row}", f"={text}", "value")
