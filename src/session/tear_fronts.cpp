#include "src/session/tear_fronts.hpp"

#include "solvers/fracture/tear_seed.hpp"
#include "src/model/finite_model.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/way_out.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/front_joining.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::app {
namespace {

// In units of the fine spacing:
constexpr double averaged_over = 1.5;  // length along the front over which intensities are averaged
constexpr double motion_smoothing = 1; // and motions
constexpr double motion_slope = 2;     // by which motions differ for each unit of G / G_c, at most
constexpr double probe = 0.5;          // so far ahead the toughness is looked at
constexpr double met_reach = 0.3;      // nearer to another sheet a front has met it
constexpr double overlap = 0.05;       // by which a front runs into the sheet that it meets
constexpr double smallest_seed = 2;    // least radius of a tear that starts without a cut
constexpr double ligament = 2;         // between two fronts: a narrower one is not resolved and gives way
constexpr double joined_reach = 1.5;   // of the ligament: fronts so near to it are those of its sides
constexpr double gap_share = 0.4;      // of the gap between two fronts: farther none of them goes in one increment

/// Whether another sheet passes through the front there, beside the own one on both of its faces.
bool has_met(const topology::Incision& incision, const topology::FrontFrame& frame, double fine) {
  const Vector3 along = met_reach * fine * frame.ahead, off = 0.1 * fine * frame.normal;
  return incision.blocks(frame.point + off - along, frame.point + off + along) &&
         incision.blocks(frame.point - off - along, frame.point - off + along);
}

/// The motion, ended just behind the first sheet in its way; none where the front has met one.
Vector3 up_to_next_sheet(const topology::Incision& incision, const topology::FrontFrame& frame, const Vector3& motion,
                         double fine) {
  const double length = motion.norm();
  if (length < 1e-3 * fine)
    return Vector3::Zero();
  if (has_met(incision, frame, fine))
    return Vector3::Zero();
  const Vector3 way = motion / length;
  const double start = 1e-2 * fine;
  const auto blocked = [&](double at) { return incision.blocks(frame.point + start * way, frame.point + at * way); };
  if (length <= start || !blocked(length + overlap * fine))
    return motion;
  double clear = start, hit = length + overlap * fine;
  for (int halving = 0; halving < 30; ++halving)
    (blocked(0.5 * (clear + hit)) ? hit : clear) = 0.5 * (clear + hit);
  return (hit + overlap * fine) * way;
}

} // namespace

// Before averages and directions.
std::vector<solvers::FrontState> TearFronts::found_states(const BodyModel& model) const {
  const double fine = zone_.spacing.fine;
  if (model.finite != nullptr)
    return model.finite->front_states(toughness_, fine);
  std::vector<Vector3> closed;
  if (model.state)
    for (std::size_t p = 0; p < std::min(model.pairs.size(), model.state->lips.closed.size()); ++p)
      if (model.state->lips.closed[p] != 0)
        closed.push_back(model.sprinkling.nodes.positions[model.pairs[p].plus]);
  return solvers::front_states(*model.body, model.field, toughness_, fine, closed, &model.front_rules);
}

std::vector<solvers::FrontState> TearFronts::states(const BodyModel& model) const {
  if (model.incision == nullptr || model.incision->front().empty())
    return {};
  const double fine = zone_.spacing.fine;
  std::vector<solvers::FrontState> found = found_states(model);
  std::erase_if(found, [&](const solvers::FrontState& state) {
    return !state.intensities.allFinite() || has_met(*model.incision, state.frame, fine);
  });
  return solvers::directed(solvers::averaged(scenario_.material, found, averaged_over * fine),
                           scenario_.tearing.direction, toughness_, probe * fine);
}

std::optional<std::vector<solvers::FrontState>> TearFronts::known_states(const BodyModel& model) const {
  try {
    return states(model);
  } catch (const NumericalError&) {
    return std::nullopt;
  }
}

topology::FrontGrowth TearFronts::grow(const BodyModel& model, const std::vector<solvers::FrontState>& states,
                                       double longest) const {
  const double fine = zone_.spacing.fine;
  const topology::Incision& incision = *model.incision;
  const auto motion = states.empty()
                          ? std::function<Vector3(const topology::FrontFrame&)>(
                                [&](const topology::FrontFrame& frame) -> Vector3 { return longest * frame.ahead; })
                          : solvers::tear_motion(states, longest, motion_smoothing * fine, motion_slope * fine);
  const auto facing = topology::facing_fronts(incision, longest / gap_share);
  return topology::grow_front(
      incision,
      [&](const topology::FrontFrame& frame) {
        Vector3 step = motion(frame);
        for (const topology::FacingFronts& pair : facing)
          if ((pair.middle - frame.point).norm() < sheet_edge(zone_) && step.norm() > gap_share * pair.across.norm())
            step *= gap_share * pair.across.norm() / step.norm();
        return up_to_next_sheet(incision, frame, step, fine);
      },
      sheet_edge(zone_));
}

