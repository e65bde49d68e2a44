"""What the archive writes it reads back: tables, manifests, packs, signatures and the chain."""

import json
from itertools import pairwise
from pathlib import Path
from random import Random

import pandas as pd
import pytest
from generated import DOCUMENTS, FEW, NAMES, SOME, frames
from hypothesis import given
from hypothesis import strategies as st

from pipelines.archive import files, hash_chain, packs, parquet, signatures
from pipelines.archive.keys import digest, stage_key
from pipelines.archive.pack_writing import FolderToPack, write_pack
from schemas import table_check
from schemas.tables import TABLES, VERSION


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("written")


@pytest.mark.parametrize("name", TABLES)
@FEW
@given(data=st.data())
def test_a_table_and_some_of_its_columns_read_back_as_they_were_written(
    name: str, data: st.DataObject, folder: Path
) -> None:
    frame = table_check.check(name, data.draw(frames(name)))
    path = folder / f"{name}.parquet"
    path.write_bytes(written := parquet.table_bytes(name, frame, VERSION))
    back = parquet.read_table(path, name, files.hash_of(written))
    pd.testing.assert_frame_equal(back, frame, check_exact=True)
    assert parquet.table_bytes(name, back, VERSION) == written
    chosen = data.draw(st.lists(st.sampled_from(list(frame.columns)), min_size=1, unique=True))
    some = parquet.read_table(path, name, columns=chosen)
    pd.testing.assert_frame_equal(some[chosen], frame[chosen], check_exact=True)


@SOME
@given(DOCUMENTS)
def test_a_manifest_reads_back_as_it_was_written(content: dict[str, object]) -> None:
    assert files.parsed(files.json_bytes(content), Path("a.json")) == content


@SOME
@given(DOCUMENTS, st.randoms(use_true_random=False))
def test_a_digest_does_not_depend_on_the_order_of_keys(content: dict[str, object], random: Random) -> None:
    shuffled = list(content.items())
    random.shuffle(shuffled)
    assert digest(dict(shuffled)) == digest(content)


@SOME
@given(DOCUMENTS, DOCUMENTS)
def test_other_parameters_have_another_key(one: dict[str, object], other: dict[str, object]) -> None:
    keys = [stage_key("fit", {"dwells": "1"}, parameters, "code") for parameters in (one, other)]
    assert (keys[0] == keys[1]) == (json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True))


@FEW
@given(content=DOCUMENTS, more=DOCUMENTS)
def test_a_signature_is_good_until_anything_changes(
    content: dict[str, object], more: dict[str, object], folder: Path
) -> None:
    place = folder / "key.pem"
    public = signatures.private_key(place).public_key() if place.exists() else signatures.make_key(place)
    keys = {signatures.name_of(public): public}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(signatures.VARIABLE, str(place))
        signed = signatures.signed(content)
    assert signatures.check(json.loads(files.json_bytes(signed)), keys) == signatures.GOOD
    changed = {**signed, **{name: value for name, value in more.items() if name != signatures.ENTRY}}
    wanted = signatures.GOOD if files.json_bytes(changed) == files.json_bytes(signed) else signatures.BAD
    assert signatures.check(changed, keys) == wanted
    assert signatures.check(signed, {}) == signatures.UNKNOWN


FOLDERS = st.dictionaries(
    NAMES.map(lambda name: f"runs/{name}"),
    st.dictionaries(NAMES, st.binary(max_size=200), min_size=1, max_size=3),
    min_size=1,
    max_size=4,
)


@FEW
@given(portions=st.lists(FOLDERS, min_size=1, max_size=3), number=st.integers(0, 2**31))
def test_packed_files_read_as_the_last_pack_has_them(
    portions: list[dict[str, dict[str, bytes]]], number: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("packed")
    (root / packs.FOLDER).mkdir()
    latest: dict[str, dict[str, bytes]] = {}
    for portion in portions:
        listed = [
            FolderToPack(name, number, {file: (len(data), number) for file, data in contents.items()})
            for name, contents in portion.items()
        ]
        write_pack(root, "2026-01", listed, lambda name, file, of=portion: of[name][file])
        for name, contents in portion.items():
            latest[name] = {**latest.get(name, {}), **contents}
    known = packs.Packs(root)
    assert set(known.folders("runs")) == set(latest)
    for name, contents in latest.items():
        found = known.folder(name)
        assert found is not None
        assert found.mtime_ns == number
        assert {file: packs.read(member) for file, member in found.files.items()} == contents
        assert packs.read_together(found.files) == contents


@FEW
@given(sealed=st.lists(st.dictionaries(NAMES, NAMES, max_size=3), min_size=2, max_size=5))
def test_each_entry_of_the_chain_holds_the_hash_of_the_one_before(
    sealed: list[dict[str, str]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("chain")
    assert [hash_chain.append(root, "run", one, {}) for one in sealed] == list(range(1, len(sealed) + 1))
    places = [place for _, place in hash_chain.entries(root)]
    for one, place in zip(sealed, places, strict=True):
        assert files.read_json(place)["files"] == one
    for before, after in pairwise(places):
        assert files.read_json(after)["previous"] == files.sha256(before)
