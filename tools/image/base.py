"""The image of the last commit, built with the same commands: what a change costs is seen beside it."""

import hashlib
import os
import shutil
import subprocess
import tarfile
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

from tools.common import paths

SOURCES = ("firmware", "include", "userparams.h")
CHANGED = (":(glob)firmware/**/*.[ch]", ":(glob)include/**/*.h", "userparams.h")


class NoBase(Exception):
    """There is nothing to compare with; str() says why."""


def commit(root: Path = paths.ROOT) -> str:
    """The commit to compare with: the last one, or the one before it when the sources are just as the last one has them."""
    if shutil.which("git") is None:
        raise NoBase("git is not installed")
    if _git(root, "rev-parse", "--show-prefix") is None or _git(root, "rev-parse", "--verify", "HEAD") is None:
        raise NoBase("there is no git history here")
    changed = _git(root, "--no-optional-locks", "status", "--porcelain", "--", *CHANGED)
    name = "HEAD" if changed else "HEAD~1"
    found = _git(root, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}")
    if found is None:
        raise NoBase("the sources are as in the only commit that is here")
    return found


def build(commit_id: str, compile_words: list[str], link_words: list[str], root: Path = paths.ROOT, cache: Path | None = None) -> Path:
    """The commit's ELF file, from the cache if it has been built with these commands before.
    @param compile_words compiler and flags; -c, source and object are added
    @param link_words the same with {objects}, {elf} and {map} in it"""
    key = hashlib.sha256("\0".join([*compile_words, *link_words]).encode()).hexdigest()[:8]
    folder = (cache or root / "build" / "size") / f"{commit_id[:12]}-{key}"
    elf = folder / "foc33.elf"
    if elf.is_file():
        return elf
    source = folder / "source"
    shutil.rmtree(folder, ignore_errors=True)
    source.mkdir(parents=True)
    _extract(root, commit_id, source)
    files = sorted(path.relative_to(source) for path in source.glob("firmware/*/*.c"))
    if not files:
        raise NoBase(f"commit {commit_id[:7]} has no firmware")
    objects = [folder / "objects" / path.with_suffix(".o") for path in files]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for ok in pool.map(lambda pair: _compile(compile_words, *pair, source), zip(files, objects)):
            if not ok:
                raise NoBase(f"commit {commit_id[:7]} does not compile with these flags")
    unfinished = folder / "unfinished.elf"
    words = []
    for word in link_words:
        words += [str(path) for path in objects] if word == "{objects}" else [word.format(elf=unfinished, map=folder / "foc33.map")]
    if not _run(words, source):
        raise NoBase(f"commit {commit_id[:7]} does not link with these flags")
    unfinished.rename(elf)
    return elf


def _compile(words: list[str], source: Path, target: Path, folder: Path) -> bool:
    target.parent.mkdir(parents=True, exist_ok=True)
    return _run([*words, "-c", str(source), "-o", str(target)], folder)


def _run(words: list[str], folder: Path) -> bool:
    try:
        return subprocess.run(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0
    except OSError:
        return False


def _extract(root: Path, commit_id: str, target: Path) -> None:
    archive = subprocess.run(["git", "archive", "--format=tar", commit_id], cwd=root, capture_output=True, check=False)
    if archive.returncode != 0:
        raise NoBase(f"git archive {commit_id[:7]} failed")
    with tarfile.open(fileobj=BytesIO(archive.stdout)) as tar:
        tar.extractall(target, [member for member in tar if member.name.split("/")[0] in SOURCES])


def _git(root: Path, *arguments: str) -> str | None:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
