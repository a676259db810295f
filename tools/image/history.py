"""What the image took at each commit: a line a commit in docs/history/NAME.csv, and its curves, so that the cost of each capability is seen.

A commit's line is written when `make size` or `make cycles` measures sources that are just as that commit has them; a later measurement of the
same commit replaces it.
"""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt # noqa: E402  the backend must be chosen first

from tools.common import paths # noqa: E402
from tools.common.errors import UserError # noqa: E402

from . import base # noqa: E402

FOLDER = Path("docs/history")
FIRST = ["commit", "date"]
MOST_CURVES = 12
UNITS = {"size": "bytes", "cycles": "cycles"}

Line = dict[str, str]


def keep(name: str, values: dict[str, float], pictures: Path, root: Path = paths.ROOT) -> str:
    """Writes the line of the commit that is checked out, and draws all of them.
    @param values by column: bytes or cycles @param pictures folder of NAME_history.png @return what to tell"""
    try:
        commit, date = base.checked_out(root)
    except base.NoBase as reason:
        return f"no line in {FOLDER / name}.csv: {reason}"
    path = root / FOLDER / f"{name}.csv"
    columns, lines = _read(path)
    columns += [column for column in values if column not in columns]
    lines = [line for line in lines if line["commit"] != commit]
    lines.append({"commit": commit, "date": date} | {column: f"{value:.10g}" for column, value in values.items()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(lines)
        picture = draw(name, columns[len(FIRST):], lines, pictures)
    except OSError as error:
        raise UserError(f"cannot write ({error.strerror})", str(paths.shown(path)), "make the folder writable") from None
    return f"history: {paths.shown(path)}, {paths.shown(picture)}"


def _read(path: Path) -> tuple[list[str], list[Line]]:
    """Columns and lines of a file; none if there is no file yet."""
    if not path.exists():
        return list(FIRST), []
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        columns, lines = list(reader.fieldnames or []), list(reader)
    if columns[:len(FIRST)] != FIRST:
        raise UserError(f"does not begin with {','.join(FIRST)}", f"{paths.shown(path)}:1", "take the file from the last commit: git checkout")
    for number, line in enumerate(lines, 2):
        if len(line) != len(columns) or None in line.values() or not all(_is_number(line[column]) for column in columns[len(FIRST):]):
            raise UserError("a line needs a number or nothing for each column", f"{paths.shown(path)}:{number}", "take the file from the last commit: git checkout")
    return columns, lines


def _is_number(text: str) -> bool:
    try:
        return text == "" or float(text) >= 0
    except ValueError:
        return False


def draw(name: str, columns: list[str], lines: list[Line], folder: Path) -> Path:
    """The columns that are largest in the last line, over the commits: folder/NAME_history.png."""
    last = lines[-1]
    shown = sorted((column for column in columns if last.get(column)), key=lambda column: -float(last[column]))[:MOST_CURVES]
    figure, axes = plt.subplots(figsize=(10, 6), layout="constrained")
    for column in shown:
        axes.plot([float(line.get(column) or "nan") for line in lines], marker=".", label=column)
    axes.set(title=f"{name}: commit by commit", ylabel=UNITS[name], yscale="log", xticks=range(len(lines)))
    axes.set_xticklabels([f"{line['date']} {line['commit']}" for line in lines], rotation=90, fontsize=7)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    axes.grid(alpha=0.3)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}_history.png"
    figure.savefig(path)
    plt.close(figure)
    return path
