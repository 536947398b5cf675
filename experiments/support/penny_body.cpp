#include "experiments/support/penny_body.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <cmath>

namespace spherecut::experiments {

const CutFrame& penny_frame() {
  static const CutFrame frame = tilted_frame({0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});
  return frame;
}

CutBody penny_body(int nodes, std::uint64_t seed, double nu, const PrecutMethod& method) {
  const Vector3 half_size(2, 2, 2); // m
  CutBodyCase cut;
  cut.domain = topology::make_box_domain(-half_size, half_size, 0.5);
  cut.sheets = {topology::make_disc_sheet(penny_frame().origin, penny_frame().normal, penny_radius, 0.1)};
  cut.slope = 0.25 * std::cbrt(2400.0 / nodes); // one field of spacings, scaled: steeper ones cost accuracy
  cut.nodes = nodes;
  cut.seed = seed;
  cut.method = method.method;
  cut.sight = method.sight;
  CutBody body = cut_body(cut);
  body.problem.material = {1, nu, 0};
  return body;
}

} // namespace spherecut::experiments
