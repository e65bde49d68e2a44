"""Which records an early end leaves out, and how a run says it."""

from small_station import short_recipe

from pipelines.schedule.early_end import EarlyEnd, NotReached, early_end_sentence, left_out, told_sentences
from pipelines.schedule.steps import steps


def test_a_check_of_a_temperature_and_the_static_record_stay_and_no_check_is_repeated() -> None:
    plan = steps(short_recipe(poses=3, static_s=30.0, temperatures=(0.0, 25.0, 50.0)))
    missing = left_out(plan, 4)  # in the second soak, after its first pose
    kept = [(step.kind, step.temperature) for step in plan[5:] if step not in missing]
    assert kept == [("verification", 25.0), ("allan", 25.0)]
    recipe = short_recipe(poses=3)
    plan = steps(recipe.model_copy(update={"verification": recipe.verification * 3}))
    assert [step.kind for step in plan if step not in left_out(plan, 0)] == ["dwell", "verification"]
    recipe = short_recipe(poses=2, temperatures=(0.0, 50.0))
    plan = [step.__class__(**{**step.__dict__, "settled": False}) for step in steps(recipe)]
    assert [step.kind for step in left_out(plan, 3)] == ["dwell", "verification"]


END: EarlyEnd = {
    "ended": True, "reason": "8 of 8 units decided", "dwells": 40, "soaks_C": [25.0, -10.0], "dwell_s": [4.0, 10.0],
    "given_up": ["third_order"], "fails": {"A1": "bias 3 ± 1 mg, limit 1 mg", "A2": "bias 4 ± 1 mg, limit 1 mg"},
    "withdrawn": ["A2"], "not_reached": [],
}  # fmt: skip


def test_the_sentence_names_what_was_left_out() -> None:
    assert early_end_sentence(END) == (
        "ended when it was known: 8 of 8 units decided; 40 dwells of the plan not taken, no soak at 25, -10 °C any more; "
        "given up: third_order, which the whole plan shows; dwells of 4 to 10 s by the noise of the run"
    )
    assert early_end_sentence(END | {"ended": False, "dwell_s": [10.0, 10.0]}) == ""
    assert told_sentences(END) == [
        "A1 failed before the end: bias 3 ± 1 mg, limit 1 mg",
        "A2 failed before the end: bias 4 ± 1 mg, limit 1 mg; withdrawn: by the whole run it passes",
    ]


def test_the_sentence_names_what_was_not_reached_of_all_or_of_one_unit() -> None:
    missed: list[NotReached] = [{"figure": "bias", "unit": unit, "share": 1.25} for unit in ("A1", "A2")]
    end: EarlyEnd = END | {"ended": False, "dwell_s": [10.0, 10.0], "not_reached": missed}
    said = "asked uncertainty not reached: bias of A1 (1.25 of what is asked)"
    assert early_end_sentence(end) == f"{said}, bias of A2 (1.25 of what is asked)"
    assert early_end_sentence(end, "A1") == said
    assert early_end_sentence(end, "A3") == ""
