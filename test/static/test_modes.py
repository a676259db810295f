"""The library and the virtual board build in every mode with warnings as errors; make test has built them, this tells how it went."""

import re
from pathlib import Path

import pytest

MODES = re.findall(r"^/\* #define (\w+) \*/", Path(__file__).parents[2].joinpath("userparams.h").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("mode", ["default", *MODES])
def test_everything_compiles_without_a_warning(mode: str, pytestconfig: pytest.Config) -> None:
    if not pytestconfig.option.made:
        pytest.skip("make test builds the modes")
    assert Path(pytestconfig.option.made, "modes", mode).exists(), "does not build; the compiler's message is above"
