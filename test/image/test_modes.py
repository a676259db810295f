"""The image in every mode and with the scope: it builds without a warning, links, and passes make firmware's checks."""

import pytest
from xc16 import build_image

from tools.common.param_rows import modes

MEMORY_OF_ITS_OWN = ("TUNING", "TORQUE_PROFILE", "SNAPSHOT", "IDENTIFY", "BRINGUP")
"""These share the RAM with the scope. On each push they are built with it, which takes more of all; for a release without it, too."""
DEFINES = ["", "SCOPE=1", *(pytest.param(mode, marks=[pytest.mark.release] * (mode in MEMORY_OF_ITS_OWN)) for mode in modes()),
           *(f"SCOPE=1 -D{mode}" for mode in MEMORY_OF_ITS_OWN)]


@pytest.mark.parametrize("define", DEFINES, ids=lambda define: define or "delivered")
def test_image_of(define: str) -> None:
    build_image(*([f"DEFINES=-D{define}", f"VARIANT=check-{define.replace(' -D', '-').replace('=', '-')}"] if define else []))
