"""Runs the proofs: Frama-C's Eva over test/proof/*.c with the target's 16-bit int. One proof is one function proof_*().

The head of each file names its sources, Eva's options, the modes of the firmware in which a proof runs as well, and which proofs take minutes. A proof passes if
Eva raises no alarm, every `check` is valid and reached, and the proof's function returns; there is no list of exceptions.

proved.txt keeps, for each proof, the checksum of what it was given when it passed: text without comments, options and Frama-C's version. With
--new only those run whose checksum has changed, and an eighth of the others, another one with each commit; not of those that take minutes.
"""

import argparse
import functools
import hashlib
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

HERE = Path(os.path.relpath(Path(__file__).parent)) # Frama-C cannot tell a blank in a path from the next argument
BUILD = Path("build/proof")
RECORD = HERE / "proved.txt"
SPOT_CHECKS = 8 # with --new, one in so many of the recorded proofs runs all the same
KERNEL = """-machdep gcc_x86_16 -warn-signed-overflow -no-warn-left-shift-negative -kernel-warn-key parser:decimal-float=inactive,annot:missing-spec=abort
    -eva -eva-warn-signed-converted-downcast -eva-no-show-progress -report-unclassified-warning NONE""".split()
HEADERS = {"SCOPED": "scoped_header.h", "LATE": "late_header.h", "EACH": "each_header.h", "EACH_LATE": "each_late_header.h"}
"""Modes that are a header: with the scope, and any sine beside the current; with the shortest period, whose duties are late; with dead time's compensation for each pulse."""
PROVED = {"Valid", "Considered valid", "Valid under hypotheses", "Dead"}


@dataclass
class Proof:
    name: str
    function: str
    file: Path
    sources: list[str]
    options: list[str]
    mode: str
    minutes: bool = False
    """long enough to hold up a push"""


def head_entry(text: str, key: str) -> list[str]:
    match = re.search(rf"^ \* {key}:((?:.*\n \*     )*.*?)(?: \*/)?$", text, re.M)
    return match[1].replace("\n *     ", " ").split() if match else []


def read_proofs(file: Path) -> list[Proof]:
    text = file.read_text()
    functions = re.findall(r"^void (proof_\w+)\(void\)$", text, re.M)
    modes = head_entry(text, "modes")
    proofs = []
    for function in functions:
        for mode in [""] + (modes[1:] if modes and modes[0] == function else []):
            name = function.removeprefix("proof_") + (f"_{mode}" if mode else "")
            proofs.append(Proof(name, function, file, head_entry(text, "sources"), head_entry(text, "options"), mode,
                                function in head_entry(text, "minutes")))
    return proofs


def cpp_options(proof: Proof) -> list[str]:
    """Of the preprocessor. A register or flag that an interrupt may change is any value at the start of a proof, and constant during a tick."""
    mode = ["-include", f"{HERE}/{HEADERS[proof.mode]}"] if proof.mode in HEADERS else [f"-D{proof.mode}"] if proof.mode else []
    return [f"-I{HERE}", "-Iinclude", "-Itools/cpu_host", "-I.", "-Dvolatile=", *mode]


@functools.cache
def frama_c(option: str) -> str:
    return subprocess.run(["frama-c", option], text=True, capture_output=True, check=True).stdout.strip()


def checksum(proof: Proof) -> str:
    """Of everything that decides how the proof ends."""
    share = frama_c("-print-share-path")
    command = ["gcc", "-E", "-P", "-C", "-nostdinc", f"-I{share}/libc", "-D__FRAMAC__", "-D__FC_MACHDEP_GCC_X86_16", *cpp_options(proof)]
    text = "".join(subprocess.run([*command, file], text=True, capture_output=True, check=True).stdout for file in (str(proof.file), *proof.sources))
    text = re.sub(r"/\*(?!@).*?\*/|//(?!@)[^\n]*", " ", text, flags=re.DOTALL)
    return hashlib.sha256(" ".join([frama_c("-version"), *KERNEL, *proof.options, proof.function, *text.split()]).encode()).hexdigest()[:16]


def read_record() -> dict[str, str]:
    """Checksum of each proof when it last passed."""
    return dict(line.split() for line in RECORD.read_text().splitlines()) if RECORD.exists() else {}


