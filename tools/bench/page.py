"""A page in one file, index.html: notes, tables, and the curves of runs, which zoom without a network."""

import base64
import html
import json
from dataclasses import dataclass, field
from pathlib import Path

from tools.common import paths
from .picture import Picture

NAME = "index.html"
LIBRARY = "dygraph.min.js"
LIBRARY_FOLDERS = (Path("/usr/share/javascript/dygraphs"), paths.ROOT / "build" / "setup" / "node_modules" / "dygraphs" / "dist")
"""Debian's libjs-dygraphs, or npm's dygraphs."""
NO_LIBRARY = "The curves need dygraphs: install Debian's libjs-dygraphs, or npm install --prefix build/setup dygraphs@2.2.1, and run again."
MOST_CURVES = 1_600_000
"""Bytes of all pictures of a page together; bad rows have theirs first."""


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    cells: list[str]
    bad: bool = False
    picture: int | None = None
    """a click shows this one of the page's pictures"""
    at_s: float | None = None
    """a click shows this moment"""


@dataclass(frozen=True)
class Table:
    """A table with a heading."""

    title: str
    head: list[str]
    rows: list[Row]


@dataclass
class Page:
    """What a page shows, in this order."""

    title: str
    passed: bool
    verdict: str
    notes: list[str]
    before: list[Table] = field(default_factory=list)
    pictures: list[Picture | None] = field(default_factory=list)
    after: list[Table] = field(default_factory=list)
    images: list[str] = field(default_factory=list)
    """PNG files of the folder"""
    files: list[str] = field(default_factory=list)
    """other files of the folder, to be opened from the page"""


def write(folder: Path, page: Page, folders: tuple[Path, ...] = LIBRARY_FOLDERS) -> None:
    """Writes the page. `folders`: where the plotting library may be."""
    here, script = Path(__file__).parent, library(folders)
    pictures = _that_fit(page.pictures, {row.picture for table in page.before for row in table.rows if row.bad})
    parts = [f"<h1>{_text(page.title)}</h1>", f'<p class="{"good" if page.passed else "bad"}">{_text(page.verdict)}</p>',
             "".join(f"<p>{_text(note)}</p>" for note in page.notes), *map(_table, page.before)]
    if any(pictures):
        parts.append('<h2 id="title">Curves</h2>' + ('<div id="curves"></div>' if script else f'<p class="bad">{_text(NO_LIBRARY)}</p>'))
    left_out = sum(picture is None for picture in pictures) if any(pictures) else 0
    parts += [f"<p>{left_out} runs without curves: the page would be too large.</p>"] * bool(left_out)
    parts += map(_table, page.after)
    parts += [_image(folder / name) for name in page.images]
    parts += ["<h2>Files</h2><p>" + " ".join(f'<a href="{_text(name)}">{_text(name)}</a>' for name in page.files) + "</p>"] * bool(page.files)
    if script and any(pictures):
        data = [picture and {"head": picture.head, "curves": base64.b64encode(picture.curves).decode()} for picture in pictures]
        parts += [f'<script type="application/json" id="pictures">{_json(data)}</script>',
                  f"<script>{script}</script>", f'<script>{(here / "page.js").read_text(encoding="utf-8")}</script>']
    head = f'<meta charset="utf-8"><title>{_text(page.title)}</title>\n<style>{(here / "page.css").read_text(encoding="utf-8")}</style>'
    (folder / NAME).write_text(f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n' + "\n".join(parts) + "\n</body></html>\n",
                               encoding="utf-8")


def draws(folders: tuple[Path, ...] = LIBRARY_FOLDERS) -> bool:
    """Whether a page will have curves."""
    return any((folder / LIBRARY).is_file() for folder in folders)


def library(folders: tuple[Path, ...]) -> str:
    """The plotting library and its style, or "" where it is not installed."""
    for folder in folders:
        file = folder / LIBRARY
        if file.is_file():
            style = json.dumps((folder / "dygraph.min.css").read_text(encoding="utf-8").partition("/*# source")[0])
            script = file.read_text(encoding="utf-8").partition("//# source")[0]
            return f"{script};document.head.appendChild(document.createElement('style')).textContent={style};".replace("</script", "<\\/script")
    return ""


def _that_fit(pictures: list[Picture | None], first: set[int | None]) -> list[Picture | None]:
    """The pictures up to MOST_CURVES, from those that come first on; None for the others."""
    size, result = 0, [None] * len(pictures)
    for number in sorted(range(len(pictures)), key=lambda number: number not in first):
        picture = pictures[number]
        size += len(picture.curves) + len(picture.head) if picture else 0
        result[number] = picture if size <= MOST_CURVES else None
    return result


def _text(text: str) -> str:
    return html.escape(text)


def _json(data: object) -> str:
    """JSON that ends no script element."""
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def _table(table: Table) -> str:
    rows = "".join(_row(row) for row in table.rows)
    head = "".join(f"<th>{_text(cell)}</th>" for cell in table.head)
    return f'<h2>{_text(table.title)}</h2><div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _row(row: Row) -> str:
    marks = ' class="bad"' if row.bad else ""
    marks += "" if row.picture is None else f' data-picture="{row.picture}"'
    marks += "" if row.at_s is None else f' data-at="{row.at_s:.6f}"'
    return f"<tr{marks}>" + "".join(f"<td>{_text(cell)}</td>" for cell in row.cells) + "</tr>"


def _image(file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode()
    return f'<p><img alt="{_text(file.stem)}" src="data:image/png;base64,{data}"></p>'
