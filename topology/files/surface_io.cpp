#include "topology/files/surface_io.hpp"

#include "topology/base/errors.hpp"
#include "topology/files/surface_format.hpp"
#include "topology/files/vtk_surface.hpp"

#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/PLY.h>
#include <CGAL/IO/STL.h>
#include <CGAL/Simple_cartesian.h>
#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fmt/format.h>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

namespace spherecut::topology {

namespace {

using Point = CGAL::Simple_cartesian<double>::Point_3;

std::string lower_case_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

std::optional<SurfaceFormat> format_of(const std::filesystem::path& file) {
  const std::string extension = lower_case_extension(file);
  if (extension == ".obj")
    return SurfaceFormat::obj;
  if (extension == ".ply")
    return SurfaceFormat::ply;
  if (extension == ".stl")
    return SurfaceFormat::stl;
  if (extension == ".off")
    return SurfaceFormat::off;
  return std::nullopt;
}

bool parse(SurfaceFormat format, std::istream& stream, std::vector<Point>& points,
           std::vector<std::vector<int>>& polygons) {
  switch (format) {
  case SurfaceFormat::obj:
    return CGAL::IO::read_OBJ(stream, points, polygons);
  case SurfaceFormat::ply:
    return CGAL::IO::read_PLY(stream, points, polygons);
  case SurfaceFormat::stl:
    return CGAL::IO::read_STL(stream, points, polygons);
  case SurfaceFormat::off:
    return CGAL::IO::read_OFF(stream, points, polygons);
  }
  return false;
}

template <typename Value>
void append_little_endian(std::string& bytes, Value value) {
  auto raw = std::bit_cast<std::array<char, sizeof(Value)>>(value);
  if constexpr (std::endian::native == std::endian::big)
    std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

std::string obj_text(const SurfaceMesh& mesh) {
  std::string text;
  for (const Vector3& v : mesh.vertices)
    fmt::format_to(std::back_inserter(text), "v {} {} {}\n", v.x(), v.y(), v.z());
  for (const Triangle& t : mesh.triangles)
    fmt::format_to(std::back_inserter(text), "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return text;
}

std::string ply_bytes(const SurfaceMesh& mesh) {
  std::string bytes = fmt::format("ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex {}\n"
                                  "property double x\nproperty double y\nproperty double z\nelement face {}\n"
                                  "property list uchar int vertex_indices\nend_header\n",
                                  mesh.vertices.size(), mesh.triangles.size());
  for (const Vector3& v : mesh.vertices)
    for (int d = 0; d < 3; ++d)
      append_little_endian(bytes, v[d]);
  for (const Triangle& t : mesh.triangles) {
    append_little_endian(bytes, std::uint8_t{3});
    for (const int v : t)
      append_little_endian(bytes, static_cast<std::int32_t>(v));
  }
  return bytes;
}

} // namespace

std::string file_contents(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    throw InputError(fmt::format("{}: no such file", name));
  if (std::filesystem::is_directory(status))
    throw InputError(fmt::format("{}: is a folder, not a file", name));
  constexpr std::uintmax_t most_bytes = 2'000'000'000;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error)
    throw InputError(fmt::format("{}: cannot be read: {}", name, error.message()));
  if (size == 0)
    throw InputError(fmt::format("{}: the file is empty", name));
  if (size > most_bytes)
    throw InputError(fmt::format("{}: {:.1f} GB: at most {:.0f} GB", name, static_cast<double>(size) / 1e9,
                                 static_cast<double>(most_bytes) / 1e9));
  std::ifstream stream(file, std::ios::binary);
  std::string text(size, '\0');
  if (!stream.read(text.data(), static_cast<std::streamsize>(size)))
    throw InputError(fmt::format("{}: cannot be read", name));
  return text;
}

void require_readable(const PolygonSoup& soup, const std::string& name) {
  for (std::size_t v = 0; v < soup.vertices.size(); ++v)
    if (!soup.vertices[v].allFinite())
      throw InputError(fmt::format("{}: vertex {} (counted from 0) is not finite", name, v));
  const int vertices = static_cast<int>(soup.vertices.size());
  for (std::size_t f = 0; f < soup.polygons.size(); ++f) {
    if (soup.polygons[f].size() < 3 || soup.polygons[f].size() > most_corners)
      throw InputError(fmt::format("{}: face {} (counted from 0) has {} corners: must be 3 to {}", name, f,
                                   soup.polygons[f].size(), most_corners));
    for (const int v : soup.polygons[f])
      if (v < 0 || v >= vertices)
        throw InputError(fmt::format("{}: face {} refers to vertex {} (both counted from 0): must be 0 to {}", name, f,
                                     v, vertices - 1));
  }
}

namespace {

/// Polygons of a file that CGAL parses, in its own unit.
PolygonSoup parsed_polygons(const std::filesystem::path& file, const std::string& name) {
  const auto format = format_of(file);
  if (!format)
    throw InputError(fmt::format("{}: unknown extension '{}': must be .obj, .ply, .stl, .off, .vtk or .vtp", name,
                                 file.extension().string()));
  const std::string text = checked_text(*format, file_contents(file), name);
  std::vector<Point> points;
  PolygonSoup soup;
  std::string reason = "its contents do not follow the format";
  bool parsed = false;
  try {
    std::istringstream stream(text);
    parsed = parse(*format, stream, points, soup.polygons);
  } catch (const std::exception& error) {
    reason = error.what();
  }
  if (!parsed && !(points.empty() || soup.polygons.empty()))
    throw InputError(fmt::format("{}: cannot be read as {}: {}", name, file.extension().string(), reason));
  soup.vertices.reserve(points.size());
  for (const Point& p : points)
    soup.vertices.emplace_back(p.x(), p.y(), p.z());
  return soup;
}

} // namespace

PolygonSoup read_polygons(const std::filesystem::path& file, double scale_to_metres) {
  const std::string name = file.string();
  if (!(std::isfinite(scale_to_metres) && scale_to_metres > 0))
    throw InputError(
        fmt::format("{}: scale = {}: must be a positive number of metres per unit of the file", name, scale_to_metres));
  PolygonSoup soup;
  if (const std::string extension = lower_case_extension(file); extension == ".vtk")
    soup = vtk_polygons(file_contents(file), name);
  else if (extension == ".vtp")
    soup = vtp_polygons(file_contents(file), name);
  else
    soup = parsed_polygons(file, name);
  if (soup.vertices.empty() || soup.polygons.empty())
    throw InputError(fmt::format("{}: holds {} vertices and {} faces: there is no surface", name, soup.vertices.size(),
                                 soup.polygons.size()));
  for (Vector3& v : soup.vertices)
    v *= scale_to_metres;
  require_readable(soup, name);
  return soup;
}

void write_surface(const std::filesystem::path& file, const SurfaceMesh& mesh) {
  const std::string extension = lower_case_extension(file);
  if (extension != ".obj" && extension != ".ply")
    throw InputError(
        fmt::format("{}: surfaces are written as .obj or .ply, not '{}'", file.string(), file.extension().string()));
  const std::string bytes = extension == ".obj" ? obj_text(mesh) : ply_bytes(mesh);
  std::ofstream stream(file, std::ios::binary);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream)
    throw InputError(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
}

} // namespace spherecut::topology
