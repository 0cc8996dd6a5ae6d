"""A report as one HTML file: no script, and nothing from elsewhere."""

import base64
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from typing import assert_never

import matplotlib as mpl
from matplotlib.figure import Figure

from daemon.export.report.document import Block, Drawing, Facts, Heading, Report, Table, Verdict, Words
from daemon.export.report.layout import MM_AN_INCH, SETTINGS, WIDTH, draw


def html(report: Report) -> bytes:
    """Return the report as a page that says the same wherever it is opened."""
    with mpl.rc_context(SETTINGS):
        body = "\n".join(_block(block) for block in report.blocks)
    title = escape(report.title)
    style = files("daemon.export.report").joinpath("report.css").read_text(encoding="utf-8")
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}\n</body>\n</html>\n"
    ).encode()


def _block(block: Block) -> str:
    match block:
        case Heading():
            return f"<h2>{escape(block.text)}</h2>"
        case Words():
            return f"<p>{escape(block.text)}</p>"
        case Verdict():
            return f'<p class="verdict {escape(block.judgement)}">{escape(block.sentence)}</p>'
        case Facts():
            rows = "".join(
                f'<tr><th scope="row">{escape(name)}</th><td>{escape(fact)}</td></tr>'
                for name, fact in block.rows
            )
            return f'<table class="facts">{rows}</table>'
        case Table():
            return _table(block)
        case Drawing():
            caption = escape(block.caption)
            source = base64.b64encode(_svg(block)).decode()
            image = f'<img src="data:image/svg+xml;base64,{source}" alt="{caption}">'
            return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
        case _:
            assert_never(block)


def _table(table: Table) -> str:
    caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    head = f"<thead><tr>{_cells(table.headings, table.words, 'th')}</tr></thead>"
    rows = "".join(f"<tr>{_cells(row, table.words, 'td')}</tr>" for row in table.rows)
    return f'<div class="wide"><table>{caption}{head}<tbody>{rows}</tbody></table></div>'


def _cells(cells: Sequence[str], words: int, tag: str) -> str:
    scope = ' scope="col"' if tag == "th" else ""
    classes = [' class="word"'] * words + [""] * len(cells)
    return "".join(
        f"<{tag}{scope}{kind}>{escape(cell)}</{tag}>" for cell, kind in zip(cells, classes, strict=False)
    )


def _svg(drawing: Drawing) -> bytes:
    size = WIDTH, drawing.height
    page = Figure(figsize=(WIDTH / MM_AN_INCH, drawing.height / MM_AN_INCH))
    draw(drawing, page, 0.0, 0.0, size)
    file = BytesIO()
    page.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()
