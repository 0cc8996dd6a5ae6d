"""Keys are made and removed while a daemon runs and while none does; what is kept of them lets nobody in."""

import asyncio
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect

from daemon.access.access import running_access
from daemon.access.key_ring import KeyRing
from daemon.access.keys import ApiKey, digest_of, make_key
from daemon.access.roles import Role
from daemon.errors import KeyNameError, NoKeyError, StoreError
from daemon.profile import Profile
from daemon.server import serve
from daemon.service import Service
from daemon.store import Store
from tests.daemon.access.commands import command
from tests.daemon.access.keys import bearer, close_code
from tests.daemon.snapshots import restore_snapshot


async def as_other_process(*arguments: object) -> int:
    """The command line has an event loop of its own."""
    return await asyncio.to_thread(command, *arguments)


async def until_status(http: httpx.AsyncClient, secret: str, status: int) -> None:
    """Ask until the answer is the expected one, which it must be soon."""
    async with asyncio.timeout(60):
        while True:
            answer = await http.get("/session", headers=bearer(secret))
            if answer.status_code == status:
                return
            await asyncio.sleep(0.02)


async def test_a_running_daemon_knows_keys_as_they_come_and_go(
    flowing: str, http: httpx.AsyncClient, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / "data"
    assert await as_other_process("key", "add", "panel", "--role", "viewer", "--data", data) == 0
    secret = capsys.readouterr().out.strip()
    await until_status(http, secret, 200)
    assert (await http.get("/session", headers=bearer(secret))).json()["key"] == "panel"
    cookie = (await http.post("/session", headers=bearer(secret))).headers["set-cookie"].partition(";")[0]
    http.cookies.clear()
    stream = f"{flowing.replace('http', 'ws')}/api/v1/pose/stream"
    async with (
        connect(stream, additional_headers=bearer(secret)) as poses,
        http.stream("GET", "/camera/stream.mjpg", headers=bearer(secret)) as pictures,
    ):
        parts = pictures.aiter_bytes()
        await anext(parts)
        assert await as_other_process("key", "remove", "panel", "--data", data) == 0
        async with asyncio.timeout(60):
            assert await close_code(poses) == 1008
            async for _ in parts:
                pass
    for shown in (bearer(secret), {"Cookie": cookie}):
        assert (await http.get("/session", headers=shown)).json()["code"] == "key_unknown"


async def test_the_daemon_tells_when_a_key_was_used(
    guarded: Service, http: httpx.AsyncClient, secrets: dict[Role, str], tmp_path: Path
) -> None:
    before = datetime.now(UTC) - timedelta(seconds=1)
    await http.get("/rig", headers=bearer(secrets[Role.VIEWER]))
    await guarded.access.ring.tell()
    used = {key.name: key.last_used_at for key in await guarded.store.keys.all()}
    assert used["viewer"] is not None
    assert used["viewer"] > before
    assert used["operator"] is None


def test_keys_are_listed_without_what_lets_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "new" / "data"
    for name, role in (("zoe", "admin"), ("anna@lab", "operator")):
        assert command("key", "add", name, "--role", role, "--data", data) == 0
    secrets = capsys.readouterr().out.split()
    assert len(secrets) == 2
    assert all(secret.startswith("activecam_") and len(secret) > 50 for secret in secrets)
    for file in data.rglob("*"):
        assert not any(secret.encode() in file.read_bytes() for secret in secrets if file.is_file())

    assert command("key", "list", "--json", "--data", data) == 0
    printed = capsys.readouterr().out
    assert [(key["name"], key["role"], key["last_used_at"]) for key in json.loads(printed)] == [
        ("anna@lab", "operator", None),
        ("zoe", "admin", None),
    ]
    assert digest_of(secrets[0].encode()) not in printed
    assert command("key", "list", "--data", data) == 0
    assert "zoe" in capsys.readouterr().out
    assert command("key", "remove", "zoe", "--data", data) == 0
    assert command("audit", "--json", "--data", data) == 0
    done = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [entry["path"].partition(" --")[0] for entry in done] == [
        "activecam key add zoe",
        "activecam key add anna@lab",
        "activecam key remove zoe",
    ]
    assert all(entry["who"] and entry["address"] == "this machine" for entry in done)


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["add", "anna", "--role", "viewer"], 1, "there is a key 'anna' already: choose another name"),
        (["add", "a b", "--role", "viewer"], 1, "'a b' cannot be a key's name"),
        (["add", "ben"], 2, "--role"),
        (["add", "ben", "--role", "king"], 2, "'king' is not one of"),
        (["remove", "ben"], 1, "there is no key 'ben'"),
        (["list", "--data", "nowhere"], 1, "nowhere: no daemon has kept anything in this folder"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, said: str
) -> None:
    assert command("key", "add", "anna", "--role", "admin", "--data", tmp_path) == 0
    capsys.readouterr()
    where = [] if "--data" in arguments else ["--data", tmp_path]
    assert command("key", *arguments, *where) == status
    assert said in capsys.readouterr().err
    assert not Path("nowhere").exists()


