"""Every key of every file that a user writes has a meaning, and the reference page has every key."""

import tomllib
from importlib.resources import files

import pytest
from each import each
from in_process import document_of, given, refused

from pipelines.cli.plan_keys import SUBJECTS
from pipelines.demo.scenes import SCENES
from schemas.key_list import FILES, keys_of
from stations.plant.faults.catalogue import kinds


@each(FILES)
def test_every_key_has_a_meaning_that_is_a_sentence(name: str) -> None:
    keys = keys_of(FILES[name])
    assert len(keys) > 8
    assert [f"{key.table}.{key.name}" for key in keys if not key.meaning.endswith(".")] == []
    assert [f"{key.table}.{key.name}" for key in keys if not key.value] == []


def test_no_meaning_is_left_of_a_key_that_does_not_exist() -> None:
    texts = tomllib.loads(files("schemas").joinpath("key_texts.toml").read_text("utf-8"))
    used = {key.meaning for model in FILES.values() for key in keys_of(model)}
    stray = [f"{table}.{name}" for table, own in texts.items() for name, text in own.items() if text not in used]
    assert stray == []


@pytest.mark.parametrize(("name", "sample"), [("recipe", "production.toml"), ("limits", "limits-consumer.toml")])
def test_every_key_of_a_built_in_file_is_listed(name: str, sample: str) -> None:
    content = tomllib.loads(files("schemas").joinpath("samples", sample).read_text("utf-8"))
    assert set(content) <= {key.name for key in keys_of(FILES[name]) if not key.table}


def test_every_fault_is_listed_with_its_figures_and_every_hidden_effect_of_the_demo() -> None:
    rows = {row["fault"]: row for row in SUBJECTS["fault"][1]()}
    assert set(rows) == set(kinds())
    for name, kind in kinds().items():
        assert rows[name]["meaning"], name
        assert all(f"{figure}=" in rows[name]["keys"] for figure in kind.figures)
    assert {row["hidden effect"] for row in SUBJECTS["demo"][1]()} == {scene.kind for scene in SCENES}


@each(["", *SUBJECTS])
def test_the_command_prints_a_list_within_80_columns_and_refuses_an_unknown_one(subject: str) -> None:
    words = ("plan", "keys", *([subject] if subject else []))
    document = document_of(*words)
    assert document["subject"] == subject
    assert document["rows"]
    assert max(map(len, given(*words, columns=80)[1].splitlines())) <= 80
    assert f"did you mean {subject or 'recipe'}" in refused("plan", "keys", f"{subject or 'recipe'}s")
