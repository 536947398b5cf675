#include "topology/files/surface_io.hpp"

#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <random>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::TemporaryFolder;

namespace {

std::filesystem::path save(const TemporaryFolder& folder, const std::string& name, const std::string& text) {
  const std::filesystem::path file = folder.path() / name;
  std::ofstream(file, std::ios::binary) << text;
  return file;
}

std::string text_stl(const SurfaceMesh& mesh) {
  std::string text = "solid test\n";
  for (const Triangle& t : mesh.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const int v : t)
      text += fmt::format("vertex {} {} {}\n", mesh.vertices[v].x(), mesh.vertices[v].y(), mesh.vertices[v].z());
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid test\n";
}

std::string binary_stl(const SurfaceMesh& mesh, const std::string& title = "binary") {
  std::string bytes = title;
  bytes.resize(80, ' ');
  const auto append = [&bytes](auto value) {
    std::array<char, sizeof(value)> raw;
    std::memcpy(raw.data(), &value, sizeof(value));
    bytes.append(raw.data(), raw.size());
  };
  append(static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const Triangle& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i)
      append(0.0F);
    for (const int v : t)
      for (int d = 0; d < 3; ++d)
        append(static_cast<float>(mesh.vertices[v][d]));
    append(std::uint16_t{0});
  }
  return bytes;
}

std::string off(const SurfaceMesh& mesh) {
  std::string text = fmt::format("OFF\n# a comment\n{} {} 0\n", mesh.vertices.size(), mesh.triangles.size());
  for (const Vector3& v : mesh.vertices)
    text += fmt::format("{} {} {}\n", v.x(), v.y(), v.z());
  for (const Triangle& t : mesh.triangles)
    text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return text;
}

std::string text_ply(const SurfaceMesh& mesh) {
  std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
                                 "property float z\nelement face {}\nproperty list uchar int vertex_indices\n"
                                 "end_header\n",
                                 mesh.vertices.size(), mesh.triangles.size());
  for (const Vector3& v : mesh.vertices)
    text += fmt::format("{} {} {}\n", v.x(), v.y(), v.z());
  for (const Triangle& t : mesh.triangles)
    text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return text;
}

SurfaceMesh as_mesh(const PolygonSoup& soup) {
  SurfaceMesh mesh;
  mesh.vertices = soup.vertices;
  for (const auto& polygon : soup.polygons) {
    REQUIRE(polygon.size() == 3);
    mesh.triangles.push_back({polygon[0], polygon[1], polygon[2]});
  }
  return mesh;
}

} // namespace

TEST_CASE("OBJ and PLY give back every bit that was written", "[surface_io]") {
  const TemporaryFolder folder;
  const SurfaceMesh mesh = make_hemisphere(0.05, 0.01);
  for (const char* name : {"a.obj", "a.ply", "A.OBJ"}) {
    write_surface(folder.path() / name, mesh);
    const SurfaceMesh back = as_mesh(read_polygons(folder.path() / name));
    CHECK(back.vertices == mesh.vertices);
    CHECK(back.triangles == mesh.triangles);
  }
}

TEST_CASE("STL, OFF and text PLY are read, scaled to metres", "[surface_io]") {
  const TemporaryFolder folder;
  const SurfaceMesh mesh = make_hemisphere(50, 10);
  const std::vector<std::pair<std::string, std::string>> files = {
      {"t.stl", text_stl(mesh)},
      {"b.stl", binary_stl(mesh)},
      {"solid.stl", binary_stl(mesh, "solid of a CAD system")},
      {"m.off", off(mesh)},
      {"m.ply", text_ply(mesh)}};
  for (const auto& [name, text] : files) {
    INFO(name);
    const SurfaceMesh back = as_mesh(read_polygons(save(folder, name, text), 0.001));
    CHECK(back.vertices.size() == mesh.vertices.size());
    CHECK(back.triangles.size() == mesh.triangles.size());
    CHECK(volume(back) == Approx(1e-9 * volume(mesh)).epsilon(1e-5));
  }
}

TEST_CASE("OBJ with texture references, negative indices, polygons and foreign lines is read", "[surface_io]") {
  const TemporaryFolder folder;
  const auto file = save(folder, "quads.obj",
                         "# units\nmtllib a.mtl\no thing\nv 0 0 0 1 0 0\nv 1 0 0\nv +1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
                         "usemtl skin\ns off\nl 1 2\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -4//1 -3//1 -2//1\n");
  const PolygonSoup soup = read_polygons(file);
  REQUIRE(soup.polygons.size() == 2);
  CHECK(soup.polygons[0] == std::vector<int>{0, 1, 2, 3});
  CHECK(soup.polygons[1] == std::vector<int>{0, 1, 2});
  CHECK(soup.vertices[2] == Vector3(1, 1, 0));
}

