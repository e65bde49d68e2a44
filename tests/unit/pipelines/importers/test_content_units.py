"""Units that the name of a column states."""

from pipelines.importers.content import unit_in


def test_a_unit_stands_in_brackets_or_behind_an_underscore() -> None:
    stated = {"out [g]": "g", "time (ms)": "ms", "time_s": "s", "out_g": "g", "acc_mV": "mV", "ref_m_s2": "m/s^2"}
    stated |= dict.fromkeys(("axes", "log", "_sg", "out_G"), "")
    assert {name: unit_in(name) for name in stated} == stated
