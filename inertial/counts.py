"""Numbers with their noun in reasons, in the singular or the plural."""


def number_of(number: int, noun: str, plural: str = "") -> str:
    """``1 dwell``, ``2 dwells``; ``plural`` where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def size_text(size: int) -> str:
    """A number of bytes: ``512 bytes``, ``18.7 MB`` (10⁶ bytes), ``3.20 GB``."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.{max(0, 2 - len(str(int(size / factor))) + 1)}f} {unit}"
    return number_of(size, "byte")


def degrees_of_freedom(number: int) -> str:
    """``1 degree of freedom``, ``2 degrees of freedom``."""
    return number_of(number, "degree of freedom", "degrees of freedom")
