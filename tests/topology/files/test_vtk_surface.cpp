// VTK files, legacy and XML, in every encoding that writers use; each says the same cube or is refused.
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <zlib.h>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

const SurfaceMesh& block_mesh() {
  static const SurfaceMesh mesh = make_block(Vector3(0.02, 0.03, 0.04), 0.01);
  return mesh;
}

template <typename Number>
void append_number(std::string& bytes, Number value, bool big_endian) {
  auto raw = std::bit_cast<std::array<char, sizeof(Number)>>(value);
  if (big_endian)
    std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

std::string legacy_text() {
  const SurfaceMesh& mesh = block_mesh();
  std::string text = fmt::format("# vtk DataFile Version 3.0\nblock\nASCII\nDATASET POLYDATA\nPOINTS {} double\n",
                                 mesh.vertices.size());
  for (const Vector3& v : mesh.vertices)
    text += fmt::format("{} {} {}\n", v.x(), v.y(), v.z());
  text += fmt::format("POLYGONS {} {}\n", mesh.triangles.size(), 4 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return text + fmt::format("\nPOINT_DATA {}\nNORMALS Normals float\n0 0 1\n", mesh.vertices.size());
}

std::string legacy_binary(bool with_offsets) {
  const SurfaceMesh& mesh = block_mesh();
  std::string bytes = fmt::format("# vtk DataFile Version {}\nblock\nBINARY\nDATASET POLYDATA\nPOINTS {} double\n",
                                  with_offsets ? "5.1" : "4.2", mesh.vertices.size());
  for (const Vector3& v : mesh.vertices)
    for (int d = 0; d < 3; ++d)
      append_number(bytes, v[d], true);
  bytes += "\nMETADATA\nINFORMATION 0\n\n";
  const std::size_t faces = mesh.triangles.size();
  if (with_offsets) {
    bytes += fmt::format("POLYGONS {} {}\nOFFSETS vtktypeint64\n", faces + 1, 3 * faces);
    for (std::size_t f = 0; f <= faces; ++f)
      append_number(bytes, static_cast<std::int64_t>(3 * f), true);
    bytes += "\nCONNECTIVITY vtktypeint64\n";
  } else {
    bytes += fmt::format("POLYGONS {} {}\n", faces, 4 * faces);
  }
  for (const Triangle& t : mesh.triangles) {
    if (!with_offsets)
      append_number(bytes, std::int32_t{3}, true);
    for (const int v : t)
      with_offsets ? append_number(bytes, std::int64_t{v}, true) : append_number(bytes, std::int32_t{v}, true);
  }
  return bytes + "\n";
}

std::string base64(const std::string& bytes) {
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k > bytes.size() ? '=' : digits[group >> (18U - 6U * static_cast<unsigned>(k)) & 63U];
  }
  return text;
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string packed(size, '\0');
  REQUIRE(compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                   bytes.size()) == Z_OK);
  packed.resize(size);
  return packed;
}

enum class Encoding { ascii, binary, appended_raw, appended_base64 };

std::string vtp(Encoding encoding, bool packed, bool long_headers) {
  const SurfaceMesh& mesh = block_mesh();
  std::string appended;
  const auto header_number = [&](std::string& bytes, std::uint64_t value) {
    long_headers ? append_number(bytes, value, false) : append_number(bytes, static_cast<std::uint32_t>(value), false);
  };
  const auto array = [&](const std::string& name, const std::string& type, const std::string& data,
                         const std::string& text) {
    std::string tag = fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents='1' ", type, name);
    if (encoding == Encoding::ascii)
      return tag + "format=\"ascii\">\n" + text + "\n</DataArray>\n";
    std::string head, body = data;
    if (packed) { // two blocks
      const std::size_t half = data.size() / 16 * 8;
      const std::string first = deflated(data.substr(0, half)), rest = deflated(data.substr(half));
      for (const std::size_t value : {std::size_t{2}, half, data.size() - half, first.size(), rest.size()})
        header_number(head, value);
      body = first + rest;
    } else {
      header_number(head, data.size());
    }
    const std::string spelled = packed ? base64(head) + base64(body) : base64(head + body);
    if (encoding == Encoding::binary)
      return tag + "format=\"binary\">\n  " + spelled + "\n</DataArray>\n";
    tag += fmt::format("format=\"appended\" offset=\"{}\"/>\n", appended.size());
    appended += encoding == Encoding::appended_raw ? head + body : spelled;
    return tag;
  };
  std::string points, connectivity, offsets, points_text, connectivity_text, offsets_text;
  for (const Vector3& v : mesh.vertices)
    for (int d = 0; d < 3; ++d) {
      append_number(points, v[d], false);
      points_text += fmt::format("{} ", v[d]);
    }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const int v : mesh.triangles[t]) {
      append_number(connectivity, std::int64_t{v}, false);
      connectivity_text += fmt::format("{} ", v);
    }
    append_number(offsets, static_cast<std::int64_t>(3 * (t + 1)), false);
    offsets_text += fmt::format("{} ", 3 * (t + 1));
  }
  std::string xml = fmt::format("<?xml version=\"1.0\"?>\n<!-- a > b -->\n<VTKFile type=\"PolyData\" version=\"1.0\" "
                                "byte_order=\"LittleEndian\"{}{}>\n<PolyData>\n<Piece NumberOfPoints=\"{}\">\n",
                                long_headers ? " header_type=\"UInt64\"" : "",
                                packed ? " compressor=\"vtkZLibDataCompressor\"" : "", mesh.vertices.size());
  xml += "<PointData>" + array("Points", "Float64", points.substr(0, 800), "1 2 3") + "</PointData>\n";
  xml += "<Points>" + array("Points", "Float64", points, points_text) + "</Points>\n";
  xml += "<Polys>" + array("connectivity", "Int64", connectivity, connectivity_text) +
         array("offsets", "Int64", offsets, offsets_text) + "</Polys>\n</Piece>\n</PolyData>\n";
  if (!appended.empty())
    xml += fmt::format("<AppendedData encoding=\"{}\">\n_{}\n</AppendedData>\n",
                       encoding == Encoding::appended_raw ? "raw" : "base64", appended);
  return xml + "</VTKFile>\n";
}

