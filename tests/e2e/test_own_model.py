"""A run is judged with the model that it was calibrated with, unless another one is named."""

import json

import pytest
from capture_double import small_run
from in_process import given

OWN = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "second_order"]


@pytest.fixture
def told(tmp_path):
    """The document of a command about a run with a model of its own."""
    plain = '"scale_temperature"]'
    run = small_run(tmp_path, None, (plain, plain.replace("]", ', "second_order"]')))

    def document(command: str, *more: str) -> dict:
        return json.loads(given(command, "latest", "--archive", run.archive.root, "--json", *more)[1])

    return document


def test_a_run_is_judged_with_its_own_model_unless_another_is_named(told, no_next_measurement: None) -> None:
    judged = told("diagnose")
    assert judged["effects"] == told("compare")["effects"] == OWN
    assert {name for group in judged["classes"] for name in group["effects"]}.isdisjoint(OWN)
    assert told("compare", "--effects", "bias,scale,misalignment")["effects"] == OWN[:3]


@pytest.mark.slow
def test_a_run_is_diagnosed_with_the_model_that_is_named(told) -> None:
    assert told("diagnose", "--effects", "bias,scale,misalignment")["effects"] == OWN[:3]
