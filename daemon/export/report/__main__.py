"""A report, made by a process of its own, `python -m daemon.export.report pdf 7`: a subject comes in, a file goes out.

It ends, with no file, when the pipe of that number is closed at its other end: nobody waits for it any more.
"""

import os
import pickle
import sys
import threading

from daemon.export.report import html, pdf, report


def _end_with(pipe: int) -> None:
    os.read(pipe, 1)  # nothing is ever sent
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with, args=[int(sys.argv[2])], daemon=True).start()
    subject = pickle.load(sys.stdin.buffer)  # noqa: S301  from who has started this process
    form = {"html": html, "pdf": pdf}[sys.argv[1]]
    sys.stdout.buffer.write(form(report(subject)))
