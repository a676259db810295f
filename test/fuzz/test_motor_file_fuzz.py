"""Fuzzing of the motor and board file loaders: whatever stands in a file, the result is a sane motor or exactly one line, never a traceback."""

import json
import math
import random
import re
import tomllib
from collections.abc import Callable
from typing import Any

import pytest
from support import MOTORS

from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError

SEED = 33
CASES = 1000 # of each kind
ESSENTIAL = ("resistance", "inductance", "inductance_d", "inductance_q", "kphi", "inertia", "voltage", "current", "torque", "speed", "maximum_speed",
             "pole_pairs")

EVERYTHING = (paths.ROOT / "examples/my_motor.toml").read_text(encoding="utf-8")
"""All that a motor file may hold."""

NUMBERS = ("0", "-0.0", "-1", "1e300", "-1e300", "1e-300", "nan", "inf", "-inf", "1_000", "0x7f", "0b1", "9" * 30, "9" * 400, "9" * 5000, "5.34e6", "1e-9",
           "2.5", "1979-05-27", "07:32:00", "true", "\"1\"", "[]", "[1, 2]", "[[1]]", "{}", "{ value = 1 }", "{ factor = 2 }", "'", "", "1.", ".5", "+1", "--1")
WORDS = ("", " ", "ohm", "V", "N m", "mH line-to-line", "ohm winding", "rpm/V", "A dc", "[?]", "\\u0000", "\\n\\r", "\\u2028", "\\U0010ffff", "\\ud800", "x" * 3000,
         "%s%n", "../../x", "\\", "\"", "delta", "Y")
BYTES = b"\0\n\r\t \"'#=.,-+[]{}()e01\x7f\x80\xc3\xff"
SPANS = (re.compile(r"(?<![\w\"])-?\d[\d.e+-]*"), re.compile(r"(?<=\")[^\"\n]*(?=\")"), re.compile(r"[A-Za-z_]+(?= =)"), re.compile(r"\[[a-z]+\]"))


def texts() -> list[str]:
    """The good files that are spoilt."""
    return [(paths.MOTORS / f"{name}.toml").read_text(encoding="utf-8") for name in MOTORS] + [EVERYTHING, EVERYTHING.replace('"Y"', '"delta"')]


def spoil_bytes(text: str, dice: random.Random) -> bytes:
    """A few bytes changed, lost, doubled or cut off."""
    data = bytearray(text.encode())
    for _ in range(dice.randint(1, 4)):
        at = dice.randrange(len(data))
        kind = dice.randrange(5)
        if kind == 0:
            data[at] = dice.choice(BYTES)
        elif kind == 1:
            data.insert(at, dice.choice(BYTES))
        elif kind == 2:
            del data[at:at + dice.randint(1, 30)]
        elif kind == 3:
            data[at:at] = data[at:at + dice.randint(1, 60)]
        else:
            data[at] ^= 1 << dice.randrange(8)
    return bytes(data[:dice.randrange(len(data))] if dice.random() < 0.05 else data)


def spoil_tokens(text: str, dice: random.Random) -> bytes:
    """A number, a string, a key or a table's name replaced by something else that a person or another file might have written there."""
    for _ in range(dice.randint(1, 2)):
        spans = [match.span() for match in dice.choice(SPANS).finditer(text)]
        if spans:
            start, end = dice.choice(spans)
            other = dice.choice([text[a:b] for a, b in spans])
            text = text[:start] + dice.choice((dice.choice(NUMBERS), dice.choice(WORDS), other)) + text[end:]
    return text.encode("utf-8", "surrogatepass")


def spoil_lines(text: str, dice: random.Random) -> bytes:
    """Lines lost, doubled, exchanged, taken from another motor."""
    lines = text.splitlines()
    for _ in range(dice.randint(1, 3)):
        a, b = dice.randrange(len(lines)), dice.randrange(len(lines))
        kind = dice.randrange(4)
        if kind == 0:
            lines[a], lines[b] = lines[b], lines[a]
        elif kind == 1:
            lines.insert(a, lines[b])
        elif kind == 2:
            lines[a] = dice.choice(dice.choice(texts()).splitlines())
        elif len(lines) > 1:
            del lines[a]
    return ("\n".join(lines) + "\n").encode()


def spoil_values(text: str, dice: random.Random) -> bytes:
    """Numbers scaled, by a little or by powers of ten, and with the other sign: the file stays well formed."""
    def scaled(match: re.Match) -> str:
        if dice.random() > 0.08:
            return match[0]
        return repr(float(match[0]) * dice.choice((0.9, 1.1, 2.0, 0.5, 10.0, 0.1, 1e3, 1e-3, 1e6, 1e-6, -1.0, 0.0, 10.0 ** dice.uniform(-3.0, 3.0))))
    return re.sub(r"(?<=value = )[-+0-9.e]+", scaled, text).encode()


