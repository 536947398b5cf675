// Small questions about the three corners of a triangle.
#pragma once

#include "topology/base/types.hpp"

#include <algorithm>
#include <vector>

namespace spherecut::topology {

inline bool has_corner(const Triangle& t, int point) {
  return t[0] == point || t[1] == point || t[2] == point;
}

/// Where the point is among the corners; 3 when it is none.
inline int corner_at(const Triangle& t, int point) {
  return static_cast<int>(std::find(t.begin(), t.end(), point) - t.begin());
}

/// The corner that is neither u nor v; -1 when there is none.
inline int third_corner(const Triangle& t, int u, int v) {
  for (const int point : t)
    if (point != u && point != v)
      return point;
  return -1;
}

/// Whether the triangle runs from u to v.
inline bool runs(const Triangle& t, int u, int v) {
  return (t[0] == u && t[1] == v) || (t[1] == u && t[2] == v) || (t[2] == u && t[0] == v);
}

/// Ascending, each value once.
inline void keep_once(std::vector<int>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

} // namespace spherecut::topology
