"""Programs the board with MPLAB IPE's command line, after the checks of image.py; says how where it is not installed.

    python3 -m tools.image.flash build/target/foc33.hex --elf build/target/foc33.elf --tool PK4 [--ipe folder]

Exit status 0: programmed and verified by the tool. 1: the image or the programming failed. 2: not programmed, something is missing."""

import argparse
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError, suggestion

from . import crc, device, image

TOOLS = {"PK3": "PICkit 3", "PK4": "MPLAB PICkit 4", "PK5": "MPLAB PICkit 5", "ICD4": "MPLAB ICD 4", "SNAP": "MPLAB Snap"}
NAMES = ("ipecmd.sh", "ipecmd", "ipecmd.exe")
INSIDE = ("", "bin", "mplab_platform/mplab_ipe", "mplab_platform/mplab_ipe/bin", "mplab_platform/bin", "mplab_ipe", "mplab_ipe/bin")
USUAL = ("/opt/microchip/mplabx", "/Applications/microchip/mplabx", "C:/Program Files/Microchip/MPLABX",
         "C:/Program Files (x86)/Microchip/MPLABX")


def command(ipecmd: str, tool: str, hex_file: Path) -> list[str]:
    """Erases, programs, verifies (-M), then lets the program run (-OL)."""
    return [ipecmd, f"-P{device.NAME}", f"-TP{tool}", f"-F{hex_file.resolve()}", "-M", "-OL"]


def in_folder(folder: Path) -> str | None:
    """ipecmd in a folder of MPLAB IPE or MPLAB X."""
    return next((str(folder / inside / name) for inside in INSIDE for name in NAMES if (folder / inside / name).is_file()), None)


def find(ipe: Path | None, usual: tuple[str, ...] = USUAL) -> str | None:
    """ipecmd in the folder that the user names, else on PATH, else the newest in the usual places."""
    if ipe is not None:
        if found := in_folder(ipe):
            return found
        raise UserError(f"not programmed: no {NAMES[0]} in IPE={ipe}", "", "name the folder of MPLAB X or of MPLAB IPE that has it")
    folders = [folder for place in usual if Path(place).is_dir() for folder in Path(place).iterdir() if folder.is_dir()]
    folders.sort(key=lambda folder: [int(number) for number in re.findall(r"\d+", folder.name)], reverse=True) # the newest first
    return next(filter(None, (*map(shutil.which, NAMES), *map(in_folder, folders))), None)


def checked(hex_file: Path, elf_file: Path) -> list[str]:
    """Failures of the image that is about to be programmed."""
    elf, words = image.read_elf(elf_file), image.read_hex(hex_file)
    return image.check(elf, words, None, image.wanted_fields(image.CONFIG_C.read_text(encoding="utf-8"), crc.keeps_parameters(elf)), None)


def program(options: argparse.Namespace) -> int:
    tool = options.tool.upper()
    if tool not in TOOLS:
        raise UserError(f"no tool TOOL={options.tool}", "make flash", suggestion(tool, TOOLS))
    failures = checked(options.hex, options.elf)
    if failures:
        for failure in failures:
            print(f"foc33: {options.hex.name}, {failure}", file=sys.stderr)
        print("foc33: not programmed, the image failed its checks: build it anew with make firmware", file=sys.stderr)
        return 1
    ipecmd = find(options.ipe)
    if ipecmd is None:
        print(f"with MPLAB IPE: {shlex.join(command(NAMES[0], tool, options.hex))}", flush=True)
        raise UserError("not programmed: MPLAB IPE's ipecmd.sh is not on PATH nor in its usual place", "",
                        "install MPLAB X with IPE (microchip.com), or give IPE=folder, or run the command above where it is installed")
    line = command(ipecmd, tool, options.hex)
    print(f"{TOOLS[tool]}: {shlex.join(line)}", flush=True)
    try:
        status = subprocess.run(line, cwd=options.hex.resolve().parent, check=False).returncode # it leaves its logs where it runs
    except OSError as error:
        raise UserError(f"not programmed: cannot start ipecmd ({error.strerror})", ipecmd, "check the installation of MPLAB IPE") from None
    if status != 0:
        print(f"foc33: programming failed, ipecmd exit status {status}: see its lines above; cable, power of the board, TOOL={tool}?",
              file=sys.stderr)
        return 1
    print("programmed and verified; the board runs the new program. docs/flashing.md: what you should see now")
    return 0


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.flash", description=__doc__.splitlines()[0])
    parser.add_argument("hex", type=Path)
    parser.add_argument("--elf", type=Path, required=True, help="the program that the HEX was made of, for the checks")
    parser.add_argument("--tool", default="PK4", help=f"{', '.join(TOOLS)} (PK4)")
    parser.add_argument("--ipe", type=Path, help="folder of MPLAB X or MPLAB IPE")
    return command_line.run(lambda: program(parser.parse_args(arguments)))


if __name__ == "__main__":
    sys.exit(main())
