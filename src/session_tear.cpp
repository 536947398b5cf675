// The tears of a session: fronts that are given more energy than new cut takes move, increment by increment, until they
// are not, or nothing is left to tear. The tool stands still meanwhile.
#include "solvers/tear_seed.hpp"
#include "src/session.hpp"
#include "src/stage_timer.hpp"
#include "topology/cut_sheets.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

// In units of the fine spacing:
constexpr double averaged_over = 1.5; // length along the front over which intensities are averaged
constexpr double smoothing = 1;       // and motions
constexpr double probe = 0.5;         // so far ahead the toughness is looked at
constexpr double met_reach = 0.3;     // nearer to another sheet a front has met it
constexpr double overlap = 0.05;      // by which a front runs into the sheet that it meets
constexpr double bridge = 4;          // a front shorter than this, too near to the surface for intensities, gives way
constexpr double bridge_step = 3;     // by this in one increment
constexpr double smallest_seed = 2;   // least radius of a tear that starts without a cut
// Of the longest step:
constexpr double first_step = 0.5, least_step = 0.2; // while the decay of G is not known; where it is
constexpr double told = 0.5;        // increments at least so long tell the decay, and whether growth is unstable
constexpr double kept_drive = 0.95; // share of the G / G_c of its start that a growth keeps
constexpr int kept_to_tell = 2;     // after so many of them: it is
constexpr double in_balance = 1.01; // G / G_c up to which nothing moves: intensities scatter by as much

double drive_of(const std::vector<solvers::FrontState>& states) {
  double most = 0;
  for (const solvers::FrontState& state : states)
    most = std::max(most, state.release / state.toughness);
  return most;
}

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

double mean_toughness(const topology::FrontGrowth& growth, const topology::Incision& before,
                      const topology::Domain& domain, const std::function<double(const Vector3&)>& toughness) {
  double area = 0, sum = 0;
  for (std::size_t s = 0; s < growth.sheets.size(); ++s) {
    const topology::SurfaceMesh& sheet = growth.sheets[s];
    const std::size_t had = s < before.sheets().size() ? before.sheets()[s].triangles.size() : 0;
    for (std::size_t t = had; t < sheet.triangles.size(); ++t) {
      const auto& [a, b, c] = sheet.triangles[t];
      const Vector3 &x = sheet.vertices[a], &y = sheet.vertices[b], &z = sheet.vertices[c];
      const Vector3 middle = (x + y + z) / 3;
      if (domain.signed_distance(middle) > 0)
        continue;
      const double part = 0.5 * (y - x).cross(z - x).norm();
      area += part;
      sum += part * toughness(middle);
    }
  }
  return area > 0 ? sum / area : 0;
}

/// G - G_c of `states`, weighted by how far the nearest of the places `from` moves; J/m2. Zero without weights.
double mean_surplus(const std::vector<solvers::FrontState>& states, const std::vector<solvers::FrontState>& from,
                    const std::vector<double>& advance) {
  double sum = 0, weights = 0;
  for (const solvers::FrontState& state : states) {
    const auto nearest = std::min_element(from.begin(), from.end(), [&](const auto& a, const auto& b) {
      return (a.frame.point - state.frame.point).squaredNorm() < (b.frame.point - state.frame.point).squaredNorm();
    });
    const double weight = advance[static_cast<std::size_t>(nearest - from.begin())];
    sum += weight * (state.release - state.toughness);
    weights += weight;
  }
  return weights > 0 ? sum / weights : 0;
}

TearIncrement increment_of(const std::vector<solvers::FrontState>& states, const topology::Incision* incision) {
  TearIncrement increment;
  if (incision != nullptr) {
    increment.area = incision->area();
    increment.front_length = incision->front_length();
  }
  double most = -1;
  for (const solvers::FrontState& state : states) {
    increment.front += state.frame.point / static_cast<double>(states.size());
    if (const double drive = state.release / state.toughness; drive > most) {
      most = drive;
      increment.most = state.frame.point;
      increment.intensities = state.intensities;
      increment.release = state.release;
      increment.toughness = state.toughness;
    }
  }
  return increment;
}

} // namespace

