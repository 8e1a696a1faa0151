"""Writes tables as TOML that people read: an entry a line, changes as tables of their own."""

from collections.abc import Iterator
from typing import Any

from rparm.files import toml_key, toml_value

DEEP = ("sampled", "events", "tables", "terminals")  # sections of tables


def written(tables: dict[str, Any]) -> str:
    """Return the text of tables."""
    heads = {key: value for key, value in tables.items() if not isinstance(value, dict)}
    flat = {"experiment", *(key for key, v in tables.items() if key == "modes")}
    heads |= {key: tables[key] for key in tables if key in flat}
    lines = [f"{key} = {_inline(value)}" for key, value in heads.items()]
    for section, entries in tables.items():
        if section not in heads and entries:
            lines += _table(section, entries, section in DEEP)
    return "\n".join([*lines, ""])


def _table(head: str, entries: dict[str, Any], is_deep: bool) -> Iterator[str]:
    below = {key: value for key, value in entries.items() if is_deep and isinstance(value, dict)}
    if len(below) < len(entries):
        yield from ("", f"[{head}]")
        for key, value in entries.items():
            if key not in below:
                yield f"{toml_key(key)} = {_inline(value)}"
    for key, value in below.items():
        yield from _table(f"{head}.{toml_key(key)}", value, head in DEEP)


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{toml_key(k)} = {_inline(v)}' for k, v in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    return toml_value(value)
