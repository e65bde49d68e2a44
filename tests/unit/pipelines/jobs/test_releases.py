"""A misspelt kind of device of a release is told."""

from pathlib import Path

from in_process import text_of

from pipelines.archive import Archive


def test_a_release_for_a_kind_of_device_that_is_nearly_a_known_one_says_so(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    model.write_text('[model]\nname = "few"\nversion = 1\neffects = ["bias", "scale"]\n', encoding="utf-8")
    Archive(tmp_path / "a").prepare()
    words = ("release", model, "--since", "2026-01-01", "--force", "--reason", "a test", "--archive", tmp_path / "a")
    said = [text_of(*words, "--device", kind, status=0) for kind in ("ADXL35", "adxl355", "house make 7")]
    assert "ADXL35 is not one that the program knows; did you mean ADXL355?" in said[0]
    assert "for ADXL355 from" in said[1]
    assert not any("not one that" in text for text in said[1:])
