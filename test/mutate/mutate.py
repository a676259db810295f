"""Mutation testing of the firmware: plants one small defect at a time and counts how many the tests notice.

A mutant is killed when a test fails, crashes or does not end; one that does not compile, or whose object code is the same as
without the change, does not count. Writes report.txt and report.json, and ends with exit code 1 below the required share."""
import argparse
import json
import os
import queue
import random
import re
import shutil
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mutants
import suite

FILES = ("include/*/**/*.h", "firmware/**/*.c")
# Tables of names, ranges and texts: build-time checks and documents read them, not the control law. Of a number by trial make sensitivity tells.
NOT_MUTATED = ("include/control/tuned.h", "include/drive/param_limits.h", "include/drive/faults.h", "firmware/drive/param_text.c",
               "firmware/drive/param_check.c")
UNIT_SHARE, CLOSED_LOOP_SHARE = 85.0, 90.0
KILLED = ("killed", "timeout")


def fail(what, where, remedy):
    print(f"foc33: {what}, {where}: {remedy}", file=sys.stderr)
    sys.exit(2)


def parse(argv):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--compile", required=True, help="compiler and flags of the tests, without -c")
    parser.add_argument("--tests", nargs="*", default=[], metavar="unit/test_x", help="unit tests")
    parser.add_argument("--scripts", nargs="*", default=[], metavar="unit/test_x", help="tests in Python, run for the parameters")
    parser.add_argument("--behaviour", nargs="*", default=[], metavar="behaviour/test_x", help="closed-loop tests")
    parser.add_argument("--closed-loop", action="store_true", help="survivors of the unit tests meet the closed-loop tests")
    parser.add_argument("--full", action="store_true", help="every mutant, not a sample")
    parser.add_argument("--sample", type=int, default=600, help="how many mutants to try (default 600)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default 1)")
    parser.add_argument("--files", nargs="*", default=[], metavar="text", help="every mutant of the files whose path contains a text")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 2)
    parser.add_argument("--out", default="build/mutate")
    return parser.parse_args(argv)


def all_mutants(root, wanted):
    """@return {file: mutants}"""
    paths = sorted(str(p.relative_to(root)) for pattern in FILES for p in root.glob(pattern))
    chosen = [p for p in paths if p not in NOT_MUTATED and (not wanted or any(w in p for w in wanted))]
    found = {p: mutants.of_file(p, (root / p).read_text()) for p in chosen}
    return {p: m for p, m in found.items() if m}


def sample(by_file, size, seed):
    """Of each file its share of `size`, and five at least; the same for the same sources and seed."""
    total = sum(len(m) for m in by_file.values())
    chosen = {}
    for file, found in by_file.items():
        share = min(len(found), max(5, round(len(found) * size / total)))
        picked = random.Random(f"{seed} {file}").sample(range(len(found)), share)
        chosen[file] = [found[i] for i in sorted(picked)]
    return chosen


def read_equivalent(path):
    """Entries of equivalent.txt: mutants' keys, a line each, then an indented line with the reason of them all. @return {key: reason}"""
    entries, keys = {}, []
    for number, line in enumerate(path.read_text().splitlines() if path.exists() else [], 1):
        if not line.strip() or line.startswith("#"):
            continue
        if line[0] not in " \t":
            keys.append(line.strip())
        elif keys:
            entries |= dict.fromkeys(keys, line.strip())
            keys = []
        else:
            fail("a reason without a mutant", f"{path}:{number}", "put the mutant's line before it")
    if keys:
        fail(f"no reason for {keys[0]}", str(path), "add an indented line that says why the change has no effect")
    return entries


