"""The technician's page in a real Chromium: STOP with three tabs open, opening, size, and what each tab costs.

The daemon serves the paper's simulated table, in a process of its own. All tabs are seen, and show the live picture
with the target in it: more than those of one window ever do, of which all but one are hidden.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from playwright.sync_api import Browser, BrowserContext, Page

from benchmarks.chromium import chromium
from benchmarks.printing import console, say, spread_cells, table
from benchmarks.timing import Spread

STOP_LIMIT: Final = 100.0
"""Milliseconds from the key to the latch, with three tabs."""
OPENING_LIMIT: Final = 1000.0
"""Milliseconds from the address to a STOP that can be used."""
SIZE_LIMIT: Final = 300.0
"""Kilobytes that opening the page transfers."""
TAB_LIMIT: Final = 2.0
"""Percent of a core of the daemon's that a second and a third tab may add each."""
SERVE: Final = ("from daemon.cli import main; main()", "serve", "--profile", "paper-table", "--port", "0")
TABS: Final = 3

NOTE_TIMES: Final = """
const listen = window.addEventListener;
window.addEventListener = function (type, ...rest) {
  listen.call(this, type, ...rest);
  if (type === "keydown") window.usable ??= performance.now();
};
const note = () => { window.pressed = performance.timeOrigin + performance.now(); };
listen.call(window, "keydown", note, { capture: true });
"""
"""A script that notes when STOP listens, and when its key is pressed (Unix time, ms)."""


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the medians."""
    with _daemon() as (address, process), chromium() as browser:
        openings = [_opened(browser, address) for _ in range(1 if quick else 10)]
        rounds, seconds = (1, 1.0) if quick else (5, 4.0)
        costs: list[list[float]] = [[] for _ in range(TABS)]
        stops: list[float] = []
        for _ in range(rounds):
            context = browser.new_context()
            context.add_init_script(NOTE_TIMES)
            tabs = []
            for shares in costs:
                tabs.append(_tab(context, address))
                shares.append(_cost(tabs[-1], process, seconds))
            stops += [_stop(tabs[i % TABS]) for i in range(2 if quick else 6)]
            context.close()
    usable, sizes = zip(*openings, strict=True)
    rows = table("The page", "", "median", "min..max", "limit")
    for label, values, limit in (
        ("STOP from its key to the latch, three tabs (ms)", stops, STOP_LIMIT),
        ("from the address to a usable STOP (ms)", usable, OPENING_LIMIT),
        ("transferred to open it (kB)", sizes, SIZE_LIMIT),
    ):
        rows.add_row(label, *spread_cells(Spread.of(values), 1), f"{limit:g}")
    for number, shares in enumerate(costs, start=1):
        limit = f"{Spread.of(costs[number - 2]).median + TAB_LIMIT:.1f}" if number > 1 else ""
        label = f"the daemon's processor time, tabs open: {number} (% of a core)"
        rows.add_row(label, *spread_cells(Spread.of(shares), 1), limit)
    console.print(rows)
    say(f"A second and a third tab should add at most {TAB_LIMIT:g} % each.")
    return {
        "STOP, ms": Spread.of(stops).median,
        "usable, ms": Spread.of(usable).median,
        "transferred, kB": Spread.of(sizes).median,
        "three tabs, %": Spread.of(costs[-1]).median,
    }


@contextmanager
def _daemon() -> Iterator[tuple[str, int]]:
    """Give the page's address and the daemon's process."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-c", *SERVE, "--data", str(Path(folder) / "data")]
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
        ) as process:
            try:
                assert process.stdout is not None
                said = process.stdout.readline()
                if " at http" not in said:
                    raise RuntimeError(
                        "the daemon did not start: 'activecam serve --profile paper-table' says why"
                    )
                yield said.partition(" at ")[2].split("/api")[0] + "/", process.pid
            finally:
                process.terminate()


def _opened(browser: Browser, address: str) -> tuple[float, float]:
    """Open the page for the first time; return when its STOP could be used (ms), and what was transferred (kB)."""
    context = browser.new_context()
    context.add_init_script(NOTE_TIMES)
    page = _tab(context, address)
    usable: float = page.evaluate("window.usable")
    transferred: float = page.evaluate(
        "[...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')]"
        ".reduce((sum, entry) => sum + entry.transferSize, 0)"
    )
    context.close()
    return usable, transferred / 1000


def _tab(context: BrowserContext, address: str) -> Page:
    """Return a tab that shows the live picture."""
    page = context.new_page()
    page.set_default_timeout(60_000)  # a busy machine takes its time
    page.goto(address)
    page.locator("canvas[data-points]").first.wait_for()
    return page


def _stop(page: Page) -> float:
    """Stop by the key, and return how long that took to the latch (ms)."""
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Acknowledge").wait_for()
    pressed: float = page.evaluate("window.pressed")
    rig: dict[str, Any] = page.evaluate("fetch('api/v1/rig').then((answer) => answer.json())")
    since = datetime.fromisoformat(rig["stop"]["since"]).timestamp()
    page.get_by_role("button", name="Acknowledge").click()
    page.get_by_role("button", name="Acknowledge").wait_for(state="hidden")
    return 1e3 * since - pressed


def _cost(newest: Page, process: int, seconds: float) -> float:
    """Return the daemon's processor time (% of a core) with the tabs that are open."""
    newest.wait_for_timeout(500)  # in which it is not all new any more
    before, began = _processor_time(process), time.monotonic()
    newest.wait_for_timeout(1000 * seconds)
    return 100 * (_processor_time(process) - before) / (time.monotonic() - began)


def _processor_time(process: int) -> float:
    """Return the seconds of processor time that a process has had."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
