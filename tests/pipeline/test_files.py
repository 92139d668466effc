"""Atomic files: complete or not there at all, and the old file untouched until then."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.files import atomic_file, check_writable


def test_a_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 251 + ".txt")  # the longest name there is
    with atomic_file(path) as part:
        part.write_text("new", encoding="ascii")
        assert not path.exists() and part.parent == tmp_path
    assert path.read_text(encoding="ascii") == "new" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("fault", "raised", "message"),
    [
        (
            OSError(28, "No space left on device"),
            RecordingError,
            r"^JSON cannot be written \(No space left.*free space",
        ),
        (OSError("two\nlines"), RecordingError, r"\(two lines\)"),
        (RecordingError("the source broke off"), RecordingError, "^the source broke off$"),
        (BrokenPipeError(), BrokenPipeError, None),
        (ZeroDivisionError(), ZeroDivisionError, None),
    ],
)
def test_a_fault_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, fault: Exception, raised: type[Exception], message: str | None
) -> None:
    path = tmp_path / "a.json"
    path.write_text("old", encoding="ascii")
    with pytest.raises(raised, match=message), atomic_file(path, "JSON") as part:
        part.write_text("half", encoding="ascii")
        raise fault
    assert path.read_text(encoding="ascii") == "old" and list(tmp_path.iterdir()) == [path]


def test_a_block_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"), atomic_file(tmp_path / "a"):
        pass


def test_places_that_cannot_be_written_are_named_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path, why in ((tmp_path, "it is a folder"), (tmp_path / "no" / "a", "its folder does not exist")):
        with pytest.raises(RecordingError, match=f"^figure cannot be written, {why}: .*{path}$"):
            check_writable(path, "figure")
        with pytest.raises(RecordingError, match=why), atomic_file(path):
            pytest.fail("the block is entered")
    with pytest.raises(RecordingError, match="its folder does not exist"):
        check_writable(tmp_path / "file" / "below")
    check_writable(tmp_path / "new")
    check_writable(tmp_path / "file")


def test_of_a_link_the_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder" / "file")
    for content in ("first", "second"):
        with atomic_file(tmp_path / "link") as part:
            part.write_text(content, encoding="ascii")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "folder" / "file").read_text(encoding="ascii") == content
    assert len(list(tmp_path.rglob("*"))) == 3


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_written_through(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(path.read_text(encoding="ascii")))
    reader.start()
    with atomic_file(path) as part:
        part.write_text("text", encoding="ascii")
    reader.join(10)
    assert read == ["text"] and path.is_fifo() and list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_device_is_an_error_and_stays_a_device(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("/dev/full")
    with pytest.raises(RecordingError, match="No space left on device"), atomic_file(tmp_path / "link") as part:
        part.write_text("text", encoding="ascii")
    assert (tmp_path / "link").is_char_device() and list(tmp_path.iterdir()) == [tmp_path / "link"]


def test_a_name_that_the_system_does_not_take_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"^file cannot be written, File name too long"):
        check_writable(tmp_path / ("x" * 300))


def test_half_a_file_is_removed_when_the_system_ends_the_program(tmp_path: Path) -> None:
    script = """
import sys, time
from pathlib import Path
from spinscope.app.terminal import exit_on_signals
from spinscope.pipeline.files import atomic_file
exit_on_signals()
with atomic_file(Path(sys.argv[1])) as part:
    part.write_text("half", encoding="ascii")
    print("writing", flush=True)
    time.sleep(60)
"""
    command = [sys.executable, "-c", script, str(tmp_path / "a")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "writing\n"
    process.terminate()
    process.communicate(timeout=30)
    assert process.returncode == 143 and not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="no /dev/stdout on this system")
@pytest.mark.parametrize("output", ["-", "/dev/stdout"])
def test_json_goes_to_standard_output(samples: Path, output: str) -> None:
    command = [sys.executable, "-m", "spinscope", "info", str(samples / "spinner_ball2_side.h5"), "--json", output]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith('{"path": ') and done.stdout.endswith("}\n")
