#include "src/output/vtp.hpp"

#include "src/base/output_file.hpp"

#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <stdexcept>

namespace spherecut::app {
namespace {

static_assert(std::endian::native == std::endian::little, "the appended data is declared little-endian");

// The blocks of the appended section: each is its length in bytes as UInt64, then the bytes.
class Appended {
 public:
  template <class T>
  std::size_t add(const std::vector<T>& values) {
    const std::size_t offset = bytes_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof(length));
    append(values.data(), length);
    return offset;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  std::string bytes_;
};

std::vector<double> flat(const std::vector<Vector3>& points) {
  std::vector<double> values;
  values.reserve(3 * points.size());
  for (const Vector3& p : points)
    values.insert(values.end(), {p.x(), p.y(), p.z()});
  return values;
}

std::string array_line(std::string_view type, std::string_view name, int components, std::size_t offset) {
  return fmt::format(
      "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type, name,
      components, offset);
}

template <std::size_t size>
std::string cells(std::string_view tag, const std::vector<std::array<int, size>>& corners, Appended& appended) {
  std::vector<std::int64_t> connectivity;
  std::vector<std::int64_t> offsets;
  for (const std::array<int, size>& cell : corners) {
    connectivity.insert(connectivity.end(), cell.begin(), cell.end());
    offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
  }
  std::string text = fmt::format("<{}>\n", tag);
  text += array_line("Int64", "connectivity", 1, appended.add(connectivity));
  text += array_line("Int64", "offsets", 1, appended.add(offsets));
  return text + fmt::format("</{}>\n", tag);
}

std::string value_arrays(std::string_view tag, const std::vector<PointData>& arrays, std::size_t count,
                         Appended& appended) {
  std::string text = fmt::format("<{}>\n", tag);
  for (const PointData& array : arrays) {
    if (array.values.size() != count * static_cast<std::size_t>(array.components))
      throw std::logic_error(fmt::format("{} '{}' has {} values for {}", tag, array.name, array.values.size(), count));
    text += array_line("Float64", array.name, array.components, appended.add(array.values));
  }
  return text + fmt::format("</{}>\n", tag);
}

} // namespace

PointData scalar_data(std::string name, std::vector<double> values) {
  return {std::move(name), 1, std::move(values)};
}

PointData vector_data(std::string name, const std::vector<Vector3>& values) {
  return {std::move(name), 3, flat(values)};
}

void write_vtp(const std::filesystem::path& file, const PolyData& data) {
  Appended appended;
  const bool cloud = data.triangles.empty() && data.lines.empty();
  const std::size_t vertices = cloud ? data.points.size() : 0;
  std::string xml = fmt::format("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
                                "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n"
                                "<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" NumberOfLines=\"{}\" "
                                "NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
                                data.points.size(), vertices, data.lines.size(), data.triangles.size());
  xml += value_arrays("PointData", data.point_data, data.points.size(), appended);
  xml += value_arrays("CellData", data.cell_data, vertices + data.lines.size() + data.triangles.size(), appended);
  xml += "<Points>\n" + array_line("Float64", "Points", 3, appended.add(flat(data.points))) + "</Points>\n";
  if (cloud) {
    std::vector<std::array<int, 1>> singles;
    singles.reserve(data.points.size());
    for (int i = 0; i < std::ssize(data.points); ++i)
      singles.push_back({i});
    xml += cells("Verts", singles, appended);
  }
  if (!data.lines.empty())
    xml += cells("Lines", data.lines, appended);
  if (!data.triangles.empty())
    xml += cells("Polys", data.triangles, appended);
  xml += "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
  replace_file(file, xml + appended.bytes() + "\n</AppendedData>\n</VTKFile>\n");
}

void write_vtp(const std::filesystem::path& file, const std::vector<Vector3>& points,
               const std::vector<Triangle>& triangles, const std::vector<PointData>& data) {
  write_vtp(file, PolyData{points, triangles, {}, data, {}});
}

void write_pvd(const std::filesystem::path& file, const std::vector<SeriesEntry>& entries) {
  std::string xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" "
                    "byte_order=\"LittleEndian\">\n<Collection>\n";
  for (const SeriesEntry& entry : entries)
    xml += fmt::format("<DataSet timestep=\"{:.9g}\" part=\"{}\" file=\"{}\"/>\n", entry.time, entry.part, entry.file);
  replace_file(file, xml + "</Collection>\n</VTKFile>\n");
}

} // namespace spherecut::app
