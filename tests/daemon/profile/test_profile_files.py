"""Where a profile comes from."""

from collections.abc import Callable
from pathlib import Path

import pytest

from daemon.profile import ProfileError, load_profile, shipped_profiles


def _refusal(path: str | Path) -> str:
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    return str(caught.value)


def test_a_shipped_profile_goes_by_its_name() -> None:
    assert load_profile("paper-table").source == load_profile(load_profile("paper-table").source or "").source


def test_a_path_to_a_file_called_like_a_shipped_profile_is_that_file(
    rig: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = rig()
    path.rename(path.with_name("turntable"))
    monkeypatch.chdir(path.parent)
    assert load_profile("./turntable").name == "A small rig"
    assert load_profile(Path("turntable")).name == "A small rig"
    assert load_profile("turntable").name == "A turntable"


def test_a_missing_file_is_offered_the_shipped_ones() -> None:
    assert _refusal("no/rig.toml") == (
        "no/rig.toml: there is no such file; "
        f"give a file's path, or a shipped profile's name: {', '.join(shipped_profiles())}"
    )
    assert _refusal("paper-tabel") == (
        "paper-tabel: there is no such file; did you mean the shipped profile 'paper-table'?"
    )


def test_a_folder_is_no_profile(tmp_path: Path) -> None:
    assert _refusal(tmp_path) == f"{tmp_path}: is a folder: name the profile's file in it"


def test_a_path_through_a_file_cannot_be_read(rig: Callable[..., Path]) -> None:
    path = rig() / "rig.toml"
    assert _refusal(path) == f"{path}: cannot be read: Not a directory"


def test_text_must_be_utf8(rig: Callable[..., Path]) -> None:
    path = rig()
    path.write_bytes(b'# one\nname = "Pr\xfcfstand"\n')
    assert _refusal(path) == f"{path}:2: is not UTF-8 text: save the file as UTF-8"


def test_a_byte_order_mark_does_not_matter(rig: Callable[..., Path]) -> None:
    path = rig()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_profile(path).name == "A small rig"


def test_an_empty_file_lacks_everything(rig: Callable[..., Path]) -> None:
    path = rig()
    path.write_text("")
    assert _refusal(path) == f"{path}:1: format: is missing (and 6 more problems)"
