"""The garbage collector is as it was after a block of imports, also after one that fails."""

import gc

import pytest

from pipelines.orchestrator.quick_imports import quick_imports


@pytest.fixture(autouse=True)
def collector():
    """The collector of the process of the tests, put back."""
    before = gc.isenabled()
    yield
    gc.unfreeze()
    gc.enable() if before else gc.disable()


def test_nothing_is_searched_in_the_block_or_later_of_what_it_made_and_the_collector_is_as_before() -> None:
    gc.enable()
    before = gc.get_freeze_count()
    with quick_imports():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() > before
    with pytest.raises(ModuleNotFoundError), quick_imports():
        __import__("no_such_module_of_tumbleline")
    assert gc.isenabled()
    gc.disable()
    with quick_imports():
        pass
    assert not gc.isenabled()
