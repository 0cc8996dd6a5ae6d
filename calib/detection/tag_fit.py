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
OF_TAGS = np.eye(PARAMETERS, dtype=np.float32)[OF_SIDES]
"""(4, 8, 18): how a side's own parameters change with its tag's."""
ENDS = np.kron(np.eye(4), [[1, -1, 0], [1, 1, 0]])
"""(8, 12): what the heights of sides at both ends are of HEIGHTS."""

MOST_STEPS = 8
SETTLED = PARAMETERS  # times the scatter: a step that gains less in squares is below the noise
LONGEST_STEP, LONGEST_STRETCH = 1.0, 0.5  # px; of the blur's logarithm
LEAST_BLUR = 0.2  # px
RIDGE = 1e-6  # of the diagonal
CLIPPED_BLUR = (
    0.75  # px; sharper edges show too little of their shoulders to tell clipping from a bright paper
)
UNTOLD = 1.0  # px
CLIPPED = 0.1  # of all pixels: noise brings few of them to one extreme value
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
    what one more step might gain in the sum of squares, over that.
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
    limits = _limits(strips, sharp=bool(np.exp(np.median(look[:, :2])) <= CLIPPED_BLUR))
    bow = 1 - t * t
    above_course = strips.heights
    if courses is not None:
        even, uneven = np.moveaxis(courses.reshape(-1, 2, 1).astype(np.float32), 1, 0)
        above_course = above_course - bow * (even + uneven * t)
    freedom = np.maximum(used.reshape(n, -1).sum(axis=1) - PARAMETERS, 1)
    fitted = np.zeros((n, PARAMETERS))
    fitted[:, LOOK] = look
    for _ in range(MOST_STEPS):
        normal, right, squares = _of_tags(_linearised(fitted, strips, above_course, bow, limits))
        inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        step = _step(inverse, right, fitted[:, BLURS])
        fitted += step
        gain = (step * right).sum(axis=1)
        scatter = np.maximum((squares - gain) / freedom, ROUNDING_VARIANCE)
        # Near the end, what is left to go is of the second order of the last step.
        unsettled = np.abs(gain) * _in_blurs(step, fitted[:, BLURS]) ** 2 / scatter
        if (unsettled < SETTLED).all():
            break
    covariances = scatter[:, None, None] * inverse
    if courses is not None:
        fitted, covariances = _bowed_alike(fitted, covariances)
    # Clipped edges that show no slope at all may be anywhere in what was clipped.
    untold = np.isfinite(limits).any() & (np.exp(fitted[:, BLURS]).min(axis=1) < 1.01 * LEAST_BLUR)
    return TagFit(
        heights=fitted[:, HEIGHTS] @ ENDS.T,
        covariances=ENDS @ covariances[:, HEIGHTS, HEIGHTS] @ ENDS.T
        + (untold * UNTOLD**2)[:, None, None] * np.eye(len(ENDS)),
        look=fitted[:, LOOK],
        scatter=scatter,
        unsettled=unsettled,
    )


def _limits(strips: Strips, sharp: bool) -> tuple[float, float]:
    """Give the darkest and the brightest grey value: the camera may have clipped what is beyond.

    Of a `sharp` picture they are given where many pixels have that very value, and -inf and inf where few do.
    """
    values = strips.values[strips.used > 0]
    darkest, brightest = float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))
    if not sharp:
        return darkest, brightest
    dark, bright = (values == darkest).sum(), (values == brightest).sum()
    return (
        darkest if dark > CLIPPED * len(values) else -np.inf,
        brightest if bright > CLIPPED * len(values) else np.inf,
    )


def _linearised(
    fitted: Floats, strips: Strips, above_course: Singles, bow: Singles, limits: tuple[float, float]
) -> Singles:
    """Draw tags of parameters (n, 18): how the pixels change with sides' own, and in the last row what is left.

    Gives (s, 9, m).
    """
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
    changes = np.empty((len(mean), 9, strips.used.shape[1]), dtype=np.float32)
    np.negative(by_height, out=changes[:, 0])
    np.multiply(changes[:, 0], strips.along, out=changes[:, 1])
    np.multiply(changes[:, 0], bow, out=changes[:, 2])
    np.multiply(by_blur, contrast, out=changes[:, 3])
    np.multiply(ink, light, out=changes[:, 5])
    np.subtract(light, changes[:, 5], out=changes[:, 4])
    np.multiply(reflected, strips.x, out=changes[:, 6])
    np.multiply(reflected, strips.y, out=changes[:, 7])
    np.subtract(strips.values, np.clip(model, *limits, out=model), out=changes[:, 8])
    changes[:, 8] *= strips.used
    return changes


