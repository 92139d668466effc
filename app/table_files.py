"""Files of tables, the format chosen by the suffix: CSV, JSON lines, Parquet."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.files import atomic_file
from spinscope.pipeline.result_rows import ResultRow

Columns = Mapping[str, type]  # str, int, float or bool by name
ROWS_TOGETHER = 10_000  # of a row group of Parquet


def check_table_name(path: Path) -> None:
    """Raise ParameterError for a suffix that is no table's."""
    if path.suffix.lower() not in WRITERS:
        raise ParameterError(f"a table is one of {', '.join(WRITERS)}: give a name that ends so instead of {path}")


def write_table(path: Path, columns: Columns, rows: Iterable[ResultRow]) -> None:
    """Write rows, whose missing columns are empty; the file appears whole or not at all; raises RecordingError."""
    with atomic_file(path, "table") as part:
        WRITERS[path.suffix.lower()](part, columns, ({name: row.get(name) for name in columns} for row in rows))


def _write_csv(path: Path, columns: Columns, rows: Iterable[ResultRow]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _write_json_lines(path: Path, columns: Columns, rows: Iterable[ResultRow]) -> None:
    with open(path, "w", encoding="utf-8") as file:
        file.writelines(json.dumps(row, allow_nan=False) + "\n" for row in rows)


def _write_parquet(path: Path, columns: Columns, rows: Iterable[ResultRow]) -> None:
    import pyarrow as arrow  # 0.1 s to load
    from pyarrow import parquet

    types = {str: arrow.string(), int: arrow.int64(), float: arrow.float64(), bool: arrow.bool_()}
    schema = arrow.schema([(name, types[kind]) for name, kind in columns.items()])
    with parquet.ParquetWriter(path, schema) as writer:
        waiting: list[ResultRow] = []
        for row in rows:
            waiting.append(row)
            if len(waiting) == ROWS_TOGETHER:
                writer.write_table(arrow.Table.from_pylist(waiting, schema))
                waiting.clear()
        writer.write_table(arrow.Table.from_pylist(waiting, schema))


WRITERS: dict[str, Callable[[Path, Columns, Iterable[ResultRow]], None]] = {
    ".csv": _write_csv,
    ".jsonl": _write_json_lines,
    ".parquet": _write_parquet,
}
