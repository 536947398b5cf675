#include "solvers/quadrature/split_box.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace spherecut::solvers {

namespace {

constexpr double sliver = 1e-9; // of the box's volume

/// A box face cut by a plane has at most five corners.
struct BoxSection {
  std::array<Vector3, 5> corners;
  int count = 0;
  void add(const Vector3& x) { corners[count++] = x; }
};

} // namespace

// Seen from a point of the plane the cut itself has no volume: the signed tetrahedra over what the plane leaves of the
// six faces fill the part.
std::array<BoxPart, 2> split_box(const Vector3& centre, const Vector3& half, const Vector3& point,
                                 const Vector3& normal) {
  const double whole = 8 * half.prod(), offset = normal.dot(point - centre);
  const double reach = normal.cwiseAbs().dot(half);
  if (offset <= -reach)
    return {BoxPart{whole, centre}, BoxPart{}};
  if (offset >= reach)
    return {BoxPart{}, BoxPart{whole, centre}};
  const Vector3 apex = offset / normal.squaredNorm() * normal; // relative to the centre
  double volume = 0;
  Vector3 moment = Vector3::Zero();
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0}) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<Vector3, 4> corners;
      for (int k = 0; k < 4; ++k) {
        corners[k][axis] = side * half[axis];
        corners[k][u] = (k == 1 || k == 2 ? side : -side) * half[u]; // counter-clockwise from outside
        corners[k][v] = (k >= 2 ? 1 : -1) * half[v];
      }
      BoxSection kept;
      for (int k = 0; k < 4; ++k) {
        const Vector3 &a = corners[k], &b = corners[(k + 1) % 4];
        const double at_a = normal.dot(a) - offset, at_b = normal.dot(b) - offset;
        if (at_a >= 0)
          kept.add(a);
        if ((at_a >= 0) != (at_b >= 0))
          kept.add(a + at_a / (at_a - at_b) * (b - a));
      }
      for (int k = 1; k + 1 < kept.count; ++k) {
        const Vector3 &a = kept.corners[0], &b = kept.corners[k], &c = kept.corners[k + 1];
        const double part = (a - apex).dot((b - apex).cross(c - apex)) / 6;
        volume += part;
        moment += part / 4 * (apex + a + b + c);
      }
    }
  if (volume < sliver * whole)
    return {BoxPart{}, BoxPart{whole, centre}};
  if (whole - volume < sliver * whole)
    return {BoxPart{whole, centre}, BoxPart{}};
  return {BoxPart{volume, centre + moment / volume}, BoxPart{whole - volume, centre - moment / (whole - volume)}};
}

} // namespace spherecut::solvers