def is_spot_check(proof: Proof, commit: str) -> bool:
    return not proof.minutes and int(hashlib.sha256(f"{commit} {proof.name}".encode()).hexdigest(), 16) % SPOT_CHECKS == 0


def run(proof: Proof) -> tuple[list[str], float]:
    """What is wrong with the proof, and the seconds it took."""
    report = BUILD / f"{proof.name}.csv"
    report.unlink(missing_ok=True)
    command = ["frama-c", *KERNEL, *proof.options, f"-cpp-extra-args={' '.join(cpp_options(proof))}", "-main", proof.function, str(proof.file),
               *proof.sources, "-then", "-report-csv", str(report)]
    start = time.monotonic()
    try:
        done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    except OSError as error:
        print(f"foc33: {command[0]}, proofs: cannot be run ({error.strerror}); make proof installs it", file=sys.stderr)
        os._exit(2)
    seconds = time.monotonic() - start
    (BUILD / f"{proof.name}.log").write_text(done.stdout)
    if done.returncode != 0 or not report.exists():
        errors = [line.strip() for line in done.stdout.splitlines() if "rror" in line]
        return [f"Frama-C did not finish: {errors[0] if errors else done.returncode}"], seconds
    return judge(proof, report.read_text(), done.stdout), seconds


def judge(proof: Proof, report: str, log: str) -> list[str]:
    wrong = []
    analysed = set(re.findall(r"Values at end of function (\w+)", log))
    ends = re.search(rf"Values at end of function {proof.function}:\n\s*NON TERMINATING", log)
    if proof.function not in analysed or ends:
        wrong.append(f"{proof.function} does not return: an alarm or a wrong bound stops every path")
    for row in report.splitlines()[1:]:
        directory, file, line, function, kind, status, statement = row.split("\t")
        if directory.startswith("FRAMAC_SHARE"):
            continue
        unreached = status == "Dead" and kind == "user check" and function in analysed
        if status not in PROVED or unreached:
            what = "is never reached" if unreached else "may fail"
            wrong.append(f"{directory}/{file}:{line}: {function}: {kind} {what}: {statement}")
    return wrong


def prove(proofs: list[Proof], checksums: dict[str, str]) -> tuple[int, int]:
    """Runs them and records what passes. @return how many passed and failed"""
    record, passed = read_record(), 0
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for proof, (wrong, seconds) in zip(proofs, pool.map(run, proofs)):
            for line in wrong:
                print(f"  {line}")
            print(f"{proof.name}: " + (f"FAIL: {len(wrong)} alarms" if wrong else "PASS") + f" ({seconds:.0f} s)", flush=True)
            passed += not wrong
            record.pop(proof.name, None)
            record |= {} if wrong else {proof.name: checksums[proof.name]}
    known = {proof.name for proof in all_proofs()}
    RECORD.write_text("".join(f"{name} {text}\n" for name, text in sorted(record.items()) if name in known))
    return passed, len(proofs) - passed


def all_proofs() -> list[Proof]:
    return [proof for file in sorted(HERE.glob("*.c")) for proof in read_proofs(file)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("only", nargs="*", help="names of proofs (all)")
    parser.add_argument("--new", action="store_true", help="only what proved.txt does not have as it is, and spot checks")
    options = parser.parse_args()
    known = all_proofs()
    proofs = [proof for proof in known if not options.only or proof.name in options.only]
    if wrong_names := [name for name in options.only if name not in {proof.name for proof in known}]:
        print(f"foc33: no such proof, {' '.join(wrong_names)}: use one of {' '.join(proof.name for proof in known)}", file=sys.stderr)
        return 2
    BUILD.mkdir(parents=True, exist_ok=True)
    try:
        checksums = {proof.name: checksum(proof) for proof in proofs}
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"foc33: proofs, preprocessor or frama-c: {error}; make proof installs Frama-C", file=sys.stderr)
        return 2
    recorded = []
    if options.new:
        commit = subprocess.run(["git", "rev-parse", "HEAD"], text=True, capture_output=True, check=False).stdout.strip()
        record = read_record()
        recorded = [proof for proof in proofs if record.get(proof.name) == checksums[proof.name] and not is_spot_check(proof, commit)]
        print("".join(f"{proof.name}: PASS (as recorded)\n" for proof in recorded), end="", flush=True)
    passed, failed = prove([proof for proof in proofs if proof not in recorded], checksums)
    print(f"{passed + len(recorded)} passed, {failed} failed")
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
