#include "topology/incision/lip_lift.hpp"

namespace spherecut::topology {

Vector3 lift_off(const Incision& incision, const Vector3& x, double reach, double height) {
  if (!incision.near(x, reach))
    return x;
  const auto sheet = incision.closest(x, reach);
  if (!sheet)
    return x;
  const double side = (x - sheet->point).dot(sheet->normal);
  if (side == 0)
    return x;
  const Vector3 off = side > 0 ? sheet->normal : Vector3(-sheet->normal);
  for (double step = height; step > 0.2 * height; step *= 0.5) // less where another sheet is near
    if (!incision.blocks(x, x + step * off))
      return x + step * off;
  return x;
}

Eye eye_at(const Incision& incision, const Vector3& x, double radius) {
  constexpr double at_face = 0.02, lift = 0.05;
  return {x, lift_off(incision, x, at_face * radius, lift * radius)};
}

} // namespace spherecut::topology
