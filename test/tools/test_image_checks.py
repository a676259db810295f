"""The checks of an image: a good image passes, and each broken thing is one line that says what and where."""

import re

import pytest
from sample_image import CONFIG, LIBRARY, RETFIE, good_image, record, take_ram
from support import command

from tools.image import device, image

CALL, RCALL = 0x020000, 0x070000
BUDGET = """with_caller = []
budget = {{ note = {{ flash_bytes = 1, ram_bytes = 1 }}, image = {{ flash_bytes = {}, ram_bytes = {}, stack_bytes = {} }} }}
cycles = {{ isr_max_cycles = 1, isr_mean_cycles = 1, period_max_cycles = 1, period_mean_cycles = 1, latency_max_cycles = 1, isr_bound_cycles = 1, duty_bound_cycles = 1, slow_bound_cycles = 1, duty_deadline_cycles = 1, both_deadline_cycles = 1, scenarios = [] }}
stack = {{ calls_nothing = [] }}
"""


class Bench:
    """An image to break, and the command that checks it."""

    def __init__(self, folder):
        self.folder, self.image = folder, good_image()

    def check(self, *more: str, arguments: list[str] | None = None) -> tuple[int, str, list[str]]:
        """Exit status, stdout, lines of stderr."""
        status, out, error = command(*(arguments or self.image.write(self.folder)), *more, main=image.main)
        return status, out, error.splitlines()

    def fails(self, *patterns: str, more: tuple[str, ...] = ()) -> None:
        """The image fails with exactly these lines."""
        status, _, lines = self.check(*more)
        assert (status, len(lines)) == (1, len(patterns)), lines
        for pattern, line in zip(patterns, lines):
            assert re.search(pattern, line), line

    def passes(self, *more: str) -> str:
        status, out, lines = self.check(*more)
        assert (status, lines) == (0, [])
        return out

    def budget(self, *figures: int) -> tuple[str, str]:
        path = self.folder / "budget.toml"
        path.write_text(BUDGET.format(*figures), encoding="utf-8")
        return "--budget", str(path)

    @property
    def flash(self) -> int:
        return 3 * (sum(address in device.PROGRAM for address in self.image.words) + len(self.image.constant_words))


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


# ---- the whole -----------------------------------------------------------------------------------------------------------
def test_a_good_image_passes_and_its_sizes_are_printed(bench):
    assert f"flash {bench.flash} of 33024 bytes of the chip, RAM 300 of 2048 bytes of the chip, 1732 bytes free" in bench.passes()


@pytest.mark.parametrize("parts, told", [(["33FJ128MC802"], "33FJ128MC802"), ([device.NAME, "33FJ64MC204"], "33FJ32MC204, 33FJ64MC204")])
def test_an_image_of_which_any_part_is_for_another_chip_is_refused(bench, parts, told):
    del bench.image.numbers[f"__{device.NAME}"]
    bench.image.numbers |= {f"__{part}": 1 for part in parts}
    bench.fails(f"the image is for {told}, not for the 33FJ32MC204")


def test_the_last_word_of_the_flash_is_inside_and_the_next_one_is_not(bench):
    bench.image.words[0x57FE] = 0
    bench.image.places.append((0x57FE, 2, ".text", "a.o"))
    bench.passes()
    bench.image.words[0x5800] = 0
    bench.fails("1 words outside the flash .*0x005800")


# ---- what is broken is a line each ------------------------------------------------------------------------------------------
def other_elf(image):
    image.constants = []
    image.places = [place for place in image.places if place[2] != ".const"]
    image.hex_words = {**image.words, 0x204: 1, 0x5000: 7}


def compilers_default(image):
    start = image.symbols["__DefaultInterrupt"]
    image.places = [place if place[0] != start else (*place[:2], ".isr", "default_isr") for place in image.places]


def no_reset_vector(image):
    del image.words[0], image.words[2]


def nested_helper(image):
    inner = image.function("__fpack", 0x060000, file=f"{LIBRARY}(fpack.eo)")
    outer = image.function("__mulsf3", CALL | inner, 0, 0x060000, file=f"{LIBRARY}(mulsf3.eo)")
    image.function("caller", CALL | outer, 0, file="a.o")


def unseen_helper(image):
    image.function("__divsf3", 0x060000, file=f"{LIBRARY}(divsf3.eo)")
    image.constant(1, 2, file=f"{LIBRARY}(fp_thenan.o)")


