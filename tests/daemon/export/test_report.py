"""The report: it says what is known and not more, the same each time, needs nothing from elsewhere, and can be read."""

import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest

from calib import Calibration, Session, solve
from calib.session_writer import SessionWriter
from daemon.errors import ExportError
from daemon.export import Subject
from daemon.export.making_reports import made_apart
from daemon.export.report import html, pdf, report
from daemon.export.report.document import Drawing, Facts, Heading, Table, Verdict, Words
from tests.calib.scenes import DISK_CENTRES, DISKS, plan, points_session, two_axis_rig
from tests.daemon.export.subjects import calibration_of, subject_of

LAST_WORDS = "a <b>note</b> & $10^2$ of it"


def noisy(session: Session) -> Session:
    """Return a session whose points scatter, as they do."""
    rng = np.random.default_rng(0)
    views = []
    for view in session.views:
        assert view.points is not None
        pixels = np.array(view.points.pixels) + 0.05 * rng.normal(size=(len(view.points.pixels), 2))
        points = view.points.model_copy(update={"pixels": pixels.tolist()})
        views.append(view.model_copy(update={"points": points}))
    return session.with_views(views)


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    """A calibration of two axes, with the session that it was solved from."""
    session = noisy(points_session(two_axis_rig(), plan() + plan(verify=True), DISKS, DISK_CENTRES))
    folder = tmp_path_factory.mktemp("sessions") / "monday"
    SessionWriter(folder, session)
    return subject_of(
        solve(session),
        folder=folder,
        id="1087d24108964e429a2ba048f07a4efa",
        made_at=datetime(2026, 3, 14, 9, 27, 12, tzinfo=UTC),
        rig="A <table> & $more$",
        owner="anna",
        note=LAST_WORDS,
    )


@pytest.fixture(scope="module")
def page(subject: Subject) -> bytes:
    """Its report for browsers."""
    return html(report(subject))


@pytest.fixture(scope="module")
def paper(subject: Subject) -> bytes:
    """Its report to print."""
    return pdf(report(subject))


def blocks_of(subject: Subject, kind: Any) -> list[Any]:
    return [block for block in report(subject).blocks if isinstance(block, kind)]


def test_the_verdict_comes_first_and_then_whose_it_is(subject: Subject) -> None:
    blocks = report(subject).blocks
    quality = subject.calibration.quality
    assert blocks[0] == Verdict(str(quality.judgement), str(quality.verdict))
    assert isinstance(blocks[1], Facts)
    facts = dict(blocks[1].rows)
    assert facts["Rig"] == "A <table> & $more$"
    assert facts["Calibrated"] == "2026-03-14 09:27:12 UTC"
    assert (facts["By"], facts["Note"], facts["Session"]) == ("anna", LAST_WORDS, "monday")
    assert facts["Target"] == "circle grid, 6 rows of 7, pitch 30 mm, disk diameter 18 mm"


def test_the_papers_four_tables_are_there_with_how_sure_they_are(subject: Subject) -> None:
    tables = {table.title[:7]: table for table in blocks_of(subject, Table)}
    held_out = plan(verify=True)
    for number, joint in ((1, "slide"), (2, "pan")):
        table = tables[f"Table {number}"]
        assert len(table.rows) == sum(view["joint"] == joint for view in held_out) - 1
        for row in table.rows:
            cells = dict(zip(table.headings, row, strict=False))
            predicted, measured = (
                next(float(v) for k, v in cells.items() if k.startswith(w)) for w in ("predicted", "measured")
            )
            fine = {"mm": 1.0, "deg": 1e3 * np.radians(1)}["mm" if number == 1 else "deg"]
            error = next(float(v) for k, v in cells.items() if k.startswith("error ("))
            assert fine * abs(predicted - measured) == pytest.approx(error, abs=0.003)
            assert float(row[2]) > 0
    for number in (3, 4):
        assert len(tables[f"Table {number}"].rows) == 5
        assert all(float(row[3]) > 0 for row in tables[f"Table {number}"].rows)


def test_every_parameter_is_there_with_its_deviation(subject: Subject) -> None:
    [table] = [table for table in blocks_of(subject, Table) if table.title.startswith("Parameters")]
    found = {row[0]: row for row in table.rows}
    lens = subject.calibration.cameras[0].intrinsics
    assert lens is not None
    _, value, std, unit = found["main.fx"]
    assert float(value) == pytest.approx(lens.fx, abs=float(std))
    assert unit == "px"
    point = subject.calibration.joints[1].point
    assert float(found["pan.point.z"][1]) == pytest.approx(1e3 * point[2], abs=0.1)
    assert found["pan.point.z"][3] == "mm"


def test_residuals_are_drawn_of_all_points_that_are_used(subject: Subject) -> None:
    count = len(plan() + plan(verify=True))
    captions = [drawing.caption for drawing in blocks_of(subject, Drawing)]
    assert any(
        f"{42 * count} points of {count} views, predicted less measured" in caption for caption in captions
    )


def test_without_its_session_it_says_what_it_lacks_and_the_rest_all_the_same(subject: Subject) -> None:
    alone = replace(subject, folder=None)
    sentences = [words.text for words in blocks_of(alone, Words)]
    assert (
        "Residuals by direction and by place are left out: "
        "it is not known which session this calibration was solved from." in sentences
    )
    headings = [heading.text for heading in blocks_of(alone, Heading)]
    assert headings == [heading.text for heading in blocks_of(subject, Heading)]
    assert pdf(report(alone)).startswith(b"%PDF")


