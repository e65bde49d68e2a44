"""What is stated of references, device and certificate: what is refused, what is missing, and what a decision then says."""

from pathlib import Path

import numpy as np
import pytest
from each import each
from in_process import given, text_of
from pydantic import ValidationError
from root_process import ROOT
from small_station import short_recipe

from pipelines.archive import Run
from pipelines.certificates.stated_budget import stated_budget
from pipelines.jobs.job import job_of_run
from pipelines.jobs.terms import refuse_contradictions
from pipelines.schedule.steps import steps
from pipelines.stages.figures import UNITS
from pipelines.stages.uncertainty.contributions import merged, sources
from schemas.decisions import decide
from schemas.errors import RecipeInvalid, WrongUse
from schemas.limits import parse_limits
from schemas.station import StationConfig, load_station
from schemas.uncertainty import Uncertainty

LINE = ROOT / "deploy" / "stations" / "line-1.toml"


def stated(**entries: object) -> Uncertainty:
    return Uncertainty.model_validate(entries)


@each([
    ({"level": {"u_urad": -1.0, "source": "s"}}, "level.u_urad"),
    ({"level": {"u_urad": 1.0, "U_urad": 2.0, "k": 2, "source": "s"}}, "stated twice"),
    ({"level": {"U_urad": 2.0, "source": "s"}}, "k: missing"),
    ({"level": {"half_width_deg": 2.0, "source": "s"}}, "distribution: missing"),
    ({"level": {"u_urad": 1.0, "scope": "planet", "source": "s"}}, "level.scope"),
    ({"level": {"u_urad": 1.0}}, "reference: missing"),
    ({"level": {"source": "s"}}, "no uncertainty is stated"),
    ({"level": {"u_urad": 1.0, "exact": True, "source": "s"}}, "exact: true beside"),
    ({"gravity": {"value_m_s2": 9.80665, "u_ppm": 1.0, "reference": "G"}}, "standard gravity, not a site's value"),
    ({"gravity": {"source": "formula", "latitude_deg": 48.0}}, "latitude_deg, height_m"),
    ({"gravity": {"value_m_s2": 9.80, "latitude_deg": 48.0, "height_m": 0.0, "u_ppm": 1.0, "reference": "G"}}, "differ by"),
    ({"seet": {"u_urad": 1.0}}, "seet"),
])  # fmt: skip
def test_a_statement_that_cannot_be_is_refused_with_its_key(row: tuple[dict, str]) -> None:
    entries, message = row
    with pytest.raises(ValidationError) as refused:
        stated(**entries)
    text = str(refused.value)
    assert message.rsplit(".", 1)[-1] in text
    assert message.split(".", 1)[0] in text


def test_every_form_of_a_statement_is_one_standard_uncertainty_and_reads_as_it_was_written() -> None:
    forms = (
        {"u_urad": 20.0}, {"U_urad": 40.0, "k": 2}, {"half_width_urad": 20.0 * 3**0.5, "distribution": "rectangular"},
        {"u_deg": np.degrees(20e-6)}, {"u_arcsec": 3600 * np.degrees(20e-6)},
    )  # fmt: skip
    for form in forms:
        entry = stated(level={**form, "source": "s"})
        assert entry.level.standard().u == pytest.approx(20e-6)
        assert (entry.not_stated["seat"], "level" in entry.not_stated) == ("misalignment", False)
    config = load_station(LINE)
    document = config.model_dump(mode="json")
    assert StationConfig.model_validate(document) == config
    level = {"U_urad": 100.0, "k": 2.0, "scope": "station", "source": "vial, 0.02 mm/m"}
    assert document["uncertainty"]["level"] == level


@each([
    ('reference = "PT-7"', 'reference = "PT-8"', r"no \[\[reference\]\] is called 'PT-8'"),
    ("offset_U_K = 0.1", "offset_U_K = 0.02", "reference PT-7 has 0.05 K; state at least that"),
    ("level = { U_urad = 100.0, k = 2.0, scope", "level = { exact = true, scope", "a station of kind simulated is needed"),
])  # fmt: skip
def test_a_station_that_claims_too_much_is_refused(row: tuple[str, str, str], tmp_path: Path) -> None:
    old, new, message = row
    file, text = tmp_path / "line.toml", LINE.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=message):
        load_station(file)


def test_the_recipes_gravity_must_be_the_stations() -> None:
    recipe, station = short_recipe(), load_station(LINE)
    refuse_contradictions(recipe, station)  # 77 ppm from the formula, which is uncertain by 60
    with pytest.raises(RecipeInvalid, match="they differ by"):
        refuse_contradictions(recipe.model_copy(update={"local_gravity_m_s2": 9.81}), station)


def test_a_recipes_entries_go_before_the_stations_and_the_weaker_source_counts() -> None:
    station = stated(grade_source="certificates", level={"u_urad": 1.0, "source": "s"}, pose={"u_urad": 5.0})
    both = merged(station, stated(grade_source="data_sheet", pose={"u_urad": 9.0}))
    assert both.grade_source == "data_sheet"
    assert sources(both)["pose"].stated.u == pytest.approx(9e-6)
    assert "level" in sources(both)


