"""Reading of meshes: STL, OBJ, PLY, GLB and what else trimesh reads."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import InputError
from olp.files.write import PathLike, Reader, read_bytes


def read_mesh(
    path: PathLike, read: Reader = read_bytes
) -> tuple[Array, Index]:
    """(v, 3) vertices and (m, 3) triangles of a mesh, in the units and the frame of its file.

    Triangles without an area stay: they are edges of something. Raises InputError for what is no mesh.
    """
    import trimesh

    data = read(path)
    try:
        # the text of an ASCII file tells its kind as little as a suffix in capitals
        kind = Path(path).suffix.lower().removeprefix(".")
        loaded: Any = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False).to_mesh()
        vertices, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces, np.int64)
    except Exception as error:  # readers of many formats raise what they like
        raise InputError(
            f"is no mesh that can be read ({type(error).__name__}); expected STL, OBJ, PLY or GLB",
            file=str(path),
        ) from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError(
            "holds no triangles, or corners that are not finite; expected a mesh", file=str(path)
        )
    return vertices, faces
