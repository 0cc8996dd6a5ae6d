"""A report for the lab book, as HTML and as PDF.

content     what it says, from a subject: the verdict first
tables      the paper's for this rig, and what was found;  numbers  with as many digits as mean anything
figures     what is drawn
document    the blocks that it consists of
layout      what both forms share;  html, pdf  the two of them
"""

from daemon.export.report.content import report
from daemon.export.report.html import html
from daemon.export.report.pdf import pdf

__all__ = ["html", "pdf", "report"]
