"""Bodies: meshes of the job where their frames put them, and a machine whose nodes follow its axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from judge.machines import CHAINS, Recipe, zero_machine
from judge.unpacker import Page

import olp
from olp.core.errors import ConfigError, InputError
from olp.core.geometry import rotation_matrix
from olp.files.meshes import read_mesh
from olp.review import meshes
from olp.review.meshes import coarser, nodes, of_machine

TEXT = "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nY80 Z30\nM2\n"


def job(folder: Path, machine: Path, *tables: str) -> Path:
    (folder / "part.ngc").write_text(TEXT)
    path = folder / "job.toml"
    described = "".join(f"[[meshes]]\n{table}\n" for table in tables)
    path.write_text(f'schema = "olp-job-1"\nprogram = "part.ngc"\nmachine = "{machine}"\n{described}')
    return path


def page_of(folder: Path, machine: Path, *tables: str) -> Page:
    path = job(folder, machine, *tables)
    return Page(olp.view(folder / "part.ngc", machine, path, time=False).html())


def corners(page: Page, name: str) -> np.ndarray:
    """Least and largest corner of a mesh in the frame of the positions."""
    mesh = next(m for m in page.manifest["meshes"] if m["label"] == name)
    vertices = page.array(mesh["vertices"]) + np.array(page.manifest["origin_mm"])
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "glb"])
def test_a_mesh_stands_where_its_frame_is(kind: str, tmp_path: Path) -> None:
    """Work offsets of the test machine: G54 at (250, 200, -300), G55 at (420, 310, -280)."""
    machine = zero_machine(tmp_path / "m")
    trimesh.creation.box((40.0, 30.0, 20.0)).export(tmp_path / f"box.{kind}")
    half = np.array([[-20.0, -15.0, -10.0], [20.0, 15.0, 10.0]])
    for frame, shift in (("G54", [0, 0, 0]), ("G55", [170, 110, 20]), ("machine", [-250, -200, 300])):
        page = page_of(tmp_path, machine, f'file = "box.{kind}"\nrole = "fixture"\nframe = "{frame}"')
        np.testing.assert_allclose(corners(page, "box"), half + np.array(shift), atol=1e-4)
    page = page_of(
        tmp_path, machine, f'file = "box.{kind}"\nrole = "workpiece"\nframe = "G54"\nunit_mm = 25.4'
    )
    np.testing.assert_allclose(corners(page, "box"), 25.4 * half, atol=1e-3)
    assert [m["role"] for m in page.manifest["meshes"] if m["label"] == "box"] == ["workpiece"]


def test_a_mesh_in_a_rotated_frame_is_rotated(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    trimesh.creation.box((40.0, 30.0, 20.0)).export(tmp_path / "box.stl")
    path = job(tmp_path, machine, 'file = "box.stl"\nrole = "fixture"\nframe = "vice"')
    path.write_text(
        path.read_text() + "[work_offsets.vice]\nX_mm = 250.0\nY_mm = 200.0\nZ_mm = -300.0\nC_deg = 90.0\n"
    )
    page = Page(olp.view(tmp_path / "part.ngc", machine, path, time=False).html())
    np.testing.assert_allclose(corners(page, "box"), [[-15, -20, -10], [15, 20, 10]], atol=1e-4)


def test_rotations_are_right_handed_and_in_order() -> None:
    """A point on X, turned by 90 degrees about Z, lies on Y; A comes before B, B before C."""
    about = {axis: rotation_matrix(tuple(90.0 * (k == axis) for k in range(3))) for axis in range(3)}
    np.testing.assert_allclose(about[2] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(about[0] @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(about[1] @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    whole = rotation_matrix((90.0, 90.0, 90.0))
    np.testing.assert_allclose(whole, about[2] @ about[1] @ about[0], atol=1e-15)


@pytest.mark.parametrize(
    ("name", "data"), [("bad.stl", b"solid nothing\n"), ("bad.glb", b"\x00" * 40), ("bad.xyz", b"1")]
)
def test_what_is_no_mesh_is_refused_with_its_name(name: str, data: bytes, tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=name):
        page_of(tmp_path, machine, f'file = "{name}"\nrole = "fixture"')


def test_a_frame_or_file_that_is_not_there_is_refused_with_its_line(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    for table, key in (
        ('file = "box.stl"\nrole = "fixture"\nframe = "G59"', "frame"),
        ('file = "no.stl"\nrole = "fixture"', "file"),
        ('file = "box.stl"\nrole = "fixture"\nunit_mm = 0.0', "unit_mm"),
    ):
        with pytest.raises(ConfigError, match=rf"job\.toml: line \d+: meshes\[\d\]\.{key}"):
            page_of(tmp_path, machine, table)


def test_a_fine_mesh_is_drawn_coarser(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(meshes, "MOST_FACES", 500)
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=50.0)
    sphere.export(tmp_path / "ball.ply")
    vertices, faces = coarser(*read_mesh(tmp_path / "ball.ply"))
    assert 100 < len(faces) <= 500
    assert faces.max() < len(vertices)
    radius = np.linalg.norm(vertices[np.unique(faces)], axis=1)
    assert radius.min() > 40.0 and radius.max() <= 50.0 + 1e-4
    small = coarser(sphere.vertices[:3], np.array([[0, 1, 2]]))
    assert len(small[1]) == 1


# -- the machine ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("chain", CHAINS)
def test_nodes_bring_the_tool_to_the_tip(chain: str, tmp_path: Path) -> None:
    """Whatever carries what: the tool's body, moved by the nodes above it, ends at the tip."""
    tools = {1: {"Z_mm": 120.0, "radius_mm": 5.0}}
    machine = zero_machine(tmp_path / "m", Recipe(chain=chain, tools=tools))
    page = page_of(tmp_path, machine)
    tool = next(m for m in page.manifest["meshes"] if m["role"] == "tool")
    vertices = page.array(tool["vertices"])
    bottom = np.array([*vertices.mean(axis=0)[:2], vertices[:, 2].min()])
    shift = page.array(page.manifest["axes"])
    tip = page.array("P")
    moving = {tuple(node["path"]): node["axis"] for node in page.manifest["nodes"]}
    for k in range(0, len(tip), 7):
        place = bottom.copy()
        for depth in range(len(tool["path"])):
            axis = moving.get(tuple(tool["path"][: depth + 1]))
            if axis is not None:
                place[axis] += shift[k, axis]
        np.testing.assert_allclose(place, tip[k], atol=1e-3)


