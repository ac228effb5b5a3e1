"""Tables of files, positions of axes, and numbers with limits, as pydantic models.

Only modules that read or write files load this, never `import olp`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError


def refusal(sentence: str) -> PydanticCustomError:
    """An error whose sentence is complete: it is shown after the key path as it stands."""
    return PydanticCustomError("olp", "{sentence}", {"sentence": sentence})


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise refusal(
            f"= [{pair[0]:g}, {pair[1]:g}] mm is empty; expected [min, max] in mm with min below max"
        )
    return pair


Interval = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_ascending)]
Triple = Annotated[tuple[float, float, float], Field(strict=False)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """A TOML table. `not_built` holds keys of the contract that this version cannot honour, and why."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    not_built: ClassVar[dict[str, str]] = {}


class Position(Table):
    """Axis positions in mm; the position of an axis that is left out is not known."""

    X: float | None = Field(default=None, description="a position of axis X in mm")
    Y: float | None = Field(default=None, description="a position of axis Y in mm")
    Z: float | None = Field(default=None, description="a position of axis Z in mm")

    @property
    def values(self) -> tuple[float | None, float | None, float | None]:
        return (self.X, self.Y, self.Z)

    @property
    def complete(self) -> tuple[float, float, float] | None:
        """The three positions, None where one is missing."""
        x, y, z = self.values
        return None if x is None or y is None or z is None else (x, y, z)


def is_table(annotation: Any) -> bool:
    """Whether an annotation is one of the table models."""
    return isinstance(annotation, type) and issubclass(annotation, Table)
