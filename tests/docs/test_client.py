"""The client's page: its examples work one after the other, and name nothing that there is not."""

import re
import subprocess
import sys

import activecam_client
from tests.docs.pages import blocks, page

PAGE = "how-to/ask-for-the-pose.md"


def test_the_examples_work_one_after_the_other(served: str) -> None:
    program = "\n".join(block.text for block in blocks(PAGE, "python"))
    program = program.replace("http://localhost:8080", served)
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "succeeded" in ran.stdout
    assert "(100, 3)" in ran.stdout
    assert ran.stdout.splitlines()[-1].startswith("time_not_covered - ")


def test_every_error_is_one_of_the_package() -> None:
    for name in re.findall(r"`(\w+Error)`", page(PAGE)):
        assert issubclass(getattr(activecam_client, name), activecam_client.ActivecamError)
