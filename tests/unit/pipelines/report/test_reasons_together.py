"""Equal reasons of many units are told once, with the value of each unit and the limit."""

from pipelines.report.reasons import grouped_reasons


def row(unit: str, reasons: str, outcome: str = "fail") -> dict[str, str]:
    return {"unit": unit, "reasons": reasons, "outcome": outcome}


def test_equal_reasons_are_one_with_every_value_others_stay_apart_and_the_most_frequent_is_first() -> None:
    rows = [
        row(f"B{k:02d}", f"bias_error_ug fail: {1100 + k} ± 20 µg, limit 1000 µg, margin -{100 + k} µg")
        for k in range(32)
    ]
    (group,) = grouped_reasons([*rows, row("B99", "", "pass")])
    assert group.text == "Rms error of the worst axis on poses not used: fail, limit 1000 µg"
    assert len(group.units) == 32
    assert group.units[3] == ("B03", "1103 ± 20 µg")
    assert group.sentence.startswith(f"{group.text}: B00 (1100 ± 20 µg), B01 (1101 ± 20 µg)")
    rows = [
        row("A", "zero_g_offset_mg fail: -80 mg, limit 75 mg, margin -5 mg"),
        row("B", "constant output 0 LSB on x in record 3; check wiring", "refused"),
        row("C", "constant output 0 LSB on x in record 7; check wiring", "refused"),
        row("D", "constant output 0 LSB on y in record 7; check wiring", "refused"),
    ]
    told = grouped_reasons(rows)
    assert [[unit for unit, _ in group.units] for group in told] == [["B", "C"], ["A"], ["D"]]
    assert told[0].sentence == "constant output 0 LSB on x in record …; check wiring: B (3), C (7)"
    assert told[2].sentence == "D: constant output 0 LSB on y in record 7; check wiring"