@pytest.mark.parametrize("change, patterns", [
    pytest.param(other_elf, ["HEX and ELF differ in 2 words, the first at 0x000204: 0x000001 in the HEX, 0x000000 in the ELF"],
                 id="a HEX of another ELF"),
    pytest.param(lambda image: image.point("_ADC1Interrupt", image.symbols["__FLTA1Interrupt"]), [
        r"vector _ADC1Interrupt of the IVT \(0x02E\) goes to .* \(_FLTA1Interrupt\), not to .* \(_ADC1Interrupt\)", "of the AIVT"],
                 id="a vector that goes to another handler"),
    pytest.param(lambda image: image.point("_T3Interrupt", image.symbols["_main"]),
                 [r"_T3Interrupt of the IVT .*\(main\), not to .*_DefaultInterrupt", "AIVT"], id="a vector that goes elsewhere"),
    pytest.param(lambda image: image.function("_T1Interrupt", RETFIE),
                 ["_T1Interrupt of the IVT .*_DefaultInterrupt.*, not to .*_T1Interrupt", "AIVT"], id="a function that is not in its vector"),
    pytest.param(lambda image: image.words.update({device.IVT + 2 * number: 0 for number in range(len(device.VECTORS))}),
                 ["IVT", "IVT", "IVT", "and 123 more vectors of the IVT"], id="many wrong vectors"),
    pytest.param(compilers_default, ["_DefaultInterrupt is the compiler's"], id="the compiler's own default handler"),
    pytest.param(lambda image: image.words.update({0: 0x040000 | image.symbols["_main"]}),
                 [r"reset vector: goes to .* \(main\), not to the start-up code at 0x000200"], id="a reset vector that goes elsewhere"),
    pytest.param(no_reset_vector, ["reset vector: 0xFFFFFF 0xFFFFFF is no GOTO"], id="no reset vector"),
    pytest.param(lambda image: image.words.pop(0xF80006), [r"word FOSCSEL \(0xF80006\) is missing: FNOSC must be FRC"],
                 id="a configuration word that is missing"),
    pytest.param(nested_helper, [r"__mulsf3\(\) .*called by caller\(\)"], id="what only a helper calls is not told too"),
    pytest.param(unseen_helper, [r"__divsf3\(\) .*called by nothing that can be seen",
                                 r"\.const of the compiler's library .*fp_thenan.o\)\), called by nothing that can be seen"],
                 id="a helper and a constant that nothing visible calls"),
    pytest.param(lambda image: image.places.pop(), [
        "2 words from 0x.* on come from no file that the map names: the map is of another build, or the linker made them for a pointer"],
                 id="a map of another build")])
def test_each_broken_thing_is_a_line_that_says_what_and_where(bench, change, patterns):
    change(bench.image)
    bench.fails(*patterns)


# ---- vectors -------------------------------------------------------------------------------------------------------------
def test_the_vectors_have_the_addresses_of_the_family_s_reference_manual():
    places = {name: 4 + 2 * number for number, name in enumerate(device.VECTORS)}
    known = {"_OscillatorFail": 0x06, "_AddressError": 0x08, "_StackError": 0x0A, "_MathError": 0x0C, "_INT0Interrupt": 0x14,
             "_T1Interrupt": 0x1A, "_U1RXInterrupt": 0x2A, "_U1TXInterrupt": 0x2C, "_ADC1Interrupt": 0x2E, "_CNInterrupt": 0x3A, "_MPWM1Interrupt": 0x86,
             "_FLTA1Interrupt": 0x92}
    assert {name: places[name] for name in known} == known
    assert len(device.VECTORS) == (0x100 - 0x04) // 2


@pytest.mark.parametrize("base, table", [(device.IVT, "IVT"), (device.AIVT, "AIVT")])
def test_every_erased_vector_is_found_but_the_product_may_leave_the_end_of_the_tables_erased(bench, base, table):
    for number, name in enumerate(device.VECTORS[:8 + device.LEFT_ERASED]):
        kept = bench.image.words.pop(base + 2 * number)
        bench.fails(rf"vector {name} of the {table} \(0x{base + 2 * number:03X}\) is erased")
        bench.image.words[base + 2 * number] = kept
    for number in range(8 + device.LEFT_ERASED, len(device.VECTORS)):
        del bench.image.words[base + 2 * number]
    bench.passes()


