#include "tests/support/sheets.hpp"

namespace spherecut::tests {

topology::SurfaceMesh grid_sheet(int columns, int rows, const std::function<Vector3(double, double)>& place) {
  topology::SurfaceMesh sheet;
  for (int i = 0; i <= columns; ++i)
    for (int j = 0; j <= rows; ++j)
      sheet.vertices.push_back(place(double(i) / columns, double(j) / rows));
  const auto at = [rows](int i, int j) { return i * (rows + 1) + j; };
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      sheet.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      sheet.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return sheet;
}

topology::SurfaceMesh flat_sheet(const Vector3& corner, const Vector3& first, const Vector3& second, int columns,
                                 int rows) {
  return grid_sheet(columns, rows, [&](double s, double t) -> Vector3 { return corner + s * first + t * second; });
}

topology::SurfaceMesh moved(topology::SurfaceMesh sheet, const std::function<Vector3(const Vector3&)>& move) {
  for (Vector3& x : sheet.vertices)
    x = move(x);
  return sheet;
}

} // namespace spherecut::tests
