#include "solvers/release/front_states.hpp"

#include "solvers/elasticity/rotation.hpp"
#include "solvers/fracture/local_values.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/way_out.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::solvers {
namespace {

/// The shift of the wide tube stays whole over one and a half spacings: with one the mean G of a peel is 4 % below the
/// small-strain integral, with one and a half 1 %. Under a thin layer, which bends and turns within it, and where the
/// front turns the narrow one serves.
constexpr ReleaseOptions wide{.inner = 1.5, .outer = 4}, narrow{.inner = 0.5, .outer = 2.5, .half_length = 1};
constexpr double thin = 3; // spacings between the front and the surface, across the sheet

/// The integral over a tube in the body, or over what of it lies there.
std::optional<double> release_at(const FiniteBody& body, const EnergyMomentum& momentum,
                                 const topology::FrontFrame& frame) {
  const topology::Domain& domain = *body.problem().domain;
  const double spacing = spacing_at(body.problem().nodes, frame.point);
  const double depth = -domain.signed_distance(frame.point) / spacing;
  const double layer = std::min(topology::way_out(domain, frame.point, frame.normal, thin * spacing),
                                topology::way_out(domain, frame.point, -frame.normal, thin * spacing));
  for (const ReleaseOptions& tube : {wide, narrow})
    for (const double inset : {0.0, std::min(depth, deepest_inset)}) {
      if ((tube.outer == wide.outer && layer < thin * spacing) || (inset > 0 && depth < least_inset))
        continue;
      ReleaseOptions options = tube;
      options.inset = inset;
      try {
        return momentum.at(frame, options).rate;
      } catch (const InputError&) { // the tube leaves the body, or the front turns within it
      }
    }
  return std::nullopt;
}

} // namespace

std::vector<FrontState> front_states(const FiniteBody& body, const VectorX& coefficients,
                                     const std::function<double(const Vector3&)>& toughness, double spacing,
                                     const std::vector<Vector3>& closed,
                                     const std::function<FibreFrame(const Vector3& x)>& fibres) {
  const Problem& problem = body.problem();
  if (problem.incision == nullptr)
    throw InputError("tearing: the body has no cut");
  const EnergyMomentum momentum(body, coefficients, fibres);
  const auto jump = [&](const Vector3& plus, const Vector3& minus) -> Vector3 {
    const FiniteState above = body.at(plus, coefficients), below = body.at(minus, coefficients);
    const Vector3 apart = plus - minus; // at rest
    return rotation_between(below.deformation, above.deformation).transpose() *
               (apart + above.displacement - below.displacement) -
           apart;
  };
  const auto by_jump = [&](const topology::FrontFrame& frame) {
    return displacement_correlation(problem, frame, jump);
  };
  const auto by_integral = [&](std::size_t, const topology::FrontFrame& frame) -> std::optional<Intensities> {
    const std::optional<double> release = release_at(body, momentum, frame);
    if (!release)
      return std::nullopt;
    // Where the jump tells of no mode that opens or slides, what is released opens the front straight ahead.
    Intensities modes = Intensities::UnitX();
    try {
      if (const Intensities found = by_jump(frame); driving_release_rate(problem.material, found) > 0)
        modes = found;
    } catch (const InputError&) { // no room for the jump
    }
    modes[0] = std::max(0.0, modes[0]); // faces that are pressed together do not open
    return std::sqrt(std::max(0.0, *release) / driving_release_rate(problem.material, modes)) * modes;
  };
  return front_states(problem, front_samples(*problem.incision, spacing), {by_integral, by_jump}, toughness, closed);
}

} // namespace spherecut::solvers
