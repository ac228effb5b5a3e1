"""How much work an input may cause: bounded by its bytes, so that no small file takes long."""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.progress import Progress, silent
from olp.core.values import dataclass

#: Bytes of blocks that the run of a short parametric program may visit, and for each byte of a longer one.
RUN_BYTES = 12_000_000
RUN_PER_BYTE = 80
#: So often a run tells how far it is.
_TOLD = 500
_RUN_TOO_LONG = (
    "the run visits more than {limit} bytes of blocks; correct an endless loop, or divide the program"
)


@dataclass(slots=True)
class Budget:
    """An amount of work that may be spent once. `message` is raised where it is exceeded, with {limit} put
    in. `tell` is told what share of it is spent."""

    limit: int
    message: str
    tell: Progress = silent
    spent: int = 0
    told: int = 0

    @classmethod
    def of(cls, size: int, *, least: int, per_byte: float, message: str, tell: Progress = silent) -> Budget:
        """For an input of `size` bytes: `least`, or so much for each byte where that is more."""
        return cls(max(least, int(per_byte * size)), message, tell)

    @classmethod
    def of_run(
        cls, size: int, limit: int = RUN_BYTES, message: str = _RUN_TOO_LONG, tell: Progress = silent
    ) -> Budget:
        """For what a parametric program of `size` bytes makes: `limit`, or `RUN_PER_BYTE` where that is
        more."""
        return cls.of(size, least=limit, per_byte=RUN_PER_BYTE, message=message, tell=tell)

    @property
    def left(self) -> int:
        """What may still be spent."""
        return self.limit - self.spent

    def spend(self, amount: int) -> None:
        """Take an amount. Raises ProgramError, without a line, where the budget is exceeded."""
        self.spent += amount
        if self.spent > self.limit:
            raise ProgramError(self.message.format(limit=self.limit), code="OLP543")
        if self.spent - self.told > self.limit // _TOLD:
            self.told = self.spent
            self.tell("unroll", self.spent / self.limit)
