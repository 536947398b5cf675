// The method that a problem is solved by: the one place that knows them all.
#include "solvers/appended/appended_body.hpp"
#include "solvers/body/discretisation.hpp"
#include "solvers/body/elastic_body.hpp"
#include "solvers/published/published.hpp"
#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

std::unique_ptr<Discretisation> append_cut(Problem problem, const DiscretisationOptions& options) {
  if (problem.opaque != nullptr && problem.opaque != problem.incision)
    throw InputError("the rule 'appended' on a body with narrow gaps of its own surface: its spheres see through "
                     "them; take 'enriched'");
  std::shared_ptr<const UncutBody> uncut;
  return make_appended(std::move(problem), options, uncut);
}

} // namespace

std::unique_ptr<Discretisation> discretise(Problem problem, const DiscretisationOptions& options) {
  if (!(options.support_radius >= 0) || !std::isfinite(options.support_radius))
    throw InputError(fmt::format("a support radius of {:g} spacings; allowed: above 0, or 0 for the method's own",
                                 options.support_radius));
  if (options.quadrature < 1 || !(options.cell_size > 0) || !std::isfinite(options.cell_size))
    throw InputError(fmt::format("background cells of {:g} spacings with {} points a direction; allowed: both above 0",
                                 options.cell_size, options.quadrature));
  if (options.method != Method::galerkin)
    require_one_material(problem, fmt::format("method {}", to_string(options.method)));
  switch (options.method) {
  case Method::collocation:
    return make_collocation(std::move(problem), options);
  case Method::galerkin:
    if (options.sight == SightRule::appended && (problem.incision != nullptr || options.cut_ahead))
      return append_cut(std::move(problem), options);
    return make_galerkin(std::move(problem), options);
  case Method::published:
    return make_published(std::move(problem), options);
  }
  throw InputError(fmt::format("method {} does not exist", static_cast<int>(options.method)));
}

} // namespace spherecut::solvers
