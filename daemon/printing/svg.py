"""The sheet as SVG, in millimetres."""

from xml.sax.saxutils import escape

from daemon.printing.sheet import TEXT_SIZE, Sheet


def svg(sheet: Sheet) -> bytes:
    """Return the sheet as an SVG file whose user unit is the millimetre."""
    width, height = _mm(sheet.width), _mm(sheet.height)
    # One path, since the edges that neighbouring cells share would shine through between shapes of their own.
    path = "".join(
        f"M{_mm(x)} {_mm(y)}h{_mm(w)}v{_mm(h)}h{_mm(-w)}z" for x, y, w, h in sheet.ink.rectangles.tolist()
    )
    circles = (
        f'<circle cx="{_mm(x)}" cy="{_mm(y)}" r="{_mm(diameter / 2)}"/>'
        for x, y, diameter in sheet.ink.disks.tolist()
    )
    texts = (f'<text x="{_mm(text.x)}" y="{_mm(text.y)}">{escape(text.words)}</text>' for text in sheet.texts)
    lines = (
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}" font-family="Helvetica, Arial, sans-serif" font-size="{_mm(TEXT_SIZE)}">',
        f"<title>{escape(sheet.title)}</title>",
        f'<rect width="{width}" height="{height}" fill="white"/>',
        f'<path d="{path}"/>',
        *circles,
        '<g fill="white">',
        *texts,
        "</g>",
        "</svg>",
    )
    return ("\n".join(lines) + "\n").encode()


def _mm(length: float) -> str:
    """Write a length (m) in millimetres, to a nanometre."""
    return f"{1000 * length:.6f}".rstrip("0").rstrip(".")
