"""`activecam demo`: the whole thing on simulated hardware, in the terminal."""

import asyncio
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from calib import Calibration, load_calibration
from calib.verification import VERIFICATION
from daemon.cli.console import output, progress_bar, warn
from daemon.cli.progress import RunProgress
from daemon.cli.solve import print_calibration
from daemon.cli.verification_tables import print_verification
from daemon.errors import RunError
from daemon.procedure.events import Finished, Verified, Warned
from daemon.profile import Profile, ProfileError, load_profile
from daemon.service import Service, running_service


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam demo --profile pan-tilt")(demo)


def demo(
    profile: Annotated[str, typer.Option(help="A simulated rig's profile.")] = "paper-table",
    data: Annotated[Path, typer.Option(help="Where runs and calibrations are kept.")] = Path(
        "activecam-demo"
    ),
) -> None:
    """Calibrate a simulated rig joint by joint, and judge the result on views it has not seen."""
    rig = load_profile(profile)
    if rig.simulation is None:
        raise ProfileError(
            [f"{profile}: the demo is for simulated rigs; use 'activecam serve' for a real one"]
        )
    output.print(f"Calibrating {rig.name} (simulated, {rig.simulation.time_scale:g} times faster than life)")
    folder, verified, truth = asyncio.run(_calibrate(rig, data))
    calibration = load_calibration(folder / "calibration.json")
    print_calibration(calibration)
    if verified is not None:
        print_verification(VERIFICATION.validate_python(verified))
    output.print(truth)
    output.print(f"Calibration: {folder / 'calibration.json'}", soft_wrap=True)
    output.print(f"Session:     {folder}", soft_wrap=True)
    middle = " ".join(f"{(low + high) / 2:g}" for low, high in calibration.range)
    output.print(
        f"Ask for a pose:  activecam pose {folder / 'calibration.json'} --readings {middle}\n"
        f"Or by HTTP:      activecam serve --profile {profile} --data {data}",
        soft_wrap=True,
    )


async def _calibrate(profile: Profile, data: Path) -> tuple[Path, dict[str, Any] | None, str]:
    """Run the profile's procedure; return the session's folder, the verification, and the truth about it."""
    async with running_service(profile, data) as service:
        run = await service.runs.start(owner="activecam demo")
        folder, verified = service.store.session_folder(run), None
        with progress_bar() as advance:
            progress = RunProgress(advance)
            async for event in service.runs.events(run.id):
                progress.show(event)
                match event:
                    case Warned(message=message):
                        warn(message)
                    case Verified(result=result):
                        verified = result
                    case Finished(error=str(error)):
                        raise RunError(f"the calibration did not succeed: {error}")
                    case _:
                        pass
        return folder, verified, _against_truth(service, load_calibration(folder / "calibration.json"))


def _against_truth(service: Service, calibration: Calibration) -> str:
    """Return how far the calibrated camera is from the true one, over readings in the calibrated range."""
    assert service.rig.world is not None
    low, high = np.array(calibration.range).T
    readings = np.random.default_rng(0).uniform(low, high, (200, len(low)))
    true = np.array([service.rig.world.world_from_camera(vector) for vector in readings])
    found = calibration.world_from_camera(readings)
    distance = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)
    cosine = (np.einsum("nij,nij->n", found[:, :3, :3], true[:, :3, :3]) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1, 1))
    return (
        "Against the simulated truth, anywhere in the calibrated range: camera position "
        f"{1e3 * distance.mean():.3f} mm mean, {1e3 * distance.max():.3f} mm at most; "
        f"rotation {1e3 * angle.mean():.3f} mrad mean, {1e3 * angle.max():.3f} mrad at most"
    )
