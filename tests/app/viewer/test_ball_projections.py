"""Which directions lie behind the pixels of the logo's pictures."""

from __future__ import annotations

import numpy as np

from spinscope.app.viewer.ball_projections import disc_directions, disc_mask, texture_directions


def test_the_textures_middle_faces_the_camera_with_the_images_right_and_down() -> None:
    texels = texture_directions()
    height, width, _ = texels.shape
    middle = texels[height // 2, width // 2]
    assert middle @ [0, 0, -1] > 0.99
    assert texels[height // 2, width // 2 + 20][0] > 0.3
    assert texels[height // 2 + 15, width // 2][1] > 0.3


def test_the_left_disc_looks_at_the_middle_and_the_right_one_at_the_back() -> None:
    """Seen by the camera: x to the right and y down on the left disc; mirrored left to right on the right one."""
    mask = disc_mask()
    directions = np.full((*mask.shape, 3), np.nan)
    directions[mask] = disc_directions(np.array([0.0, 0.0, -1.0]))
    size = mask.shape[0]
    np.testing.assert_allclose(directions[size // 2, size // 2], [0, 0, -1], atol=0.02)
    assert directions[size // 2, size // 2 + 40][0] > 0.4
    assert directions[size // 2 + 40, size // 2][1] > 0.4
    back = mask.shape[1] - size // 2
    np.testing.assert_allclose(directions[size // 2, back], [0, 0, 1], atol=0.02)
    assert directions[size // 2, back + 40][0] < -0.4
    np.testing.assert_allclose(np.linalg.norm(directions[mask], axis=1), 1, atol=1e-9)
