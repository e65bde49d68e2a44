"""Versions of model files: extended, read back, walked through."""

import re
from datetime import UTC, datetime

import pytest
from each import each

from inertial import effects
from pipelines.diagnosis.confirmation import evolution
from pipelines.jobs.model_files import ModelStep, chosen_effects, extended, new_model, read_model, versions
from schemas.errors import RecipeInvalid, WrongUse
from schemas.model import ModelFile
from schemas.toml_files import parse_as

NOW = datetime(2026, 5, 4, 12, 0, tzinfo=UTC)
COMMENTED = """\
# Of line 3.
[model]
name = "line"
version = 1
effects = ["bias", "scale"]  # to begin with

[[formula]]
id = "wet"
columns = ["humidity_pct"]
why = "Moisture."
"""


@pytest.fixture(autouse=True)
def forgotten():
    with effects.additions_forgotten():
        yield


def step(effect, **more):
    return ModelStep(effect, "A. Tester", NOW, "the residuals say so", **more)


def test_the_next_version_keeps_comments_and_says_who_when_and_why_and_takes_formulas_and_covariates(tmp_path):
    text, model = extended(COMMENTED, step("third_order", run="run-7"), "model line.toml")
    assert "# Of line 3." in text
    assert "# to begin with" in text
    assert (model.model.version, model.model.effects) == (2, ["bias", "scale", "third_order"])
    assert model.change[-1].model_dump(include={"effect", "by", "at", "why", "run"}) == {
        "effect": "third_order", "by": "A. Tester", "at": NOW, "why": "the residuals say so", "run": "run-7",
    }  # fmt: skip
    text, _ = extended(COMMENTED, step("wet"), "model line.toml")
    _, model = extended(text, step("covariate:pressure_hPa"), "model line.toml")
    assert (model.model.version, model.model.effects[-2:]) == (3, ["wet", "covariate:pressure_hPa"])
    for effect, said in (("third_ordr", "did you mean third_order"), ("scale", "'scale' is in version 1 already")):
        with pytest.raises(RecipeInvalid, match=said):
            extended(COMMENTED, step(effect), "model line.toml")
    with pytest.raises(WrongUse, match="leave one out"):
        chosen_effects("bias", tmp_path / "m.toml", "compare")


VERSIONS = """
[model]
name = "line"
version = 2
effects = ["bias", "scale"]
[[change]]
version = 1
by = "A. Tester"
at = 2026-01-01
why = "start"
[[change]]
version = 2
effect = "scale"
by = "A. Tester"
at = 2026-02-01
why = "residuals follow the force"
"""


@each([
    (COMMENTED, '"humidity_pct"', '"sqr(humidity_pct)"', "formula wet: unknown function 'sqr'; did you mean sqrt"),
    (COMMENTED, 'id = "wet"', 'id = "third_order"', "the catalogue has an effect with this id"),
    (COMMENTED, 'id = "wet"', 'id = "Wet one"', "formula.id', number 1"),
    (COMMENTED, 'columns = ["humidity_pct"]', "columns = []", "formula.columns', number 1"),
    (VERSIONS, "version = 2\neffects", "version = 3\neffects", "every version needs its"),
    (VERSIONS, '["bias", "scale"]', '["bias", "bias"]', "bias is there twice"),
    (VERSIONS, 'why = "start"', 'wy = "start"', "did you mean why"),
    (VERSIONS, "version = 1\n", "version = 2\n", "do not rise"),
])  # fmt: skip
def test_refuses_a_file_with_a_slip(row, tmp_path):
    content, old, new, message = row
    path = tmp_path / "line.toml"
    path.write_text(content, encoding="utf-8")
    with effects.additions_forgotten():
        assert read_model(path).model.effects == ["bias", "scale"]
    path.write_text(content.replace(old, new), encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=message):
        read_model(path)
    with pytest.raises(RecipeInvalid, match=r"none\.toml cannot be read"):
        read_model(tmp_path / "none.toml")


def test_walks_through_the_versions(tmp_path):
    text = new_model(tmp_path / "My Model.toml", ["bias", "scale"], "A. Tester", NOW)
    for name in ("misalignment", "third_order"):
        text, model = extended(text, step(name), "model")
    assert model.model.name == "my-model"
    assert [(len(v.effects), v.added) for v in versions(model)] == [
        (2, ()),
        (3, ("misalignment",)),
        (4, ("third_order",)),
    ]
    gone = text.replace('    "third_order",\n', "").replace("version = 3\neffects", "version = 4\neffects")  # and out
    gone += '\n[[change]]\nversion = 4\neffect = "third_order"\nby = "B"\nat = 2026-06-01\nwhy = "not confirmed"\n'
    assert versions(parse_as(ModelFile, gone, "model"))[-1].removed == ("third_order",)


def errors(fit, heldout, fresh, progress=None):
    figures = {"rms_ug": fit, "heldout_rms_ug": heldout, "fresh_rms_ug": fresh, "floor_ug": 5.0}
    return {**figures, "progress": progress, "warnings": []}


def judged(confirmed, part, error, fall, density=None):
    by = "fresh run" if part is not None else "dwells left out"
    return {
        "judged_by": by, "confirmed": confirmed, "part": part, "part_u": error, "fall_ug": fall, "fall_u_ug": 0.4,
        "log_density": density, "estimated_again": None, "reason": None, "rises": None,
    }  # fmt: skip


TOLD = {
    "confirmed: 0.98 ± 0.04": (5.1, judged(True, 0.98, 0.02, 10.4)),
    "refuted: -0.10 ± 0.20": (15.52, judged(False, -0.1, 0.1, -0.02)),
    "not decided.*measure another run": (15.4, judged(None, 0.5, 0.4, 0.1)),
    "not decided.*a fresh run of the same units decides": (None, judged(None, None, None, -0.1, density=-3.0)),
}


@each(TOLD)
def test_an_effect_is_judged_against_the_version_before_it_and_refuted_only_by_evidence_against_it(said):
    _, model = extended(COMMENTED, step("third_order"), "model")
    (fresh, verdict), asked = TOLD[said], []

    def compare(effects, before):
        asked.append((len(effects), before and len(before)))
        return errors(15.0, 16.0, fresh and 15.5) if before is None else errors(5.0, 5.2, fresh, verdict)

    rows = evolution(versions(model), compare)
    assert asked == [(2, None), (3, 2)]
    assert [row["confirmed"] for row in rows] == [None, verdict["confirmed"]]
    assert (rows[1]["fall_ug"], rows[1]["fall_u_ug"]) == (verdict["fall_ug"], 0.4)
    assert re.match(said, rows[1]["text"])
