"""What the tests of trouble have in common: the verdict on a lot is made once."""

from collections.abc import Iterator

import pytest
from judged_once import judged_once


@pytest.fixture(scope="package", autouse=True)
def one_judgement_of_a_lot() -> Iterator[None]:
    with judged_once():
        yield
