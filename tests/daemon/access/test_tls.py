"""The daemon by HTTPS, and the files that it cannot do it with."""

import ssl
import subprocess
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect

from daemon.cli import main
from daemon.errors import ServeError
from daemon.server import Door, address_of, bind, serving
from daemon.service import Service
from daemon.tls import Tls
from tests.daemon.rigs import write_profile


def make(folder: Path, *options: str) -> Tls:
    """A certificate of this machine's own, for an hour or so."""
    made = Tls(folder / "certificate.pem", folder / "key.pem")
    folder.mkdir(exist_ok=True)
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
    command += ["-days", "1", "-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"]
    command += ["-keyout", str(made.key), "-out", str(made.certificate), *(options or ["-nodes"])]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("openssl, which makes the certificate, is not installed")
    return made


async def test_it_is_served_by_https(service: Service, tmp_path: Path) -> None:
    tls = make(tmp_path)
    tls.check()
    trusting = ssl.create_default_context(cafile=str(tls.certificate))
    with bind("127.0.0.1", 0) as listening:
        address = address_of(listening, tls)
        assert address.startswith("https://127.0.0.1:")
        async with serving(service, listening, Door(tls=tls)):
            async with httpx.AsyncClient(base_url=address, verify=trusting) as client:
                assert (await client.get("/api/v1/health")).json()["status"] == "ok"
            stream = f"{address.replace('https', 'wss')}/api/v1/pose/stream"
            async with connect(stream, ssl=trusting) as socket_:
                assert "not_calibrated" in str(await socket_.recv())


def test_files_that_are_of_no_use_are_named(tmp_path: Path) -> None:
    good, other = make(tmp_path / "good"), make(tmp_path / "other")
    locked = make(tmp_path / "locked", "-passout", "pass:1234")
    (tmp_path / "text").write_text("none")
    for tls, said in (
        (
            Tls(tmp_path / "missing", good.key),
            "missing: No such file or directory: give another --tls-certificate",
        ),
        (Tls(good.certificate, tmp_path), "Is a directory: give another --tls-key"),
        (Tls(tmp_path / "text", good.key), "not a certificate and a private key in PEM form"),
        (Tls(good.certificate, other.key), "key.pem: this is not the key of .*certificate.pem"),
        (locked, "the key is encrypted: give one without a passphrase"),
    ):
        with pytest.raises(ServeError, match=said):
            tls.check()


def test_a_certificate_without_its_key_is_a_wrong_call(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["serve", "--profile", str(write_profile(tmp_path)), "--data", str(tmp_path / "data")]
    for option in ("--tls-certificate", "--tls-key"):
        with pytest.raises(SystemExit) as ended:
            main([*call, option, str(tmp_path / "file")])
        assert ended.value.code == 2
        assert "go together" in capsys.readouterr().err
    assert not (tmp_path / "data").exists()