@pytest.mark.parametrize("name", device.REQUIRED)
def test_a_missing_handler_is_named(bench, name):
    del bench.image.symbols[f"_{name}"]
    bench.image.point(name, bench.image.symbols["__DefaultInterrupt"])
    bench.fails(f"the image has no {name}: ")


def test_a_misspelt_handler_is_named(bench):
    bench.image.function("_ADC1Interupt", RETFIE)
    bench.passes() # no vector's name at all: the compiler warns of it
    bench.image.function("_ADC2Interrupt", RETFIE)
    bench.fails("_ADC2Interrupt is no vector of the 33FJ32MC204: the function never runs")


# ---- configuration words -------------------------------------------------------------------------------------------------
KNOWN = {**device.BOARD_NEEDS, **image.wanted_fields(CONFIG)}


@pytest.mark.parametrize("name", KNOWN)
def test_every_wrong_bit_of_a_known_field_is_found(bench, name):
    field = device.FIELDS[name]
    for bit in (1 << n for n in range(8) if field.mask & 1 << n):
        bench.image.words[field.word] ^= bit
        bench.fails(rf"configuration word {device.WORDS[field.word]} .*: {name} is .*, must be {KNOWN[name]} \(")
        bench.image.words[field.word] ^= bit


@pytest.mark.parametrize("old, new, expected", [("PWMPIN = ON", "PWMPIN = OFF", "PWMPIN = OFF in main.c, but the board needs ON"),
                                                ("#pragma", "#pragma config PLLKEN = ON\n#pragma", "PLLKEN = ON in main.c is unknown")])
def test_sources_that_set_what_the_board_cannot_have_are_refused(bench, old, new, expected):
    arguments = bench.image.write(bench.folder)
    path = bench.folder / "main.c"
    path.write_text(path.read_text().replace(old, new, 1))
    status, _, lines = bench.check(arguments=arguments)
    assert status == 1 and expected in lines[0]


def test_the_table_names_every_field_with_its_meaning_and_bits_that_mean_nothing_do_not_matter(bench):
    out = bench.passes("--table")
    for text in ("FOSCSEL  0x00  FNOSC     FRC (internal oscillator)", "FICD     0xC1  ICS       PGD3 (debugger on PGC3/PGD3)"):
        assert text in out
    bench.image.words |= {0xF80000: 0xFFFFFF, 0xF8000E: 0x01}
    bench.passes()


def test_the_projects_own_settings_are_all_known_and_what_the_board_needs():
    text = image.CONFIG_C.read_text(encoding="utf-8")
    for keeps, needs in ((False, device.BOARD_NEEDS), (True, device.KEPT_NEEDS)):
        config = image.wanted_fields(text, keeps)
        assert len(config) > 10 and config["WDTPOST"] == ("PS64" if keeps else "PS16")
        for name, value in config.items():
            assert value in device.FIELDS[name].values and value == needs.get(name, value), name


# ---- the compiler's library ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("helper, member, advice", [
    ("__divsf3", "divsf3.eo", "a float"), ("__divsi3", "divsi3.eo", "a division"), ("__muldi3", "muldi3.eo", "64-bit"),
                                                    ("memcpy", "memcpy.eo", "a copy"),
    ("__udivmodsi4", "lib_int.o", "a division"), ("oddity", "x.o", "without the library")])
def test_a_helper_is_named_with_its_caller_and_what_to_write_instead(bench, helper, member, advice):
    target = bench.image.function(helper, 0x000000, 0x060000, file=f"{LIBRARY}({member})", section=".libm.x")
    bench.image.function("caller", CALL | target, 0x000000, 0x060000, file="a.o")
    bench.fails(rf"{helper}\(\) of the compiler's library is in the image \(libc99-pic30-elf.a\({member}\)\), "
                rf"called by caller\(\): .*{advice}")


@pytest.mark.parametrize("opcode", [RCALL, 0x370000, 0x320000, 0x0C0000])
def test_relative_calls_and_jumps_are_seen_too(bench, opcode):
    target = bench.image.function("__mulsf3", 0x060000, file=f"{LIBRARY}(mulsf3.eo)")
    at = bench.image.function("caller", 0, 0x060000, file="a.o")
    bench.image.words[at] = opcode | (target - at - 2) // 2 & 0xFFFF
    bench.fails(r"called by caller\(\)")


