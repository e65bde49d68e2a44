"""The JSON documents of references: keys of files and names of options."""

from __future__ import annotations

from typing import Annotated

from typing_extensions import TypedDict


class KeysDocument(TypedDict):
    """``keys [SUBJECT] --json``: the keys of a file, or the names that an option takes."""

    subject: Annotated[str, "empty: the list of subjects"]
    rows: Annotated[list[dict[str, str]], "one for each key or name, by the heads of the printed table"]
