"""The stages of the estimator, one a file, in the order of the flow.

Every stage module has

- `INPUTS`, the names of what its step takes, in order: "packet" or stages before it;
- a `...Parameters` class and a `...Result` class;
- `start(parameters, setting) -> state`, fresh state for a new recording;
- `step(parameters, state, *inputs) -> result`, one tick. State may change in place; inputs never, and results
  never share memory with it. No clock, no randomness that is not seeded, no knowledge of other ticks than by state.
"""
