"""A flame-style picture: who is inside whom from top to bottom, and width for cycles; one SVG file with texts under the pointer."""

import zlib
from collections import Counter
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

WIDTH, ROW, MARGIN, HEAD = 1200, 18, 10, 46
CHARACTER = 6.6     # width of a letter
NARROWEST = 0.4     # boxes below this many pixels are left out


@dataclass
class Box:
    """A function in its callers."""

    name: str
    cycles: float = 0.0
    inside: dict[str, "Box"] = field(default_factory=dict)

    def depth(self) -> int:
        return 1 + max((box.depth() for box in self.inside.values()), default=0)


def tree(stacks: Counter) -> Box:
    """The stacks as boxes in boxes; the outermost one is everything."""
    top = Box("")
    for stack, cycles in stacks.items():
        here = top
        here.cycles += cycles
        for name in stack:
            here = here.inside.setdefault(name, Box(name))
            here.cycles += cycles
    return top


def svg(stacks: Counter, title: str, per: float) -> str:
    """The picture.
    @param per number of interrupts that the cycles are a sum of"""
    top = tree(stacks)
    height = HEAD + ROW * max(top.depth() - 1, 1) + MARGIN
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
             'font-family="monospace" font-size="11">',
             f'<rect width="{WIDTH}" height="{height}" fill="#fffdf7"/>',
             f'<text x="{MARGIN}" y="20" font-size="14">{escape(title)}</text>',
             f'<text x="{MARGIN}" y="36" fill="#666">width: cycles per interrupt; point at a box for its numbers</text>']
    if top.cycles > 0.0:
        scale = (WIDTH - 2 * MARGIN) / top.cycles
        _boxes(top, MARGIN, 0, scale, top.cycles, per, lines)
    return "\n".join([*lines, "</svg>", ""])


def _boxes(parent: Box, left: float, level: int, scale: float, whole: float, per: float, lines: list[str]) -> None:
    for box in sorted(parent.inside.values(), key=lambda item: (-item.cycles, item.name)):
        width = box.cycles * scale
        if width >= NARROWEST:
            top = HEAD + level * ROW
            told = f"{box.name}: {box.cycles / per:.1f} cycles, {100.0 * box.cycles / whole:.1f} %"
            lines.append(f'<g><title>{escape(told)}</title><rect x="{left:.2f}" y="{top}" width="{width:.2f}" height="{ROW - 1}" fill="{_color(box.name)}" '
                         'stroke="#fffdf7" stroke-width="0.5"/>')
            letters = int((width - 6) / CHARACTER)
            if letters >= 3:
                text = box.name if len(box.name) <= letters else box.name[:letters - 1] + "…"
                lines.append(f'<text x="{left + 3:.2f}" y="{top + 13}" pointer-events="none">{escape(text)}</text>')
            lines.append("</g>")
            _boxes(box, left, level + 1, scale, whole, per, lines)
        left += width


def _color(name: str) -> str:
    """A warm colour that is always the same for a name."""
    number = zlib.crc32(name.encode())
    return f"hsl({12 + number % 40}, {62 + number // 40 % 25}%, {60 + number // 1000 % 14}%)"
