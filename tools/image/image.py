"""Checks an image before it is flashed: device, vectors, configuration words, HEX against ELF, library helpers, budgets.

    python3 -m tools.image.image foc33.elf foc33.hex [--map foc33.map] [--budget firmware/budget.toml]

One line for each failure and exit status 1; a file that cannot be read is one line and exit status 2."""

import argparse
import re
import sys
from pathlib import Path

from tools.common import command_line, paths
from tools.common.errors import UserError

from . import attribution, crc, device, size, wcet
from .budget import Budget, Limits, shares
from .linked import Piece, default_handler_is_ours, divisions, origins, read_map
from .program import Elf, Words, read_elf, read_hex, reset_target

CONFIG_C = paths.ROOT / "firmware" / "board" / "main.c"
CHOICE = re.compile(r"^#if PARAMS_KEPT\n(.*?)^#else\n(.*?)^#endif\n", re.MULTILINE | re.DOTALL)
PRAGMA = re.compile(r"^\s*#\s*pragma\s+config\s+(\w+)\s*=\s*(\w+)\s*$", re.MULTILINE)


def check_device(elf: Elf) -> list[str]:
    """The part that every object was compiled for."""
    if elf.devices == {device.NAME}:
        return []
    found = ", ".join(sorted(elf.devices)) or "no part at all"
    return [f"the image is for {found}, not for the {device.NAME}: compile every file with -mcpu={device.NAME}"]


def check_memory(words: Words) -> list[str]:
    """Every word is in the flash or is a configuration word."""
    outside = sorted(address for address in words if address not in device.FLASH and address not in device.CONFIGURATION)
    if not outside:
        return []
    return [f"{len(outside)} words outside the flash of the {device.NAME} (0x0000 .. 0x{device.FLASH[-1]:04X}), "
            f"the first at 0x{outside[0]:06X}"]


def check_same(hex_words: Words, elf: Elf) -> list[str]:
    """The HEX file is the ELF file, word for word. A word that one of them lacks is erased flash."""
    different = sorted(address for address in hex_words.keys() | elf.words.keys()
                       if hex_words.get(address, device.ERASED) != elf.words.get(address, device.ERASED))
    if not different:
        return []
    first = different[0]
    return [f"HEX and ELF differ in {len(different)} words, the first at 0x{first:06X}: {_shown(hex_words, first)} in the HEX, "
            f"{_shown(elf.words, first)} in the ELF"]


def _shown(words: Words, address: int) -> str:
    return f"0x{words[address]:06X}" if address in words else "erased"


def check_reset(words: Words, elf: Elf) -> list[str]:
    """The first instruction goes to the start-up code."""
    target = reset_target(words)
    if target is None:
        return [f"reset vector: 0x{words.get(0, device.ERASED):06X} 0x{words.get(2, device.ERASED):06X} is no GOTO"]
    starts = {elf.symbols[name] for name in ("__reset", "__resetPRI") if name in elf.symbols}
    if not starts:
        return ["reset vector: the image has no start-up code (__reset)"]
    return [] if target in starts else [f"reset vector: goes to 0x{target:06X} ({elf.function_at(target)}), not to the start-up code at "
                                        f"0x{min(starts):06X}"]


def check_vectors(words: Words, elf: Elf, pieces: list[Piece] | None) -> list[str]:
    """Both tables: each entry goes to its function; one without a function to _DefaultInterrupt, which must be ours."""
    default = elf.symbols.get("_" + device.DEFAULT_VECTOR)
    if default is None:
        return [f"vectors: the image has no {device.DEFAULT_VECTOR}"]
    failures = [f"vectors: the image has no {name}: a misspelt name in the sources, or a file that is not linked"
                for name in device.REQUIRED if "_" + name not in elf.symbols]
    for symbol in sorted(elf.symbols):
        name = symbol.removeprefix("_")
        if re.fullmatch(r"_[A-Z]\w*(Interrupt|Error|Fail|Trap\d)", name) and elf.symbols[symbol] in device.PROGRAM \
                and name != device.DEFAULT_VECTOR and name.replace("_Alt", "_", 1) not in device.VECTORS:
            failures.append(f"vectors: {name} is no vector of the {device.NAME}: the function never runs")
    for table, base, prefix in (("IVT", device.IVT, "_"), ("AIVT", device.AIVT, "_Alt")):
        wrong = []
        for number, name in enumerate(device.VECTORS):
            wanted = elf.symbols.get("_" + prefix + name[1:], elf.symbols.get("_" + name, default))
            got = words.get(base + 2 * number, device.ERASED)
            if got == device.ERASED and number >= len(device.TRAPS) + device.LEFT_ERASED:
                continue
            if got != wanted:
                what = "is erased" if got == device.ERASED else f"goes to 0x{got:06X} ({elf.function_at(got)})"
                wrong.append(f"vector {name} of the {table} (0x{base + 2 * number:03X}) {what}, not to 0x{wanted:06X} "
                             f"({elf.function_at(wanted)})")
        failures += wrong[:3] + ([f"and {len(wrong) - 3} more vectors of the {table}"] if len(wrong) > 3 else [])
    if pieces is not None and not default_handler_is_ours(elf, pieces):
        failures.append(f"vectors: {device.DEFAULT_VECTOR} is the compiler's, which leaves the outputs as they are: "
                        "define it in firmware/board/isr.c")
    return failures


