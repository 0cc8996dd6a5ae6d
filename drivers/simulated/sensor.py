"""From light to numbers: blur, illumination, exposure, noise, and 8 bits."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.simulated.options import PictureOptions

Grey = NDArray[np.float32]


@dataclass(frozen=True)
class Sensor:
    """The sensor behind one lens; light is float32 grey levels (height, width), or finer."""

    options: PictureOptions
    width: int
    height: int

    def gather(self, light: Grey) -> Grey:
        """Return the light on each pixel that arrives through a lens that is out of focus and lit unevenly.

        The light given may be a whole number of times finer than the pixels, and is to be for edges to lie where
        they are: a lens blurs light before pixels add it up, and what they have added up no blur mends.
        """
        finer = light.shape[0] // self.height
        if self.options.defocus > 0.0:
            light = np.asarray(cv2.GaussianBlur(light, (0, 0), finer * self.options.defocus), np.float32)
        if finer > 1:
            light = np.asarray(cv2.resize(light, (self.width, self.height), interpolation=cv2.INTER_AREA))
        return light * self._gain

    def read(self, light: Grey, noise: np.random.Generator) -> NDArray[np.uint8]:
        """Return one picture of gathered light, with its own noise."""
        if self.options.noise > 0.0:
            light = noise.standard_normal(light.shape, np.float32) * np.float32(self.options.noise) + light
        return np.clip(np.rint(light), 0, 255).astype(np.uint8)

    @cached_property
    def _gain(self) -> Grey:
        """Factor on the light of each pixel."""
        x = np.linspace(-1.0, 1.0, self.width)[None, :]
        y = np.linspace(-1.0, 1.0, self.height)[:, None]
        corner = (x * x * self.width**2 + y * y * self.height**2) / (self.width**2 + self.height**2)
        light = (1.0 - self.options.vignetting * corner) * (1.0 + self.options.light_gradient * x)
        return np.asarray(self.options.brightness * light, np.float32)