Energies energies(const BodyModel& model) {
  Energies energies;
  energies.loads = model.body->load_work(model.field);
  const solvers::ContactState& tool = model.state->tool;
  for (std::size_t c = 0; c < tool.nodal_forces.size(); ++c)
    energies.tool += tool.nodal_forces[c].dot(tool.displacement.segment<3>(3 * static_cast<Eigen::Index>(c)));
  return energies;
}

// What the step has done before it tears. What a blade that cuts without resistance releases, and what a grasper does
// that lets go, belongs to nobody.
void Session::book_loading(const StepSample& sample, bool dissipates) {
  const Energies now = energies(model_);
  const Vector3 force = model_.state->tool.tool_force;
  if (!tears_) {
    tears_ = TearAccount{};
  } else {
    EnergyLedger& ledger = tears_->ledger;
    double work = 0;
    if (sample.tool && tears_->pose)
      work = -0.5 * (tears_->force + force).dot(sample.tool->point - tears_->pose->point);
    const double loads = now.loads - tears_->last.loads, elastic = now.elastic() - tears_->last.elastic();
    ledger.tool += work;
    ledger.loads += loads;
    ledger.elastic += elastic;
    if (dissipates)
      ledger.dissipation += std::max(0.0, work + loads - elastic);
  }
  tears_->last = now;
  tears_->force = force;
  tears_->pose = sample.tool;
}

// Along all fronts but where they have met another sheet.
std::vector<solvers::FrontState> Session::front_states() const {
  if (model_.incision == nullptr || model_.incision->front().empty())
    return {};
  const double fine = zone_.spacing.fine;
  std::vector<solvers::FrontState> states = solvers::front_states(*model_.body, model_.field, toughness_, fine);
  std::erase_if(states, [&](const solvers::FrontState& state) {
    return !state.intensities.allFinite() || has_met(*model_.incision, state.frame, fine);
  });
  return solvers::directed(solvers::averaged(scenario_.material, states, averaged_over * fine),
                           scenario_.tearing.direction, toughness_, probe * fine);
}

topology::FrontGrowth Session::grow_tear(const std::vector<solvers::FrontState>& states, double longest) const {
  const double fine = zone_.spacing.fine;
  const topology::Incision& incision = *model_.incision;
  const auto motion = states.empty()
                          ? std::function<Vector3(const topology::FrontFrame&)>(
                                [&](const topology::FrontFrame& frame) -> Vector3 { return longest * frame.ahead; })
                          : solvers::tear_motion(states, longest, smoothing * fine);
  return topology::grow_front(
      incision,
      [&](const topology::FrontFrame& frame) { return up_to_next_sheet(incision, frame, motion(frame), fine); },
      sheet_edge(zone_));
}

// A crack across the largest stress, where that reaches the strength off every cut, held region and tool.
std::optional<topology::SurfaceMesh> Session::seed_of_tear() const {
  const TearSettings& settings = scenario_.tearing;
  if (settings.strength == 0)
    return std::nullopt;
  const solvers::NodeCloud& nodes = model_.sprinkling.nodes;
  const auto toughness = toughness_;
  const double length = settings.length > 0
                            ? settings.length
                            : solvers::averaging_length(scenario_.material, scenario_.toughness, settings.strength);
  std::vector<Vector3> held;
  for (const solvers::Prescribed& entry : model_.body->problem().prescribed)
    held.push_back(nodes.positions[entry.node]);
  held.insert(held.end(), model_.patch.rest.begin(), model_.patch.rest.end());
  const solvers::WeakPlace weakest =
      solvers::weakest_place(*model_.body, model_.field, length, settings.strength, [&](int i) {
        const Vector3& x = nodes.positions[i];
        return nodes.kinds[i] != solvers::NodeKind::lip &&
               (model_.incision == nullptr || !model_.incision->closest(x, length)) &&
               std::none_of(held.begin(), held.end(), [&](const Vector3& y) { return (y - x).norm() < length; });
      });
  if (weakest.node < 0)
    return std::nullopt;
  const Vector3& place = nodes.positions[weakest.node];
  const double radius = std::max(solvers::seed_radius(scenario_.material, toughness(place), settings.strength),
                                 smallest_seed * zone_.spacing.fine);
  return topology::make_disc_sheet(place, weakest.stress.direction, radius, std::min(sheet_edge(zone_), radius / 2));
}