def wanted_fields(text: str, keeps: bool = False) -> dict[str, str]:
    """The settings of main.c, in a program with PARAMS_KEPT or without."""
    return dict(PRAGMA.findall(CHOICE.sub(lambda choice: choice[1 if keeps else 2], text)))


def check_configuration(words: Words, config: dict[str, str], keeps: bool = False) -> list[str]:
    """Every field of the configuration words as main.c and the board want it; a field that neither names is left alone."""
    needs = device.KEPT_NEEDS if keeps else device.BOARD_NEEDS
    failures = [f"configuration: {name} = {config[name]} in main.c, but the board needs {value} ({device.FIELDS[name].values[value][1]})"
                for name, value in needs.items() if config.get(name, value) != value]
    for name, value in {**needs, **config}.items():
        field = device.FIELDS.get(name)
        if field is None or value not in field.values:
            failures.append(f"configuration: {name} = {value} in main.c is unknown for the {device.NAME}: "
                            "add it to tools/image/device.py")
            continue
        word = words.get(field.word)
        if word is None:
            failures.append(f"configuration word {device.WORDS[field.word]} (0x{field.word:06X}) is missing: {name} must be {value}")
        elif word & field.mask != field.values[value][0]:
            failures.append(f"configuration word {device.WORDS[field.word]} (0x{field.word:06X}) = 0x{word & 0xFF:02X}: {name} is "
                            f"{field.meaning(word)}, must be {value} ({field.values[value][1]})")
    return failures


def configuration_table(words: Words) -> list[str]:
    """Each field of the configuration words in the image, with its meaning."""
    return [f"{device.WORDS[field.word]:8} 0x{word & 0xFF:02X}  {name:9} {field.meaning(word)}"
            for name, field in device.FIELDS.items() for word in [words.get(field.word, device.ERASED)]]


def flash_bytes(words: Words) -> int:
    """Program memory above the vectors, as the linker's report and data sheets count it."""
    return attribution.BYTES_PER_WORD * sum(address in device.PROGRAM for address in words)


def stack_space(elf: Elf) -> int | None:
    """Bytes between the start of the stack and its limit."""
    low, high = elf.symbols.get("__SP_init"), elf.symbols.get("__SPLIM_init")
    return None if low is None or high is None else high - low


def deepest_stack(elf: Path, objdump: str, budget: Budget) -> tuple[int, list[str]]:
    """Bytes of the deepest stack, and what keeps it from being known for sure, as make size finds them."""
    result = size.deepest(attribution.read(elf), size.disassemble(objdump, elf), budget)
    return result.depth, result.errors


def longest_paths(elf: Path, budget: Budget, delivered: bool) -> tuple[str, list[str]]:
    """The control interrupt's longest paths in a line, and what is wrong with them."""
    bounds, failures = wcet.check(elf, budget.cycles, delivered)
    return ", ".join(("longest path of the interrupt " if not number else "of its slow work " if bound.handler == wcet.SLOW else "")
                     + f"{bound.cycles} cycles to its {bound.to}" for number, bound in enumerate(bounds)), failures


def start_up_bytes(elf: Path, budget: Budget) -> int:
    """Flash of the compiler's start-up code, which differs between versions and is in no budget."""
    return budget.uncounted(shares(attribution.read(elf), budget))