TEST_CASE("Files that are missing, empty, folders or of another kind are refused by name", "[surface_io]") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(read_polygons(folder.path() / "none.obj"),
                    Catch::Contains("none.obj") && Catch::Contains("no such"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "empty.ply", "")), Catch::Contains("empty"));
  std::filesystem::create_directory(folder.path() / "folder.obj");
  CHECK_THROWS_WITH(read_polygons(folder.path() / "folder.obj"), Catch::Contains("folder"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "a.xyz", "x")), Catch::Contains(".xyz") && Catch::Contains(".stl"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "noextension", "x")), Catch::Contains("extension"));
  const SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 1);
  // The wrong extension for the contents.
  const std::vector<std::string> contents = {text_stl(mesh), binary_stl(mesh), off(mesh), text_ply(mesh)};
  const std::vector<std::string> names = {"a.stl", "b.stl", "c.off", "d.ply"};
  for (std::size_t i = 0; i < contents.size(); ++i)
    for (const char* wrong : {"x.obj", "x.stl", "x.off", "x.ply"}) {
      INFO(names[i] << " as " << wrong);
      if (names[i].substr(1) != std::string(wrong).substr(1))
        CHECK_THROWS_AS(read_polygons(save(folder, wrong, contents[i])), InputError);
    }
  const auto sound = save(folder, "sound.off", off(mesh));
  CHECK_NOTHROW(read_polygons(sound));
  for (const double scale : {0.0, -1.0, std::numeric_limits<double>::infinity()})
    CHECK_THROWS_WITH(read_polygons(sound, scale), Catch::Contains("scale"));
  CHECK_THROWS_AS(write_surface(folder.path() / "a.stl", mesh), InputError);
  CHECK_THROWS_WITH(write_surface(folder.path() / "no" / "such" / "a.obj", mesh), Catch::Contains("written"));
}

TEST_CASE("Files cut short anywhere before their last element are refused", "[surface_io]") {
  const TemporaryFolder folder;
  const SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 0.5);
  write_surface(folder.path() / "whole.ply", mesh);
  std::ifstream stream(folder.path() / "whole.ply", std::ios::binary);
  const std::string ply((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  const std::vector<std::pair<std::string, std::string>> files = {{"cut.stl", text_stl(mesh)},
                                                                  {"cut.stl", binary_stl(mesh)},
                                                                  {"cut.off", off(mesh)},
                                                                  {"cut.ply", text_ply(mesh)},
                                                                  {"cut.ply", ply}};
  for (const auto& [name, text] : files)
    for (const double part : {0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95}) {
      INFO(name << " at " << part);
      const auto size = static_cast<std::size_t>(part * static_cast<double>(text.size()));
      CHECK_THROWS_AS(read_polygons(save(folder, name, text.substr(0, size))), InputError);
    }
  CHECK_THROWS_WITH(read_polygons(save(folder, "cut.ply", ply.substr(0, ply.size() - 5))),
                    Catch::Contains("face 47 of 48") && Catch::Contains("cut short"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "cut.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2")),
                    Catch::Contains("line 4") && Catch::Contains("cut short"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "cut.obj", "v 0 0 0\nv 1 0")), Catch::Contains("line 2"));
}

TEST_CASE("Garbage is refused, whatever the extension, without asking for much memory", "[surface_io]") {
  const TemporaryFolder folder;
  std::mt19937 random(99);
  for (int round = 0; round < 20; ++round) {
    std::string bytes(200 + 100 * round, '\0');
    for (char& c : bytes)
      c = static_cast<char>(random() & 0xff);
    for (const std::string extension : {".obj", ".ply", ".stl", ".off"})
      CHECK_THROWS_AS(read_polygons(save(folder, "garbage" + extension, bytes)), InputError);
    CHECK_THROWS_AS(read_polygons(save(folder, "garbage.off", "OFF\n" + bytes)), InputError);
    CHECK_THROWS_AS(read_polygons(save(folder, "garbage.stl", "solid \n" + bytes)), InputError);
    CHECK_THROWS_AS(read_polygons(save(folder, "garbage.ply",
                                       "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                                       "property float y\nproperty float z\nelement face 9\n"
                                       "property list uint int vertex_indices\nend_header\n" +
                                           bytes)),
                    InputError);
  }
  CHECK_THROWS_AS(read_polygons(save(folder, "huge.off", "OFF\n2000000000 2000000000 0\n0 0 0\n")), InputError);
  CHECK_THROWS_AS(read_polygons(save(folder, "huge.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n999999999 0 1 2\n")),
                  InputError);
  CHECK_THROWS_AS(read_polygons(save(folder, "huge.ply",
                                     "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                     "property float z\nelement face 1\nproperty list uint int vertex_indices\n"
                                     "end_header\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n")),
                  InputError);
}

