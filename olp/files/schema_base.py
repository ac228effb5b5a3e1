"""What every table of a file is, and positions of axes."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field


class Table(BaseModel):
    """A TOML table. `not_built` holds keys of the contract that this version cannot honour, and why."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    not_built: ClassVar[dict[str, str]] = {}


class Position(Table):
    """Axis positions in mm; an axis that is not named is not known."""

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