def check_budget(words: Words, elf: Elf, limits: Limits | None, deepest: int | None = None, start_up: int = 0) -> list[str]:
    """Flash, without the compiler's start-up code, and RAM in their budgets, the stack in its own and in what is left of the RAM."""
    failures = []
    flash, stack = flash_bytes(words) - start_up, stack_space(elf)
    room = limits.stack if limits else stack
    if deepest is not None and room is not None and deepest > room:
        failures.append(f"stack: up to {deepest} bytes of {room}; make size shows the calls")
    if limits is None:
        return failures
    if flash > limits.flash:
        failures.append(f"flash: {flash} bytes of a budget of {limits.flash}; make size shows what takes them")
    if elf.ram_bytes > limits.ram:
        failures.append(f"RAM: {elf.ram_bytes} bytes of a budget of {limits.ram}, the stack not counted; make size shows what takes them")
    if stack is not None and stack < limits.stack:
        failures.append(f"stack: {stack} bytes are left for it, the budget says {limits.stack}")
    return failures


def summary(words: Words, elf: Elf, limits: Limits | None, deepest: int | None = None, start_up: int = 0) -> str:
    """What the image takes of its budget, or of the chip where there is none."""
    flash, ram = ((f"{limits.flash} bytes", f"{limits.ram} bytes") if limits else
                  (f"{len(device.PROGRAM) * attribution.BYTES_PER_WORD} bytes of the chip", f"{len(device.RAM)} bytes of the chip"))
    stack = stack_space(elf)
    kept = f", {len(device.KEPT) * attribution.BYTES_PER_WORD} more for kept parameters" if crc.keeps_parameters(elf) else ""
    return (f"flash {flash_bytes(words) - start_up} of {flash}{kept}{f' and {start_up} of start-up code' if start_up else ''}, RAM {elf.ram_bytes} of {ram}, "
            + ("" if deepest is None else f"stack at most {deepest}{f' of {limits.stack}' if limits else ''} bytes, ")
            + f"{stack if stack is not None else 'unknown'} bytes free for it")


def check(elf: Elf, words: Words, pieces: list[Piece] | None, config: dict[str, str], limits: Limits | None,
          deepest: int | None = None, start_up: int = 0) -> list[str]:
    """Every failure of an image; `pieces` None when there is no map, `deepest` None when nobody has looked for the deepest stack."""
    return [*check_device(elf), *check_memory(words), *check_same(words, elf), *check_reset(words, elf), *check_vectors(words, elf, pieces),
            *check_configuration(words, config, crc.keeps_parameters(elf)), *crc.check(words, elf), *([*origins(elf, pieces), *divisions(elf, pieces)] if pieces is not None else []),
            *check_budget(words, elf, limits, deepest, start_up)]


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.image", description=__doc__.splitlines()[0])
    parser.add_argument("elf", type=Path)
    parser.add_argument("hex", type=Path)
    parser.add_argument("--map", type=Path, help="the linker's map: looks for library helpers too")
    parser.add_argument("--budget", type=Path, help="TOML file with [budget.image]")
    parser.add_argument("--other-header", action="store_true", help="another userparams.h than the budget's: it is held to the chip and the deadline")
    parser.add_argument("--config", type=Path, default=CONFIG_C, help="C file with the #pragma config lines (firmware/board/main.c)")
    parser.add_argument("--objdump", help="XC16's disassembler: looks for the deepest stack too")
    parser.add_argument("--wcet", action="store_true", help="looks for the interrupt's longest path too, with the simulator's decoder")
    parser.add_argument("--table", action="store_true", help="also print the configuration words and their meaning")
    return command_line.run(lambda: _run(parser.parse_args(arguments)))


def _run(options: argparse.Namespace) -> int:
    elf, words = read_elf(options.elf), read_hex(options.hex)
    pieces = read_map(options.map) if options.map else None
    limits = Budget.read(options.budget).image if options.budget and not options.other_header else None
    deepest, unsure = deepest_stack(options.elf, options.objdump, Budget.read()) if options.objdump else (None, [])
    start_up = start_up_bytes(options.elf, Budget.read(options.budget)) if options.objdump and limits else 0
    try:
        config = wanted_fields(options.config.read_text(encoding="utf-8"), crc.keeps_parameters(elf))
    except OSError as error:
        raise UserError(f"cannot read the configuration ({error.strerror})", str(options.config)) from None
    failures = check(elf, words, pieces, config, limits, deepest, start_up) + [f"stack: {reason}" for reason in unsure if limits]
    paths_text, too_long = longest_paths(options.elf, Budget.read(options.budget), not options.other_header) if options.wcet and options.budget else ("", [])
    failures += too_long
    for failure in failures:
        print(f"foc33: {options.hex.name}, {failure}", file=sys.stderr)
    if options.table:
        print("\n".join(configuration_table(words)))
    print(f"{options.hex}: {summary(words, elf, limits, deepest, start_up)}{paths_text and f', {paths_text}'}"
          f"{f'; {len(failures)} checks failed' if failures else ''}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
