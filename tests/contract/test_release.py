"""The bill of materials of a release says what the lock says, and the hashes of a release are those of its files."""

import hashlib
import json
import re
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import pytest
from test_packaging import ROOT

from deploy import release
from deploy.sbom import LOCK, bill, project_of, release_time
from pipelines.flows import deploy

WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@cache
def made(lock: str | None = None) -> dict:
    return bill(lock or LOCK.read_text(encoding="utf-8"), project_of(ROOT), WHEN)


def test_every_library_of_the_lock_is_in_the_bill_with_its_version_and_hashes() -> None:
    text = LOCK.read_text(encoding="utf-8")
    entries = re.findall(r"^([\w.-]+)(?:\[.*?\])?==(\S+)", text, re.MULTILINE)
    components = made()["components"]
    assert len(entries) > 100
    assert [(c["name"], c["version"]) for c in components] == sorted((name.lower(), v) for name, v in entries)
    hashes = [p for c in components for p in c["properties"] if p["name"] == "tumbleline:lock:sha256"]
    assert len(hashes) == text.count("--hash=sha256:")
    # what is installed on some Pythons only is optional and says where
    whenever = next(c for c in components if c["name"] == "whenever")
    assert whenever["scope"] == "optional"
    assert whenever["properties"][0] == {"name": "tumbleline:lock:marker", "value": 'python_full_version >= "3.13"'}
    needing = [d["ref"] for d in made()["dependencies"] if whenever["bom-ref"] in d["dependsOn"]]
    assert any(ref.startswith("pkg:pypi/prefect@") for ref in needing)
    assert {c["scope"] for c in components if c["name"] == "numpy"} == {"required"}


def test_the_bill_has_the_form_of_cyclonedx_and_each_reference_leads_to_a_component() -> None:
    content = made()
    assert (content["bomFormat"], content["specVersion"], content["version"]) == ("CycloneDX", "1.6", 1)
    assert re.fullmatch(r"urn:uuid:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", content["serialNumber"])
    assert content["metadata"]["timestamp"] == "2026-01-02T03:04:05Z"
    own = content["metadata"]["component"]
    assert (own["name"], own["licenses"]) == ("tumbleline", [{"license": {"id": "Apache-2.0"}}])
    references = [own["bom-ref"], *(c["bom-ref"] for c in content["components"])]
    assert len(set(references)) == len(references)
    assert [d["ref"] for d in content["dependencies"]] == references
    below = {d["ref"]: d["dependsOn"] for d in content["dependencies"]}
    assert {ref for refs in below.values() for ref in refs} <= set(references)
    assert len(below[own["bom-ref"]]) == len(project_of(ROOT)["dependencies"])


def test_licences_are_those_of_the_installed_version() -> None:
    licences = {c["name"]: c.get("licenses") for c in made()["components"]}
    assert "BSD-3-Clause" in json.dumps(licences["numpy"])
    (unknown,) = made("numpy==0.0.1 \\\n    --hash=sha256:" + "0" * 64)["components"]
    assert "licenses" not in unknown


def test_a_release_has_its_hashes_and_nothing_of_an_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "dist"
    folder.mkdir()
    (folder / "old.whl").write_bytes(b"")

    def built(place: Path, root: Path = ROOT) -> tuple[Path, Path]:
        place.mkdir(exist_ok=True)
        wheel, source = place / "a.whl", place / "a.tar.gz"
        wheel.write_bytes(b"wheel")
        source.write_bytes(b"source")
        return wheel, source

    monkeypatch.setattr(release, "build", built)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    written = release.release(folder)
    assert sorted(folder.iterdir()) == sorted(written)
    sums = dict(line.split("  ")[::-1] for line in (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines())
    assert sums == {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in written if p.name != "SHA256SUMS"}
    bom = json.loads(next(folder.glob("*.cdx.json")).read_text(encoding="utf-8"))
    assert bom["metadata"]["timestamp"] == "1970-01-01T00:00:00Z"
    assert any("a.whl" in one["value"] for one in bom["metadata"]["component"]["properties"])
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert release_time() == datetime(1970, 1, 2, tzinfo=UTC)
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert abs((release_time() - datetime.now(UTC)).total_seconds()) < 60.0


def test_flows_of_an_installed_product_work_in_the_folder_that_they_were_registered_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert deploy._working_folder() == ROOT
    monkeypatch.setattr(deploy, "TREE", tmp_path / "site-packages")
    monkeypatch.chdir(tmp_path)
    assert deploy._working_folder() == tmp_path
