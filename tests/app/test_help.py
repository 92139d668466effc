"""Help texts of the command line."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from spinscope.app.cli import COMMANDS, cli


@pytest.mark.parametrize("group", [(), ("coach",), ("calibrate",)])
def test_every_command_is_listed_with_its_whole_first_sentence(group: tuple[str, ...]) -> None:
    result = CliRunner().invoke(cli, [*group, "--help"], terminal_width=80)
    assert result.exit_code == 0
    listed = result.output.partition("Commands:")[2]
    assert listed.strip() and "..." not in listed
    if not group:
        names = [line.split()[0] for line in listed.splitlines() if line.startswith("  ") and line[2:3].strip()]
        assert names == [command.name for command in COMMANDS]
