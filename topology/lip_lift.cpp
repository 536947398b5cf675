#include "topology/lip_lift.hpp"

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

} // namespace spherecut::topology
