"""The page in one text: markup, style, scripts and the plotting library."""

from pathlib import Path

from tools.bench import page as bench_page

HERE = Path(__file__).parent / "page"
SCRIPTS = ("link", "board", "bench", "drive", "rotor", "planes", "strips", "measure", "traces", "scope", "remote", "kept", "step", "loops", "tuning", "main")
"""In this order; each is one matter."""


def text(nonce: str) -> str:
    """`nonce`: scripts run only with it."""
    library = bench_page.library(bench_page.LIBRARY_FOLDERS)
    scripts = "\n".join(_read(f"{name}.js") for name in SCRIPTS)
    return (_read("page.html").replace("/* style */", _read("page.css")).replace("<!-- board -->", _read("board.svg"))
            .replace("<!-- scripts -->", f'<script nonce="{nonce}">{library}</script>\n<script nonce="{nonce}">"use strict";\n{scripts}</script>'))


def _read(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")
