"""The garbage collector is as it was after a block of imports, also after one that fails."""

import gc

import pytest

from pipelines.orchestrator.server import quick_imports


@pytest.fixture(autouse=True)
def collector():
    """The collector of the process of the tests, put back."""
    before = gc.isenabled()
    yield
    gc.unfreeze()
    gc.enable() if before else gc.disable()


def test_nothing_is_searched_in_the_block_and_what_it_made_is_not_searched_later() -> None:
    gc.enable()
    before = gc.get_freeze_count()
    with quick_imports():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() > before


def test_a_failed_import_leaves_the_collector_on() -> None:
    gc.enable()
    with pytest.raises(ModuleNotFoundError), quick_imports():
        __import__("no_such_module_of_tumbleline")
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    with quick_imports():
        pass
    assert not gc.isenabled()
