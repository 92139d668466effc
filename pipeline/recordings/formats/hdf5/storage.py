"""Check that the values of an HDF5 dataset lie in the file itself."""

from __future__ import annotations

from pathlib import Path

import h5py

from ....errors import RecordingError


def own_dataset(data: h5py.Dataset, path: Path) -> h5py.Dataset:
    """Give the dataset back if the file at `path` holds its values; raises RecordingError otherwise.

    A link, external storage or a virtual dataset has HDF5 read any other file of the disk as if it were events.
    """
    if data.file.filename != str(path) or data.external is not None or data.is_virtual:
        raise RecordingError(
            f"{data.name} lies in another file, which is not read: copy it into one file (h5repack IN OUT): {path}"
        )
    return data
