"""The bits of the command line: the same scene gives the same positions, tets and reports."""

import base64
import json
import subprocess
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import incise

SCENE = """
[report]
every = 1
quantities = ["energy", "volume", "speed", "force"]
[world]
gravity = [0.0, 0.0, -9.81]
ground = { height = -0.6, friction = 0.4 }
[solver]
substeps = 6
precision = "PRECISION"
[[body]]
shape = { kind = "liver", tets = 1500 }
young_modulus = 5e4
fixed = [{ half_space = { point = [-0.4, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
[[stroke]]
kind = "sweep"
frames = [2, 14]
blade = [[0.05, -1.0, 0.6], [0.05, 1.0, 0.6]]
path = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.2]]
"""
FRAMES = 18


def array(element):
    """The numbers of a DataArray of a .vtu file, inline and in base64 with the header that VTK documents."""
    dtype = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "<u1"}[element.get("type")]
    if element.get("format") == "ascii":
        return np.array(element.text.split(), dtype=dtype)
    assert element.get("format") == "binary"
    text = element.text.strip()
    header = {"UInt64": "<u8", "UInt32": "<u4"}
    return header, text, dtype


def read_vtu(path):
    """Positions and tets that `incise run --save-mesh` wrote."""
    root = ElementTree.parse(path).getroot()
    assert root.get("compressor") is None
    width = {"UInt64": 8, "UInt32": 4}[root.get("header_type", "UInt32")]

    def numbers(element):
        read = array(element)
        if isinstance(read, np.ndarray):
            return read
        _, text, dtype = read
        data = base64.b64decode(text)
        size = int.from_bytes(data[:width], "little")
        return np.frombuffer(data[width : width + size], dtype)

    named = {element.get("Name"): element for element in root.iter("DataArray")}
    return numbers(named["position"]).reshape(-1, 3), numbers(named["connectivity"]).reshape(-1, 4)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_the_command_line_and_python_agree_bit_for_bit(cli, tmp_path, precision):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.replace("PRECISION", precision))
    command = [cli, "run", scene, "--frames", str(FRAMES), "--quiet", "--no-pictures", "--out", tmp_path / "out"]
    command += ["--save-mesh", tmp_path / "end.vtu", "--jsonl", tmp_path / "frames.jsonl"]
    subprocess.run(command, check=True, timeout=300)
    sim = incise.Simulation.from_scene(scene)
    reports = sim.run(FRAMES)
    assert reports[-1]["pieces"] == 2

    positions, tets = read_vtu(tmp_path / "end.vtu")
    assert positions.tobytes() == sim.positions.tobytes()
    assert np.array_equal(tets, sim.tets)

    def timeless(report):
        return {key: value for key, value in report.items() if key != "ms"}

    lines = [json.loads(line) for line in (tmp_path / "frames.jsonl").read_text().splitlines()]
    assert [timeless(line) for line in lines] == [timeless(report) for report in reports]
    assert all(set(line["ms"]) == set(report["ms"]) for line, report in zip(lines, reports))


def test_colors_of_a_mesh(cli, tmp_path):
    mesh = incise.Mesh.generate("torus", 2000)
    mesh.save(tmp_path / "torus.vtk")
    for algorithm, clustering in [("auto", "none"), ("scgc", "serial:10"), ("greedy", "none")]:
        command = [cli, "color", tmp_path / "torus.vtk", "--algorithm", algorithm, "--clustering", clustering]
        command += ["--csv", tmp_path / "colors.csv"]
        subprocess.run(command, check=True, timeout=300, capture_output=True)
        table = np.loadtxt(tmp_path / "colors.csv", delimiter=",", skiprows=1, dtype=int)
        clusters = incise.cluster(mesh.tets, clustering)
        coloring = incise.color(clusters.quotient, algorithm, particles=len(mesh.points))
        assert np.array_equal(clusters.labels, table[:, 1])
        assert np.array_equal(coloring.colors[clusters.labels], table[:, 2])
