"""Every figure of merit that is found: limits files may name it, it says what it needs, has a value, a label and documents."""

from types import SimpleNamespace

import numpy as np
import pytest
from each import each

from pipelines.archive.code import CODE
from pipelines.archive.keys import sources
from pipelines.stages.figures import FIGURES, UNITS
from pipelines.stages.grade import GradeEvidence, grade, refuse_limits_without_figures
from schemas.errors import RecipeInvalid
from schemas.limits import Limits, limits_of

ALL = {"name": "all", "figures": {name: {"max": 1e9, "unit": unit} for name, unit in UNITS.items()}}


@pytest.fixture(scope="module")
def table(kept):
    """Figures of a kept archive, graded by limits on every figure."""
    there = kept.tables()
    evidence = GradeEvidence(**{name: kept.table(name) for name in GradeEvidence.__dataclass_fields__ if name in there})
    return grade(evidence, limits_of(ALL, UNITS))["figures"]


def yielded(kept) -> list[str]:
    """Figures for which the recipe of the kept run lacks nothing."""
    recipe = SimpleNamespace(sensor_axes=3, **kept.about["recipe"])
    return [name for name, kind in FIGURES.items() if not kind.missing(recipe)]


@each(FIGURES)
def test_a_figure_is_in_the_table_with_its_unit_and_decision(name: str, kept, table) -> None:
    rows = table[table["figure"] == name]
    if name not in yielded(kept):
        assert rows.empty
        return
    assert len(rows) == table["unit"].nunique() > 1
    assert np.isfinite(rows["value"]).all()
    assert (rows["uncertainty"] >= 0.0).all()
    assert (set(rows["unit_text"]), set(rows["outcome"])) == ({FIGURES[name].unit}, {"pass"})


def test_the_table_has_the_figures_in_their_order_their_code_is_in_its_key_and_limits_know_them(kept, table) -> None:
    first = table.loc[table["unit"] == table["unit"].iloc[0], "figure"]
    assert first.tolist() == yielded(kept)
    assert len(first) > 10
    assert {kind.value.__module__ for kind in FIGURES.values()} <= set(sources(CODE["grade"]))
    with pytest.raises(TypeError, match="known figures"):
        Limits.model_validate(ALL)


UNIT_OF_ENDING = {
    "_ug": "µg", "_mg": "mg", "_mrad": "mrad", "_ug_K": "µg/K", "_ppm_K": "ppm/K", "_pct_FS": "%", "_rtHz": "µg/√Hz",
}  # fmt: skip


@each(FIGURES)
def test_a_figure_is_named_in_parts_that_agree_and_says_what_a_recipe_lacks(name: str) -> None:
    kind = FIGURES[name]
    assert kind.label
    assert kind.meaning.endswith(".")
    assert kind.unit == next((unit for end, unit in UNIT_OF_ENDING.items() if name.endswith(end)), kind.unit)
    bare = SimpleNamespace(static_record_s=0.0, verification=[], effects=[], tumbles=True, sensor_axes=3)
    missing = kind.missing(bare)
    own = {"effects": [missing.split()[1]] if missing else [], "stability": object(), "tumbles": True, "sensor_axes": 3}
    full = SimpleNamespace(static_record_s=3600.0, verification=["v1"], **own)
    assert kind.missing(full) == ""
    limits = limits_of({"name": "one", "figures": {name: {"max": 1.0, "unit": UNITS[name]}}}, UNITS)
    refuse_limits_without_figures(limits, full)
    if missing:
        with pytest.raises(RecipeInvalid, match=name):
            refuse_limits_without_figures(limits, bare)
