"""`activecam serve`: the daemon and its REST API."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.operation.log_format import LogFormat, LogLevel, log_to_stderr
from daemon.profile import load_profile
from daemon.server import DEFAULT_HOST, DEFAULT_PORT
from daemon.server import serve as serve_rig
from daemon.tls import Tls


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam serve --profile paper-table --data /var/lib/activecam")(serve)


def serve(
    profile: Annotated[str, typer.Option(help="The rig's profile: a file, or a shipped one's name.")],
    data: Annotated[Path, typer.Option(help="Where runs and calibrations are kept.")] = Path(
        "activecam-data"
    ),
    host: Annotated[str, typer.Option(help="The address to listen on.")] = DEFAULT_HOST,
    port: Annotated[int, typer.Option(help="The port to listen on; 0 takes a free one.")] = DEFAULT_PORT,
    host_name: Annotated[
        list[str] | None, typer.Option(help="A name under which clients may ask; may be given several times.")
    ] = None,
    keys: Annotated[
        bool, typer.Option("--keys", help="Ask for a key on this machine too, as behind a proxy.")
    ] = False,
    tls_certificate: Annotated[
        Path | None, typer.Option(help="Serve by HTTPS with this certificate (PEM).")
    ] = None,
    tls_key: Annotated[Path | None, typer.Option(help="The certificate's private key (PEM).")] = None,
    log_format: Annotated[LogFormat, typer.Option(help="How the log on stderr is written.")] = LogFormat.TEXT,
    log_level: Annotated[LogLevel, typer.Option(help="From which level on.")] = LogLevel.INFO,
) -> None:
    """Own the rig: move its axes, run calibrations, and answer where the camera is, by HTTP."""
    if (tls_certificate is None) != (tls_key is None):
        raise typer.BadParameter("--tls-certificate and --tls-key go together: give both, or neither")
    tls = None if tls_certificate is None or tls_key is None else Tls(tls_certificate, tls_key)
    rig = load_profile(profile)
    log_to_stderr(log_format, log_level)

    def ready(address: str) -> None:
        typer.echo(
            f"Serving '{rig.name}' at {address}/api/v1 (the page: {address}/, the API described: {address}/docs)"
        )

    serve_rig(rig, data, host, port, ready, host_names=host_name or (), keys=keys, tls=tls)
