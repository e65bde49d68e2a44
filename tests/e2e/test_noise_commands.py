"""``allan`` and ``psd`` of files and runs, against allantools and against each other."""

from pathlib import Path

import allantools
import numpy as np
import pandas as pd
import pytest
from each import each
from in_process import document_of, refused, text_of

RATE = 100.0
N = 0.002  # g/√Hz, two-sided as in IEEE Std 952
OF_G = ("--map", "time=t", "--unit-of", "output=g")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """400 s of white noise, and white noise with a random walk."""
    rng = np.random.default_rng(5)
    white = N * np.sqrt(RATE) * rng.standard_normal((40_000, 2))
    white[:, 1] += 0.004 / np.sqrt(RATE) * np.cumsum(rng.standard_normal(40_000))
    path = tmp_path_factory.mktemp("noise") / "rest.csv"
    pd.DataFrame({"t": np.arange(40_000) / RATE, "ax": white[:, 0], "ay": 1.0 + white[:, 1]}).to_csv(path, index=False)
    return path


def within(curve: dict) -> bool:
    """Whether every deviation of a curve lies within its interval."""
    rows = zip(curve["low"], curve["deviation"], curve["high"], strict=True)
    return all(low < value < high for low, value, high in rows)


def test_the_deviations_are_those_of_allantools_and_terms_have_a_value_or_a_limit(record: Path) -> None:
    allan, table = document_of("noise", "allan", record, *OF_G), pd.read_csv(record)
    for curve in allan["curves"]:
        values = table[curve["channel"]].to_numpy()
        taus, peer, *_ = allantools.oadev(values, rate=RATE, data_type="freq", taus=curve["tau_s"])
        np.testing.assert_allclose(curve["tau_s"], taus)
        np.testing.assert_allclose(curve["deviation"], peer, rtol=1e-9)
        assert within(curve)
    terms = {(row["channel"], row["term"]): row for row in allan["terms"]}
    assert terms["ax", "N"]["low"] < N < terms["ax", "N"]["high"]
    assert terms["ax", "N"]["unit"] == "g/√Hz"
    assert terms["ay", "K"]["low"] < 0.004 < terms["ay", "K"]["high"]
    assert terms["ax", "K"]["value"] is None
    assert terms["ax", "K"]["high"] < 0.002


def test_the_density_gives_the_deviation_and_the_level_of_white_noise_and_is_drawn(
    record: Path, tmp_path: Path
) -> None:
    document = document_of("noise", "psd", record, "--rate", "100", "--map", "ax", "--unit-of", "output=g")
    (spectrum,) = document["spectra"]
    assert spectrum["median_amplitude"] == pytest.approx(N * np.sqrt(2.0), rel=0.03)
    np.testing.assert_allclose(spectrum["deviation_from_density"], spectrum["deviation"], rtol=0.15)
    np.testing.assert_allclose(spectrum["deviation"], N / np.sqrt(spectrum["tau_s"]), rtol=0.15)
    pictures = ("--output", tmp_path / "a.png", "--output", tmp_path / "a.html")
    text_of("noise", "psd", record, "--map", "time=t", *pictures, status=0)
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a.html").read_text(encoding="utf-8").count("<svg") == 1
    told = refused("noise", "allan", record, "--map", "time=t", "--output", tmp_path / "a.bmp")
    assert "picture: .svg, .png, .pdf" in told


STATISTICS = {
    "modified": ("mdev", 1.0, "g"),
    "hadamard": ("ohdev", 1.0, "g"),
    "total": ("totdev", 1.0, "g"),
    "time": ("tdev", 9.80665, "m/s"),
    "tie": ("tierms", 9.80665, "m/s"),
    "mtie": ("mtie", 9.80665, "m/s"),
}
WITHOUT_INTERVAL = {"tie", "mtie"}


