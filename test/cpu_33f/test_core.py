"""What the core offers to those around it: resets, low power, register hooks, reports, profile, stack, program memory."""

import contextlib
import ctypes
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from machine import ERASED, PROGRAM
from test_interrupts import ENTRY, INT0, MAIN, STACK_AT, Chip, first, requested
from test_vectors import differences
from vectors import FOLDER, read

RCON = 0x740
SWR = 1 << 6
IDLE, SLEEP = 1, 2
AT = 0x2C0
PROFILE_OFF, PROFILE_ALL, PROFILE_HANDLERS = range(3)
READ = ctypes.CFUNCTYPE(ctypes.c_uint16, ctypes.c_void_p, ctypes.c_uint16)
WRITE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16, ctypes.c_uint16)
RESET = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int)
SYMBOL = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, ctypes.c_uint32, ctypes.POINTER(ctypes.c_uint32))
MARK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64)
CLEARED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


@contextlib.contextmanager
def hooked(chip: Chip, function: str, *hooks: object, place: tuple = ()) -> Iterator[None]:
    """The core's hooks, set by this function of it, as long as the block runs."""
    setter, nothing = getattr(chip.machine.library, function), ctypes.c_void_p()
    setter(chip.machine.core, *place, *hooks, nothing)
    try:
        yield
    finally:
        setter(chip.machine.core, *place, *(type(hook)() for hook in hooks), nothing)


def core(chip: Chip, function: str, *arguments: object) -> int:
    return getattr(chip.machine.library, function)(chip.machine.core, *arguments)


# ---- hooks on registers --------------------------------------------------------------------------------------------------

def accesses(text: str) -> tuple[Chip, list[tuple]]:
    """Reads (of 1234) and writes that a hook on 02C0 sees while a program runs."""
    chip = Chip(text + "\n" + MAIN, w={0: 0xABCD, 5: AT, 6: AT + 1})
    seen = []
    read_hook = READ(lambda context, address: (seen.append(("read", address)), 0x1234)[1])
    write_hook = WRITE(lambda context, address, new, mask: seen.append(("write", address, new & mask, mask)))
    with hooked(chip, "iss_sfr_hook", read_hook, write_hook, place=(ctypes.c_uint16(AT),)):
        chip.run(text.count("\n") + 1)
    return chip, seen


@pytest.mark.parametrize("text, value, mask", [
    ("mov w0,0x2C0", 0xABCD, 0xFFFF), ("mov.b wreg,0x2C0", 0x00CD, 0x00FF), ("mov.b wreg,0x2C1", 0xCD00, 0xFF00),
    ("mov w0,[w5]", 0xABCD, 0xFFFF),
    ("mov.b w0,[w6]", 0xCD00, 0xFF00), ("clr 0x2C0", 0, 0xFFFF), ("setm.b 0x2C1", 0xFF00, 0xFF00)])
def test_hooks_see_words_and_bytes_with_the_bits_that_count(text: str, value: int, mask: int) -> None:
    assert accesses(text)[1] == [("write", AT, value, mask)]


@pytest.mark.parametrize("text, value", [("mov 0x2C0,w1", 0x1234), ("mov.b [w6],w1", 0x12), ("btst 0x2C0,#2", 0)])
def test_hooks_give_what_is_read(text: str, value: int) -> None:
    chip, seen = accesses(text)
    assert (seen, chip.w[1]) == ([("read", AT)], value)


@pytest.mark.parametrize("text, wanted", [("bset 0x2C0,#0", 0x1235), ("bclr 0x2C0,#12", 0x0234), ("btg 0x2C0,#15", 0x9234),
                                          ("inc 0x2C0", 0x1235),
                                          ("ior 0x2C0", 0xBBFD)])
def test_hooks_see_a_read_and_a_write_of_an_instruction_that_changes_bits(text: str, wanted: int) -> None:
    (kind, _), (name, address, new, mask) = accesses(text)[1]
    assert (kind, name, address, 0x1234 & ~mask | new) == ("read", "write", AT, wanted)


