"""Reports are made by processes of their own.

Drawing is seconds of Python, during which a daemon's other threads, a stop among them, would come in between the lines
alone; and what it takes of memory would be the daemon's for ever. It holds an end of a pipe, and is over when the other
one is closed: with the process that waits for it, however that ends.
"""

import logging
import os
import pickle
import subprocess
import sys
import threading
from typing import Final

from daemon.errors import ExportError
from daemon.export.subject import Subject

logger = logging.getLogger(__name__)

TIMEOUT: Final = 600.0
"""Seconds after which it has gone wrong, on any machine."""

_making = threading.Lock()
"""One at a time, however many ask."""


def made_apart(form: str, subject: Subject) -> bytes:
    """Return the report on a subject as `html` or `pdf`; raises ExportError, which is an error in the program."""
    theirs, ours = os.pipe()
    command = [sys.executable, "-m", "daemon.export.report", form, str(theirs)]
    try:
        with _making:
            done = subprocess.run(  # noqa: S603  ourselves
                command,
                input=pickle.dumps(subject),
                capture_output=True,
                check=False,
                timeout=TIMEOUT,
                pass_fds=[theirs],
            )
    except subprocess.TimeoutExpired as error:
        raise ExportError(f"the report was not made within {TIMEOUT:.0f} s") from error
    finally:
        os.close(theirs)
        os.close(ours)
    if done.returncode != 0:
        logger.error("the report could not be made:\n%s", done.stderr.decode(errors="replace"))
        raise ExportError("the report could not be made, for an error in the program: please report it")
    return done.stdout