def test_the_order_of_verification_is_the_recipes() -> None:
    recipe = short_recipe(poses=4, temperatures=(0.0, 25.0))
    last = [one.kind[0] for one in steps(recipe)]
    spread = steps(recipe.model_copy(update={"verification_order": "interleaved"}))
    assert last == list("ddddvddddv")
    assert [one.kind[0] for one in spread] == list("ddvddddvdd")
    assert [one.record for one in spread] == list(range(10))
    listed = recipe.model_copy(update={"verification_order": "interleaved", "procedures": [{"kind": "multi_position"}]})
    assert [one.pose for one in steps(listed)] == [one.pose for one in spread]
    assert "verification_order" not in recipe.model_dump()  # captures of earlier versions keep their names


LIMITS = 'name = "t"\nrule = "{rule}"\n{more}[figures]\nbias_error_ug = {{ max = 1000.0, unit = "µg" }}\n'


def test_a_conditional_result_reads_as_not_accepted_and_a_guard_band_keeps_an_allowed_probability() -> None:
    limits = parse_limits(LIMITS.format(rule="guarded_acceptance", more=""), "limits", UNITS)
    decision = decide(limits, "bias_error_ug", 485.0, 275.0)
    assert "not accepted: inside the guard band, 485 ± 550 µg, limit 1000 µg" in decision.sentence
    assert decision.pfa == 0.0
    assert decision.pfr == pytest.approx(1.0 - 0.030553, abs=1e-6)
    limits = parse_limits(LIMITS.format(rule="allowed_pfa", more="pfa_max = 0.02\n"), "limits", UNITS)
    inside, beyond = (decide(limits, "bias_error_ug", 1000.0 - w * 100.0, 100.0) for w in (2.0538, 2.0536))
    assert (inside.outcome, beyond.outcome) == ("pass", "conditional pass")
    assert inside.pfa == pytest.approx(0.02, abs=1e-4)
    for rule, largest, told in (
        ("allowed_pfa", 0.05, "pfa_max"),
        ("simple_acceptance", 0.01, "found 0.01 beside rule"),
    ):
        with pytest.raises(RecipeInvalid, match=told):
            parse_limits(LIMITS.format(rule=rule, more=f"pfa_max = {largest}\n"), "limits", UNITS)


def test_plan_refuses_a_limit_that_cannot_be_reached_and_says_where_nothing_is_stated(tmp_path: Path) -> None:
    """A QA700 moves by 50 µg from one switch-on to the next: no recipe makes it a navigation part for a year."""
    recipe = (ROOT / "deploy" / "recipes" / "qa700.toml").read_text(encoding="utf-8")
    (tmp_path / "nav.toml").write_text(recipe.replace("qa700.limits.toml", "navigation"), encoding="utf-8")
    said = "the end of the period of validity: limit 50 µg, expected over 12 months"
    assert said in text_of("plan", tmp_path / "nav.toml", status=1)
    found, out, err = given("plan", "--station", ROOT / "deploy" / "stations" / "simulated-awry.toml")
    assert (found, "noise only" in out) == (1, True)
    told = "refuses this recipe: limits production: bias_error_period_ug needs [stability] of the device, and [uncertainty]"
    assert told in " ".join(err.split())


def test_a_run_keeps_its_budget_and_risks_and_what_a_certificate_states_of_them_is_of_one_unit(run: Run) -> None:
    assert set(run.table("grades")["basis"]) == {"budget"}
    figures = run.table("figures")
    limited = figures[np.isfinite(figures["limit"])]
    assert np.isfinite(limited[["pfa", "pfr", "accept"]].to_numpy()).all()
    assert set(run.table("lot_risks")["figure"]) == set(limited["figure"])
    assert (run.table("uncertainties")["quantity"] == "bias_error_period").any()  # 12 months are within the horizon
    assert job_of_run(run).terms.stability.horizon_days > 366.0
    stated = stated_budget(run, "A1")
    row, parts = next((r, p) for r, p in stated.quantities if (r["quantity"], r["axis"]) == ("bias_error", "x"))
    assert {one["contribution"] for one in parts} >= {"noise", "seat", "pose"}
    assert row["u"] == pytest.approx(np.hypot(row["u_a"], row["u_b"]))
    assert row["u"] == pytest.approx(np.sqrt(sum(one["u"] ** 2 for one in parts)))
    assert sum(one["share"] for one in parts) == pytest.approx(1.0)
    assert np.isfinite(row["shown"])
    assert {one["unit"] for one in (*parts, *stated.decisions)} == {"A1"}
    assert {one["outcome"] for one in stated.decisions} == {"pass"}
    with pytest.raises(WrongUse, match="no uncertainty budget of unit"):
        stated_budget(run, "A9")