# ---- damage --------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("address, at_1, at_0, expected", [
    (0x0A00, 0x0001, 0, 0x1235), (0x0A00, 0, 0x0030, 0x1204), (0x0A00, 0x8000, 0x0004, 0x9230), (0x0A02, 0xFFFF, 0, 0x1234),
    (0x0004, 0x0100, 0, 0x1334)]) # the last: W2, through which the value comes
def test_bits_that_are_stuck_stay_so_whatever_is_written(address: int, at_1: int, at_0: int, expected: int) -> None:
    chip = Chip("mov w2,0x0A00\nmov 0x0A00,w3\n" + MAIN, w={2: 0x1234})
    core(chip, "iss_stick", ctypes.c_uint16(address), ctypes.c_uint16(at_1), ctypes.c_uint16(at_0))
    chip.run(2)
    core(chip, "iss_stick", *3 * [ctypes.c_uint16(0)])
    assert core(chip, "iss_peek", ctypes.c_uint16(6)) == expected


def test_a_repeated_instruction_meets_the_damage_in_each_turn_and_a_mended_word_holds_again() -> None:
    chip = Chip("repeat #3\ninc 0x0A00\nclr 0x0A00\ninc 0x0A00\n" + MAIN)
    core(chip, "iss_poke", ctypes.c_uint16(0x0A00), ctypes.c_uint16(0))
    core(chip, "iss_stick", ctypes.c_uint16(0x0A00), ctypes.c_uint16(0), ctypes.c_uint16(0x0002))
    chip.run(5)
    assert core(chip, "iss_peek", ctypes.c_uint16(0x0A00)) == 0 # 1, 0, 1, 0
    core(chip, "iss_stick", *3 * [ctypes.c_uint16(0)])
    core(chip, "iss_poke", ctypes.c_uint16(0x0A00), ctypes.c_uint16(2))
    assert core(chip, "iss_peek", ctypes.c_uint16(0x0A00)) == 2


# ---- resets --------------------------------------------------------------------------------------------------------------

def test_reset_instruction_starts_at_0_and_is_told_in_rcon() -> None:
    chip = Chip("reset\n" + MAIN + "\n .org 0x0\n goto 0x202")
    chip.run(1)
    assert (chip.pc, chip[RCON] & SWR) == (0, SWR)


def test_a_hook_takes_the_reset() -> None:
    chip, causes = Chip("reset\n" + MAIN), []
    with hooked(chip, "iss_on_reset", RESET(lambda context, cause: causes.append(cause))):
        chip.run(1)
    assert causes == [3]


def test_core_registers_have_their_reset_values() -> None:
    chip = Chip()
    core(chip, "iss_reset", 0)
    assert (chip.pc, chip.w[15], chip[0x44], chip[0x42], chip[0x52], chip[0x46], chip[0x50] & 0x8000) == (0, 0x800, 0x20, 0, 0, 0, 0)


@pytest.mark.parametrize("cause, known", enumerate((False, False, True, True, True, True, True)))
def test_ram_is_unknown_after_power_on_only(cause: int, known: bool) -> None:
    chip = Chip(MAIN + "\n .org 0x0\n goto 0x400\n .org 0x400\n mov 0x0A00,w6\n again: bra again")
    core(chip, "iss_reset", cause)
    assert (chip.run(chip.machine.registers().cycles + 8) == "") == known


# ---- low power -----------------------------------------------------------------------------------------------------------

def test_idle_waits_for_an_interrupt() -> None:
    chip = first(text="pwrsav #1\n w: inc w5,w5\n" + MAIN)
    chip.run(50)
    assert (chip.w[5], chip.w[0]) == (0, 0)
    assert chip.machine.registers().cycles >= 50
    assert requested(chip, 0, 120).w[1] == 1
    assert chip.w[5] == 1


