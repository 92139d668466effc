"""Calibration of the camera and labels of the ball from recordings: what stands before an experiment."""
