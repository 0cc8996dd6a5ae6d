"""What is printed is true to scale, and what is drawn is detected."""

import re
import struct
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pypdfium2
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from calib.detection import detect
from calib.ink import target_ink, white_rim
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
    target_points,
    target_symmetries,
)
from daemon.errors import PrintError
from daemon.printing import NAMED, Paper, Sheet, lay_out, parse_paper, pdf, png, svg
from tests.calib.detection.drawn_targets import Drawn, project

A4 = NAMED[0]
INCH = 0.0254
CIRCLES = CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018)
CHARUCO = Charuco(rows=7, columns=5, pitch=0.03, marker=0.022, dictionary="DICT_5X5_100")
TARGETS = [
    CIRCLES,
    AsymmetricCircleGrid(rows=7, columns=4, pitch=0.04, disk_diameter=0.016),
    Chessboard(rows=6, columns=9, pitch=0.02),
    CHARUCO,
    AprilGrid(rows=5, columns=4, tag=0.03, spacing=0.009),
]

counts = st.integers(3, 6)
fractions = st.floats(0.4, 0.75)


@st.composite
def targets(draw: st.DrawFn) -> Target:
    """Targets of any kind and size, and of any proportions that can be seen at 100 dpi."""
    rows, columns = draw(counts), draw(counts)
    pitch, part = round(draw(st.floats(0.02, 0.035)), 4), draw(fractions)
    match draw(st.sampled_from([target.kind for target in TARGETS])):
        case "circle_grid":
            return CircleGrid(rows=rows, columns=columns, pitch=pitch, disk_diameter=part * pitch)
        case "asymmetric_circle_grid":
            diameter = 0.7 * part * pitch
            return AsymmetricCircleGrid(rows=rows + 1, columns=columns, pitch=pitch, disk_diameter=diameter)
        case "chessboard":
            return Chessboard(rows=rows, columns=columns, pitch=pitch)
        case "charuco":
            dictionary = draw(st.sampled_from(["DICT_4X4_50", "DICT_5X5_100", "DICT_6X6_250"]))
            return Charuco(
                rows=rows,
                columns=columns,
                pitch=pitch,
                marker=(0.2 + part) * pitch * 0.9,
                dictionary=dictionary,
            )
        case _:
            return AprilGrid(rows=rows, columns=columns, tag=pitch, spacing=part * pitch / 2)


def named(target: object) -> str | None:
    return getattr(target, "kind", None)


def picture(file: bytes) -> NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED))


