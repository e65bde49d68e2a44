"""A rule over many things is one test that names everything that breaks it, in place of a case for each thing."""

import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import pytest

Value = TypeVar("Value")


def each(
    values: Iterable[Value] | Callable[[], Iterable[Value]], named: Callable[[Value], str] = str
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Calls a check with every value as its first argument, and fails with the list of what is wrong.

    Further arguments are fixtures. Every value has a folder of its own in ``tmp_path`` and patches of its own. A value that
    the check skips is passed over; if all are skipped, so is the test. Values that take long to find are a function, called
    by the test: each process that collects the tests would find them else.
    """
    fixed = None if callable(values) else list(values)

    def made(check: Callable[..., None]) -> Callable[..., None]:
        def test(**fixtures: Any) -> None:
            listed = fixed if fixed is not None else list(values())  # pyright: ignore[reportCallIssue]
            wrong, errors, skipped = list[str](), list[BaseException](), list[BaseException]()
            for number, value in enumerate(listed):
                try:
                    with pytest.MonkeyPatch.context() as patches:
                        check(value, **own(fixtures, number, patches))
                except pytest.skip.Exception as reason:
                    skipped.append(reason)
                except (Exception, pytest.fail.Exception) as error:  # noqa: BLE001  # whatever a value ends in is its result
                    wrong.append(f"{named(value)}: {type(error).__name__}: {error}")
                    errors.append(error)
            if wrong:
                raise AssertionError(f"{len(wrong)} of {len(listed)} wrong\n" + "\n".join(wrong)) from errors[0]
            assert listed, "nothing to check"
            if len(skipped) == len(listed):
                raise skipped[0]

        test.__name__, test.__qualname__, test.__doc__ = check.__name__, check.__qualname__, check.__doc__
        test.__module__ = check.__module__
        parameters = list(inspect.signature(check).parameters.values())[1:]
        test.__signature__ = inspect.Signature(  # pyright: ignore[reportFunctionMemberAccess]
            [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in parameters]
        )
        return test

    return made


def own(fixtures: dict[str, Any], number: int, patches: pytest.MonkeyPatch) -> dict[str, Any]:
    """The fixtures of one value: a folder and patches that the next one does not see."""
    mine = dict(fixtures)
    if "tmp_path" in mine:
        mine["tmp_path"] = Path(mine["tmp_path"]) / str(number)
        mine["tmp_path"].mkdir()
    if "monkeypatch" in mine:
        mine["monkeypatch"] = patches
    return mine
