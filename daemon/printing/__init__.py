"""A target on a sheet of paper, true to scale.

paper          how large the sheet is
sheet          where the target, two rulers and the words go on it
pdf, svg, png  the sheet as a file
"""

from daemon.printing.paper import NAMED, Paper, parse_paper
from daemon.printing.pdf import pdf
from daemon.printing.png import png
from daemon.printing.sheet import Sheet, lay_out
from daemon.printing.svg import svg

__all__ = ["NAMED", "Paper", "Sheet", "lay_out", "parse_paper", "pdf", "png", "svg"]
