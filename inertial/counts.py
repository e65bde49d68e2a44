"""Numbers with their noun in reasons, in the singular or the plural."""


def number_of(number: int, noun: str, plural: str = "") -> str:
    """``1 dwell``, ``2 dwells``; ``plural`` where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def degrees_of_freedom(number: int) -> str:
    """``1 degree of freedom``, ``2 degrees of freedom``."""
    return number_of(number, "degree of freedom", "degrees of freedom")
