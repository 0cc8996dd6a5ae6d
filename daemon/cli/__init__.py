"""The command line: one file a command, and `main`, which turns every error into one sentence."""

from daemon.cli.main import main

__all__ = ["main"]
