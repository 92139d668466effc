"""Texts of the coach's page and report in English and German: one table, by language and key."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

TABLE = Path(__file__).with_name("texts.json")


@cache
def texts() -> dict[str, dict[str, str]]:
    """Texts by language (`en`, `de`) and key; `{name}` stands for a value."""
    table: dict[str, dict[str, str]] = json.loads(TABLE.read_text(encoding="utf-8"))
    return table