// Cuts as `grow` does and solves the body with it; where that cannot be, all is as before and the report says why.
bool Session::take_tear(const StepSample& sample, const std::function<void()>& grow, TearReport& report) {
  const auto refuse = [&](const char* why) {
    report.reason = fmt::format("refused: {}", why);
    warn("tear refused", fmt::format("a tear was refused at t = {:g} s: {}", sample.time, why));
    return false;
  };
  try {
    const StageTimer timer(profile_.topology);
    grow();
  } catch (const InputError& error) {
    return refuse(error.what());
  } catch (const NumericalError& error) {
    return refuse(error.what());
  }
  const auto segments = zone_.spacing.segments;
  const auto grasp = grasp_;
  try {
    BodyModel next;
    next.incision = incisions_->incision();
    if (!grasps())
      require_clear_of_tool(*next.incision, model_, scenario_.contact.condition);
    check_pieces(sample.time);
    {
      const StageTimer timer(profile_.level_sets);
      incisions_->update_fields();
    }
    if (!next.incision->front().empty())
      zone_.spacing.segments = fine_segments(*next.incision);
    if (grasps() && grasped_piece_is_free()) {
      grasp_.reset();
      warn("grip", fmt::format("t = {:g} s: the piece in the grasper has come off", sample.time));
    }
    sprinkle(&model_.sprinkling.nodes, next);
    build(next);
    solve(sample, next);
    model_ = std::move(next);
    lost_grip_ = lost_grip_ || (grasp && !grasp_);
    return true;
  } catch (const InputError& error) {
    refuse(error.what());
  } catch (const NumericalError& error) {
    refuse(error.what());
  }
  zone_.spacing.segments = segments;
  grasp_ = grasp;
  incisions_->take_back();
  return false;
}