topology::FrontGrowth TearFronts::join(const BodyModel& model, const std::vector<solvers::FrontState>& states) const {
  const double reach = ligament * zone_.spacing.fine;
  const std::vector<topology::FacingFronts> facing = topology::facing_fronts(*model.incision, reach);
  const bool moves = std::any_of(facing.begin(), facing.end(), [&](const topology::FacingFronts& pair) {
    return std::any_of(states.begin(), states.end(), [&](const solvers::FrontState& state) {
      return state.release >= state.toughness && (state.frame.point - pair.middle).norm() < joined_reach * reach;
    });
  });
  return moves ? topology::join_fronts(*model.incision, reach) : topology::FrontGrowth{};
}

std::optional<topology::SurfaceMesh> TearFronts::seed(const BodyModel& model) const {
  const TearSettings& settings = scenario_.tearing;
  if (settings.strength == 0)
    return std::nullopt;
  const solvers::NodeCloud& nodes = model.sprinkling.nodes;
  const double length = settings.length > 0
                            ? settings.length
                            : solvers::averaging_length(scenario_.material, scenario_.toughness, settings.strength);
  std::vector<Vector3> held;
  for (const solvers::Prescribed& entry : model.body->problem().prescribed)
    held.push_back(nodes.positions[entry.node]);
  held.insert(held.end(), model.patch.rest.begin(), model.patch.rest.end());
  const solvers::WeakPlace weakest =
      solvers::weakest_place(*model.body, model.field, length, settings.strength, [&](int i) {
        const Vector3& x = nodes.positions[i];
        return nodes.kinds[i] != solvers::NodeKind::lip &&
               (model.incision == nullptr || !model.incision->closest(x, length)) &&
               std::none_of(held.begin(), held.end(), [&](const Vector3& y) { return (y - x).norm() < length; });
      });
  if (weakest.node < 0)
    return std::nullopt;
  const Vector3& place = nodes.positions[weakest.node];
  const double radius = std::max(solvers::seed_radius(scenario_.material, toughness_(place), settings.strength),
                                 smallest_seed * zone_.spacing.fine);
  return topology::make_disc_sheet(place, weakest.stress.direction, radius, std::min(sheet_edge(zone_), radius / 2));
}

std::optional<TearFronts::ThinLayer>
TearFronts::thin_layer(const BodyModel& model, const std::vector<solvers::FrontState>& states, double least) const {
  const topology::Domain& domain = *model.incision->domain();
  const double limit = least * zone_.spacing.fine;
  const auto thickness = [&](const Vector3& from, const Vector3& across) {
    return std::min(topology::way_out(domain, from, across, limit), topology::way_out(domain, from, -across, limit));
  };
  const auto drive = [](const solvers::FrontState& state) { return state.release / state.toughness; };
  const auto foremost =
      std::max_element(states.begin(), states.end(), [&](const auto& a, const auto& b) { return drive(a) < drive(b); });
  if (foremost == states.end() || thickness(foremost->frame.point, foremost->frame.tangent) < limit)
    return std::nullopt;
  const double layer = thickness(foremost->frame.point, foremost->frame.normal);
  return layer < limit ? std::optional<ThinLayer>({foremost->frame.point, layer}) : std::nullopt;
}

std::optional<double> TearFronts::released(const BodyModel& model, const std::vector<FrontPlace>& places) const {
  const VectorX& moved = model.finite != nullptr ? model.finite->coefficients() : model.field.coefficients;
  if (places.empty() || model.incision == nullptr || model.incision->front().empty() || moved.isZero(0))
    return 0.0;
  const std::optional<std::vector<solvers::FrontState>> states = known_states(model);
  if (!states)
    return std::nullopt;
  const double reach = 2 * zone_.spacing.fine;
  double release = 0;
  for (const FrontPlace& place : places) {
    double sum = 0, count = 0;
    for (const solvers::FrontState& state : *states)
      if ((state.frame.point - place.point).norm() < reach) {
        sum += state.release;
        count += 1;
      }
    release += count > 0 ? place.share * sum / count : 0;
  }
  return release;
}

} // namespace spherecut::app