@pytest.mark.parametrize("member", ["crt0_standard.o", "crt0_extended.o", "crt1_standard.o", "crt0.o", "data_init_standard.o",
                                    "crt_start_mode_normal.Leo", "crt_start_mode.o"])
def test_start_up_code_is_allowed_under_its_known_names(bench, member):
    bench.image.function("start", 0x060000, file=f"{LIBRARY}({member})", section=".libpic30_crt_start_mode")
    bench.passes()


@pytest.mark.parametrize("word", [0xD80102, 0xD87B85, 0xD88102, 0xD8F90F, 0xD90002]) # div.s, div.u, divf
def test_a_division_that_is_no_built_in_is_told_with_its_function(bench, word):
    bench.image.function("average", 0x090011, word, 0x060000)
    bench.fails(r"average\(\) divides by a variable with / or %: use qm_divud")


def test_built_in_divisions_and_constants_that_look_like_one_pass(bench):
    bench.image.function("average", 0x090011, 0xD88242, 0x090011, 0xD80242, 0x060000) # div.ud, div.sd
    bench.image.constant(0xD80102)
    bench.passes()


# ---- budget --------------------------------------------------------------------------------------------------------------
def test_a_budget_that_is_just_kept_passes_and_each_that_is_broken_is_a_line(bench):
    flash = bench.flash
    assert f"flash {flash} of {flash} bytes, RAM 300 of 300 bytes" in bench.passes(*bench.budget(flash, 300, 1732))
    bench.fails(f"flash: {flash} bytes of a budget of {flash - 1}", "RAM: 300 bytes of a budget of 299", "stack: 1732 bytes are left",
                more=bench.budget(flash - 1, 299, 1733))


def test_a_stack_that_is_deeper_than_its_budget_or_than_what_is_free_is_a_line(bench, monkeypatch):
    budget = bench.budget(12288, 768, 400)
    monkeypatch.setattr(image, "deepest_stack", lambda *_: (400, []))
    monkeypatch.setattr(image, "start_up_bytes", lambda *_: 0)
    assert "stack at most 400 of 400 bytes, 1732 bytes free" in bench.passes("--objdump", "x", *budget)
    take_ram(bench.image, 1700)
    bench.fails("stack: up to 400 bytes of 332", more=("--objdump", "x"))
    take_ram(bench.image, 300)
    monkeypatch.setattr(image, "deepest_stack", lambda *_: (401, ["f: calls through a pointer"]))
    bench.fails("stack: up to 401 bytes of 400; make size", "stack: f: calls through a pointer", more=("--objdump", "x", *budget))


def test_the_compiler_s_start_up_code_is_in_no_budget(bench, monkeypatch):
    monkeypatch.setattr(image, "deepest_stack", lambda *_: (100, []))
    monkeypatch.setattr(image, "start_up_bytes", lambda *_: 6)
    ours = bench.flash - 6
    assert f"flash {ours} of {ours} bytes and 6 of start-up code, RAM" in bench.passes("--objdump", "x", *bench.budget(ours, 768, 400))
    bench.fails(f"flash: {ours} bytes of a budget of {ours - 1}", more=("--objdump", "x", *bench.budget(ours - 1, 768, 400)))


# ---- files ---------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name, data, words", [
    ("a.elf", None, "No such file"), ("a.hex", None, "No such file"), ("a.map", None, "No such file"), ("a.elf", b"\x7fELF", ""),
                                               ("a.elf", b"text\n" * 40, ""),
    ("a.hex", record(0, 2, b"\0\0\0\0").encode(), ""), ("a.map", b"\xff\xfe nothing", "not a map file"),
    *(("budget.toml", text, "") for text in (b"", b"[budget.image]\nflash_bytes = 1\n", b"[budget]\nnote = 3\n", b"not toml"))])
def test_a_file_that_is_missing_or_another_is_one_line(bench, name, data, words):
    arguments = [*bench.image.write(bench.folder), *bench.budget(1, 1, 1)]
    (bench.folder / name).unlink() if data is None else (bench.folder / name).write_bytes(data)
    status, out, lines = bench.check(arguments=arguments)
    assert (status, out, len(lines)) == (2, "", 1)
    assert re.search(rf"^foc33: .*{words}.*{name}( line \d)?: (build it|check|add it|write \[|expected '=')", lines[0]), lines
