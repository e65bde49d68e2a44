"""Work on partitions, in a module that a process of its own has loaded at once."""

import os

from schemas.errors import DataRejected


def square(value: int) -> int:
    return value * value


def square_and_process(value: int) -> tuple[int, int]:
    return value * value, os.getpid()


def refuse(value: int) -> int:
    raise DataRejected(f"part {value}: no dwell, one is needed; measure it")
