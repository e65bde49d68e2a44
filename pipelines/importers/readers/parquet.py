"""Parquet files as columns: plain columns, whatever notes of other libraries lie beside them."""

import re

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipelines.importers.content import Content, begins_with
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown

NAME, TITLE, EXTRA, ORDER = "parquet", "Parquet", "", 10
recognised = begins_with(b"PAR1")
REMEDY = "copy it again"
VALUE_BYTES = 8
BATCH_ROWS = 2**16
_INDEX = re.compile(r"__index_level_\d+__")


def read(name: str, data: bytes, group: str) -> Content:
    """The plain columns of a Parquet file; notes of pandas about indices are not read, and their unnamed columns left out.

    Raises
    ------
    DataRejected
        It is no whole file, unpacks to too much, or holds lists, structures or a name twice.
    """
    broken = f"{name}: {len(data)} bytes that begin as Parquet but are not a whole file"
    with foreign(broken, REMEDY):
        file = pq.ParquetFile(pa.BufferReader(data))
        schema = file.schema_arrow
        _refuse_odd_columns(schema, name)
        refuse_larger(_claimed(file), len(data), name)
        labels = [label for label in schema.names if not _INDEX.fullmatch(label)]
        # texts stay in their dictionaries until it is known how long they are
        texts = [field.name for field in schema if _is_text(field.type)]
        reader = pq.ParquetFile(pa.BufferReader(data), read_dictionary=texts)
        pieces: list[pa.RecordBatch] = []
        size = 0
        for piece in reader.iter_batches(BATCH_ROWS, columns=labels):
            size += sum(VALUE_BYTES * len(column) + _text_bytes(column) for column in piece.columns)
            refuse_larger(size, len(data), name)
            pieces.append(piece)
        table = pa.Table.from_batches(pieces, reader.schema_arrow.empty_table().select(labels).schema)
        return Content(pd.DataFrame({label: _plain(table.column(label)) for label in labels}))


def _claimed(file: pq.ParquetFile) -> int:
    """Bytes of all values, as the file itself counts its rows and the bytes of their groups.

    The notes on single columns are not asked: pyarrow 26 ends the process where their statistics are corrupted.
    """
    about = file.metadata
    groups = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
    return max(about.num_rows * about.num_columns * VALUE_BYTES, groups)


def _text_bytes(column: pa.Array) -> int:
    if not isinstance(column, pa.DictionaryArray) or not _is_text(column.type.value_type):
        return 0
    lengths = pc.binary_length(column.dictionary)  # pyright: ignore[reportAttributeAccessIssue]  # made at import
    return pc.sum(pc.take(lengths, column.indices)).as_py() or 0  # pyright: ignore[reportAttributeAccessIssue]


def _plain(column: pa.ChunkedArray) -> pd.Series:
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    return column.to_pandas()


def _is_text(kind: pa.DataType) -> bool:
    values = kind.value_type if pa.types.is_dictionary(kind) else kind
    return values in (pa.string(), pa.large_string(), pa.binary(), pa.large_binary())


def _refuse_odd_columns(schema: pa.Schema, name: str) -> None:
    for field in schema:
        if schema.names.count(field.name) > 1:
            raise DataRejected(f"{name}: column '{shown(field.name)}' is there twice, names must differ; rename one")
        if pa.types.is_nested(field.type) and not pa.types.is_dictionary(field.type):
            raise DataRejected(
                f"{name}: column '{shown(field.name)}' holds {shown(str(field.type))}, one value a row is needed; divide it"
            )
