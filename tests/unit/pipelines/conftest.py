"""A run of the small recipe that the tests of these rooms only read."""

import pytest
from capture_double import small_run

from pipelines.archive import Run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("run"))