def spoil_types(text: str, dice: random.Random) -> bytes:
    """A node of the tree replaced by a value of another type, written out anew."""
    tree = tomllib.loads(text)
    for _ in range(dice.randint(1, 2)):
        node: Any = tree
        while True:
            key = dice.choice(list(node))
            if isinstance(node[key], dict) and node[key] and dice.random() < 0.85:
                node = node[key]
                continue
            node[key] = dice.choice((0, -1, 3, 2.5, math.nan, math.inf, True, "", "ohm", [], [1.0, 2.0], ["a"], {}, {"value": 1.0}, {"a": {"b": {}}}, 10 ** 400))
            break
    return "".join(f"{json.dumps(key)} = {written(value)}\n" for key, value in tree.items()).encode()


def written(value: Any) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {written(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    return json.dumps(value) if isinstance(value, str) else str(value).lower()


@pytest.fixture
def outcome(tmp_path):
    """What a loader makes of a file, None if it refuses properly; anything else is a failure that shows the file."""
    def of(data: bytes, load: Callable[[str], Any]) -> Any:
        (tmp_path / "file.toml").write_bytes(data)
        try:
            return load(str(tmp_path / "file.toml"))
        except UserError as error:
            line = str(error)
            assert len(line.splitlines()) == 1 and "file.toml" in line, data
            return None
        except Exception as error: # whatever it is, a user would see a traceback
            pytest.fail(f"{type(error).__name__}: {error} for {data!r}")
    return of


LIMITS = {"pole_pairs": (1, 50), "rs_ohm": (0.005, 120.0), "ld_h": (1e-5, 0.03), "lq_h": (1e-5, 0.03), "psi_vs": (1e-6, 20.0),
          "kphi_v_per_krpm": (0.15, 6000.0), "inertia_kgm2": (1e-8, 10.0), "viscous_nms": (0.0, 10.0), "coulomb_nm": (0.0, 10.0),
          "rated_voltage_v": (3.0, 400.0), "rated_current_a": (0.01, 200.0), "rated_torque_nm": (1e-4, 100.0), "rated_speed_rpm": (49.0, 32001.0),
          "maximum_speed_rpm": (49.0, 32001.0), "maximum_current_a": (0.01, 2000.0), "load_inertia_kgm2": (0.0, 10.0),
          "start_torque_nm": (0.0, 100.0), "resistance_tempco_per_k": (0.0, 0.01), "kphi_tempco_per_k": (-0.004, 0.0)}


def sane(motor: motor_file.Motor, data: bytes) -> None:
    for name, (low, high) in LIMITS.items():
        value = getattr(motor, name)
        assert low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9) or value == low, (name, value, data)
    assert type(motor.pole_pairs) is int and motor.maximum_speed_rpm >= motor.rated_speed_rpm * (1.0 - 1e-9), data
    assert 0.49 < 1.5 * motor.pole_pairs * motor.psi_vs * motor.rated_current_a / motor.rated_torque_nm < 2.01, data
    assert all(0.0 < low <= high < 1e3 for low, high in motor.spread.values()), data
    assert all(isinstance(value, float) and math.isfinite(value) for value in [*motor.tune.values(), *motor.plant_values().values.values()]), data


@pytest.mark.parametrize("spoil, least_accepted, least_refused", [
    *((spoil, CASES // 100, CASES // 10) for spoil in (spoil_bytes, spoil_tokens, spoil_lines, spoil_values)), (spoil_types, -1, CASES // 2)])
def test_a_spoilt_file_gives_a_sane_motor_or_one_line(outcome, spoil, least_accepted, least_refused):
    """The cases are not all of one kind: some files are still motors, some are not."""
    dice = random.Random(f"{SEED} {spoil.__name__}")
    originals = texts()
    accepted = 0
    for _ in range(CASES):
        data = spoil(dice.choice(originals), dice)
        motor = outcome(data, motor_file.load)
        if motor is not None:
            sane(motor, data)
            accepted += 1
    assert accepted > least_accepted and CASES - accepted > least_refused


def test_a_spoilt_board_file_gives_a_board_or_one_line(outcome):
    good = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
    dice = random.Random(SEED)
    for _ in range(CASES):
        data = dice.choice((spoil_bytes, spoil_tokens, spoil_values, spoil_types))(good, dice)
        board = outcome(data, board_file.load)
        if board is not None:
            assert 0.0 < board.current_full_scale_a < 1e5 and 0.0 < board.bus_full_scale_v < 1e3, data
            assert all(math.isfinite(value) for value in board.plant_values().values.values()), data


@pytest.mark.parametrize("text", texts(), ids=lambda text: text.splitlines()[0][:40])
def test_an_unspoilt_file_is_a_motor_but_not_after_a_slip_of_three_digits_or_a_wrong_sign_in_any_essential_number(outcome, text):
    assert outcome(text.encode(), motor_file.load) is not None
    for match in re.finditer(r"(\w+) = \{ value = ([-+0-9.e]+)", text):
        if match[1] in ESSENTIAL and "[load]" not in text[:match.start()]:
            for factor in (1e3, 1e-3, -1.0, 0.0):
                data = text[:match.start(2)] + repr(float(match[2]) * factor) + text[match.end(2):]
                assert outcome(data.encode(), motor_file.load) is None, f"{match[0]} times {factor:g}"
