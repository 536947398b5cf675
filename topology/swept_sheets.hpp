// Sheets that grow by triangles, and what a growing sheet is asked: whether a point lies on it, whether a triangle
// crosses it. Used by the blade sweep alone.
#pragma once

#include "topology/surface_mesh.hpp"

#include <optional>
#include <unordered_map>

namespace spherecut::topology {

class SweptSheets {
 public:
  /// `cell` m: about the longest edge of a triangle. `thickness` m: how near a point lies on a sheet.
  SweptSheets(double cell, double thickness) : cell_(cell), thickness_(thickness) {}

  [[nodiscard]] const std::vector<SurfaceMesh>& sheets() const { return sheets_; }
  [[nodiscard]] double thickness() const { return thickness_; }
  [[nodiscard]] int triangles() const { return static_cast<int>(places_.size()); }

  int add_sheet();
  int add_vertex(int sheet, const Vector3& x);
  void add_triangle(int sheet, const Triangle& triangle);

  /// Place on a sheet.
  struct Foot {
    Vector3 point, normal; // m; of the triangle, unit
    int sheet = -1;
  };
  /// The foot of x on a triangle of some sheet that x lies over, no more than `thickness` off; the nearest vertex of
  /// the triangle in its place where that is as near. Nothing when x lies beside all triangles.
  [[nodiscard]] std::optional<Foot> on_sheet(const Vector3& x) const;

  /// Whether the triangle meets one of `sheet` that shares no vertex with it. `indices` are its vertices in the sheet,
  /// beyond the last one where they are new.
  [[nodiscard]] bool crosses(int sheet, const Triangle& indices, const std::array<Vector3, 3>& corners) const;

 private:
  struct Place {
    int sheet, triangle;
  };
  [[nodiscard]] std::array<Vector3, 3> corners(const Place& place) const;
  template <class Visit>
  void for_cells(const BoundingBox& box, const Visit& visit) const;

  double cell_, thickness_;
  std::vector<SurfaceMesh> sheets_;
  std::vector<Place> places_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_; // places whose boxes, enlarged, meet the cell
};

} // namespace spherecut::topology
