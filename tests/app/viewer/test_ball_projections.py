"""Which directions lie behind the pixels of the logo's pictures."""

from __future__ import annotations

import numpy as np

from spinscope.app.viewer.ball_projections import disc_directions, disc_mask, map_frame, texture_directions


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


def test_the_maps_longitude_grows_in_the_sense_of_the_spin_from_the_middle_on() -> None:
    spin_rps, middle = np.array([3.0, -20.0, 8.0]), np.array([0.3, 0.2, -0.9])
    zero, quarter, pole = map_frame(spin_rps, middle)
    np.testing.assert_allclose(pole, spin_rps / np.linalg.norm(spin_rps), atol=1e-12)
    assert zero @ middle > 0 and abs(quarter @ middle) < 1e-12
    assert quarter @ (middle + 0.01 * np.cross(spin_rps, middle)) > 0  # where the spin takes it next
