"""Live runs for users: lines of JSON, sockets, tables of shots."""
