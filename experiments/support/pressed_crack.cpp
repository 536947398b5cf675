#include "experiments/support/pressed_crack.hpp"

#include <utility>

namespace spherecut::experiments {

solvers::Problem pressed_crack(const PressedCrack& crack, int seed, const PrecutMethod& method) {
  CutBodyCase cut;
  cut.domain = crack.domain;
  cut.sheets = {crack.sheet};
  cut.fine = crack.fine;
  cut.coarse = crack.coarse;
  cut.slope = 0.3;
  cut.seed = static_cast<std::uint64_t>(seed);
  cut.method = method.method;
  cut.sight = method.sight;
  CutBody body = cut_body(cut);
  body.problem.material = crack.material;
  hold_whole_surface(body.problem, crack.at_surface);
  body.problem.loads.lip_traction = [pressure = crack.pressure](const Vector3&, const Vector3& n) -> Vector3 {
    return -pressure * n;
  };
  return std::move(body.problem);
}

} // namespace spherecut::experiments
