"""Tags' sides, fitted to the grey values along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.detection.pixel_edge import edge_in_pixels
from calib.detection.tag_sides import Floats
from calib.detection.tag_strips import Singles, Strips

HEIGHTS, BOWS, BLURS, LOOK = slice(0, 12), slice(2, 12, 3), slice(12, 14), slice(12, 18)
"""Of a tag's 18 parameters: three of each side, of which one is its bow; the blurs; how it looks altogether."""
PARAMETERS = 18
OF_SIDES = np.array(
    [[3 * side, 3 * side + 1, 3 * side + 2, 12 + side % 2, 14, 15, 16, 17] for side in range(4)]
)
"""(4, 8): mean height, half the rise, bow; blur, which opposite sides share; white, black, the light's slopes."""
ENDS = np.kron(np.eye(4), [[1, -1, 0], [1, 1, 0]])
"""(8, 12): what the heights of sides at both ends are of HEIGHTS."""

MOST_STEPS = 8
LONGEST_STEP, LONGEST_STRETCH = 1.0, 0.5  # px; of the blur's logarithm
LEAST_BLUR = 0.2  # px
RIDGE = 1e-6  # of the diagonal
CLIPPED_BLUR = (
    0.75  # px; sharper edges show too little of their shoulders to tell clipping from a bright paper
)
ROUNDING_VARIANCE = 1 / 12
SURELY_BOWED = 1e-3  # px; that a lens' bend is known to at the best
MEDIAN_SQUARE = 0.4549  # of a normal variable


@dataclass(frozen=True, eq=False)
class TagFit:
    """What n tags look like.

    `heights` (n, 8) are those of each side in turn at its start and its end, px above what was taken for the
    corners, with their `covariances` (n, 8, 8). `look` (n, 6) are the logarithms of the blur (px) across sides 0 and 2
    and sides 1 and 3, the grey values of white and of black in the middle, and the light's relative slopes along x
    and y over a tag's size. `scatter` (n,) is the variance of the grey values about the drawing; `unsettled` (n,)
    the last step's gain in the sum of squares, over that.
    """

    heights: Floats
    covariances: Floats
    look: Floats
    scatter: Floats
    unsettled: Floats

    @property
    def blur(self) -> float:
        """The blur of most tags, px."""
        return float(np.exp(np.median(self.look[:, :2])))

    @property
    def contrast(self) -> Floats:
        """White less black (n,), grey values."""
        return np.asarray(self.look[:, 2] - self.look[:, 3])


def first_look(strips: Strips, blur: float) -> Floats:
    """Guess what tags look like (n, 6) from pixels well to both sides of the sides."""
    n = len(strips.used) // 4
    look = np.zeros((n, 6))
    look[:, :2] = np.log(blur)
    for column, there in ((2, strips.heights < -1), (3, strips.heights > 1)):
        counted = (strips.used * there).reshape(n, -1)
        look[:, column] = (counted * strips.values.reshape(n, -1)).sum(axis=1) / np.maximum(
            counted.sum(axis=1), 1
        )
    return look


def fit_tags(strips: Strips, courses: Floats | None, look: Floats) -> TagFit:
    """Fit drawings of tags to the strips along their sides by Gauss-Newton steps, from such a look (n, 6).

    `courses` (n, 4, 2) are what a lens is thought to make of sides: heights (1 - t²) (a + b t), at t from -1 to 1 along
    them. Each has a bow besides, which is free where nothing is known of the lens. The light is a plane. What the
    camera clips, the drawing clips as well.
    """
    n, used, t = len(look), strips.used, strips.along
    limits = _limits(strips) if np.exp(np.median(look[:, :2])) > CLIPPED_BLUR else (-np.inf, np.inf)
    bow = 1 - t * t
    above_course = strips.heights
    if courses is not None:
        even, uneven = np.moveaxis(courses.reshape(-1, 2, 1).astype(np.float32), 1, 0)
        above_course = above_course - bow * (even + uneven * t)
    freedom = np.maximum(used.reshape(n, -1).sum(axis=1) - PARAMETERS, 1)
    fitted = np.zeros((n, PARAMETERS))
    fitted[:, LOOK] = look
    for _ in range(MOST_STEPS):
        jacobian, residuals = _linearised(fitted, strips, above_course, bow, limits)
        normal, right = _of_tags(
            jacobian @ jacobian.swapaxes(1, 2), (jacobian @ residuals[..., None])[..., 0]
        )
        before, fitted = fitted, fitted + _step(normal, right)
        fitted[:, BLURS] = np.maximum(fitted[:, BLURS], np.log(LEAST_BLUR))
        gain = ((fitted - before) * right).sum(axis=1)
        squares = np.square(residuals).reshape(n, -1).sum(axis=1)
        scatter = np.maximum((squares - gain) / freedom, ROUNDING_VARIANCE)
        if (gain < PARAMETERS * scatter).all():
            break
    covariances = scatter[:, None, None] * np.linalg.inv(normal)
    if courses is not None:
        fitted, covariances = _bowed_alike(fitted, covariances)
    return TagFit(
        heights=fitted[:, HEIGHTS] @ ENDS.T,
        covariances=ENDS @ covariances[:, HEIGHTS, HEIGHTS] @ ENDS.T,
        look=fitted[:, LOOK],
        scatter=scatter,
        unsettled=np.abs(gain) / scatter,
    )


