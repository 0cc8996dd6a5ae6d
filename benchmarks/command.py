"""`python -m benchmarks [NAME ...] [--quick] [--list]`."""

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import Final

from rich.markup import escape

from benchmarks.printing import console, say

NAMES: Final = (
    "solve_time",
    "solve_growth",
    "detection_time",
    "detection_accuracy",
    "live_rate",
    "pose_rate",
    "pose_many",
    "pose_in_a_run",
    "stop_time",
    "start_time",
    "shutdown_time",
    "stop_under_load",
    "page",
    "efficiency",
    "uncertainty",
    "pictures",
    "paper_table",
    "peers",
)
"""In the order in which they run, the quick ones first."""


def main(arguments: Sequence[str]) -> int:
    """Run the benchmarks that are named, or all, and return the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for name in options.names:
        if name not in NAMES:
            parser.error(f"there is no benchmark '{name}': choose from {', '.join(NAMES)}")
    if options.list:
        for name in NAMES:
            say(f"{name:20}{_summary(_module(name))}")
        return 0
    for name in dict.fromkeys(options.names or NAMES):
        run(name, quick=options.quick)
    return 0


def run(name: str, *, quick: bool) -> Mapping[str, float]:
    """Run one benchmark under its heading, and return its main figures by name."""
    module = _module(name)
    console.rule(f"[bold]{name}[/bold]  {escape(_summary(module))}", align="left")
    figures: Mapping[str, float] = module.run(quick=quick)
    return figures


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what we claim about speed and accuracy, beside a peer or the paper.",
        epilog="Example: python -m benchmarks solve_time --quick",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="all where left out")
    parser.add_argument("--quick", action="store_true", help="small sizes: does it run, rather than how fast")
    parser.add_argument("--list", action="store_true", help="say what there is, and run nothing")
    return parser


def _module(name: str) -> ModuleType:
    return import_module(f"benchmarks.{name}")


def _summary(module: ModuleType) -> str:
    """Return the first sentence of a benchmark's docstring."""
    return (module.__doc__ or "").split("\n", 1)[0]
