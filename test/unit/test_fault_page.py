"""docs/faults.md says what include/drive/faults.h says: the page is made from the table and never edited by hand."""

import subprocess
import sys

from c_compiler import ROOT

PAGE = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")


def made() -> str:
    return subprocess.run([sys.executable, "-m", "tools.docs.tables", "--print", "faults"], capture_output=True, text=True, check=True, cwd=ROOT).stdout


def test_the_page_is_the_one_made_from_the_table() -> None:
    assert made() == PAGE, "run python3 -m tools.docs.tables"


def test_the_page_has_a_row_for_every_code() -> None:
    codes = [line.split("|")[1].strip() for line in PAGE.splitlines() if line.startswith("| ") and line[2].isdigit()]
    assert codes == [str(n) for n in range(1, 1 + len(codes))] and len(codes) >= 12, codes


def test_every_parameter_that_a_remedy_names_exists() -> None:
    known = (ROOT / "userparams.h").read_text(encoding="utf-8")
    words = {word for word in PAGE.replace("|", " ").replace(",", " ").replace(";", " ").replace("(", " ").replace(")", " ").split()
             if "_" in word and word.isupper()}
    names = {row.split("|")[2].strip() for row in PAGE.splitlines() if row.startswith("| ")}
    missing = sorted(word for word in words - names if word not in known)
    assert not missing, missing
