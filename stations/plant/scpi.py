"""Common part of the simulated devices that speak SCPI: the last error, and orders of numbers."""

DONE = "1"
OUT_OF_RANGE, UNDEFINED = -222, -113  # SCPI-99, 21.8.10 and 21.8.9
TEXTS = {0: "No error", OUT_OF_RANGE: "Data out of range", UNDEFINED: "Undefined header"}


class ScpiDevice:
    """A device whose orders are done at once; an error is told when it is asked for, and forgotten."""

    def __init__(self) -> None:
        self.error = 0

    def told_error(self) -> tuple[str, bool]:
        """The answer to the question for errors, and whether it changed anything."""
        code, self.error = self.error, 0
        return f'{code},"{TEXTS[code]}"', code != 0

    def ordered(self, value: str, low: float, high: float) -> float | None:
        """The number of an order; None, with an error, for what is no number or outside its range."""
        try:
            number = float(value)
        except ValueError:
            self.error = UNDEFINED
            return None
        if not low <= number <= high:
            self.error = OUT_OF_RANGE
            return None
        return number