void Session::tear(const StepSample& sample, bool released, StepResult& result) {
  TearReport& report = result.tear.emplace();
  book_loading(sample, released);
  EnergyLedger& ledger = tears_->ledger;
  const TearSettings& settings = scenario_.tearing;
  const double fine = zone_.spacing.fine, stride = settings.step * fine;
  const int most = tear_gradually_ ? 1 : settings.most_increments;
  const std::size_t pieces = incisions_->wound().pieces.size();
  const auto fronts = [&]() -> std::optional<std::vector<solvers::FrontState>> {
    try {
      return front_states();
    } catch (const NumericalError&) { // too near to the surface all along
      return std::nullopt;
    }
  };
  std::optional<std::vector<solvers::FrontState>> states = fronts();
  report.increments.push_back(increment_of(states.value_or(std::vector<solvers::FrontState>{}), incision()));
  report.increments.back().ledger = ledger;
  const double start = states ? drive_of(*states) : 0;
  int kept = 0;
  for (int number = 1;; ++number) {
    const bool gives_way = !states && model_.incision->front_length() < bridge * fine;
    const double drive = states ? drive_of(*states) : 0;
    std::optional<topology::SurfaceMesh> seed;
    if (!gives_way && drive < in_balance && !(seed = seed_of_tear())) {
      report.reason = !states           ? "the front is too near to the surface for its intensities"
                      : states->empty() ? "there is no front"
                                        : "less is released than a tear takes";
      break;
    }
    if (number > most) {
      report.reason = "as many increments as are allowed in one step";
      break;
    }
    if (settings.most_area > 0 && tears_->area >= settings.most_area) {
      report.reason = "as much is torn as is allowed";
      warn("torn", fmt::format("t = {:g} s: {:.3g} m2 are torn, as many as tearing.most_area allows", sample.time,
                               tears_->area));
      break;
    }
    double longest = gives_way ? bridge_step * fine : stride;
    if (!gives_way && tears_->decay > 0)
      longest = stride * std::clamp(std::log(drive) / (tears_->decay * stride), least_step, 1.0);
    else if (!gives_way && drive < 1.1)
      longest = first_step * stride;
    topology::FrontGrowth growth;
    if (seed) {
      if (model_.incision != nullptr)
        growth.sheets = model_.incision->sheets();
      growth.sheets.push_back(*seed);
      growth.triangles = static_cast<int>(seed->triangles.size());
    } else {
      growth = grow_tear(gives_way ? std::vector<solvers::FrontState>{} : *states, longest);
    }
    if (growth.triangles == 0) {
      report.reason = "the fronts have met other cuts";
      break;
    }
    const auto before = model_.incision;
    const double area_before = before == nullptr ? 0 : before->area();
    const double toughness = before == nullptr ? toughness_(seed->vertices.front())
                                               : mean_toughness(growth, *before, *organ_.domain, toughness_);
    const auto grow = [&] { seed ? incisions_->seed(*seed) : incisions_->tear(growth.sheets); };
    if (!take_tear(sample, grow, report))
      break;
    report.seeded = report.seeded || seed.has_value();
    const double torn = model_.incision->area() - area_before;
    std::optional<std::vector<solvers::FrontState>> next = fronts();
    const Energies now = energies(model_);
    const double free = tears_->last.potential() - now.potential(), surface = toughness * torn;
    double surplus = free - surface; // of a front that is gone, or comes about, by the energies alone
    if (!seed && !gives_way && next && !next->empty()) {
      std::vector<double> advance;
      const auto motion = solvers::tear_motion(*states, longest, smoothing * fine);
      for (const solvers::FrontState& state : *states)
        advance.push_back(motion(state.frame).norm());
      surplus = 0.5 * (mean_surplus(*states, *states, advance) + mean_surplus(*next, *states, advance)) * torn;
      const double drive_after = drive_of(*next);
      if (longest >= told * stride) {
        tears_->decay = std::max(0.0, std::log(drive / std::max(drive_after, 1e-3)) / longest);
        kept += drive_after >= kept_drive * start ? 1 : 0;
      }
    }
    ledger.loads += now.loads - tears_->last.loads;
    ledger.elastic += now.elastic() - tears_->last.elastic();
    ledger.surface += surface;
    ledger.dissipation += std::max(0.0, surplus);
    tears_->last = now;
    tears_->force = model_.state->tool.tool_force;
    tears_->area += torn;
    result.cut->triangles += growth.triangles;
    states = std::move(next);
    report.increments.push_back(increment_of(states.value_or(std::vector<solvers::FrontState>{}), incision()));
    TearIncrement& row = report.increments.back();
    row.number = number;
    row.triangles = growth.triangles;
    row.advance = seed ? 0 : longest;
    row.ledger = ledger;
    if (kept >= kept_to_tell && !report.unstable) {
      report.unstable = true;
      say_(fmt::format("t = {:g} s: the tear is unstable, it runs on by itself", sample.time));
    }
    if (incisions_->wound().pieces.size() > pieces)
      report.severed = true;
  }
  report.area = tears_->area;
  report.ledger = ledger;
  if (report.severed)
    say_(fmt::format("t = {:g} s: the tear has parted the organ", sample.time));
}

} // namespace spherecut::app