@pytest.mark.slow
@each(STATISTICS)
def test_other_statistics_are_those_of_allantools_with_intervals_where_they_have_one(
    statistic: str, record: Path, tmp_path: Path
) -> None:
    peer, factor, unit = STATISTICS[statistic]
    table, short = pd.read_csv(record).head(8000), tmp_path / "short.csv"  # of more the peer of some takes seconds
    table.to_csv(short, index=False)
    words = ("noise", "allan", short, *OF_G, "--statistic", statistic, "--map", "ax")
    found = document_of(*words, "--output", tmp_path / "a.html")
    assert (found["statistic"], found["deviation_unit"]) == (statistic, unit)
    (curve,) = found["curves"]
    values = table["ax"].to_numpy()
    expected = getattr(allantools, peer)(values, rate=RATE, data_type="freq", taus=np.array(curve["tau_s"]))[1]
    np.testing.assert_allclose(curve["deviation"], factor * expected, rtol=1e-9)
    assert set(curve["low"]) == {None} if statistic in WITHOUT_INTERVAL else within(curve)
    name, page = found["statistic_name"], (tmp_path / "a.html").read_text(encoding="utf-8")
    assert f"<h1>{name[0].upper()}{name[1:]}</h1>" in page
    printed = text_of(*words)
    assert name.split()[0] in printed
    assert ("no interval" in printed) == (statistic in WITHOUT_INTERVAL)


def test_a_wrong_name_a_gap_a_missing_rate_and_a_dead_channel_are_refused_or_told(record: Path, tmp_path: Path) -> None:
    message = refused("noise", "allan", record, "--map", "time=t", "--statistic", "hadamart")
    assert "--statistic: found 'hadamart', one of allan, modified, hadamard" in message
    assert "did you mean hadamard" in message
    table = pd.read_csv(record)
    table[["ax", "ay"]].to_csv(tmp_path / "no_time.csv", index=False)
    message = refused("noise", "allan", tmp_path / "no_time.csv")
    assert "none of the columns ax, ay is recognised as the time; give --map time=COLUMN or --rate HZ" in message
    table.assign(t=500 + np.arange(len(table)))[["t", "ax"]].to_csv(tmp_path / "counted.csv", index=False)
    message = refused("noise", "allan", tmp_path / "counted.csv")
    assert "allow 1 Hz in s, 1000 Hz in ms, one of them is needed; add --unit-of time=ms if it is that" in message
    table.drop(index=700).to_csv(tmp_path / "gap.csv", index=False)
    assert "after row 700 the time steps by 0.02 s" in refused(
        "noise", "allan", tmp_path / "gap.csv", "--map", "time=t"
    )
    counted = table.assign(t=np.arange(len(table)) % 256).drop(index=[700, 701, 3000])
    counted.to_csv(tmp_path / "lost.csv", index=False)
    (note,) = document_of("noise", "psd", tmp_path / "lost.csv", "--rate", 100, "--map", "ax")["notes"]
    assert note.startswith("3 samples are lost at 2 places by 't'")
    table.assign(ay=1.0).to_csv(tmp_path / "dead.csv", index=False)
    dead = ("noise", "allan", tmp_path / "dead.csv", "--map", "time=t")
    assert document_of(*dead)["notes"] == ["ay: the output never changes"]
    assert "no channel ever changes" in refused(*dead, "--map", "ay")


@each(["allan", "psd"])
def test_a_time_is_taken_for_no_output(command: str, record: Path, tmp_path: Path) -> None:
    words = ("noise", command, record, "--rate", 100)
    assert "t rises evenly and is no output" in text_of(*words, status=0)
    assert "column 't' rises in every row (from 0 to 399.99)" in refused(*words, "--map", "t,ax")
    assert "rises evenly" not in text_of(*words, "--map", "ax", status=0)
    table = pd.read_csv(record)
    late = np.cumsum(np.random.default_rng(3).uniform(0.005, 0.015, len(table)))
    table.assign(t=late).to_csv(tmp_path / "late.csv", index=False)
    message = refused("noise", command, tmp_path / "late.csv", "--rate", 100)
    assert "give --map time=t instead of --rate, or name the channels with --map" in message
