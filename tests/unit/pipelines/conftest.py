"""A run of the small recipe that the tests of these rooms only read, and commands on the archive of a test's run."""

from collections.abc import Callable, Iterator

import pytest
from capture_double import small_run
from typer.testing import CliRunner, Result

from pipelines.archive import Run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def no_verdict() -> Iterator[None]:
    """Runs without a verdict on their model, which takes longest, for files that do not look at it.

    Not for runs that are kept for the tests of other files, as ``small_run`` makes them.
    """
    from pipelines.stages import judge

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judge, "_judged", lambda *_: (judge._not_judged("it was left out"), None))
        yield


@pytest.fixture
def typed(run: Run) -> Callable[..., Result]:
    """A command on the archive of the run that the test has."""
    from pipelines.cli import app

    return lambda *words: CliRunner().invoke(app, [*words, "--archive", str(run.archive.root)])
