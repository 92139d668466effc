"""Text header of Prophesee's RAW and DAT files."""

from __future__ import annotations

MAX_HEADER_BYTES = 64 << 10


def parse_header(head: bytes) -> tuple[dict[str, str], int]:
    """Parse the lines "% key value" at the start of a file.

    Parameters
    ----------
    head : bytes
        First bytes of the file.

    Returns
    -------
    values : dict of str to str
        Value of each key.
    end : int
        Offset of the first byte after the header, which ends with the line "% end" or, in old files, before the first
        line without "% " in front; the length of `head` when the file is cut within the header.
    """
    values: dict[str, str] = {}
    at = 0
    while head.startswith(b"% ", at):
        end = head.find(b"\n", at)
        if end < 0:
            return values, len(head)
        key, _, value = head[at + 2 : end].decode("utf-8", "replace").strip().partition(" ")
        at = end + 1
        if key == "end":
            break
        values[key] = value.strip()
    return values, at
