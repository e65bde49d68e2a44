"""A run of an archive that an earlier version wrote, which the contracts of figures and panels only read."""

import pytest
from root_process import ROOT

from deploy.release import unpack
from pipelines.archive import Archive, Run


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("kept")
    unpack(ROOT / "tests" / "archives" / "v1.tar.xz", folder / "archive")
    return Archive(folder / "archive").run("latest")