void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

void require_block(const std::filesystem::path& file) {
  const CheckedSurface surface = read_surface(file);
  CHECK(surface.mended.empty());
  CHECK(surface.mesh.vertices == block_mesh().vertices);
  CHECK(surface.mesh.triangles == block_mesh().triangles);
}

} // namespace

TEST_CASE("Legacy VTK files are read as text and as bytes of both versions", "[vtk_surface]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "block.vtk";
  for (const std::string& bytes : {legacy_text(), legacy_binary(false), legacy_binary(true)}) {
    write_bytes(file, bytes);
    require_block(file);
  }
}

TEST_CASE("Strips of a legacy VTK file keep their side", "[vtk_surface]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "strip.vtk";
  write_bytes(file, "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n"
                    "0 0 0 1 0 0 0 1 0 1 1 0 0 2 0\nTRIANGLE_STRIPS 1 6\n5 0 1 2 3 4\n");
  const PolygonSoup soup = read_polygons(file, 0.5);
  REQUIRE(soup.polygons.size() == 3);
  for (const std::vector<int>& t : soup.polygons) {
    const Vector3 normal = (soup.vertices[t[1]] - soup.vertices[t[0]]).cross(soup.vertices[t[2]] - soup.vertices[t[0]]);
    CHECK(normal.z() == Approx(0.25));
  }
}

TEST_CASE("VTP files are read in every encoding", "[vtk_surface]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "block.vtp";
  for (const Encoding encoding : {Encoding::ascii, Encoding::binary, Encoding::appended_raw, Encoding::appended_base64})
    for (const bool packed : {false, true})
      for (const bool long_headers : {false, true}) {
        write_bytes(file, vtp(encoding, packed, long_headers));
        require_block(file);
      }
}

TEST_CASE("Damaged VTK files are refused in words, wherever they end", "[vtk_surface]") {
  const tests::TemporaryFolder folder;
  for (const auto& [name, bytes] : {std::pair<std::string, std::string>{"t.vtk", legacy_text()},
                                    {"b.vtk", legacy_binary(true)},
                                    {"c.vtp", vtp(Encoding::binary, true, true)},
                                    {"d.vtp", vtp(Encoding::appended_raw, true, false)}}) {
    const auto file = folder.path() / name;
    for (std::size_t part = 0; part < 40; ++part) {
      write_bytes(file, bytes.substr(0, bytes.size() * part / 40));
      try {
        read_polygons(file); // what follows the polygons may be missing
      } catch (const InputError& error) {
        CHECK_THAT(error.what(), Catch::Contains(name));
      }
      std::string flipped = bytes;
      flipped[bytes.size() * part / 40] = static_cast<char>(flipped[bytes.size() * part / 40] ^ 0x15);
      write_bytes(file, flipped);
      try {
        read_polygons(file);
      } catch (const InputError& error) {
        CHECK_THAT(error.what(), Catch::Contains(name));
      }
    }
  }
  const auto file = folder.path() / "grid.vtk";
  write_bytes(file, "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n");
  CHECK_THROWS_WITH(read_polygons(file), Catch::Contains("UNSTRUCTURED_GRID") && Catch::Contains("POLYDATA"));
}
