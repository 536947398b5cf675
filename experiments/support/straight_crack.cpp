#include "experiments/support/straight_crack.hpp"

#include "topology/incision/cut_sheets.hpp"

namespace spherecut::experiments {

CutFrame straight_crack_frame(Placement placement) {
  return placed_frame(placement, {0.03, 0.01, 0.04}, {0.12, -0.17, 0.1});
}

CutBody straight_crack_body(std::uint64_t seed, double edge, solvers::Method method, solvers::SightRule sight,
                            Placement placement) {
  const CutFrame crack = straight_crack_frame(placement);
  CutBodyCase cut;
  cut.domain = topology::make_box_domain({-1, -0.5, -1}, {1, 0.5, 1}, 0.25);
  cut.sheets = {
      topology::make_rectangle_sheet(crack.origin - 1.5 * crack.ahead, crack.normal, crack.ahead, 4, 3, edge)};
  cut.nodes = 350;
  cut.seed = seed;
  cut.method = method;
  cut.sight = sight;
  CutBody body = cut_body(cut);
  body.problem.material = {1, 0.3, 0};
  return body;
}

} // namespace spherecut::experiments
