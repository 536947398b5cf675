"""What scripts/unused_functions.py takes for a function that nobody calls."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(os.environ["SPHERECUT_SOURCE"]) / "scripts"))
import unused_functions  # noqa: E402

HEADER = """
/// Area, m2. area(mesh) is never negative.
double area(const Mesh& mesh);
class Body {
 public:
  [[nodiscard]] virtual Field solve(int load) const;
  void reset() { area(mesh_); }
};
"""


@pytest.mark.parametrize(
    "source, dead",
    [
        ("double area(const Mesh& mesh) { return 1; }\nField Body::solve(int load) const { return {}; }", {"solve", "reset"}),
        ("int main() {\n  Body body;\n  body.reset();\n  return solve(1);\n}", set()),
        ("int main() {\n  const auto run = &Body::solve;\n  body.reset();\n}", set()),
        ('// reset()\nconst char* text = "solve()";', {"solve", "reset"}),
    ],
)
def test_called_by_nobody(tmp_path, source, dead):
    (tmp_path / "body.hpp").write_text(HEADER)
    (tmp_path / "body.cpp").write_text(source)
    header, caller = (unused_functions.text_of(tmp_path / name) for name in ("body.hpp", "body.cpp"))
    found = unused_functions.unused({"body.hpp": header}, [header, caller], [])
    assert found == ([f"body.hpp: {name}" for name in sorted(dead)], [])


def test_called_by_tests_alone():
    header = "double area(const Mesh& mesh);\n"
    assert unused_functions.unused({"a.hpp": header}, [header], ["CHECK(area(mesh) == 1);\n"]) == ([], ["a.hpp: area"])


def test_the_sources_have_none():
    headers = {str(file): unused_functions.text_of(file) for file in unused_functions.sources("topology", "solvers", "src") if file.suffix == ".hpp"}
    assert unused_functions.main() == 0
    assert len(headers) > 150
