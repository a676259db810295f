"""The image in every mode and with the scope: it builds without a warning, links, and passes make firmware's checks."""

import pytest
from xc16 import build_image

from tools.common.param_rows import modes


@pytest.mark.parametrize("define", ["", "SCOPE=1", *modes()], ids=lambda define: define or "delivered")
def test_image_of(define: str) -> None:
    build_image(*([f"DEFINES=-D{define}", f"VARIANT=check-{define.replace('=', '-')}"] if define else []))
