"""The image of the last commit, built by its own Makefile: what a change costs is seen beside it."""

import hashlib
import os
import shutil
import subprocess
import tarfile
from io import BytesIO
from pathlib import Path

from tools.common import paths
from tools.common.progress import waiting

SOURCES = ("Makefile", "tools", "firmware", "include", "userparams.h") # all that `make image` reads of a tree
SETUP = Path("build/setup")                                            # what `make image` installs: this tree's is good for any commit
CHANGED = (":(glob)firmware/**/*.[ch]", ":(glob)include/**/*.h", "userparams.h")
MAKES_OWN = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")


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


def build(commit_id: str, variables: list[str], root: Path = paths.ROOT) -> Path:
    """The commit's ELF file, from the cache if it has been built so before.
    @param variables of make: OPT=-O2, XC16=folder ..."""
    key = hashlib.sha256("\0".join(variables).encode()).hexdigest()[:8]
    folder = root / "build" / "size" / f"{commit_id[:12]}-{key}"
    elf = folder / "foc33.elf"
    if elf.is_file():
        return elf
    shutil.rmtree(folder, ignore_errors=True)
    source = folder / "source"
    source.mkdir(parents=True)
    archive = subprocess.run(["git", "archive", "--format=tar", commit_id, *SOURCES], cwd=root, capture_output=True, check=False)
    if archive.returncode != 0:
        raise NoBase(f"commit {commit_id[:7]} has no firmware in the folders of today")
    with tarfile.open(fileobj=BytesIO(archive.stdout)) as tar:
        tar.extractall(source)
    (source / SETUP).parent.mkdir(exist_ok=True)
    (source / SETUP).symlink_to(root / SETUP)
    environment = {name: value for name, value in os.environ.items() if name not in MAKES_OWN}
    with waiting(f"building commit {commit_id[:7]}, to compare with"):
        done = subprocess.run(["make", "-s", f"-j{os.cpu_count()}", "target-elf", *variables], cwd=source, env=environment,
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0 or not done.stdout.strip():
        reason = next(iter(done.stderr.splitlines()), "no image named")
        raise NoBase(f"commit {commit_id[:7]} does not build with these settings: {reason}")
    (source / done.stdout.split()[-1]).rename(elf)
    return elf


def _git(root: Path, *arguments: str) -> str | None:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
