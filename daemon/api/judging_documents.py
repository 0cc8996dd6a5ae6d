"""The answers about how good a calibration is, as OpenAPI describes them."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BaseModel, Field

from calib import Calibration, paper
from calib.paper_tables import PredictionTable, TravelTable, prediction_tables, travel_tables
from calib.stated_parameters import stated_parameters
from calib.stated_quality import ViewQuality

if TYPE_CHECKING:  # they bring the solver
    from calib.residual_map import ViewMisses
    from calib.verification import Verification

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
FINE = 4
"""Decimals of a pixel that are sent."""


class ViewResiduals(BaseModel):
    """A view's points, each with what it misses by."""

    number: int = Field(description="The view's number in its run.")
    joint: str | None
    use: Literal["fit", "verify", "none"] = Field(description="What the calibration used it for.")
    set_aside: bool
    rms_px: float
    ids: list[int] = Field(description="Which of the target's points.")
    pixels: list[Pair] = Field(description="Where each is seen: x, y.")
    residuals: list[Pair] = Field(
        description="Where the calibration predicts it less where it is seen: x, y."
    )

    @classmethod
    def of(cls, misses: "ViewMisses", quality: ViewQuality | None) -> Self:
        """Describe a view."""
        return cls(
            number=misses.view,
            joint=None if quality is None else quality.joint,
            use="none" if quality is None else quality.use,
            set_aside=quality is not None and quality.set_aside,
            rms_px=misses.rms_px,
            ids=misses.ids.tolist(),
            pixels=misses.pixels.round(FINE).tolist(),
            residuals=misses.misses.round(FINE).tolist(),
        )


class ResidualsDocument(BaseModel):
    """What every point of every view is off by."""

    calibration_id: str
    run_id: str | None
    camera: str
    width: int | None = Field(description="The pictures' width (px).")
    height: int | None
    views: list[ViewResiduals]


class TravelRowDocument(BaseModel):
    """A travel, in m or rad."""

    reading: float = Field(description="The joint's, at the end of the travel, in its own unit.")
    predicted: float = Field(description="By the calibration.")
    std: float | None = Field(description="How sure it is of that; null where it does not know.")
    measured: float = Field(description="Between the camera poses of the two pictures.")
    error: float = Field(description="Of the prediction, to what was measured.")
    percent: float | None
    encoder: float | None = Field(description="By the encoder's own unit; null where that is not trusted.")
    encoder_error: float | None
    encoder_percent: float | None


class PaperTravelRow(BaseModel):
    """A row of the paper's own table, in m or rad."""

    travel: float
    error: float
    percent: float


class TravelTableDocument(BaseModel):
    """Table 1, of a straight joint, or 2, of a turning one: predicted against measured travel."""

    number: Literal[1, 2]
    joint: str
    kind: Literal["prismatic", "revolute"]
    start: list[float] = Field(description="The readings from which the travel is counted.")
    rows: list[TravelRowDocument]
    paper: list[PaperTravelRow] = Field(description="What the paper reports of its own rig.")

    @classmethod
    def of(cls, table: TravelTable) -> Self:
        """Describe a table."""
        theirs = (
            (paper.TRANSLATION_M, paper.TRANSLATION_ERROR_M, paper.TRANSLATION_PERCENT)
            if table.number == 1
            else (paper.ROTATION_RAD, paper.ROTATION_ERROR_RAD, paper.ROTATION_PERCENT)
        )
        rows = [
            PaperTravelRow(travel=travel, error=error, percent=percent)
            for travel, error, percent in zip(*theirs, strict=True)
        ]
        return cls(**asdict(table), paper=rows)


class PredictionRowDocument(BaseModel):
    """A view's points, predicted against measured."""

    view: int = Field(description="Its number in the run.")
    readings: list[float]
    points: int
    mean_px: float = Field(description="How far they are from where they are predicted, on the mean.")
    std_px: float | None = Field(description="How sure the calibration is of where it predicts them (rms).")


class PredictionTableDocument(BaseModel):
    """Table 3, of a straight joint, or 4, of a turning one: predicted against measured image points."""

    number: Literal[3, 4]
    joint: str
    kind: Literal["prismatic", "revolute"]
    rows: list[PredictionRowDocument]
    paper: list[float] = Field(description="The mean errors (px) that the paper reports, at five positions.")

    @classmethod
    def of(cls, table: PredictionTable) -> Self:
        """Describe a table."""
        theirs = (
            paper.PREDICTION_AFTER_TRANSLATION_PX if table.number == 3 else paper.PREDICTION_AFTER_ROTATION_PX
        )
        return cls(**asdict(table), paper=list(theirs))


class SpreadDocument(BaseModel):
    """The mean and the largest of some errors."""

    mean: float
    max: float


class VerifiedDocument(BaseModel):
    """What all held-out views say."""

    views: int
    mean_px: float | None
    rms_px: float | None
    max_px: float | None
    position_m: SpreadDocument | None
    rotation_rad: SpreadDocument | None


class ParameterDocument(BaseModel):
    """A parameter."""

    name: str = Field(examples=["pan.scale"])
    value: float
    std: float | None = Field(description="Its standard deviation; null where it is not known.")
    unit: str = Field(description="Empty for a number without one.", examples=["rad/deg"])
    frame: Literal["none", "world"] = Field(
        description="`world` for what changes when the target is moved, though the rig has not changed."
    )


class TablesDocument(BaseModel):
    """The paper's tables 1 to 4 for this rig, and all parameters."""

    calibration_id: str
    verified: VerifiedDocument | None = Field(
        description="By which the tables are; null where no view was held out, and then there are none."
    )
    travel: list[TravelTableDocument] = Field(description="Tables 1 and 2, one for each joint and start.")
    prediction: list[PredictionTableDocument] = Field(description="Tables 3 and 4, one for each joint.")
    parameters: list[ParameterDocument]

    @classmethod
    def of(cls, calibration_id: str, calibration: Calibration, verification: "Verification | None") -> Self:
        """Describe a calibration by what its run's held-out views said of it."""
        travel = [] if verification is None else travel_tables(verification, calibration)
        prediction = [] if verification is None else prediction_tables(verification, calibration)
        return cls(
            calibration_id=calibration_id,
            verified=None if verification is None else VerifiedDocument.model_validate(asdict(verification)),
            travel=[TravelTableDocument.of(table) for table in travel],
            prediction=[PredictionTableDocument.of(table) for table in prediction],
            parameters=[ParameterDocument(**asdict(one)) for one in stated_parameters(calibration)],
        )
