"""The keys of deviation maps and of errors by load."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from olp.core.schema import Position, Positive, Table, Text, Triple, refusal


class MapTable(Table):
    file: Text = Field(
        description="the path of a CSV file with the columns X_mm, Y_mm, Z_mm, DX_um, DY_um, DZ_um, a row "
        "a node; and sigma_DX_um, sigma_DY_um, sigma_DZ_um where uncertainties are stated"
    )
    kind: Literal["residual", "total"] = Field(
        description='"residual" (what the curves leave; adds to them) or "total" (all that was measured; no '
        "curves, squareness or cyclic errors beside it)"
    )
    tool_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the tool vector while measuring, [X, Y, Z] in mm"
    )
    interpolation: Literal["linear", "cubic"] = Field(default="linear", description='"linear" or "cubic"')
    holds_along: list[Literal["X", "Y", "Z"]] = Field(
        default=[],
        description='the axes along which the map has one level and holds everywhere, such as ["Z"]',
    )


class _OnLine(Table):
    """Where the other axes stood, and the tool vector."""

    line_mm: Position = Field(
        default_factory=Position,
        description="where the other axes stood, such as { Y = 0.0, Z = 0.0 } in mm; the datum if left out",
    )
    tool_mm: Triple = Field(default=(0.0, 0.0, 0.0), description="the tool vector then, [X, Y, Z] in mm")


class ComplianceTable(_OnLine):
    file: Text = Field(
        description="the path of a CSV file with columns such as X_mm, EZX_um_kg, EBX_urad_kg; up to three "
        "columns of axis positions"
    )
    reference: Literal["functional-point", "table"] = Field(
        default="functional-point",
        description='"functional-point" (measured at the tip on its line) or "table" (the reflector stayed '
        "fixed on a moving table)",
    )
    interpolation: Literal["linear", "cubic"] = Field(default="cubic", description='"linear" or "cubic"')


class BeamTable(_OnLine):
    axis: Literal["X", "Y", "Z"] = Field(description="the axis that moves the load along the beam")
    support: Literal["simple", "fixed", "cantilever"] = Field(
        description='"simple" (rests on both ends), "fixed" (clamped at both ends), or "cantilever" '
        "(clamped at "
        "the first end of span_mm; a ram that comes out farther)"
    )
    span_mm: Annotated[tuple[float, float], Field(strict=False)] = Field(
        description="the axis positions at which the load stands over the two supports, [first, second] in mm"
    )
    youngs_modulus_GPa: Positive = Field(description="Young's modulus of the beam, in GPa: 210 for steel")
    second_moment_mm4: Positive | None = Field(
        default=None, description="the second moment of area of the section, in mm4"
    )
    section_mm: Annotated[tuple[Positive, Positive, Positive], Field(strict=False)] | None = Field(
        default=None,
        validate_default=True,
        description="a rectangular tube instead: [width, height in the direction of bending, wall] in mm",
    )
    direction: Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"] = Field(
        default="-Z", description='where the weight pulls, "-Z" if left out'
    )

    @field_validator("span_mm")
    @classmethod
    def _not_empty(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] == value[1]:
            raise refusal("= is empty; expected the axis positions of two different ends, in mm")
        return value

    @field_validator("section_mm")
    @classmethod
    def _one_of_two(
        cls, value: tuple[float, float, float] | None, info: ValidationInfo
    ) -> tuple[float, float, float] | None:
        if "second_moment_mm4" not in info.data:
            return value
        if (value is None) == (info.data["second_moment_mm4"] is None):
            raise refusal("or second_moment_mm4: expected exactly one of the two")
        if value is not None and 2.0 * value[2] > min(value[:2]):
            raise refusal(f"has a wall of {value[2]:g} mm; expected at most half of width and height")
        return value

    @field_validator("direction")
    @classmethod
    def _across(cls, value: str, info: ValidationInfo) -> str:
        if value[1] == info.data.get("axis"):
            raise refusal(f'= "{value}" is along the beam; expected a direction across it')
        return value
