"""Names the test that leaves a socket, a file, an event loop or a process open: a plug-in of the tests' configuration.

Such an object is found when the collector of garbage meets it, which without this is in the middle of some later test.
"""

import gc
import sys
import warnings
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import pytest


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """Collects after the fixtures of a test have ended, and fails the test for what is found open."""
    yield
    # the values of its fixtures, and the frames of a failure, would otherwise be found after a later test
    if isinstance(item, pytest.Function):
        item.funcargs.clear()
    for name in ("last_exc", "last_type", "last_value", "last_traceback"):
        if hasattr(sys, name):
            delattr(sys, name)
    with resource_warnings() as found:
        gc.collect()
    last = nextitem is None or nextitem.path != item.path
    if last:
        # what survives a module and its fixtures is imports and kept values: later searches for garbage pass it over
        gc.freeze()
    if found:
        who = f"{item.name}, or a fixture that ended with it," if last else item.name
        pytest.fail(f"{who} leaves open:\n  " + "\n  ".join(found), pytrace=False)


@contextmanager
def resource_warnings() -> Iterator[list[str]]:
    """What the collector finds unclosed in the block; other exceptions of destructors go where they went before."""
    found, before = list[str](), sys.unraisablehook

    def hook(unraisable: "sys.UnraisableHookArgs") -> None:
        if unraisable.exc_type is not None and issubclass(unraisable.exc_type, ResourceWarning):
            found.append(str(unraisable.exc_value))
        else:
            before(unraisable)

    sys.unraisablehook = hook
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ResourceWarning)
            yield found
    finally:
        sys.unraisablehook = before