def _limits(strips: Strips) -> tuple[float, float]:
    """Give the darkest and the brightest grey value: the camera may have clipped what is beyond."""
    values = strips.values[strips.used > 0]
    return float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))


def _linearised(
    fitted: Floats, strips: Strips, above_course: Singles, bow: Singles, limits: tuple[float, float]
) -> tuple[Singles, Singles]:
    """Draw tags of parameters (n, 18): how the pixels change with sides' own (s, 8, m), and what is left (s, m)."""
    mean, rise, bowed, blur, white, black, along_x, along_y = np.moveaxis(
        fitted.astype(np.float32)[:, OF_SIDES].reshape(-1, 8, 1), 1, 0
    )
    heights = above_course - mean
    heights -= rise * strips.along
    heights -= bowed * bow
    ink, by_height, by_blur = _ink(heights, np.exp(blur), strips)
    light = along_x * strips.x
    light += along_y * strips.y
    light += 1
    reflected = (black - white) * ink
    reflected += white
    model = light * reflected
    counted = ((model > limits[0]) & (model < limits[1])) * strips.used
    light *= counted
    reflected *= counted
    contrast = (black - white) * light
    by_height *= contrast
    changes = np.empty((len(mean), 8, strips.used.shape[1]), dtype=np.float32)
    np.negative(by_height, out=changes[:, 0])
    np.multiply(changes[:, 0], strips.along, out=changes[:, 1])
    np.multiply(changes[:, 0], bow, out=changes[:, 2])
    np.multiply(by_blur, contrast, out=changes[:, 3])
    np.multiply(ink, light, out=changes[:, 5])
    np.subtract(light, changes[:, 5], out=changes[:, 4])
    np.multiply(reflected, strips.x, out=changes[:, 6])
    np.multiply(reflected, strips.y, out=changes[:, 7])
    return changes, strips.used * (strips.values - np.clip(model, *limits))


def _ink(heights: Singles, blur: Singles, strips: Strips) -> tuple[Singles, Singles, Singles]:
    """Draw black borders from 0 to 1, and white cells behind them; with the derivatives by heights and log blur."""
    drawings = edge_in_pixels(heights, blur)
    cells = strips.cells
    if len(cells.white):
        at = cells.side, cells.pixel
        behind = edge_in_pixels(heights[at] - cells.depths, blur[cells.side, 0])
        for drawing, part in zip(drawings, behind, strict=True):
            drawing[at] -= cells.white * part
    return drawings


def _of_tags(of_sides: Singles, right_of_sides: Singles) -> tuple[Floats, Floats]:
    """Put the normal equations of sides, (4 n, 8, 8) and (4 n, 8), together to tags' (n, 18, 18) and (n, 18)."""
    n = len(of_sides) // 4
    normal, right = np.zeros((n, PARAMETERS, PARAMETERS)), np.zeros((n, PARAMETERS))
    for side, places in enumerate(OF_SIDES):
        normal[:, places[:, None], places] += of_sides[side::4]
        right[:, places] += right_of_sides[side::4]
    # A tag without contrast, or all clipped, has no shape to speak of; it must not keep the others from theirs.
    return normal + (RIDGE * np.diagonal(normal, axis1=1, axis2=2)[:, None] + 1e-9) * np.eye(
        PARAMETERS
    ), right


def _step(normal: Floats, right: Floats) -> Floats:
    """Solve the normal equations, and shorten steps that are too long for them to hold."""
    step = np.asarray(np.linalg.solve(normal, right[..., None])[..., 0], dtype=np.float64)
    too_long = np.abs(step[:, HEIGHTS]).max(axis=1) / LONGEST_STEP
    stretched = np.abs(step[:, BLURS]).max(axis=1) / LONGEST_STRETCH
    return np.asarray(step / np.maximum(np.maximum(too_long, stretched), 1)[:, None])


def _bowed_alike(fitted: Floats, covariances: Floats) -> tuple[Floats, Floats]:
    """Draw all sides' bows to 0, as far as all of them together say that they are 0.

    Short sides hardly tell how they are bowed, and without knowing it where they end.
    """
    bows, of_bows = fitted[:, BOWS], covariances[:, BOWS, BOWS]
    of_noise = np.median(np.diagonal(of_bows, axis1=1, axis2=2))
    spread = max(float(np.median(np.square(bows)) / MEDIAN_SQUARE - of_noise), SURELY_BOWED**2)
    gain = covariances[:, :, BOWS] @ np.linalg.inv(of_bows + spread * np.eye(4))
    return fitted - (gain @ bows[..., None])[..., 0], covariances - gain @ covariances[:, BOWS]
