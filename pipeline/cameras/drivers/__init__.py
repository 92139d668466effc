"""Drivers of cameras: each module registers one in `event_camera.DRIVERS`."""
