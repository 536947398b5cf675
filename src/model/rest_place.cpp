#include "src/model/rest_place.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double rest_tolerance = 1e-4;   // of the fine spacing: of a place carried back to rest
constexpr double coarse_tolerance = 0.02; // the same where the field jumps by a little, as ahead of a front
constexpr double gap_reach = 1;           // fine spacings from a sheet: a place without material lies in its opening
constexpr double difference = 0.05;       // fine spacings, over which the displacement's derivative is taken
constexpr double outside_reach = 1.5;     // spacings from the nearest node: farther a place is outside the body
constexpr double surely_out = 0.1;        // spacings out of the body by Newton's first step: a place is outside it
constexpr double least_volume = 0.1;      // over that at rest, for such a step to tell anything

// The place of a sheet whose faces have parted so that x lies between them: on the straight line from face to face. Out
// of the body the sheet goes on in its plane. Nothing where x lies in material on one side, or ahead of the front.
std::optional<Vector3> place_in_opening(const Vector3& x, const topology::Incision& incision,
                                        const std::function<Vector3(const Vector3&)>& displacement, double fine) {
  constexpr double off = 1e-3;   // fine spacings from the sheet: on a face
  constexpr double tilted = 0.5; // more than the faces are by the displacement: a slope
  constexpr double near = 1e-2;  // fine spacings along the sheet: nothing is cut there
  constexpr int most_steps = 20;
  const Vector3 moved = displacement(x);
  const double reach = gap_reach * fine + moved.norm(); // a face may have gone that far
  Vector3 place = x - moved;
  for (int step = 0; step < most_steps; ++step) {
    const auto on = incision.closest(place, reach);
    if (!on || (on->on_border && incision.domain()->signed_distance(on->point) < 0))
      return std::nullopt;
    const Vector3 lift = off * fine * on->normal;
    const Vector3 above = x - on->point - displacement(on->point + lift),
                  below = x - on->point - displacement(on->point - lift);
    const double over = above.dot(on->normal), under = below.dot(on->normal);
    const bool is_between = over < 0 && under > 0;
    // What is left along the sheet, seen from face to face or from the face of the material.
    const Vector3 along = is_between  ? Vector3((under * above - over * below) / (under - over))
                          : over >= 0 ? Vector3(above - over * on->normal)
                                      : Vector3(below - under * on->normal);
    if (!is_between && std::max(over, -under) > tilted * along.norm())
      return std::nullopt;
    const Vector3 next = on->point + along;
    if (along.norm() <= near * fine || (on->on_border && (next - place).norm() <= near * fine))
      return is_between ? std::optional(on->on_border ? next : on->point) : std::nullopt;
    place = next;
  }
  return std::nullopt;
}

// Where Newton's first step from `start`, where the body is in `state`, leads towards what is now at x, if that is out
// of the domain by more than `margin` m.
std::optional<Vector3> step_outside(const Vector3& x, const Vector3& start, const solvers::PointState& state,
                                    const topology::Domain& domain, double margin) {
  const Matrix3 deformation = Matrix3::Identity() + state.gradient;
  if (!(deformation.determinant() > least_volume))
    return std::nullopt;
  const Vector3 rest = start + deformation.inverse() * (x - start - state.displacement);
  return domain.signed_distance(rest) > margin ? std::optional(rest) : std::nullopt;
}

// The rest positions of the nodes that are now nearest to x, nearest first.
std::vector<Vector3> nearest_moved(const Vector3& x, const BodyModel& model) {
  constexpr std::size_t most = 4;
  if (!model.solved())
    return {};
  const VectorX displacements = model.nodal_displacements();
  const std::vector<Vector3>& nodes = model.sprinkling.nodes.positions;
  std::vector<std::pair<double, std::size_t>> away;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    away.emplace_back((nodes[i] + displacements.segment<3>(3 * static_cast<Eigen::Index>(i)) - x).squaredNorm(), i);
  const std::size_t count = std::min(most, away.size());
  std::partial_sort(away.begin(), away.begin() + static_cast<std::ptrdiff_t>(count), away.end());
  std::vector<Vector3> starts;
  for (std::size_t k = 0; k < count; ++k)
    starts.push_back(nodes[away[k].second]);
  return starts;
}

Vector3 find_rest(const Vector3& x, const BodyModel& model, const topology::Domain& domain,
                  const solvers::SpacingField& spacing) {
  const double fine = spacing.fine;
  const auto displacement = [&](const Vector3& rest) {
    return model.at(domain.signed_distance(rest) <= 0 ? rest : domain.closest_surface_point(rest)).displacement;
  };
  if (model.incision != nullptr)
    if (const auto between = place_in_opening(x, *model.incision, displacement, fine))
      return *between;
  try {
    const topology::RestPlace rest =
        topology::rest_position(x, displacement, rest_tolerance * fine, coarse_tolerance * fine);
    if (!rest.exact && model.incision != nullptr) // the displacement jumps: there is a sheet
      if (const auto on = model.incision->closest(rest.position, 2 * coarse_tolerance * fine))
        return on->point;
    return rest.position;
  } catch (const NumericalError&) {
    Vector3 guess = x - displacement(x);
    if (model.incision != nullptr)
      if (const auto on = model.incision->closest(guess, gap_reach * fine))
        return on->point;
    // Tissue that has turned far: from the nodes that are now nearest.
    const std::vector<Vector3> starts = nearest_moved(x, model);
    const bool guess_is_out = domain.signed_distance(guess) > 0;
    // Outside no material is cut, and none is looked for.
    if (guess_is_out) {
      std::optional<Vector3> outside;
      bool all_lead_out = !starts.empty();
      for (std::size_t k = 0; all_lead_out && k < starts.size(); ++k) {
        const auto place = step_outside(x, starts[k], model.at(starts[k]), domain, surely_out * spacing(starts[k]));
        all_lead_out = place.has_value();
        if (!outside)
          outside = place;
      }
      if (all_lead_out)
        return *outside;
    }
    if (const auto rest =
            topology::rest_position_from(starts, x, displacement, coarse_tolerance * fine, difference * fine))
      return *rest;
    const bool is_far = starts.empty() || (starts.front() + displacement(starts.front()) - x).norm() >
                                              outside_reach * spacing(starts.front());
    // Beyond the opening of a cut the displacement jumps, but by neither side's does the place come to lie inside.
    const auto is_out = [&](const Vector3& start) { return domain.signed_distance(x - displacement(start)) > 0; };
    if (!guess_is_out || !(is_far || std::all_of(starts.begin(), starts.end(), is_out)))
      throw; // nothing is cut where the place is not known
    return guess;
  }
}

} // namespace

Vector3 rest_position(const Vector3& x, const BodyModel& model, const topology::Domain& domain,
                      const solvers::SpacingField& spacing) {
  RestMemo& memo = model.rest_memo;
  memo.turn_to(model.body.get(), model.incision, model.solved(), model.field, spacing.fine);
  const RestMemo::Found* found = memo.find(x);
  if (found == nullptr)
    try {
      found = &memo.keep(x, {find_rest(x, model, domain, spacing)});
    } catch (const NumericalError& error) {
      found = &memo.keep(x, {Vector3::Zero(), error.what()});
    }
  if (!found->error.empty())
    throw NumericalError(found->error);
  return found->rest;
}

} // namespace spherecut::app