def _ink(heights: Singles, blur: Singles, strips: Strips) -> tuple[Singles, Singles, Singles]:
    """Draw black borders from 0 to 1, and white cells behind them; with the derivatives by heights and log blur."""
    drawings = edge_in_pixels(heights, blur)
    cells = strips.cells
    if len(cells.white):
        behind = edge_in_pixels(heights.take(cells.at) - cells.depths, blur.take(cells.side))
        for drawing, part in zip(drawings, behind, strict=True):
            drawing.ravel()[cells.at] -= cells.white * part
    return drawings


def _of_tags(changes: Singles) -> tuple[Floats, Floats, Floats]:
    """Put the normal equations of sides, of changes (4 n, 9, m), together to tags': (n, 18, 18) and (n, 18).

    Gives the sums (n,) of what is left in squares, too.
    """
    own, left = changes[:, :-1], changes[:, -1]
    # numpy takes several times as long for a product of a side's own rows with themselves.
    of_sides = (own @ changes.swapaxes(1, 2)).reshape(-1, *OF_SIDES.shape, changes.shape[1])
    to_tags = OF_TAGS.swapaxes(1, 2) @ of_sides
    normal = (to_tags[..., :-1] @ OF_TAGS).sum(axis=1, dtype=np.float64)
    right = to_tags[..., -1].sum(axis=1, dtype=np.float64)
    # A tag without contrast, or all clipped, has no shape to speak of; it must not keep the others from theirs.
    diagonal = np.einsum("nii->ni", normal)
    diagonal *= 1 + RIDGE
    diagonal += 1e-9
    squares = np.einsum("sm,sm->s", left, left).reshape(-1, len(OF_SIDES)).sum(axis=1)
    return normal, right, np.asarray(squares, dtype=np.float64)


def _step(inverse: Floats, right: Floats, blurs: Floats) -> Floats:
    """Solve the normal equations, and shorten steps that are too long for them to hold, or blurs (n, 2) to shrink."""
    step = (inverse @ right[..., None])[..., 0]
    too_long = np.abs(step[:, HEIGHTS]).max(axis=1) / LONGEST_STEP
    stretched = np.abs(step[:, BLURS]).max(axis=1) / LONGEST_STRETCH
    step /= np.maximum(np.maximum(too_long, stretched), 1)[:, None]
    step[:, BLURS] = np.maximum(step[:, BLURS], np.log(LEAST_BLUR) - blurs)
    return np.asarray(step)


def _in_blurs(step: Floats, blurs: Floats) -> Floats:
    """Say how long steps (n, 18) are: of the sides over the blurs (n, 2), or of the blurs themselves."""
    moved = np.abs(step[:, HEIGHTS]).max(axis=1) / np.exp(blurs).min(axis=1)
    return np.asarray(np.maximum(moved, np.abs(step[:, BLURS]).max(axis=1)))


def _bowed_alike(fitted: Floats, covariances: Floats) -> tuple[Floats, Floats]:
    """Draw all sides' bows to 0, as far as all of them together say that they are 0.

    Short sides hardly tell how they are bowed, and without knowing it where they end.
    """
    bows, of_bows = fitted[:, BOWS], covariances[:, BOWS, BOWS]
    of_noise = np.median(np.diagonal(of_bows, axis1=1, axis2=2))
    spread = max(float(np.median(np.square(bows)) / MEDIAN_SQUARE - of_noise), SURELY_BOWED**2)
    gain = covariances[:, :, BOWS] @ np.linalg.inv(of_bows + spread * np.eye(4))
    return fitted - (gain @ bows[..., None])[..., 0], covariances - gain @ covariances[:, BOWS]
