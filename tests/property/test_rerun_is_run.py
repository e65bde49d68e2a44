"""A re-run is a run: the same bytes as a first run with that model, whatever the change, and nothing where nothing changes."""

import shutil

import pytest
from capture_double import small_run
from generated import FEW
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from pipelines.archive import Archive, Run
from pipelines.jobs.model_change import change_from_options
from pipelines.rerun.rerun import again

FEWER = settings(FEW, max_examples=3, phases=(Phase.explicit, Phase.generate))
BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")  # the limits need them
MORE = ("third_order", "second_order")
MODELS = st.lists(st.sampled_from(MORE), unique=True).map(lambda more: ",".join([*BASE, *sorted(more)]))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("first"))


def copied(original: Run, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    root = tmp_path_factory.mktemp("again") / "archive"
    shutil.copytree(str(original.archive.root), root)
    return Archive(root)


def hashes(run: Run) -> dict[str, str]:
    return {name: run.manifest(name)["sha256"] for name in run.tables()}


@pytest.mark.slow
@FEWER
@given(first=MODELS, then=MODELS)
def test_a_way_round_does_not_matter(
    first: str, then: str, original: Run, tmp_path_factory: pytest.TempPathFactory
) -> None:
    direct, round_about = (copied(original, tmp_path_factory) for _ in range(2))
    straight = again(direct, original.id, change_from_options(effects=then)).new
    over = again(round_about, original.id, change_from_options(effects=first)).new
    reached = again(round_about, over, change_from_options(effects=then)).new
    assert hashes(round_about.run(reached)) == hashes(direct.run(straight))
