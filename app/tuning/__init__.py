"""Sweeps and optimization of parameters and biases, on top of the pipeline; no web in it."""
