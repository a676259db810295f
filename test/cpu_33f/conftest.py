"""What the simulator's tests share."""

import pytest

from machine import Machine


@pytest.fixture(scope="module")
def machine() -> Machine:
    """One simulator for many programs."""
    return Machine()