def errors(
    found: NDArray[np.uint8], target: Target, picture_from_world: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Detect the target and return how far off its points are (px), in the reading that was detected."""
    detection = detect(found, target)
    drawn = Drawn(found, picture_from_world, project(picture_from_world, target_points(target)[:, :2]))
    np.testing.assert_array_equal(detection.ids, np.arange(len(drawn.points)))
    true = drawn.points if detection.disk is None else drawn.disk_centroids(target)
    readings = [np.arange(len(true)), *(symmetry.permutation for symmetry in target_symmetries(target))]
    reading = min(readings, key=lambda reading: np.linalg.norm(drawn.points[reading[0]]))
    return np.linalg.norm(detection.pixels - true[reading], axis=1)


def picture_from_world(sheet: Sheet, x_scale: float, y_scale: float) -> NDArray[np.float64]:
    """Where the target is in a picture of so many pixels a metre."""
    x, y = sheet.origin
    return np.array([[x_scale, 0, x * x_scale - 0.5], [0, y_scale, y * y_scale - 0.5], [0, 0, 1]])


@pytest.mark.parametrize("target", TARGETS, ids=named)
def test_what_is_drawn_as_png_is_detected_where_it_is(target: Target) -> None:
    sheet = lay_out(target, A4)
    scale = 300 / INCH
    assert errors(picture(png(sheet, 300)), target, picture_from_world(sheet, scale, scale)).max() < 0.05


@pytest.mark.parametrize("target", TARGETS, ids=named)
def test_what_is_drawn_as_pdf_is_detected_where_it_is(target: Target) -> None:
    sheet = lay_out(target, A4)
    page = pypdfium2.PdfDocument(pdf(sheet))[0]
    found = page.render(scale=300 / 72, grayscale=True).to_numpy()
    # PDFium stretches a page to whole pixels.
    height, width = found.shape[:2]
    view = picture_from_world(sheet, width / sheet.width, height / sheet.height)
    assert errors(found, target, view).max() < 0.05


@settings(max_examples=25, deadline=None)
@given(target=targets(), tilt=st.floats(-25, 25), roll=st.floats(-20, 20), blur=st.floats(0.6, 1.5))
def test_targets_of_all_sizes_are_detected_in_perspective(
    target: Target, tilt: float, roll: float, blur: float
) -> None:
    sheet = lay_out(target, next(paper for paper in NAMED if _fits(target, paper)))
    flat = picture(png(sheet, 300))
    scale = 300 / INCH
    focal, size = 1500.0, max(sheet.width, sheet.height)
    rotation = cv2.Rodrigues(np.radians([0, 0, roll]))[0] @ cv2.Rodrigues(np.radians([tilt, tilt / 2, 0]))[0]
    middle = rotation @ [sheet.width / 2, sheet.height / 2, 0]
    K = np.array([[focal, 0, 599.5], [0, focal, 599.5], [0, 0, 1]])
    seen = K @ np.column_stack([rotation[:, 0], rotation[:, 1], [0, 0, 1.6 * size] - middle])
    # Twice as fine, then averaged, as a sensor's pixels average.
    fine = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]]) @ seen @ _sheet_from_pixels(scale)
    soft = cv2.GaussianBlur(flat, (0, 0), max(0.3 * scale * 1.6 * size / focal / 2, 0.1))
    warped = cv2.warpPerspective(soft, fine, (2400, 2400), borderValue=(140,))
    found = cv2.GaussianBlur(cv2.resize(warped, (1200, 1200), interpolation=cv2.INTER_AREA), (0, 0), blur)
    world_in_sheet = np.array([[1, 0, sheet.origin[0]], [0, 1, sheet.origin[1]], [0, 0, 1]])
    assert errors(found, target, seen @ world_in_sheet).max() < 0.15


def _sheet_from_pixels(scale: float) -> NDArray[np.float64]:
    return np.array([[1 / scale, 0, 0.5 / scale], [0, 1 / scale, 0.5 / scale], [0, 0, 1]])


def _fits(target: Target, paper: Paper) -> bool:
    try:
        lay_out(target, paper)
    except PrintError:
        return False
    return True


def svg_shapes(file: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Rectangles, disks and the page of an SVG, in mm, which its user unit must be."""
    root = ET.fromstring(file)
    namespace = "{http://www.w3.org/2000/svg}"
    width, height = root.attrib["width"], root.attrib["height"]
    assert root.attrib["viewBox"] == f"0 0 {width.removesuffix('mm')} {height.removesuffix('mm')}"
    [path] = root.findall(f"{namespace}path")
    number = r"(-?[\d.]+)"
    rectangles = re.findall(rf"M{number} {number}h{number}v{number}h-[\d.]+z", path.attrib["d"])
    circles = [
        [float(circle.attrib[key]) * (2 if key == "r" else 1) for key in ("cx", "cy", "r")]
        for circle in root.findall(f"{namespace}circle")
    ]
    page = (float(width.removesuffix("mm")), float(height.removesuffix("mm")))
    return np.array(rectangles, dtype=float), np.array(circles).reshape(-1, 3), page


def pdf_shapes(file: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Rectangles, disks and the page of a PDF, in mm from the top left, from its path as PDFium reads it."""
    page = pypdfium2.PdfDocument(file)[0]
    raw = pypdfium2.raw
    mm = 25.4 / 72
    width, height = page.get_size()
    [path] = [found for found in page.get_objects() if found.type == raw.FPDF_PAGEOBJ_PATH]
    matrix = path.get_matrix()
    outlines: list[list[tuple[float, float]]] = []
    curved: list[bool] = []
    for index in range(raw.FPDFPath_CountSegments(path)):
        segment = raw.FPDFPath_GetPathSegment(path, index)
        x, y = raw.c_float(), raw.c_float()
        raw.FPDFPathSegment_GetPoint(segment, x, y)
        point = matrix.on_point(x.value, y.value)
        kind = raw.FPDFPathSegment_GetType(segment)
        if kind == raw.FPDF_SEGMENT_MOVETO:
            outlines.append([])
            curved.append(False)
        curved[-1] |= kind == raw.FPDF_SEGMENT_BEZIERTO
        outlines[-1].append((point[0] * mm, (height - point[1]) * mm))
    rectangles, disks = [], []
    for outline, is_disk in zip(outlines, curved, strict=True):
        low, high = np.min(outline, axis=0), np.max(outline, axis=0)
        if is_disk:
            disks.append([*(low + high) / 2, high[0] - low[0]])
        else:
            rectangles.append([*low, *(high - low)])
    return np.array(rectangles).reshape(-1, 4), np.array(disks).reshape(-1, 3), (width * mm, height * mm)


@pytest.mark.parametrize(
    "read", [lambda s: svg_shapes(svg(s)), lambda s: pdf_shapes(pdf(s))], ids=["svg", "pdf"]
)
@pytest.mark.parametrize("target", TARGETS, ids=named)
def test_files_are_true_to_scale_to_a_hundredth_of_a_millimetre(target: Target, read) -> None:
    sheet = lay_out(target, A4)
    rectangles, disks, page = read(sheet)
    np.testing.assert_allclose(page, [1000 * sheet.width, 1000 * sheet.height], atol=0.01)
    np.testing.assert_allclose(rectangles, 1000 * sheet.ink.rectangles, atol=0.01)
    np.testing.assert_allclose(disks, 1000 * sheet.ink.disks, atol=0.01)

    ink = target_ink(target)
    points = 1000 * (target_points(target)[:, :2] + sheet.origin)
    if len(ink.disks):
        np.testing.assert_allclose(disks[:, :2], points, atol=0.01)
        np.testing.assert_allclose(disks[:, 2], 1000 * target.disk_diameter, atol=0.01)
    else:
        drawn = rectangles[: len(ink.rectangles)]
        np.testing.assert_allclose(
            drawn[:, :2].min(axis=0) - points[0], 1000 * np.array(ink.extent()[:2]), atol=0.01
        )


@pytest.mark.parametrize(
    "read", [lambda s: svg_shapes(svg(s)), lambda s: pdf_shapes(pdf(s))], ids=["svg", "pdf"]
)
def test_both_rulers_are_100_mm_long_with_a_tick_every_millimetre(read) -> None:
    rectangles, _, _ = read(lay_out(CHARUCO, A4))
    for along, across in ((0, 1), (1, 0)):
        lines = rectangles[(abs(rectangles[:, 2 + along] - 100) < 0.01) & (rectangles[:, 2 + across] < 1)]
        assert len(lines) == 1
        first, foot = lines[0, along], lines[0, across] + lines[0, 2 + across]
        ticks = rectangles[abs(rectangles[:, across] - foot) < 0.01]
        ticks = ticks[np.argsort(ticks[:, along])]
        assert len(ticks) == 101
        assert ticks[0, along] == pytest.approx(first, abs=0.01)
        assert ticks[-1, along] + ticks[-1, 2 + along] == pytest.approx(first + 100, abs=0.01)
        middles = ticks[1:-1, along] + ticks[1:-1, 2 + along] / 2
        np.testing.assert_allclose(middles, first + np.arange(1, 100), atol=0.01)


@given(target=targets(), margin=st.floats(0, 0.02))
@settings(max_examples=50, deadline=None)
def test_ink_stays_within_the_margins_and_out_of_the_white_rim(target: Target, margin: float) -> None:
    paper = next((paper for paper in NAMED if _fits(target, paper)), None)
    assume(paper is not None)
    try:
        sheet = lay_out(target, paper, margin)
    except PrintError:
        assume(False)
    left, top, right, bottom = sheet.ink.extent()
    assert min(left, top, sheet.width - right, sheet.height - bottom) > margin - 1e-8
    ink, rim = target_ink(target), white_rim(target)
    others = sheet.ink.rectangles[len(ink.rectangles) :]
    first = np.array(ink.extent()[:2]) + sheet.origin - rim + 1e-8
    last = np.array(ink.extent()[2:]) + sheet.origin + rim - 1e-8
    assert np.all(np.any((others[:, :2] + others[:, 2:] <= first) | (others[:, :2] >= last), axis=1))
    assert np.all(first >= -1e-7)
    assert np.all(last <= [sheet.width + 1e-7, sheet.height + 1e-7])
    bar_left, bar_top, bar_width, bar_height = sheet.ink.rectangles[-1]
    assert all(bar_left < text.x < bar_left + bar_width for text in sheet.texts)
    assert all(bar_top < text.y < bar_top + bar_height for text in sheet.texts)


def test_a_picture_says_its_resolution_and_has_its_size() -> None:
    sheet = lay_out(CHARUCO, A4)
    file = png(sheet, 254)
    at = file.index(b"pHYs")
    assert struct.unpack(">IIB", file[at + 4 : at + 13]) == (10_000, 10_000, 1)
    assert picture(file).shape == (2970, 2100)


def test_pixels_are_as_dark_as_they_have_ink() -> None:
    sheet = lay_out(CIRCLES, A4)
    found = 1 - picture(png(sheet, 100)) / 255
    scale = 100 / INCH
    x, y = (sheet.ink.disks[0, :2] * scale).astype(int)
    reach = int(0.01 * scale)
    area = found[y - reach : y + reach + 1, x - reach : x + reach + 1].sum() / scale**2
    assert area == pytest.approx(np.pi * 0.009**2, rel=1e-3)


def test_a_pdf_asks_not_to_be_fitted_to_the_page() -> None:
    assert b"/ViewerPreferences <</PrintScaling /None>>" in pdf(lay_out(CIRCLES, A4))


@pytest.mark.parametrize("write", [svg, pdf], ids=["svg", "pdf"])
def test_the_same_sheet_is_the_same_file(write) -> None:
    assert write(lay_out(CIRCLES, A4)) == write(lay_out(CIRCLES, A4))


def test_words_say_what_it_is_and_what_to_do() -> None:
    words = " ".join(text.words for text in lay_out(CIRCLES, A4).texts)
    assert "circle grid, rows 6, columns 7, pitch 30 mm, disk diameter 18 mm" in words
    assert "both rulers must measure 100 mm" in words


def test_files_have_the_words_in_white() -> None:
    sheet = lay_out(CHARUCO, A4)
    lines = [text.words for text in sheet.texts]
    group = ET.fromstring(svg(sheet)).find("{http://www.w3.org/2000/svg}g")
    assert group is not None
    assert group.attrib["fill"] == "white"
    assert [text.text for text in group] == lines
    page = pypdfium2.PdfDocument(pdf(sheet))[0]
    assert page.get_textpage().get_text_bounded().split() == " ".join(lines).split()


def test_words_stay_in_their_bar() -> None:
    sheet = lay_out(CHARUCO, A4)
    left, top, width, height = sheet.ink.rectangles[-1]
    words = pypdfium2.PdfDocument(pdf(sheet))[0].get_textpage()
    boxes = np.array([words.get_charbox(index) for index in range(words.count_chars())]) * INCH / 72
    assert boxes[:, 0].min() > left
    assert boxes[:, 2].max() < left + width
    assert sheet.height - boxes[:, 3].max() > top
    assert sheet.height - boxes[:, 1].min() < top + height

    scale = 300 / INCH
    found = picture(png(sheet, 300))
    first, last = np.ceil([[left, top], [left + width, top + height]] @ np.diag([scale, scale])).astype(int)
    inside = found[first[1] : last[1] - 1, first[0] : last[0] - 1]
    bright = np.argwhere(inside > 200)
    assert bright.min() > 0.5e-3 * scale
    assert np.all(bright.max(axis=0) < np.array(inside.shape) - 0.2e-3 * scale)


def test_what_does_not_fit_is_told_with_what_would() -> None:
    board = Chessboard(rows=6, columns=9, pitch=0.025)
    with pytest.raises(PrintError) as refused:
        lay_out(board, A4)
    said = str(refused.value)
    assert said.startswith(
        "the chessboard does not fit on A4 with its white rim, the rulers and margins of 10 mm: "
    )
    assert said.endswith("take A3, or make it 82 % as large (rows 6, columns 9, pitch 20.5 mm)")
    lay_out(board, parse_paper("A3"))
    lay_out(board.model_copy(update={"pitch": 0.0205}), A4)
    with pytest.raises(PrintError):
        lay_out(board.model_copy(update={"pitch": 0.0208}), A4)


@pytest.mark.parametrize(
    ("paper", "says"),
    [
        (Paper("a stamp", 0.03, 0.03), "does not fit on a stamp .*: take A4$"),
        (Paper("a strip", 0.03, 3), "does not fit on a strip .*: take A4$"),
    ],
)
def test_paper_too_small_for_the_rulers_is_refused(paper: Paper, says: str) -> None:
    with pytest.raises(PrintError, match=says):
        lay_out(CHARUCO, paper)


def test_margins_that_leave_no_room_are_refused() -> None:
    with pytest.raises(PrintError, match="take larger paper, a smaller target or narrower margins"):
        lay_out(CHARUCO, A4, margin=1)


def test_a_picture_of_too_many_pixels_is_refused() -> None:
    with pytest.raises(PrintError, match="19843 x 28063 pixels: choose another --dpi"):
        png(lay_out(CHARUCO, A4), 2400)


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("A4", (0.210, 0.297)),
        ("a3", (0.297, 0.420)),
        ("letter", (0.2159, 0.2794)),
        ("300x400 mm", (0.3, 0.4)),
        ("8.5 x 14 in", (0.2159, 0.3556)),
        ("1 × 2m", (1, 2)),
    ],
)
def test_paper_has_a_name_or_a_size(text: str, size: tuple[float, float]) -> None:
    paper = parse_paper(text)
    assert (paper.width, paper.height) == pytest.approx(size)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("A9", "'A9' is no paper: write one of A4, Letter, A3, A2, A1, A0, or a size such as '300x400 mm'"),
        ("300x400", "is no paper"),
        ("300x400 px", "does not fit"),
        ("0x400 mm", "has no area"),
    ],
)
def test_what_is_no_paper_is_said_to_be_none(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        parse_paper(text)
