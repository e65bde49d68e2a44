"""The profile with corrected rows, as a separate file beside the original; comments of the original stay."""

from typing import Any

import tomlkit

from schemas.foreign import shown
from schemas.profile import Profile
from schemas.toml_files import parse_as
from stations.bringup.person import Findings
from stations.profile_files import profile_text

SUFFIX = "_corrected"


def corrected_name(profile: Profile) -> str:
    """The name of the corrected profile."""
    return profile.name.removesuffix(SUFFIX) + SUFFIX


def corrected_text(profile: Profile, findings: Findings, made: str) -> str:
    """The TOML text of the profile with the changes of a bring-up; empty where nothing is to be changed.

    Raises RecipeInvalid: the changes contradict each other, such as two registers at one address.
    """
    if not findings.changes:
        return ""
    document: Any = tomlkit.parse(profile_text(profile.name))
    document["name"] = corrected_name(profile)
    for name, changed in findings.changes.items():
        row = document if not name else next(r for r in document["registers"] if r["name"] == name)
        for key, value in changed.items():
            before = row.get(key)
            row[key] = value
            row[key].comment(
                f"corrected by a bring-up on {made[:10]}; before: {'default' if before is None else shown(before, 30)}"
            )
        if "word_order" in changed and not name:
            for register in document["registers"]:
                register.pop("word_order", None)
    text = tomlkit.dumps(document)
    parse_as(Profile, text, corrected_name(profile))
    return text
