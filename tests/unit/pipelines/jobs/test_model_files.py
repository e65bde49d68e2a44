"""Versions of model files: extended, read back, walked through."""

from datetime import UTC, datetime

import pytest

from inertial import effects
from pipelines.diagnosis.model_history import evolution
from pipelines.jobs.model_files import ModelStep, chosen_effects, extended, new_model, read_model, versions
from schemas.errors import RecipeInvalid, WrongUse

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


def test_the_next_version_keeps_comments_and_says_who_when_and_why():
    text, model = extended(COMMENTED, step("third_order", run="run-7"), "model line.toml")
    assert "# Of line 3." in text
    assert "# to begin with" in text
    assert (model.model.version, model.model.effects) == (2, ["bias", "scale", "third_order"])
    last = model.change[-1]
    assert (last.version, last.effect, last.by, last.at, last.why, last.run) == (
        2, "third_order", "A. Tester", NOW, "the residuals say so", "run-7",
    )  # fmt: skip


def test_a_formula_and_a_covariate_can_be_added():
    text, _ = extended(COMMENTED, step("wet"), "model line.toml")
    _, model = extended(text, step("covariate:pressure_hPa"), "model line.toml")
    assert model.model.effects[-2:] == ["wet", "covariate:pressure_hPa"]
    assert model.model.version == 3


@pytest.mark.parametrize(
    ("effect", "message"), [("third_ordr", "did you mean third_order"), ("scale", "'scale' is in version 1 already")]
)
def test_refuses_what_is_unknown_or_there(effect, message):
    with pytest.raises(RecipeInvalid, match=message):
        extended(COMMENTED, step(effect), "model line.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"humidity_pct"', '"sqr(humidity_pct)"', "formula wet: unknown function 'sqr'; did you mean sqrt"),
        ('id = "wet"', 'id = "third_order"', "the catalogue has an effect with this id"),
        ('id = "wet"', 'id = "Wet one"', "formula.0.id"),
        ('columns = ["humidity_pct"]', "columns = []", "formula.0.columns"),
    ],
)
def test_refuses_a_formula_that_is_none(tmp_path, old, new, message):
    path = tmp_path / "line.toml"
    path.write_text(COMMENTED.replace(old, new), encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=message):
        read_model(path)


def test_walks_through_the_versions(tmp_path):
    text = new_model(tmp_path / "My Model.toml", ["bias", "scale"], "A. Tester", NOW)
    for name in ("misalignment", "third_order"):
        text, model = extended(text, step(name), "model")
    history = versions(model)
    assert model.model.name == "my-model"
    assert [v.effects for v in history] == [
        ("bias", "scale"), ("bias", "scale", "misalignment"), ("bias", "scale", "misalignment", "third_order"),
    ]  # fmt: skip
    assert [v.added for v in history] == [(), ("misalignment",), ("third_order",)]


def test_a_removed_effect_is_told_as_removed():
    text, model = extended(COMMENTED, step("third_order"), "model")
    gone = text.replace('"third_order"]', "]").replace("version = 2\neffects", "version = 3\neffects")
    gone += '\n[[change]]\nversion = 3\neffect = "third_order"\nby = "B"\nat = 2026-06-01\nwhy = "not confirmed"\n'
    from schemas.model import parse_model

    gone = gone.replace('scale", ]', 'scale"]')
    history = versions(parse_model(gone, "model"))
    assert [v.removed for v in history][-1] == ("third_order",)
    assert "third_order" in history[-2].effects
    assert model.model.version == 2


def test_effects_and_model_together_are_refused(tmp_path):
    with pytest.raises(WrongUse, match="leave one out"):
        chosen_effects("bias", tmp_path / "m.toml", "compare")


def errors(fit, heldout, fresh, progress=None):
    figures = {"rms_ug": fit, "heldout_rms_ug": heldout, "fresh_rms_ug": fresh, "floor_ug": 5.0}
    return {**figures, "progress": progress, "warnings": []}


def judged(confirmed, part, error, fall, density=None):
    by = "fresh run" if part is not None else "dwells left out"
    return {
        "judged_by": by, "confirmed": confirmed, "part": part, "part_u": error, "fall_ug": fall, "fall_u_ug": 0.4,
        "log_density": density,
    }  # fmt: skip


def rows_of(model, told):
    asked = []

    def compare(effects, before):
        asked.append((len(effects), None if before is None else len(before)))
        return told[len(effects)]

    return evolution(versions(model), compare), asked


def test_an_effect_is_judged_against_the_version_before_it_and_refuted_only_by_evidence_against_it():
    text, _ = extended(COMMENTED, step("third_order"), "model")
    _, model = extended(text, step("warm_up"), "model")
    told = {
        2: errors(15.0, 16.0, 15.5),
        3: errors(5.0, 5.2, 5.1, judged(True, 0.98, 0.02, 10.4)),
        4: errors(4.9, 5.3, 5.12, judged(False, -0.1, 0.1, -0.02)),
    }
    rows, asked = rows_of(model, told)
    assert asked == [(2, None), (3, 2), (4, 3)]
    assert [row["confirmed"] for row in rows] == [None, True, False]
    assert [(rows[1][k], rows[2][k]) for k in ("fall_ug", "fall_u_ug")] == [(10.4, -0.02), (0.4, 0.4)]
    assert "confirmed: 0.98 ± 0.04" in rows[1]["text"]
    assert rows[2]["text"].startswith("refuted: -0.10 ± 0.20")


def test_what_a_fresh_run_cannot_decide_asks_for_one_more_run_and_is_not_taken_out():
    _, model = extended(COMMENTED, step("third_order"), "model")
    rows, _ = rows_of(model, {2: errors(15.0, 16.0, 15.5), 3: errors(14.9, 16.0, 15.4, judged(None, 0.5, 0.4, 0.1))})
    assert rows[-1]["confirmed"] is None
    assert "not decided" in rows[-1]["text"]
    assert "measure another run" in rows[-1]["text"]


def test_without_a_fresh_run_nothing_is_refuted():
    _, model = extended(COMMENTED, step("third_order"), "model")
    told = {2: errors(15.0, 16.0, None), 3: errors(14.0, 16.1, None, judged(None, None, None, -0.1, density=-3.0))}
    rows, _ = rows_of(model, told)
    assert rows[-1]["confirmed"] is None
    assert "a fresh run of the same units decides" in rows[-1]["text"]
