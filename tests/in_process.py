"""A command in this process, answered as by a process of its own: the start of an interpreter costs seconds of imports."""

import contextlib
import io
import json
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any, Union

import pytest
from pydantic import TypeAdapter

from docs.documents_page import command_of, documents
from pipelines.cli import main
from schemas.errors import DONE, PART_FAILED

LIKE_RUN = {"fit": "run"}
"""Commands that also print the document of another one."""


def command(words: Sequence[str], columns: int = 200) -> subprocess.CompletedProcess[str]:
    """Status, standard output and standard error of ``tumbleline`` with these words; a pipe has no columns, which is 0."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["tumbleline", *words])
        patch.setenv("COLUMNS", str(columns)) if columns else patch.delenv("COLUMNS", raising=False)
        with pytest.raises(SystemExit) as left:
            main()
    return subprocess.CompletedProcess([*words], int(left.value.code or 0), out.getvalue(), err.getvalue())


def given(*words: object, columns: int = 200) -> tuple[int, str, str]:
    """The same as three values: status, standard output, standard error."""
    done = command([*map(str, words)], columns)
    return done.returncode, done.stdout, done.stderr


def text_of(*words: object, status: int | None = None) -> str:
    """What a command prints, one blank for several; it ends with a result, or with the status that is given."""
    found, out, err = given(*words)
    assert found in ({DONE, PART_FAILED} if status is None else {status}), (words, found, out, err)
    return " ".join(out.split())


def refused(*words: object, status: int = 2) -> str:
    """The one message of a command that refuses and prints no result."""
    found, out, err = given(*words)
    assert (found, out) == (status, ""), (words, found, out, err)
    assert "Traceback" not in err
    return " ".join(err.split())


def document_of(*words: object, status: int | None = None) -> dict[str, Any]:
    """The document that a command prints with ``--json``, held against the types of the documents of that command."""
    found, out, err = given(*words, "--json")
    assert found in ({DONE, PART_FAILED} if status is None else {status}), (words, found, out, err)
    return typed_document(str(words[0]), out)


def typed_document(name: str, text: str) -> dict[str, Any]:
    """A document of a command, which is of one of its types, with no key more and none less."""
    kind, document = _types(name), json.loads(text)
    found = kind.validate_json(text, strict=True, extra="forbid")
    assert kind.dump_python(found, mode="json") == document, f"{name}: a key with a default is missing"
    return document


@cache
def _types(name: str) -> TypeAdapter[dict[str, Any]]:
    names = {name, LIKE_RUN.get(name, name)}
    return TypeAdapter(Union[tuple(kind for kind in documents() if command_of(kind) in names)])  # noqa: UP007
