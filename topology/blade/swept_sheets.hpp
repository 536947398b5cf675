// Sheets that grow by triangles, and what a growing sheet is asked: whether a point lies on it, whether a triangle
// crosses it. Used by the blade sweep alone.
#pragma once

#include "topology/surface/mesh.hpp"

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

  /// Triangles of the sheet around one of its vertices.
  [[nodiscard]] const std::vector<int>& around(int sheet, int vertex) const { return around_[sheet][vertex]; }

  /// Whether the edge between two vertices of a triangle of the sheet is on its border: no other triangle has both.
  [[nodiscard]] bool is_border(int sheet, int from, int to) const;

  /// Appends the triangles of the sheet that may come within `reach` m of x, some of them more than once.
  void near(int sheet, const Vector3& x, double reach, std::vector<int>& triangles) const;

  /// Whether the sheet is one with these triangles, too: no more than two at an edge, in opposite directions, and one
  /// fan at every vertex; nor do they fold back on it. Vertices beyond the last one are new; `corners` are the places.
  [[nodiscard]] bool stays_sheet(int sheet, const std::vector<Triangle>& added,
                                 const std::vector<std::array<Vector3, 3>>& corners) const;

  /// Place on a sheet.
  struct Foot {
    Vector3 point, normal; // m; of the triangle, unit
    int sheet = -1;
  };
  /// The foot of x on a triangle of some sheet that x lies over, or over an edge that it shares, no more than
  /// `thickness` off; the nearest vertex of the triangle in its place where that is as near. Nothing when x lies beside
  /// all sheets.
  [[nodiscard]] std::optional<Foot> on_sheet(const Vector3& x) const;

  /// Whether the triangle meets one of `sheet` that shares no vertex with it. `indices` are its vertices in the sheet,
  /// beyond the last one where they are new.
  [[nodiscard]] bool crosses(int sheet, const Triangle& indices, const std::array<Vector3, 3>& corners) const;

 private:
  struct Place {
    int sheet, triangle;
  };
  [[nodiscard]] std::array<Vector3, 3> corners(const Place& place) const;
  [[nodiscard]] bool is_on_border(int sheet, int vertex) const;
  [[nodiscard]] bool folds_back(int sheet, const Triangle& indices, const std::array<Vector3, 3>& corners) const;
  [[nodiscard]] std::optional<Foot> on_ridge(const Vector3& x, const std::vector<int>& places) const;
  template <class Visit>
  void for_cells(const BoundingBox& box, const Visit& visit) const;

  double cell_, thickness_;
  std::vector<SurfaceMesh> sheets_;
  std::vector<std::vector<std::vector<int>>> around_; // by sheet and vertex
  std::vector<Place> places_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_; // places whose boxes, enlarged, meet the cell
};

} // namespace spherecut::topology