def test_an_interrupt_below_the_cpus_priority_wakes_without_a_handler() -> None:
    chip = requested(first(2, "pwrsav #1\n inc w5,w5\n" + MAIN, sr=4 << 5), 20, 60)
    assert (chip.w[1], chip.w[5]) == (0, 1)


def test_idle_takes_one_cycle_to_enter_and_its_cycles_are_counted() -> None:
    chip = first(text="pwrsav #1\n" + MAIN)
    chip.run(1)
    assert (chip.machine.registers().cycles, core(chip, "iss_power")) == (1, IDLE)
    requested(chip, 51, 51 + ENTRY)
    assert (chip.pc, chip[STACK_AT], core(chip, "iss_power")) == (chip.labels["first"], PROGRAM + 2, 0)


def test_sleep_is_told_and_ends_when_somebody_wakes_it() -> None:
    chip = Chip("pwrsav #0\n inc w5,w5\n" + MAIN)
    chip.run(10)
    assert (core(chip, "iss_power"), chip.w[5]) == (SLEEP, 0)
    core(chip, "iss_wake")
    chip.run(11)
    assert (core(chip, "iss_power"), chip.w[5]) == (0, 1)


# ---- observation ---------------------------------------------------------------------------------------------------------

def profiled(chip: Chip, what: int, run: Callable[[], object]) -> tuple[Any, Any]:
    """Executions and cycles by address / 2 of what runs."""
    library = chip.machine.library
    library.iss_profile_counts.restype = ctypes.POINTER(ctypes.c_uint32)
    library.iss_profile_cycles.restype = ctypes.POINTER(ctypes.c_uint64)
    assert core(chip, "iss_profile", what) & 1
    run()
    return core(chip, "iss_profile_counts"), core(chip, "iss_profile_cycles")


def test_the_profile_counts_instructions_and_cycles_of_each_address() -> None:
    chip = Chip("mov #5,w5\n l: dec w5,w5\n b: bra nz,l\n" + MAIN, w={5: 0})
    counts, cycles = profiled(chip, PROFILE_ALL, lambda: chip.run(1 + 5 + 9))
    at = chip.labels["b"] // 2
    assert (counts[at - 1], cycles[at - 1], counts[at], cycles[at], counts[at + 1]) == (5, 5, 5, 9, 0)
    core(chip, "iss_profile", PROFILE_OFF)