@pytest.mark.parametrize("name", ["", "a" * 65, "a/b", "a\nb", "../a"])
def test_a_name_is_plain(name: str) -> None:
    with pytest.raises(KeyNameError):
        make_key(name, Role.VIEWER)


async def test_keys_and_deeds_of_an_older_daemon_are_kept(tmp_path: Path) -> None:
    restore_snapshot(3, tmp_path)
    store = await Store.open(tmp_path)
    keys = {key.name: key for key in await store.keys.all()}
    assert {name: key.role for name, key in keys.items()} == {"anna": Role.OPERATOR, "panel": Role.VIEWER}
    assert keys["anna"].last_used_at == datetime(2026, 3, 14, 9, 26, 53, 589793, tzinfo=UTC)
    assert keys["panel"].last_used_at is None
    deeds = await store.audit.read(None, 10)
    assert [(deed.id, deed.who, deed.asked, deed.status) for deed in deeds] == [
        (8, None, "", None),
        (7, "anna", '{"target": 12.5}', 202),
    ]
    await store.close()


def test_a_daemon_that_nobody_could_use_is_not_started(
    profile: Profile, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(NoKeyError, match="make one with 'activecam key add'"):
        serve(profile, tmp_path / "data", host="0.0.0.0", port=0)
    assert "ANYBODY ON THE NETWORK TO 0.0.0.0 CAN READ THE KEYS" in caplog.text
    caplog.clear()
    with pytest.raises(NoKeyError):
        serve(profile, tmp_path / "data", port=0, keys=True)
    assert not caplog.text


@pytest.mark.parametrize("asked", [False, True])
async def test_keys_are_read_where_they_are_asked_for_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: bool
) -> None:
    monkeypatch.setattr("daemon.access.key_ring.REFRESHED", 0)
    store = await Store.open(tmp_path)
    await store.keys.add(make_key("anna", Role.OPERATOR)[1])
    read, looks = store.keys.all, asyncio.Queue[None]()

    async def counted() -> Sequence[ApiKey]:
        looks.put_nowait(None)
        return await read()

    monkeypatch.setattr(store.keys, "all", counted)
    async with running_access(store, keys_asked=asked) as access:
        if asked:
            for _ in range(3):
                await looks.get()
        else:
            await access.book.read()  # whoever else uses the database's thread
            await access.book.read()
    assert asked or looks.empty()
    await store.close()


async def test_while_the_store_cannot_be_read_the_keys_stay_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("daemon.access.key_ring.REFRESHED", 0)
    monkeypatch.setattr("daemon.access.key_ring.TOLD", 0)
    store = await Store.open(tmp_path)
    _, key = make_key("anna", Role.OPERATOR)
    await store.keys.add(key)
    ring, looks, told = KeyRing(store.keys), 0, asyncio.Event()
    await ring.refresh()
    read, tell = store.keys.all, store.keys.used

    async def all_or_none() -> Sequence[ApiKey]:
        nonlocal looks
        looks += 1
        if looks <= 3:
            raise StoreError("disk I/O error")
        return await read()

    async def used(times: Mapping[str, datetime]) -> None:
        assert ring.find(key.digest) == key
        await tell(times)
        told.set()

    monkeypatch.setattr(store.keys, "all", all_or_none)
    monkeypatch.setattr(store.keys, "used", used)
    assert ring.find(key.digest) == key
    following = asyncio.create_task(ring.follow())
    await told.wait()
    following.cancel()
    assert looks >= 4
    assert caplog.messages == ["keys that are added or removed now are not noticed: disk I/O error"]
    assert (await read())[0].last_used_at is not None
    await store.close()
