"""A rule over many things names everything that breaks it, and tries the rest all the same."""

import pytest
from each import each


def test_every_value_is_tried_and_all_that_are_wrong_are_named() -> None:
    seen = []

    @each([1, 2, 3, 4])
    def rule(value: int) -> None:
        seen.append(value)
        assert value != 2
        if value == 4:
            raise KeyError("gone")

    with pytest.raises(AssertionError, match=r"2 of 4 wrong\n2: AssertionError(.|\n)*4: KeyError: 'gone'"):
        rule()
    assert seen == [1, 2, 3, 4]


def test_a_value_that_is_skipped_is_passed_over_and_no_value_at_all_is_wrong() -> None:
    def rule(value: int) -> None:
        if value:
            pytest.skip("not here")

    each([0, 1])(rule)()
    with pytest.raises(pytest.skip.Exception):
        each([1, 1])(rule)()
    with pytest.raises(AssertionError, match="nothing to check"):
        each([])(rule)()


@each(["first", "second"])
def test_every_value_has_a_folder_and_patches_of_its_own(value: str, tmp_path, monkeypatch) -> None:
    import os

    assert list(tmp_path.iterdir()) == []
    assert "TUMBLELINE_EACH" not in os.environ
    (tmp_path / value).touch()
    monkeypatch.setenv("TUMBLELINE_EACH", value)