@pytest.mark.parametrize("what, background", [(PROFILE_ALL, 1), (PROFILE_HANDLERS, 0)])
def test_a_profile_of_handlers_leaves_out_what_the_background_executes(what: int, background: int) -> None:
    chip = first(text="rcall both\n" + MAIN.replace("first: inc", "first: rcall both\n inc") + ".org 0x3C0\nboth: inc w6,w6\n return\n")
    counts, cycles = profiled(chip, what, lambda: requested(chip, 10, 40))
    both, handler, loop = (chip.labels[name] // 2 for name in ("both", "first", "loop"))
    assert (counts[both], cycles[both], cycles[both + 1]) == (1 + background, 1 + background, 3 * (1 + background))
    assert [cycles[handler + n] for n in range(4)] == [ENTRY + 2, 1, 1, 3] # its call, its count, bclr, retfie
    assert (counts[loop] > 0) == bool(background)
    core(chip, "iss_profile", PROFILE_OFF)


def test_hooks_tell_of_interrupts() -> None:
    chip, seen = first(), []
    enter = MARK(lambda context, vector, cycle: seen.append(("enter", vector, cycle)))
    leave = MARK(lambda context, vector, cycle: seen.append(("leave", vector, cycle)))
    with hooked(chip, "iss_on_interrupt", enter, leave):
        requested(chip, 1, 40)
    assert seen == [("enter", 8 + INT0, 1), ("leave", 8 + INT0, 1 + ENTRY + 5)]


@pytest.mark.parametrize("text, cycles", [("clrwdt\n nop\n clrwdt\n", [1, 3]), ("nop\n pwrsav #0\n", [2]), ("nop\n pwrsav #1\n", [2])])
def test_clrwdt_is_told_and_pwrsav_clears_the_watchdog_too(text: str, cycles: list[int]) -> None:
    chip, cleared = Chip(text + MAIN), []
    with hooked(chip, "iss_on_clrwdt", CLEARED(lambda context: cleared.append(chip.machine.registers().cycles))):
        chip.run(3)
    assert cleared == cycles


def test_nothing_changes_while_the_profile_is_on() -> None:
    chip = Chip()
    core(chip, "iss_profile", PROFILE_ALL)
    wrong = [f"{vector}: {found}" for name in ("flow.txt", "cycles.txt") for vector in read(FOLDER / name)
             if (found := differences(vector, chip.machine, 0))]
    core(chip, "iss_profile", PROFILE_OFF)
    assert wrong == []


@pytest.mark.parametrize("text, wanted", [
    ("push w0\n pop w0\n", 2), ("push w0\n push w0\n pop w0\n pop w0\n", 4), ("lnk #20\n ulnk\n", 22),
    ("lnk #20\n push w0\n pop w0\n ulnk\n", 24),
    ("mov.d w0,[w15++]\n nop\n", 4), ("rcall f\n bra e\n f: return\n e: nop\n", 4)])
def test_the_deepest_stack_counts_every_word_and_frame(text: str, wanted: int) -> None:
    chip = Chip("mov #0x900,w15\n " + text + MAIN)
    core(chip, "iss_stack_clear")
    chip.run(14)
    assert core(chip, "iss_stack_bytes") == wanted


def test_reports_name_the_symbol() -> None:
    chip, start = Chip("nop\n .word24 0xDB0000\n" + MAIN), ctypes.create_string_buffer(b"_start")
    name = SYMBOL(lambda context, data, address, offset: (offset.__setitem__(0, address - 0x200), ctypes.addressof(start))[1])
    with hooked(chip, "iss_on_symbol", name):
        assert re.search("0*202.*_start", chip.run(20))


# ---- program memory ------------------------------------------------------------------------------------------------------

def test_program_written_through_the_pointer_is_decoded_when_told() -> None:
    chip = Chip("l: inc w5,w5\n bra l")
    chip.machine.library.iss_program.restype = ctypes.POINTER(ctypes.c_uint32)
    core(chip, "iss_program")[PROGRAM // 2] = 0xE90285  # dec w5,w5
    core(chip, "iss_program_changed")
    chip.run(1)
    assert chip.w[5] == 0xFFFF


@pytest.mark.parametrize("address, exists", [(0x57FE, True), (0x5800, False), (0xF7FFFE, False), (0xF80000, True), (0xF80016, True),
                                             (0xF80018, False)])
def test_program_memory_ends_where_the_chips_does(address: int, exists: bool) -> None:
    chip = Chip()
    assert core(chip, "iss_write_program", address, 0x123456) == exists
    core(chip, "iss_write_program", address, ERASED)


def test_changed_program_memory_is_decoded_anew() -> None:
    chip = Chip("l: inc w5,w5\n bra l")
    chip.run(9)
    chip.machine.load({PROGRAM: 0xE90285, PROGRAM + 2: 0x37FFFE})  # dec w5,w5
    before = chip.w[5]
    chip.run(12)
    assert chip.w[5] == before - 1


@pytest.mark.parametrize("at", range(1, 12))
def test_interrupt_latency_is_the_same_for_all_moments(at: int) -> None:
    chip = first(text="l: nop\n nop\n nop\n nop\n bra l\n" + MAIN)
    chip.run(at)
    now = chip.machine.registers().cycles
    assert requested(chip, 0, 0).until("first") == now + ENTRY
