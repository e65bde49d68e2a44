"""The archive: immutable Parquet tables with manifests, written aside, made durable, then published."""

from pipelines.archive.archive import Archive, default_root
from pipelines.archive.keys import code_hash, stage_key
from pipelines.archive.listing import RunInfo
from pipelines.archive.records import Records
from pipelines.archive.run import Run

__all__ = ["Archive", "Records", "Run", "RunInfo", "code_hash", "default_root", "stage_key"]
