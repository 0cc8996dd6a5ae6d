"""`activecam profile`: what profiles there are, and what is wrong with one."""

import json
from typing import Annotated

import typer

from daemon.cli.console import errors, output
from daemon.profile import Profile, ProfileError, load_profile, shipped_profiles

app = typer.Typer(help="Check a rig's profile, or list those that are shipped.")


def register(parent: typer.Typer) -> None:
    """Add the commands to `parent`."""
    parent.add_typer(app, name="profile")


@app.command(epilog="Example: activecam profile check my-rig.toml")
def check(
    profile: Annotated[str, typer.Argument(help="A profile file, or a shipped one's name.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON.")] = False,
) -> int:
    """Check a profile: every problem with its line, or what the rig is."""
    try:
        loaded = load_profile(profile)
    except ProfileError as error:
        if as_json:
            typer.echo(json.dumps({"valid": False, "problems": error.problems}))
        else:
            for problem in error.problems:
                errors.print(problem, markup=False, soft_wrap=True)
        return 1
    if as_json:
        typer.echo(json.dumps({"valid": True, "problems": []}))
    else:
        output.print(_description(loaded), markup=False, soft_wrap=True)
    return 0


@app.command("list", epilog="Example: activecam profile list")
def list_shipped() -> None:
    """List the profiles that are shipped; their names can be given wherever a profile file can."""
    for name in shipped_profiles():
        typer.echo(f"{name}: {load_profile(name).name}")


def _description(profile: Profile) -> str:
    lines = [f"{profile.name}: no problems found"]
    for axis in profile.axes:
        low, high = axis.spec.limits
        lines.append(f"  axis '{axis.spec.name}', {axis.spec.kind}, {low:g} to {high:g} {axis.spec.unit}")
    camera = profile.camera.spec
    lines.append(
        f"  camera '{camera.name}', {camera.width} x {camera.height}, target '{profile.target.kind}'"
    )
    planned = sum(len(sweep.readings) for sweep in profile.procedure.sweeps) + len(profile.procedure.views)
    lines.append(f"  {planned} views in the procedure")
    return "\n".join(lines)
