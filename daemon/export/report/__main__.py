"""A report, made by a process of its own, `python -m daemon.export.report pdf`: a subject comes in, a file goes out."""

import pickle
import sys

from daemon.export.report import html, pdf, report

if __name__ == "__main__":
    subject = pickle.load(sys.stdin.buffer)  # noqa: S301  from who has started this process
    form = {"html": html, "pdf": pdf}[sys.argv[1]]
    sys.stdout.buffer.write(form(report(subject)))
