"""A run is judged with the model that it was calibrated with, unless another one is named."""

import json

import pytest
from capture_double import small_run

from pipelines.cli import main

OWN = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "second_order"]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path):
    """The document of a command about a run with a model of its own."""
    plain = '"scale_temperature"]'
    run = small_run(tmp_path, None, (plain, plain.replace("]", ', "second_order"]')))

    def document(command: str, *more: str) -> dict:
        words = ["tumbleline", command, "latest", "--archive", str(run.archive.root), "--json", *more]
        monkeypatch.setattr("sys.argv", words)
        with pytest.raises(SystemExit):
            main()
        return json.loads(capsys.readouterr().out)

    return document


@pytest.mark.parametrize("command", ["diagnose", "compare"])
def test_a_run_is_judged_with_its_own_model(told, command: str) -> None:
    assert told(command)["effects"] == OWN
    assert told(command, "--effects", "bias,scale,misalignment")["effects"] == OWN[:3]


def test_an_effect_that_the_run_has_is_not_called_missing(told) -> None:
    named = {name for group in told("diagnose")["classes"] for name in group["effects"]}
    assert named.isdisjoint(OWN)
