"""docs/simulator.md has the simulator's own table of assumptions."""

import subprocess
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "simulator.md"


class Page(unittest.TestCase):
    def test_the_table_is_what_assumptions_h_says(self):
        made = subprocess.run([sys.executable, "tools/docs/simulator.py", "--print"], capture_output=True, text=True, check=True, cwd=ROOT).stdout
        self.assertEqual(made, PAGE.read_text(encoding="utf-8"), "run python3 tools/docs/simulator.py")

    def test_every_assumption_has_a_row(self):
        text = (ROOT / "tools/iss33f/assumptions.h").read_text(encoding="utf-8")
        self.assertEqual(PAGE.read_text(encoding="utf-8").count("\n| `") - sum(line.startswith("| `make") for line in PAGE.read_text().splitlines()),
                         text.count("    X("))