def test_a_picture_that_is_gone_is_said_to_be(subject: Subject, tmp_path: Path) -> None:
    assert subject.folder is not None
    session = Session.model_validate_json((subject.folder / "session.json").read_bytes())
    views = [view.model_dump(exclude_unset=True) for view in session.views]
    for number, view in enumerate(views):
        del view["points"]
        view["image"] = f"frames/{number:04d}.png"
    SessionWriter(
        tmp_path / "gone", session.with_views([type(session.views[0]).model_validate(v) for v in views])
    )
    sentences = [words.text for words in blocks_of(replace(subject, folder=tmp_path / "gone"), Words)]
    assert any("left out" in sentence and "0000.png" in sentence for sentence in sentences)


def test_a_calibration_of_poses_alone_has_a_report() -> None:
    blind = subject_of(calibration_of("six-axis-arm"))
    text = text_of(pdf(report(blind)))
    assert "j6.scale" in text
    assert "No views were held out." in text


class Page(HTMLParser):
    """A page: its tags with their attributes, what is not closed, and its words."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(page.decode())
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_the_page_is_whole_and_asks_for_nothing_from_elsewhere(subject: Subject, page: bytes) -> None:
    read = Page(page)
    assert read.open == []
    assert {tag for tag, _ in read.tags} & {"script", "link", "iframe", "object", "form", "a", "b"} == set()
    for tag, attributes in read.tags:
        assert not any(name.startswith("on") for name in attributes)
        if tag == "img":
            assert str(attributes["src"]).startswith("data:image/svg+xml;base64,")
            assert attributes["alt"]
    assert b"http:" not in page
    assert b"https:" not in page
    assert b"url(" not in page
    text = "".join(read.words)
    assert str(subject.calibration.quality.verdict) in text
    assert LAST_WORDS in text


@dataclass(frozen=True)
class Sheet:
    """A page of a PDF: its size in points, its words, and where each line of them is (left, bottom, right, top)."""

    size: tuple[float, float]
    text: str
    lines: list[tuple[float, float, float, float]]


def sheets_of(written: bytes) -> list[Sheet]:
    sheets = []
    with closing(pypdfium2.PdfDocument(written)) as document:
        for number in range(len(document)):
            with closing(document[number]) as page, closing(page.get_textpage()) as text:
                lines = [text.get_rect(i) for i in range(text.count_rects())]
                sheets.append(Sheet(page.get_size(), text.get_text_bounded(), lines))
    return sheets


def text_of(written: bytes) -> str:
    return re.sub(r"\s+", " ", " ".join(sheet.text for sheet in sheets_of(written)))


def test_the_pdf_has_pages_with_the_same_words_and_its_title(subject: Subject, paper: bytes) -> None:
    with closing(pypdfium2.PdfDocument(paper)) as document:
        assert document.get_metadata_dict()["Title"] == "Calibration: A <table> & $more$"
        assert len(document) >= 3
    text = text_of(paper)
    assert str(subject.calibration.quality.verdict) in text
    assert LAST_WORDS in text
    for heading in blocks_of(subject, Heading):
        assert heading.text in text


@pytest.mark.parametrize("name", ["two axes", "an arm with much to say"])
def test_no_words_of_a_page_lie_on_others_or_off_it(name: str, paper: bytes) -> None:
    shown = paper
    if name != "two axes":
        arm = calibration_of("six-axis-arm")
        shown = pdf(report(subject_of(arm, rig="an arm " * 30, note="long " * 90 + 200 * "o")))
    for sheet in sheets_of(shown):
        width, height = sheet.size
        assert sheet.lines
        for left, bottom, right, top in sheet.lines:
            assert 0 < left < right < width
            assert 0 < bottom < top < height
        for one, other in combinations(sheet.lines, 2):
            across = min(one[2], other[2]) - max(one[0], other[0])
            down = min(one[3], other[3]) - max(one[1], other[1])
            assert min(across, down) < 0.5, (one, other)


def test_one_that_is_made_apart_is_the_same_and_an_error_there_is_one_here(
    subject: Subject, page: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    assert made_apart("html", subject) == page
    with pytest.raises(ExportError, match="an error in the program"):
        made_apart("html", replace(subject, verification="[]"))
    assert "ValidationError" in caplog.text


SLEEPING = """
import time
from daemon.export.making_reports import made_apart

class Sleeping:
    def __reduce__(self):
        return time.sleep, (600,)

made_apart("pdf", Sleeping())
"""


def test_one_that_nobody_waits_for_any_more_ends() -> None:
    with subprocess.Popen([sys.executable, "-c", SLEEPING]) as daemon:
        (making,) = within_a_minute(lambda: children_of(daemon.pid))
        daemon.kill()
    within_a_minute(lambda: not is_alive(making))


def within_a_minute(found: Callable[[], Any]) -> Any:
    end = time.monotonic() + 60
    while not (value := found()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return value


def children_of(pid: int) -> list[int]:
    """Return those of a process that is there."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def is_alive(pid: int) -> bool:
    """Return whether a process is there, and has not only not been asked after since it ended."""
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def test_the_same_calibration_makes_the_same_files(subject: Subject, page: bytes, paper: bytes) -> None:
    again = replace(subject, calibration=Calibration.model_validate_json(subject.document))
    assert html(report(again)) == page
    assert pdf(report(again)) == paper
