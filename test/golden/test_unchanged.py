"""The golden vectors are those that the reference model gives."""

import subprocess
import sys
from pathlib import Path


def test_the_reference_model_gives_the_vectors_as_they_are() -> None:
    command = [sys.executable, Path(__file__).with_name("generate.py"), "--check"]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
