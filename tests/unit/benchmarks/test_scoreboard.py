"""The comparison of two checkouts by their outcomes on the same cases."""

from benchmarks.scoreboard.__main__ import rows


def outcomes(name: str, *hits: bool) -> dict[tuple[str, ...], dict[str, bool]]:
    return {("worlds", "hidden", "w", str(k)): {name: hit} for k, hit in enumerate(hits)}


def test_a_row_is_worse_or_better_by_more_cases_than_chance_would_change() -> None:
    for name, before, after, verdict in (
        ("exact", [*[False] * 12, True], [True] * 13, ("WORSE", 0, 12)),
        ("physics named", [False] * 12, [True] * 12, ("BETTER", 12, 0)),
    ):
        (row,), worse = rows(outcomes(name, *before), outcomes(name, *after))
        assert worse == (verdict[0] == "WORSE")
        assert (row["verdict"], row["better"], row["worse"]) == verdict
    ((row,), worse) = rows(outcomes("exact", False, True, False), outcomes("exact", True, True))
    assert not worse  # by a few cases; one that is missing is not compared
    assert (row["verdict"], row["n"], row["other n"], row["p"]) == ("", 3, 2, 1.0)
    table, _ = rows(outcomes("wrong fresh: warm_up", True), None)
    assert (table[0]["rarer is better"], table[0]["hits"], table[0]["n"]) == (True, 1, 1)
