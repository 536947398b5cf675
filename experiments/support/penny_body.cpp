#include "experiments/support/penny_body.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <cmath>

namespace spherecut::experiments {

CutFrame penny_frame(Placement placement) {
  return placed_frame(placement, {0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});
}

CutBody penny_body(int nodes, std::uint64_t seed, double nu, const PrecutMethod& method, Placement placement) {
  const CutFrame crack = penny_frame(placement);
  const Vector3 half_size(2, 2, 2); // m
  CutBodyCase cut;
  cut.domain = topology::make_box_domain(-half_size, half_size, 0.5);
  cut.sheets = {topology::make_disc_sheet(crack.origin, crack.normal, penny_radius, 0.1)};
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
