"""Draws docs/model.svg: the drive with the symbols of its equations. Run it after a change."""

from pathlib import Path

INK, BELT, FORCE, MOTION = "#222222", "#555555", "#b04000", "#005a9c"
FLOOR, TOP, LEFT, RIGHT = 210, 100, 330, 470  # of the slide, px


def line(*points: tuple[float, float], colour: str = INK, width: float = 2.0) -> str:
    """Return a line through points."""
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'


def arrow(x: float, y: float, dx: float, dy: float, colour: str) -> str:
    """Return an arrow from (x, y) on."""
    head = "force" if colour == FORCE else "motion"
    return (
        f'<line x1="{x:g}" y1="{y:g}" x2="{x + dx:g}" y2="{y + dy:g}" stroke="{colour}" '
        f'stroke-width="2.5" marker-end="url(#{head})"/>'
    )


def text(x: float, y: float, symbol: str, meaning: str = "", colour: str = INK) -> str:
    """Return a symbol in italics, and what it means behind it."""
    tail = f'<tspan font-style="normal" font-size="15"> {meaning}</tspan>' if meaning else ""
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{colour}" font-size="20" font-style="italic">'
        f"{symbol}{tail}</text>"
    )


def spring(y: float, coils: int = 7) -> str:
    """Return a spring from the frame to the slide."""
    start, end = 110.0, LEFT - 50.0
    step = (end - start) / (2 * coils)
    zigzag = [(start + (i + 0.5) * step, y + (-12, 12)[i % 2]) for i in range(2 * coils)]
    return line((60, y), (start, y), *zigzag, (end, y), (LEFT, y))


def damper(y: float) -> str:
    """Return a damper from the frame to the slide."""
    cup = line((230, y - 14), (170, y - 14), (170, y + 14), (230, y + 14))
    piston = line((205, y - 10), (205, y + 10), width=4) + line((205, y), (LEFT, y))
    return cup + line((60, y), (170, y)) + piston


def wheel(x: float) -> str:
    """Return a pulley of the belt."""
    y = FLOOR + 40
    return (
        f'<circle cx="{x}" cy="{y}" r="40" fill="none" stroke="{BELT}" stroke-width="3"/>'
        f'<circle cx="{x}" cy="{y}" r="4" fill="{BELT}"/>'
    )


def heads() -> str:
    """Return the heads of the arrows."""
    return "".join(
        f'<marker id="{name}" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="5" '
        f'markerHeight="5" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="{colour}"/></marker>'
        for name, colour in (("force", FORCE), ("motion", MOTION))
    )


def drawing() -> str:
    """Return the drawing. Its background is its own, so that it is legible on dark pages too."""
    middle = (LEFT + RIGHT) / 2
    hatching = "".join(line((60, y), (46, y + 14), width=1.2) for y in range(90, FLOOR, 14))
    parts = [
        '<rect width="760" height="330" rx="8" fill="#fbfbf8"/>',
        line((60, 88), (60, FLOOR)),
        hatching,
        spring(125),
        text(190, 103, "k"),
        damper(178),
        text(183, 214, "c"),
        f'<rect x="{LEFT}" y="{TOP}" width="{RIGHT - LEFT}" height="{FLOOR - TOP}" rx="3" '
        f'fill="#dfe6ee" stroke="{INK}" stroke-width="2"/>',
        text(middle - 34, 150, "m", "slide"),
        wheel(230),
        wheel(570),
        line((230, FLOOR), (570, FLOOR), colour=BELT, width=3),
        line((230, FLOOR + 80), (570, FLOOR + 80), colour=BELT, width=3),
        arrow(340, FLOOR + 22, 60, 0, MOTION),
        text(412, FLOOR + 28, "v", "belt", MOTION),
        arrow(middle, 34, 0, TOP - 38, FORCE),
        text(middle + 10, 52, "N", "normal force", FORCE),
        arrow(RIGHT + 4, 135, 70, 0, FORCE),
        text(RIGHT + 84, 141, "u", "control force", FORCE),
        arrow(RIGHT + 4, 190, 70, 0, FORCE),
        text(RIGHT + 84, 196, "N μ(x\u2032 \u2212 v)", "friction", FORCE),
        line((LEFT, 70), (LEFT, 94), colour=MOTION),
        arrow(LEFT, 80, 46, 0, MOTION),
        text(LEFT - 22, 74, "x", "", MOTION),
    ]
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 330" width="760" height="330" '
        'font-family="DejaVu Serif, Georgia, serif" role="img">'
        "<title>A slide of mass m on spring k and damper c, pressed with N onto a belt that moves "
        f"at v</title><defs>{heads()}</defs>{''.join(parts)}</svg>\n"
    )


if __name__ == "__main__":
    Path(__file__).with_name("model.svg").write_text(drawing(), encoding="utf-8")