@pytest.mark.parametrize("chain", CHAINS)
def test_every_axis_has_a_body_of_its_own(chain: str, tmp_path: Path) -> None:
    machine = olp.load_setup(zero_machine(tmp_path / "m", Recipe(chain=chain))).machine
    gauge, tip = np.array([0.0, 0.0, 120.0]), np.zeros(3)
    bodies = list(of_machine(machine, np.array([400.0, 300.0, -200.0]), gauge, tip, 5.0))
    paths = [node.path for node in nodes(machine)]
    assert len(paths) == 3 and all(len(path) == k + 2 for k, path in enumerate(paths))
    assert {body.path for body in bodies} == {(), *paths}
    for body in bodies:
        size = body.vertices.max(axis=0) - body.vertices.min(axis=0)
        assert (size > 0.0).all()
        # closed, with faces that look outwards
        mesh = trimesh.Trimesh(body.vertices, body.faces, process=True)
        assert mesh.is_watertight and mesh.volume > 0.0


def test_no_tool_is_drawn_where_several_are_used(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    (tmp_path / "part.ngc").write_text(
        "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nT2 M6\nG43 H2\nG0 X5 Y0 Z20\nG1 X9 F60\nM2\n"
    )
    scene = olp.view(tmp_path / "part.ngc", machine, time=False).scene
    assert "tool" not in {body.role for body in scene.bodies}
    assert scene.tool_radius_mm == 5.0
