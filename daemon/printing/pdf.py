"""The sheet as PDF."""

from io import BytesIO
from math import cos, pi, sin, tan

import pydyf

from daemon.printing.sheet import TEXT_SIZE, Sheet

POINTS_A_MM = 72 / 25.4
ARCS = 8
"""Curves of which a circle is made: with eight it is round to 4e-6 of its radius."""


def pdf(sheet: Sheet) -> bytes:
    """Return the sheet as a PDF file of one page that asks viewers to print it as large as it is."""
    document = pydyf.PDF()
    content = _content(sheet)
    document.add_object(content)
    font = pydyf.Dictionary({"Type": "/Font", "Subtype": "/Type1", "BaseFont": "/Helvetica"})
    document.add_object(font)
    size = [POINTS_A_MM * 1000 * length for length in (sheet.width, sheet.height)]
    document.add_page(
        pydyf.Dictionary(
            {
                "Type": "/Page",
                "Parent": document.pages.reference,
                "MediaBox": pydyf.Array([0, 0, *size]),
                "Contents": content.reference,
                "Resources": pydyf.Dictionary({"Font": pydyf.Dictionary({"F": font.reference})}),
            }
        )
    )
    document.catalog["ViewerPreferences"] = pydyf.Dictionary({"PrintScaling": "/None"})
    document.info["Title"] = pydyf.String(sheet.title)
    file = BytesIO()
    document.write(file)
    return file.getvalue()


def _content(sheet: Sheet) -> pydyf.Stream:
    """Draw the ink as one path, for no edges to shine through, in millimetres with y upwards; then the white words."""
    content = pydyf.Stream(compress=True)
    content.set_matrix(POINTS_A_MM, 0, 0, POINTS_A_MM, 0, 0)
    for x, y, width, height in (1000 * sheet.ink.rectangles).tolist():
        content.rectangle(x, 1000 * sheet.height - y - height, width, height)
    for x, y, diameter in (1000 * sheet.ink.disks).tolist():
        _circle(content, x, 1000 * sheet.height - y, diameter / 2)
    content.fill()
    content.set_color_rgb(1, 1, 1)
    for text in sheet.texts:
        content.begin_text()
        content.set_font_size("F", 1000 * TEXT_SIZE)
        content.move_text_to(1000 * text.x, 1000 * (sheet.height - text.y))
        content.show_text_string(text.words)
        content.end_text()
    return content


def _circle(content: pydyf.Stream, x: float, y: float, radius: float) -> None:
    handle = 4 / 3 * tan(pi / (2 * ARCS)) * radius
    content.move_to(x + radius, y)
    for arc in range(ARCS):
        (c0, s0), (c1, s1) = ((cos(a), sin(a)) for a in (2 * pi * arc / ARCS, 2 * pi * (arc + 1) / ARCS))
        content.curve_to(
            x + radius * c0 - handle * s0,
            y + radius * s0 + handle * c0,
            x + radius * c1 + handle * s1,
            y + radius * s1 - handle * c1,
            x + radius * c1,
            y + radius * s1,
        )
    content.close()
