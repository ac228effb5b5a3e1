"""Reading of meshes: STL, OBJ, PLY, GLB and every other format that trimesh reads."""

from __future__ import annotations

import io
import logging
from pathlib import Path
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import InputError
from olp.files.write import PathLike, Reader, read_bytes


def read_mesh(path: PathLike, read: Reader = read_bytes) -> tuple[Array, Index]:
    """(v, 3) vertices and (m, 3) triangles of a mesh, in the units and the frame of its file.

    Triangles without an area are kept, because they may be edges. Raises InputError where the file is not a
    mesh.
    """
    import trimesh

    # it logs the exceptions of a damaged file, which become one sentence here
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    data = read(path)
    try:
        # trimesh detects the format from the suffix in lower case only
        kind = Path(path).suffix.lower().removeprefix(".")
        loaded: Any = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False).to_mesh()
        vertices, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces, np.int64)
    except Exception as error:  # the readers of many formats raise any exception
        raise InputError(
            f"cannot be read as a mesh ({type(error).__name__}); expected STL, OBJ, PLY or GLB",
            file=str(path),
        ) from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError(
            "holds no triangles, or corners that are not finite; expected a mesh", file=str(path)
        )
    return vertices, faces