TEST_CASE("Coordinates that are not finite are refused with their place", "[surface_io]") {
  const TemporaryFolder folder;
  for (const std::string bad : {"nan", "inf", "-inf", "1e999"}) {
    INFO(bad);
    CHECK_THROWS_WITH(read_polygons(save(folder, "n.obj", "v 0 0 0\nv 1 0 " + bad + "\nv 0 1 0\nf 1 2 3\n")),
                      Catch::Contains("n.obj: line 2") && Catch::Contains(bad));
    CHECK_THROWS_WITH(read_polygons(save(folder, "n.off", "OFF\n3 1 0\n0 0 0\n1 0 " + bad + "\n0 1 0\n3 0 1 2\n")),
                      Catch::Contains("line 4"));
    CHECK_THROWS_WITH(read_polygons(save(folder, "n.stl",
                                         "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 " + bad +
                                             "\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n")),
                      Catch::Contains("line 5"));
  }
  SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 1);
  mesh.vertices[3].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(read_polygons(save(folder, "n.stl", binary_stl(mesh))), Catch::Contains("not finite"));
  write_surface(folder.path() / "n.ply", mesh);
  CHECK_THROWS_WITH(read_polygons(folder.path() / "n.ply"), Catch::Contains("vertex 3"));
}

TEST_CASE("Indices out of range are refused with face and index", "[surface_io]") {
  const TemporaryFolder folder;
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  for (const std::string bad : {"5", "100000", "-5"})
    CHECK_THROWS_WITH(read_polygons(save(folder, "i.obj", vertices + "f 1 2 3\nf 1 2 " + bad + "\n")),
                      Catch::Contains("i.obj"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "i.obj", vertices + "f 1 2 3\nf 1 2 5\n")),
                    Catch::Contains("face 1") && Catch::Contains("vertex 4"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "i.obj", vertices + "f 0 1 2\n")), Catch::Contains("line 5"));
  CHECK_THROWS_WITH(read_polygons(save(folder, "i.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")),
                    Catch::Contains("'7'"));
  SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 1);
  mesh.triangles[2] = {0, 1, 77};
  write_surface(folder.path() / "i.ply", mesh);
  CHECK_THROWS_WITH(read_polygons(folder.path() / "i.ply"), Catch::Contains("face 2") && Catch::Contains("77"));
}

TEST_CASE("Files are read as programs leave them", "[surface_io]") {
  const TemporaryFolder folder;
  const SurfaceMesh mesh = make_block(Vector3(4, 4, 4), 2);
  const std::string mark = "\xEF\xBB\xBF";
  std::string upper = text_stl(mesh);
  for (char& c : upper)
    c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  std::string obj = "# a cube\n", continued = obj, old_mac;
  for (const Vector3& v : mesh.vertices) {
    obj += fmt::format("v {} {} {} # a corner\n", v.x(), v.y(), v.z());
    continued += fmt::format("v {} \\\r\n{} {}\r\n", v.x(), v.y(), v.z());
  }
  for (const Triangle& t : mesh.triangles) {
    obj += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    continued += fmt::format("f {} {}\\\n {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  }
  old_mac = obj;
  for (std::size_t at = 0; (at = old_mac.find(" # a corner", at)) != std::string::npos;)
    old_mac.erase(at, 11);
  std::replace(old_mac.begin(), old_mac.end(), '\n', '\r');
  std::string commented = off(mesh);
  commented.replace(0, 4, "OFF # made by hand\n# and more\n");
  const std::vector<std::pair<std::string, std::string>> files = {
      {"upper.stl", upper},
      {"mark.stl", mark + text_stl(mesh)},
      {"blank.stl", "\n " + text_stl(mesh) + std::string(3, '\0')},
      {"nan.stl", std::string(text_stl(mesh)).replace(text_stl(mesh).find("normal 0 0 0"), 12, "normal nan nan nan")},
      {"comments.obj", obj},
      {"mark.obj", mark + obj},
      {"continued.obj", continued},
      {"nul.obj", obj + '\0'},
      {"end.obj", obj + "\x1A"},
      {"mac.obj", old_mac.substr(old_mac.find('\r') + 1)},
      {"comment.off", commented},
      {"mark.off", mark + commented},
      {"mark.ply", mark + text_ply(mesh)}};
  for (const auto& [name, text] : files) {
    INFO(name);
    const SurfaceMesh back = as_mesh(read_polygons(save(folder, name, text)));
    CHECK(back.triangles.size() == mesh.triangles.size());
    CHECK(volume(back) == Approx(64));
  }
  // A fault after a continued line is told with its own line.
  CHECK_THROWS_WITH(read_polygons(save(folder, "bad.obj", "v 0 \\\n0 0\nv 1 x 0\n")), Catch::Contains("line 3"));
}
