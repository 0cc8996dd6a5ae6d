"""The figure of the documentation is drawn from figures alone, the same each time."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from benchmarks.uncertainty import ALONG, Sampled
from benchmarks.uncertainty_figure import draw


def test_every_component_is_drawn_and_the_same_each_time(tmp_path: Path) -> None:
    claimed = np.arange(1, 7) * np.ones((len(ALONG), 1)) * 1e-3
    files = [tmp_path / "a.svg", tmp_path / "b.svg"]
    for file in files:
        draw(Sampled(claimed, 1.1 * claimed, draws=50), file)
    assert files[0].read_bytes() == files[1].read_bytes()
    text = [element.text for element in ElementTree.parse(files[0]).iter() if element.text]
    assert "standard deviation of the position (mm)" in text
    assert [name for name in text if name in ("x", "y", "z")] == ["x", "y", "z"] * 2
