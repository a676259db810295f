"""make examples: the harness compiles and turns its motor, the scenario's expectations hold, the board's numbers give a header."""

import subprocess
import unittest

from tools.common.paths import ROOT


class Examples(unittest.TestCase):
    def test_all_of_them_run(self):
        done = subprocess.run(["make", "-s", "examples"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        self.assertEqual(0, done.returncode, done.stdout)


if __name__ == "__main__":
    unittest.main()
