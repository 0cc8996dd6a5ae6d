"""The session format: what is kept, what is refused and in which words, and what survives a crash."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib import load_session
from calib.errors import FormatError, ImageError, UnsolvableError
from calib.observations import observe
from calib.session import SESSION_FORMAT, Session, View
from calib.session_writer import SessionWriter

IDENTITY = np.eye(4).tolist()


def document(**changes: Any) -> dict[str, Any]:
    return {
        "format": SESSION_FORMAT,
        "joints": [
            {"name": "slide", "kind": "prismatic", "reading_unit": "mm"},
            {"name": "pan", "kind": "revolute", "reading_unit": "deg"},
        ],
        "cameras": [{"name": "main", "width": 640, "height": 480}],
        "target": {"kind": "chessboard", "rows": 6, "columns": 9, "pitch": 0.025},
        "views": [{"joint": "slide", "readings": [0.0, 0.0], "world_from_camera": IDENTITY}],
        **changes,
    }


def view(**changes: Any) -> dict[str, Any]:
    return {"joint": "pan", "readings": [1.0, 2.0], "world_from_camera": IDENTITY, **changes}


def picture(**changes: Any) -> dict[str, Any]:
    return view(world_from_camera=None, image="a.png", **changes)


def written(folder: Path, value: Any) -> Path:
    (folder / "session.json").write_text(json.dumps(value))
    return folder


def test_is_read_from_its_folder_or_its_file(tmp_path: Path) -> None:
    written(tmp_path, document())
    assert load_session(tmp_path) == load_session(tmp_path / "session.json")
    assert load_session(tmp_path).folder == tmp_path


def test_unknown_keys_are_kept(tmp_path: Path) -> None:
    known = document(weather="rain", views=[view(temperature_c=21.5)])
    SessionWriter(tmp_path / "copy", load_session(written(tmp_path, known)))
    assert json.loads((tmp_path / "copy" / "session.json").read_text()) == known


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"format": "activecam.session/9"}, "format must be 'activecam.session/1', but it has"),
        ({"joints": [{"name": "a", "kind": "round", "reading_unit": "x"}]}, r"joints\[0\]\.kind: .*revolute"),
        ({"cameras": []}, "cameras: "),
        ({"cameras": [{"name": "main", "link": "tilt"}]}, r"cameras\[0\]\.link: 'tilt' is not a joint"),
        ({"cameras": [{"name": "a"}, {"name": "a"}]}, "cameras: the name 'a' stands twice"),
        ({"target": {"kind": "dartboard"}}, "target: .*dartboard"),
        ({"views": [view(readings=[1.0])]}, r"views\[0\]\.readings: has 1 numbers for 2 joints"),
        ({"views": [view(readings=[1.0, "x"])]}, r"views\[0\]\.readings\[1\]: "),
        ({"views": [view(readings=[1.0, float("nan")])]}, r"views\[0\]\.readings\[1\]: .*finite"),
        ({"views": [view(joint="tilt")]}, r"views\[0\]\.joint: 'tilt' is not a joint of this session"),
        ({"views": [view(camera="other")]}, r"views\[0\]\.camera: 'other' is not a camera"),
        ({"views": [view(approached=[1])]}, r"views\[0\]\.approached: has 1 numbers for 2 joints"),
        ({"views": [view(world_from_camera=None)]}, r"views\[0\]: must carry one of image, points"),
        ({"views": [view(image="a.png")]}, r"views\[0\]: must carry one of .* image and world_from_camera"),
        ({"views": [picture(images=["b.png", "a.png"])]}, r"views\[0\]: images must begin with the view's image"),
        ({"views": [picture(images=[])]}, r"views\[0\]: images must begin with the view's image"),
        ({"views": [view(images=["a.png"])]}, r"views\[0\]: images must begin with the view's image"),
        ({"views": [picture(images=["a.png", "/b.png"])]}, r"images: '/b.png' must be a path inside"),
        ({"views": [picture(images=["a.png", "a.png"])]}, r"images: 'a.png' stands twice"),
        ({"views": [view(world_from_camera=[[2, 0, 0, 0], *IDENTITY[1:]])]}, "is not a rotation"),
        ({"views": [view(world_from_camera=IDENTITY[:3])]}, "must be a 4 x 4 matrix"),
        ({"views": [view(world_from_camera=None, image="../a.png")]}, "inside the session's folder"),
        ({"nominal": {"convention": "standard_dh", "dh": [], "std": {"length": 1, "angle": 1, "scale": 1}}},
         "nominal.dh: has 0 rows for 2 joints"),
        ({"origin": {"camera": "other", "readings": [0, 0], "pixel": [1, 1]}}, "origin.camera: 'other'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(tmp_path: Path, changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FormatError, match=sentence) as caught:
        load_session(written(tmp_path, document(**changes)))
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        ({"ids": [0, 1], "pixels": [[1, 2]]}, "has 2 ids but 1 pixels"),
        ({"ids": [0, 0], "pixels": [[1, 2], [3, 4]]}, "an id stands in it twice"),
        ({"ids": [54], "pixels": [[1, 2]]}, "54 is not a point of the target, which has 54"),
        ({"ids": [-1], "pixels": [[1, 2]]}, r"ids\[0\]"),
        ({"ids": [0], "pixels": [[1]]}, r"pixels\[0\]"),
    ],
)
def test_points_are_checked(tmp_path: Path, points: dict[str, Any], sentence: str) -> None:
    wrong = view(world_from_camera=None, points=points)
    with pytest.raises(FormatError, match=sentence):
        load_session(written(tmp_path, document(views=[wrong])))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not JSON at line 1"),
        ('{"format": "activecam.session/1", "joints": [', "seems to be cut off"),
        ("[1, 2]", "must be a JSON object, not list"),
    ],
)
def test_a_broken_file_is_named(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "session.json").write_text(text)
    with pytest.raises(FormatError, match=sentence):
        load_session(tmp_path)


def test_no_such_session(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="there is no such"):
        load_session(tmp_path / "nowhere")
    with pytest.raises(FormatError, match=r"session\.json: there is no such file"):
        load_session(tmp_path)


def test_no_views_and_missing_pictures_are_found_when_needed(tmp_path: Path) -> None:
    with pytest.raises(UnsolvableError, match="the session has no views"):
        observe(load_session(written(tmp_path, document(views=[]))))
    lost = document(views=[view(world_from_camera=None, image="frames/0000.png")])
    with pytest.raises(ImageError, match=r"frames/0000\.png: the picture is missing"):
        observe(load_session(written(tmp_path, lost)))
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0000.png").write_bytes(b"no picture")
    with pytest.raises(ImageError, match=r"frames/0000\.png: cannot be read"):
        observe(load_session(tmp_path))


def test_a_target_never_seen(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    cv2.imwrite(str(tmp_path / "frames" / "0000.png"), np.full((480, 640), 128, np.uint8))
    blank = document(views=[view(world_from_camera=None, image="frames/0000.png")])
    with pytest.raises(UnsolvableError, match="was not found in any of the 1 views"):
        observe(load_session(written(tmp_path, blank)))


def test_every_view_is_on_disk_when_it_is_added(tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path, Session.model_validate(document(views=[])))
    picture = np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8)
    for step in range(3):
        added = writer.add_pictures([picture + step], joint="slide", readings=[float(step), 0.0], note="wet")
        stored = load_session(tmp_path)
        assert stored.views[-1] == added
        assert stored.views[-1].readings == [step, 0.0]
        assert np.array_equal(
            cv2.imread(str(tmp_path / str(added.image)), cv2.IMREAD_GRAYSCALE), picture + step
        )
    writer.add(View.model_validate(view()))
    assert len(load_session(tmp_path).views) == 4
    assert not list(tmp_path.rglob("*.tmp"))


def test_all_frames_of_a_view_are_on_disk_and_a_lost_one_is_named(tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path, Session.model_validate(document(views=[])))
    frames = list(np.random.default_rng(0).integers(0, 255, (3, 480, 640), dtype=np.uint8))
    writer.add_pictures(frames[:1], joint=None, readings=[0.0, 0.0])
    writer.add_pictures(frames, joint=None, readings=[0.0, 0.0])
    one, several = load_session(tmp_path).views
    assert one.images is None
    assert one.frames == ["frames/0000.png"]
    assert several.image == "frames/0001.png"
    assert several.frames == ["frames/0001.png", "frames/0001-1.png", "frames/0001-2.png"]
    for frame, name in zip(frames, several.frames, strict=True):
        assert np.array_equal(cv2.imread(str(tmp_path / name), cv2.IMREAD_GRAYSCALE), frame)
    (tmp_path / "frames" / "0001-2.png").unlink()
    with pytest.raises(ImageError, match=r"frames/0001-2\.png: the picture is missing"):
        observe(load_session(tmp_path), only=[1])


def test_a_session_goes_on_after_its_last_finished_sweep_and_keeps_all_pictures(tmp_path: Path) -> None:
    def add(writer: SessionWriter, grey: int, reading: float) -> View:
        fields = {"joint": "slide", "readings": [reading, 0.0], "sweep": writer.session.sweeps_done}
        return writer.add_pictures([np.full((4, 4), grey, np.uint8)], **fields)

    cut_off = Session.model_validate(document(views=[], complete=False))
    writer = SessionWriter(tmp_path, cut_off)
    done = add(writer, 1, 0.0)
    writer.end_sweep()
    lost = [add(writer, 2, 10.0), add(writer, 3, 20.0)]
    for _ in range(2):  # cut off again before anything was taken
        writer = SessionWriter.resume(tmp_path)
        assert writer.session.views == [done]
        assert writer.session.set_aside == lost
    again = add(writer, 4, 10.0)
    assert load_session(tmp_path).views == [done, again]
    greys = [cv2.imread(str(tmp_path / str(v.image)), cv2.IMREAD_GRAYSCALE) for v in (done, *lost, again)]
    assert [int(grey[0, 0]) for grey in greys if grey is not None] == [1, 2, 3, 4]

    writer.complete()
    assert SessionWriter.resume(tmp_path).session == writer.session
    SessionWriter(tmp_path, cut_off.with_views([done]).model_copy(update={"sweeps_done": 1}))
    (tmp_path / str(done.image)).unlink()
    with pytest.raises(ImageError, match=r"0000\.png: the picture of a view is gone: start a new run"):
        SessionWriter.resume(tmp_path)


def test_a_view_that_cannot_be_written_leaves_the_session_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = SessionWriter(tmp_path, Session.model_validate(document(views=[])))
    writer.add(View.model_validate(view()))
    before = (tmp_path / "session.json").read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        writer.add_pictures([np.zeros((4, 4), np.uint8)], joint=None, readings=[0.0, 0.0])
    assert (tmp_path / "session.json").read_bytes() == before
    assert len(writer.session.views) == 1
