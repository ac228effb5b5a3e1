"""Tools as stacked frusta, from the tool table."""

from __future__ import annotations

from olp.core.machine import Tool
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class Part:
    """A frustum about the tool's axis: heights above the tip and radii, lower end first; whether it cuts."""

    name: str
    level_mm: tuple[float, float]
    radius_mm: tuple[float, float]
    cuts: bool

    def shrunk(self, by_mm: float) -> Part:
        """The same, smaller by `by_mm` at its side and at its lower end, down to size 0."""
        low, high = self.level_mm
        a, b = self.radius_mm
        return Part(
            self.name, (min(low + by_mm, high), high), (max(a - by_mm, 0.0), max(b - by_mm, 0.0)), self.cuts
        )


def parts_of(tool: Tool) -> tuple[Part, ...]:
    """The tool from its tip to the gauge point: the cutting part, the shank of the same radius, the holder.
    Empty where the table gives no length."""
    tool_vector = tool.tool_vector_mm
    if tool_vector is None or tool_vector[2] >= 0.0:
        return ()
    length = -tool_vector[2]
    free = length - sum(part.length_mm for part in tool.holder)
    cuts = min(tool.cutting_length_mm or free, free)
    radius = tool.radius_mm or 0.0
    parts = [Part("tool", (0.0, cuts), (radius, radius), True)]
    if cuts < free:
        parts.append(Part("shank", (cuts, free), (radius, radius), False))
    level = free
    for holder in tool.holder:
        ends = (level, level + holder.length_mm)
        parts.append(Part("holder", ends, (holder.radius_mm, holder.top_radius_mm), False))
        level += holder.length_mm
    return tuple(parts)