class Runner:
    """Tries mutants in parallel, each worker in a tree of its own."""

    def __init__(self, tests, out, jobs, modes):
        self.tests, self.out, self.modes = tests, out, modes
        self.trees = queue.Queue()
        for number in range(jobs):
            tree = out / f"tree{number}"
            suite.copy_sources(tests.base, tree)
            (tree / "obj").mkdir()
            self.trees.put(tree)

    def attempt(self, mutant, stages):
        """@return (result, what killed it); the stages are sets of tests, tried one after another"""
        tree = self.trees.get()
        path = tree / mutant.file
        original = path.read_text()
        try:
            path.write_text(mutant.apply(original))
            memory = {}
            result, by = "survived", ""
            for number, names in enumerate(stages):
                result, by = self.tests.judge(tree, mutant.file, names, memory)
                if result != "survived":
                    break
                if number == 0 and self.tests.same_object_code(tree, mutant.file, self.modes):
                    return "same", ""
            return result, by
        finally:
            path.write_text(original)
            self.trees.put(tree)

    def run(self, chosen, stages, jobs):
        """@return results in the order of the mutants; a line every tenth of the way"""
        begin, results = time.monotonic(), []
        with ThreadPoolExecutor(jobs) as pool:
            for result in pool.map(lambda mutant: self.attempt(mutant, stages), chosen):
                results.append(result)
                done, total = len(results), len(chosen)
                if 10 * done // total != 10 * (done - 1) // total:
                    killed = sum(kind in KILLED for kind, _ in results)
                    print(f"{done}/{total} mutants, {killed} killed, {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
        return results


def percent(killed, counted):
    return 100.0 * killed / counted if counted else 100.0


def table(rows, title="file"):
    """@param rows [(name, Counter)]"""
    lines = [f"{title:34}{'mutants':>8}{'killed':>8}{'survived':>9}{'score':>8}   not counted"]
    for name, count in rows:
        killed, survived = sum(count[kind] for kind in KILLED), count["survived"]
        rest = ", ".join(f"{count[k]} {text}" for k, text in (("equivalent", "listed"), ("same", "no effect"), ("broken", "do not compile"))
                         if count[k])
        lines.append(f"{name:34}{killed + survived:8}{killed:8}{survived:9}{percent(killed, killed + survived):7.1f}%   {rest}".rstrip())
    return lines


def report(results, required, arguments, seconds):
    """@return (text, data, passed)"""
    by_file, by_operator = {}, {}
    for mutant, result, _ in results:
        by_file.setdefault(mutant.file, Counter())[result] += 1
        by_operator.setdefault(mutant.operator, Counter())[result] += 1
    total = sum(by_file.values(), Counter())
    killed = sum(total[kind] for kind in KILLED)
    counted = killed + total["survived"]
    score = percent(killed, counted)
    survivors = [m for m, result, _ in results if result == "survived"]
    lines = table([*by_file.items(), ("all", total)]) + [""]
    lines += table(sorted(by_operator.items()), "change")
    if survivors:
        lines += ["", "survivors ([-before-]{+after+}):"]
        lines += [f"{m.file}:{m.line}: {m.operator}: {m.key.split(': ', 1)[1]}" for m in survivors]
    tests = "unit and closed-loop tests" if arguments.closed_loop else "unit tests"
    passed = score >= required and counted > 0
    how = f"every mutant of {' '.join(arguments.files)}" if arguments.files else "every mutant" if arguments.full \
        else f"sample, seed {arguments.seed}"
    lines += ["", f"{how}: {len(results)} tried in {seconds:.0f} s",
              f"{score:.1f} % of {counted} mutants killed by the {tests}, {required:.0f} % required: {'PASS' if passed else 'FAIL'}"]
    if arguments.closed_loop:
        alone = sum(result in KILLED and by.startswith("behaviour/") for _, result, by in results)
        lines.insert(-1, f"{percent(killed - alone, counted):.1f} % by the unit tests, {alone} mutants by the closed-loop tests alone")
    data = {"score": round(score, 2), "required": required, "passed": passed, "tests": tests, "full": arguments.full,
            "seed": arguments.seed, "seconds": round(seconds, 1), "files": {f: dict(c) for f, c in by_file.items()},
            "mutants": [{"file": m.file, "line": m.line, "function": m.function, "operator": m.operator, "diff": m.diff,
                         "key": m.key, "result": result, "by": by} for m, result, by in results]}
    return "\n".join(lines) + "\n", data, passed


def main(argv=None):
    arguments = parse(argv)
    root, out = Path.cwd(), Path(arguments.out).resolve()
    equivalent_file = Path(__file__).parent / "equivalent.txt"
    by_file = all_mutants(root, arguments.files)
    if not by_file:
        fail("no mutants", " ".join(arguments.files), "--files takes a part of a path such as svm.h")
    equivalent = read_equivalent(equivalent_file)
    known = {m.key for found in by_file.values() for m in found}
    stale = [key for key in equivalent if key not in known and (not arguments.files or any(key.startswith(f"{f} ") for f in by_file))]
    if stale:
        fail(f"no such mutant: {stale[0]}", os.path.relpath(equivalent_file, root),
             "the code has changed; look at the entry again or remove it")
    chosen = by_file if arguments.full or arguments.files else sample(by_file, arguments.sample, arguments.seed)
    chosen = [m for found in chosen.values() for m in found]
    begin = time.monotonic()
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    tests = suite.Suite(root, out / "base", arguments.compile, arguments.jobs)
    modes = [[f"-D{mode}"] for mode in re.findall(r"^/\* #define (\w+) \*/", (root / "userparams.h").read_text(), re.M)]
    behaviour = arguments.behaviour if arguments.closed_loop else []
    try:
        tests.prepare(arguments.tests, behaviour)
        for name in arguments.scripts:
            command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"test/{name}.py"]
            note = tests.add_script(name, command, [*mutants.SCALING_FILES, "include/drive/drive.h"])
            if note:
                print(note, file=sys.stderr)
        print(f"{len(tests.tests)} tests built and passed in {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
        stages = [{t.name for t in tests.tests if t.name not in behaviour}]
        if behaviour:
            stages.append(set(behaviour))
        tried = [m for m in chosen if m.key not in equivalent]
        outcome = dict(zip(tried, Runner(tests, out, arguments.jobs, [[], *modes]).run(tried, stages, arguments.jobs)))
    except suite.BuildError as error:
        print(error, file=sys.stderr)
        fail("the tests must pass before they can be measured", str(error).split("\n", 1)[0].rstrip(":"), "see above; run make test")
    results = [(m, *outcome.get(m, ("equivalent", equivalent.get(m.key, "")))) for m in chosen]
    text, data, passed = report(results, CLOSED_LOOP_SHARE if arguments.closed_loop else UNIT_SHARE, arguments, time.monotonic() - begin)
    (out / "report.txt").write_text(text)
    (out / "report.json").write_text(json.dumps(data, indent=1) + "\n")
    print(text, end="")
    for tree in (out / "base", *out.glob("tree*")):
        shutil.rmtree(tree)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
