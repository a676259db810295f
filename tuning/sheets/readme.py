"""The "Read me" sheet: how to use the workbook, what each sheet does, the equations."""

from .book import Book, Page

STEPS = [
    ("1", "Motor: choose your motor from the list, or \"own motor\" and fill in the yellow cells in the units of your data sheet. A yellow cell "
          "beside a chosen motor replaces that one value."),
    ("2", "Excel shows numbers only after Enable Editing, since the file comes without computed values. Look for red cells. Paste counts them and "
          "says on which sheets they are; each says what is wrong."),
    ("3", "Loops: look at the phase margins; for your own motor raise the bandwidths while the margins stay above 60 degrees."),
    ("4", "Start, Field weakening, Parameters: change what you like in the yellow cells; an empty one keeps the rule's value."),
    ("5", "Paste: copy column A from the first line of userparams.h to #endif, and paste it over everything in userparams.h. Build. A value outside "
          "its range fails the build by name."),
    ("6", "The command make tune MOTOR=name does the same from a motor file, and more: it tries bandwidths over a set of wrong motor values and the "
          "start on the rotor's equation. "
          "make tune-fw MOTOR=name tunes the field-weakening tables on the virtual board."),
]
SHEETS = [
    ("Motor", "inputs: motor and board in data-sheet terms; one star phase in SI; do the numbers fit each other?"),
    ("Parameters", "the values of userparams.h that follow from the motor and the board; what the command refuses; what the build refuses"),
    ("Loops", "bandwidths, live phase margins with the firmware's delays, gains, Bode plots"),
    ("Start", "current, lock time, ramp, hand-over speed"),
    ("Field weakening", "the 18 entries of the three tables"),
    ("Constants", "the note's constants with their pre-divisions, rounding errors and product shifts; every number the firmware derives"),
    ("Paste", "the lines of userparams.h"),
    ("Search, Bode", "grey: intermediate steps of what the command finds by trying, and the open loops over frequency"),
    ("Motors, Boards, Units", "grey: tuning/motors/*.toml, tuning/boards/*.toml, and the factors of the units"),
]
EQUATIONS = [
    ("Equation 1", "angle += w Ts; NORM_DELTAT = Ts/60 2^16 2^15", "angle a period for one electrical rpm"),
    ("Equation 2", "w = (1/Kphi) (Eqf - sgn(Eqf) Edf)", "below a tenth of nominal speed the sign of the filtered speed"),
    ("Equation 3", "Ed = Ea cos + Eb sin,  Eq = -Ea sin + Eb cos", "corrected: the sign in Eq"),
    ("Equation 4", "E = V - Rs I - Ls dI/dt", "for each axis"),
    ("Equation 5", "NORM_RS = Rs (I0/U0) 2^15 / 2,  NORM_LSDTBASE = (Ls/Ts) (I0/U0) 2^15 / 256", "corrected: the ratios, and no w0"),
    ("Equation 6", "NORM_INVKFIBASE = sqrt(3) 1000 P (U0/Kphi) 2^15 / 2", "corrected: 1/Kphi; sqrt(3) because Kphi is line to line"),
    ("Equation 7", "y += K (x - y);  K = 2^15 (1 - exp(-2 pi f Ts))", "filters of back-EMF and speed"),
    ("Equation 8", "I0 = Ipeak / 2^15;  U0 = Vdc/sqrt(3) (1 - Td/Ts) / 2^15",
     "Ipeak: current at full internal scale. This U0, not Vdc, gives the note's constants"),
    ("Equation 9", "back-EMF = w Kphi", ""),
    ("D_ILIMIT", "the note: 2 (n/60) P Ts 2^15; here 2 pi (n/60) P Ts Imax/I0",
     "a sine's steepest slope instead of a triangle's: the note's clips in field weakening; 8 times that for eight periods"),
]
CHECK = [
    ("Ipeak 3.95 A", "12990 / 1460 / 7956 / 1790 / 1502 / 6117",
     "NORM_RS, NORM_LSDTBASE, NORM_INVKFIBASE, NORM_DELTAT, D_ILIMIT_HS, D_ILIMIT_LS of the Hurst DMB0224C10002"),
    ("Ipeak 7.09 A", "23316 / 2620", "NORM_RS, NORM_LSDTBASE"),
    ("Ipeak 22 A, exponent 4 for RS", "9044 / 8129", "NORM_RS (divided by 16), NORM_LSDTBASE"),
]


def readme_page(book: Book) -> Page:
    """Builds the sheet."""
    page = book.page("Read me", [36, 84, 92], "1F4E79",
                     "From a data sheet to userparams.h: the spreadsheet of AN1292 for foc33, with live formulas and no macro.")
    page.section("How to use it")
    for number, text in STEPS:
        row = page.next_row()
        page.put(f"A{row}", f"step {number}", "label")
        _wide(page, row, text)
    page.section("Colours")
    for style, text in (("input", "yours to fill in; empty keeps the value beside it"), ("result", "what is used"),
                        ("check", "ok, amber with a warning, or red with what is wrong")):
        row = page.next_row()
        if style == "check":
            page.put(f"A{row}", "ok", style)
        else:
            page.put(f"A{row}", None if style == "input" else "1.234", style)
        _wide(page, row, text)
    page.section("Sheets")
    for name, text in SHEETS:
        row = page.next_row()
        page.put(f"A{row}", name, "label")
        _wide(page, row, text)
    for title, rows in (("Equations of AN1292 in their corrected form", EQUATIONS),
                        ("Published constants, as a check: set Ipeak on the sheet Motor and look at Constants", CHECK)):
        page.section(title)
        for name, formula, text in rows:
            row = page.next_row()
            page.put(f"A{row}", name, "label")
            page.put(f"B{row}", formula, "name")
            page.put(f"C{row}", text, "note")
    page.ws.page_setup.fitToHeight = 1
    page.ws.print_area = f"A1:C{page.row - 1}"
    return page


def _wide(page: Page, row: int, text: str) -> None:
    page.put(f"B{row}", text, "label")
    page.put(f"C{row}", None, "label")
    page.ws.merge_cells(f"B{row}:C{row}")
    page.ws.row_dimensions[row].height = 15.0 * (1 + len(text) // 150)
