// VTK PolyData files (.vtp, XML with appended raw data) and ParaView time series (.pvd).
#pragma once

#include "topology/surface/mesh.hpp"

#include <filesystem>
#include <string>

namespace spherecut::app {

/// A value at every point or cell: one component or three.
struct PointData {
  std::string name; // with its unit: "displacement [m]"
  int components = 1;
  std::vector<double> values; // components per point or cell
};

PointData scalar_data(std::string name, std::vector<double> values);
PointData vector_data(std::string name, const std::vector<Vector3>& values);

/// Points with triangles and straight lines between them and data on points and cells. Without triangles and
/// lines every point is a vertex cell.
struct PolyData {
  std::vector<Vector3> points; // m
  std::vector<Triangle> triangles;
  std::vector<std::array<int, 2>> lines;
  std::vector<PointData> point_data;
  std::vector<PointData> cell_data; // components per line, then per triangle, as VTK counts cells
};

/// Throws InputError when the file cannot be written, std::logic_error when a length does not match.
void write_vtp(const std::filesystem::path& file, const PolyData& data);

/// Points and triangles with data at the points.
void write_vtp(const std::filesystem::path& file, const std::vector<Vector3>& points,
               const std::vector<Triangle>& triangles, const std::vector<PointData>& data);

/// One file of a time series.
struct SeriesEntry {
  double time = 0;  // s
  int part = 0;     // organ, nodes and tool are parts of one series
  std::string file; // relative to the .pvd
};

/// Writes the series so far; replaces an earlier one at once.
void write_pvd(const std::filesystem::path& file, const std::vector<SeriesEntry>& entries);

} // namespace spherecut::app
