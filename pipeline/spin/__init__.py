"""Spin methods: one package or module each, every one a stage of one ball that gives an estimate."""
