"""The scripts of examples/python as they stand, each with its picture; and the code of docs/python.md."""

import os
import re
import struct
import subprocess
import sys
import zlib

import pytest
from conftest import SOURCE

SCRIPTS = sorted((SOURCE / "examples" / "python").glob("*.py"))


def is_drawn(png):
    """A picture of some size with more than one colour."""
    data = png.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    pixels = zlib.decompress(b"".join(data[m.end() : m.end() + struct.unpack(">I", data[m.start() - 4 : m.start()])[0]]
                                      for m in re.finditer(b"IDAT", data)))
    return width > 300 and height > 200 and len(set(pixels[:: max(1, len(pixels) // 20000)])) > 20


def test_there_are_five():
    assert len(SCRIPTS) == 5


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_example(script, tmp_path):
    said = subprocess.run([sys.executable, script, "--out", tmp_path], cwd=tmp_path, capture_output=True, text=True,
                          env=os.environ | {"MPLCONFIGDIR": str(tmp_path / "mpl")})
    assert said.returncode == 0, said.stdout + said.stderr
    assert said.stdout.strip()
    pictures = list(tmp_path.glob("*.png"))
    assert pictures and all(is_drawn(png) for png in pictures)


def test_code_of_the_page(tmp_path):
    text = (SOURCE / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(blocks) >= 6
    program = "\n".join(blocks)
    said = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True,
                          env=os.environ | {"MPLCONFIGDIR": str(tmp_path / "mpl")})
    assert said.returncode == 0, said.stdout + said.stderr
    for printed in re.findall(r"^print\(.*?#>? (.*)$", program, re.M):  # what the page says is printed
        assert printed in said.stdout, (printed, said.stdout)
