"""The virtual board's C library for Python: libvboard.so through ctypes, with its errors as exceptions."""

import ctypes
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tools.common.errors import UserError
from tools.common.board_keys import Key

_READ, _WRITE = 1, 2
PATH_BYTES = 400


class _KeyInfo(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("unit", ctypes.c_char_p), ("meaning", ctypes.c_char_p),
                ("min", ctypes.c_double), ("max", ctypes.c_double), ("flags", ctypes.c_uint)]


class BoardError(Exception):
    """The library refused a call; the text is its own."""


class Library:
    """What can be known without switching a board on: keys, parameters, names of faults and states."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.c = ctypes.CDLL(str(path.resolve()))
            self._declare()
        except (OSError, AttributeError) as error:
            raise UserError("cannot load the virtual board", str(path), str(error)) from None
        self.keys = {key.name: key for key in self._keys()}
        self.params = dict(self._params())

    def _declare(self) -> None:
        board, text, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_double
        out = ctypes.POINTER
        size = out(ctypes.c_size_t)
        self.declare(
                ("vb_create", board, []), ("vb_destroy", None, [board]), ("vb_set", ctypes.c_int, [board, text, number]),
                ("vb_get", ctypes.c_int, [board, text, out(number)]), ("vb_error", text, [board]),
                ("vb_key_info", out(_KeyInfo), [ctypes.c_uint]), ("vb_power_up", ctypes.c_int, [board]),
                ("vb_run", ctypes.c_int, [board, ctypes.c_uint32]), ("vb_trace_config", ctypes.c_int, [board, text, ctypes.c_uint]),
                ("vb_trace_data", out(ctypes.c_float), [board, size, size]), ("vb_trace_clear", None, [board]),
                ("vb_uart_read", ctypes.c_size_t, [board, text, ctypes.c_size_t]),
                ("vb_uart_write", ctypes.c_size_t, [board, text, ctypes.c_size_t]), ("vb_terminal", ctypes.c_int, [board, text, ctypes.c_size_t]), ("vb_warning_count", ctypes.c_uint, [board]), ("vb_warning", text, [board, ctypes.c_uint]),
                ("vb_param", ctypes.c_int, [ctypes.c_uint, out(text), out(number), out(text)]),
                ("vb_fault_name", text, [ctypes.c_int]), ("vb_state_name", text, [ctypes.c_int]))

    def declare(self, *rows: tuple[str, Any, list[Any]]) -> None:
        """Functions of the library: name, what it returns, what it takes."""
        for name, result, arguments in rows:
            function = getattr(self.c, name)
            function.restype, function.argtypes = result, arguments

    def _keys(self) -> Any:
        index = 0
        while info := self.c.vb_key_info(index):
            key = info.contents
            yield Key(key.name.decode(), (key.unit or b"").decode(), (key.meaning or b"").decode(), key.min, key.max,
                      bool(key.flags & _READ), bool(key.flags & _WRITE))
            index += 1

    def _params(self) -> Any:
        name, value, unit = ctypes.c_char_p(), ctypes.c_double(), ctypes.c_char_p()
        index = 0
        while self.c.vb_param(index, ctypes.byref(name), ctypes.byref(value), ctypes.byref(unit)) == 0:
            yield name.value.decode(), value.value
            index += 1

    def _names(self, function: Any) -> dict[int, str]:
        names = {number: function(number).decode() for number in range(64)}
        return {number: name for number, name in names.items() if name not in ("", "?")}

    def tunable(self, name: str) -> bool:
        """Whether a parameter of userparams.h can change while this firmware runs."""
        call = getattr(self.c, "probe_param_get", None)
        return call is not None and call(name.encode(), ctypes.byref(ctypes.c_double())) == 0

    @cached_property
    def states(self) -> dict[int, str]:
        """Names of the numbers in "fw.state"."""
        return self._names(self.c.vb_state_name)

    @cached_property
    def faults(self) -> dict[int, str]:
        """Names of the numbers in "fw.fault"."""
        return self._names(self.c.vb_fault_name)


class Board:
    """A virtual board with the firmware in it. The firmware is one set of globals: make one Board per process."""

    FIXED_IN = "this firmware: build it with PARAMS_IN_RAM; only the field-weakening tables and MINIMUM_SPEED_RPM can"

    def __init__(self, library: Library) -> None:
        self.library = library
        self._c = library.c
        self._vb = ctypes.c_void_p(self._c.vb_create())
        if not self._vb:
            raise BoardError("out of memory")

    def close(self) -> None:
        if self._vb:
            self._c.vb_destroy(self._vb)
            self._vb = ctypes.c_void_p()

    def _check(self, result: int) -> None:
        if result != 0:
            raise BoardError(self._c.vb_error(self._vb).decode())

    def set(self, key: str, value: float) -> None:
        self._check(self._c.vb_set(self._vb, key.encode(), value))

    def get(self, key: str) -> float:
        value = ctypes.c_double()
        self._check(self._c.vb_get(self._vb, key.encode(), ctypes.byref(value)))
        return value.value

    def power_up(self) -> None:
        self._check(self._c.vb_power_up(self._vb))

    def run(self, periods: int) -> None:
        self._check(self._c.vb_run(self._vb, periods))

    def trace_start(self, names: list[str], decimation: int) -> None:
        self._check(self._c.vb_trace_config(self._vb, ",".join(names).encode(), decimation))

    def trace_take(self) -> np.ndarray:
        """The rows since the last call, as a copy (rows, columns)."""
        rows, columns = ctypes.c_size_t(), ctypes.c_size_t()
        data = self._c.vb_trace_data(self._vb, ctypes.byref(rows), ctypes.byref(columns))
        if rows.value == 0:
            return np.empty((0, columns.value), dtype=np.float32)
        result = np.ctypeslib.as_array(data, shape=(rows.value, columns.value)).copy()
        self._c.vb_trace_clear(self._vb)
        return result

    def uart_take(self) -> str:
        """What the firmware has sent since the last call."""
        text = ctypes.create_string_buffer(4096)
        count = self._c.vb_uart_read(self._vb, text, len(text))
        return text.raw[:count].decode("latin-1")

    def uart_send(self, text: str) -> int:
        """Characters for the firmware. Returns how many have found room."""
        return self._c.vb_uart_write(self._vb, text.encode("latin-1"), len(text))

    def terminal(self) -> str:
        """Open a pseudo-terminal for UART1 and return its path."""
        path = ctypes.create_string_buffer(PATH_BYTES)
        self._check(self._c.vb_terminal(self._vb, path, PATH_BYTES))
        return path.value.decode()

    def warnings(self) -> list[str]:
        return [self._c.vb_warning(self._vb, i).decode() for i in range(self._c.vb_warning_count(self._vb))]

    def _variable(self, name: str, count: int) -> Any:
        try:
            return (ctypes.c_int16 * count).in_dll(self._c, name)
        except ValueError:
            raise BoardError(f"the firmware has no variable '{name}'") from None

    def variable(self, name: str, count: int) -> list[int]:
        """`count` 16-bit elements of a firmware variable, as a debugger would read them."""
        return list(self._variable(name, count))

    def _probe(self, action: str, name: str, value: Any) -> int:
        call = getattr(self._c, f"probe_param_{action}", None)
        return call(name.encode(), value) if call is not None else -1

    def _parameter(self, action: str, name: str, value: ctypes.c_double) -> float:
        result = self._probe(action, name, ctypes.byref(value) if action == "get" else value)
        if result == -2:
            raise BoardError(f"{name} = {value.value:g} is outside its range in userparams.h")
        if result != 0:
            raise BoardError(f"{name} cannot change in {self.FIXED_IN}")
        return value.value

    def parameter(self, name: str) -> float:
        """A parameter of userparams.h as the running firmware has it now; needs PARAMS_IN_RAM."""
        return self._parameter("get", name, ctypes.c_double())

    def write_parameter(self, name: str, value: float) -> None:
        """Change a field-weakening parameter or MINIMUM_SPEED_RPM of userparams.h while the motor turns; needs PARAMS_IN_RAM."""
        self._parameter("set", name, ctypes.c_double(value))

    def write_variable(self, name: str, value: int) -> None:
        """Write a 16-bit firmware variable, as a debugger would."""
        self._variable(name, 1)[0] = value
