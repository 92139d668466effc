"""The stages of the estimator, one a file, in the order of the flow.

Every stage module has a `...Parameters` and a `...Result` class and ends with `STAGE`, the record that the registry
lists (see `spinscope.pipeline.stage.Stage` for `start`, `step` and `absent`). No clock, no randomness that is not
seeded, no knowledge of other ticks than by state.
"""
