// The cuts of a session: the blade carried to the tissue at rest, the incision it makes, and the body that follows it.
#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <fmt/format.h>
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
constexpr double on_path = 1e-6;          // of the fine spacing: nearer to its path a blade is on it
constexpr double way_detail = 0.25;       // fine spacings from pose to pose of the way ahead

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

} // namespace

// The rest positions of the nodes that are now nearest to x, nearest first.
std::vector<Vector3> Session::nearest_moved(const Vector3& x, const BodyModel& model) const {
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

Vector3 Session::rest_position(const Vector3& x, const BodyModel& model) const {
  RestMemo& memo = model.rest_memo;
  memo.turn_to(model.body.get(), model.incision, model.solved(), model.field, zone_.spacing.fine);
  const RestMemo::Found* found = memo.find(x);
  if (found == nullptr)
    try {
      found = &memo.keep(x, {find_rest(x, model)});
    } catch (const NumericalError& error) {
      found = &memo.keep(x, {Vector3::Zero(), error.what()});
    }
  if (!found->error.empty())
    throw NumericalError(found->error);
  return found->rest;
}

// Where the material that is now at x was at rest. Outside the body the displacement goes on as at the nearest point of
// its surface. A place in the opening of a cut, where there is no material, belongs to the sheet.
Vector3 Session::find_rest(const Vector3& x, const BodyModel& model) const {
  const topology::Domain& domain = *organ_.domain;
  const auto displacement = [&](const Vector3& rest) {
    return model.at(domain.signed_distance(rest) <= 0 ? rest : domain.closest_surface_point(rest)).displacement;
  };
  const double fine = zone_.spacing.fine;
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
        const auto place =
            step_outside(x, starts[k], model.at(starts[k]), domain, surely_out * zone_.spacing(starts[k]));
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
                                              outside_reach * zone_.spacing(starts.front());
    // Beyond the opening of a cut the displacement jumps, but by neither side's does the place come to lie inside.
    const auto is_out = [&](const Vector3& start) { return domain.signed_distance(x - displacement(start)) > 0; };
    if (!guess_is_out || !(is_far || std::all_of(starts.begin(), starts.end(), is_out)))
      throw; // nothing is cut where the place is not known
    return guess;
  }
}

// Poses on the next way of the blade, of about this length, m: those of its path, or straight on where something else
// leads it.
std::vector<topology::BladePose>
Session::blade_ahead(const StepSample& sample, const std::optional<topology::BladePose>& last, double length) const {
  const std::vector<Vector3>& edge = scenario_.blade->edge;
  const double fine = zone_.spacing.fine;
  const topology::BladePose& here = *sample.blade;
  std::vector<topology::BladePose> poses;
  if (!incisions_->is_placed())
    poses.push_back(here);
  const auto scripted = blade_pose(*scenario_.blade, sample.time);
  if (scripted && edge_travel(edge, *scripted, here) < on_path * fine) {
    // Poses of short steps lie closer than a window can tell apart, and each costs a strip.
    double way = 0, since_pose = 0;
    topology::BladePose before = here;
    for (const StepSample& step : steps_) {
      if (!step.blade || step.time <= sample.time || way >= length)
        continue;
      const double travel = edge_travel(edge, before, *step.blade);
      way += travel;
      since_pose += travel;
      before = *step.blade;
      if (since_pose >= way_detail * fine || way >= length) {
        poses.push_back(before);
        since_pose = 0;
      }
    }
    if (since_pose > 0)
      poses.push_back(before);
  } else if (last) {
    const Vector3 motion = here.position - last->position;
    for (int k = 1; k <= static_cast<int>(std::lround(length / fine)) && motion.norm() > 0; ++k)
      poses.push_back({here.time + k, here.position + k * fine * motion.normalized(), here.orientation});
  }
  return poses;
}

// What the edge is going to sweep next, at rest.
topology::SurfaceMesh Session::way_of_blade(const StepSample& sample, const topology::RestMap& to_rest) const {
  return incisions_->way_through(blade_ahead(sample, last_blade_, way_spacings * zone_.spacing.fine), to_rest);
}

void Session::lift_blade() {
  if (!scenario_.blade)
    return;
  if (put_off_ == 0)
    last_blade_.reset();
  blade_lifted_ = true;
  hand_led_ = true;
  if (blade_force_ == nullptr)
    return;
  blade_force_->lift();
  drop_blade_proposal();
}

// Moves the blade, or keeps its motion for later: until it has gone blade.advance, the body need not follow. What is
// left is cut when the blade leaves the body, is lifted or gone, or the run ends.
bool Session::move_blade(const StepSample& sample, CutReport& report) {
  bool solved = false;
  const auto wait = [&] {
    if (!cuts_aside())
      return;
    wait_for_cut(sample, report);
    solved = true;
  };
  const auto make_cut = [&](const StepSample& at) {
    wait();
    put_off_ = 0;
    CutReport made;
    const bool is_solved = cut(at, made);
    solved = is_solved || (solved && !made.refused);
    report.add(made);
  };
  if (!sample.blade || blade_lifted_) {
    if (cuts_aside() && !sample.blade && !ends(sample)) // nothing needs the blade until its body is there
      return false;
    wait();
    if (put_off_ > 0) { // a lifted blade is placed anew in the step after this one
      StepSample left = sample;
      left.blade = std::exchange(last_blade_, std::nullopt);
      const bool lifted = std::exchange(blade_lifted_, false);
      make_cut(left);
      blade_lifted_ = lifted;
      return solved;
    }
    if (!sample.blade)
      return solved;
  }
  double way = 0;
  if (last_blade_ && !blade_lifted_) {
    topology::BladePose from = *last_blade_;
    for (const topology::BladePose& pose : passed_) {
      way += edge_travel(scenario_.blade->edge, from, pose);
      incisions_->put_off(pose);
      from = pose;
    }
    way += edge_travel(scenario_.blade->edge, from, *sample.blade);
  }
  if (last_blade_ && !blade_lifted_ && !ends(sample)) {
    const bool leaves_off = follows_cuts_aside() && blade_rests_ && put_off_ > 0;
    if (follows_cuts_aside() && !leaves_off && blade_moved_ != sample.time) // it is where it was
      return solved;
    if (advance() > 0) {
      put_off_ += way;
      topology::RestMap to_rest;
      if (model_.solved())
        to_rest = [this](const Vector3& x) { return rest_position(x); };
      const bool is_outside = incisions_->is_outside(*sample.blade, to_rest);
      if (cuts_aside() ? is_outside || put_off_ < most_advances * advance()
                       : !is_outside && !leaves_off && put_off_ < advance()) {
        incisions_->put_off(*sample.blade);
        return solved;
      }
    }
  }
  make_cut(sample);
  return solved;
}

void Session::refuse_cut(double time, const char* why, CutReport& report) {
  report.triangles = 0;
  report.refused = true;
  report.reason = why;
  report.update = SystemUpdate::none;
  report.update_reason.clear();
  report.nodes = report.kept_nodes = 0;
  warn("refused", fmt::format("a cut was refused at t = {:g} s: {}", time, why));
}

// Moves the blade; true when that cut something and the body with the new cut is built and solved. A refusal leaves
// body, incision and wound as they were.
bool Session::cut(const StepSample& sample, CutReport& report) {
  topology::RestMap to_rest;
  if (model_.solved())
    to_rest = [this](const Vector3& x) { return rest_position(x); };
  topology::SweepResult swept;
  const solvers::Discretisation* const body = model_.body.get();
  const bool aside = may_cut_aside(sample);
  std::optional<topology::Wound> wound_before;
  {
    const StageTimer timer(report.seconds.topology);
    try {
      if (std::exchange(blade_lifted_, false)) {
        incisions_->place(*sample.blade, to_rest);
      } else {
        swept = incisions_->move_to(*sample.blade, to_rest, aside ? &wound_before : nullptr);
      }
    } catch (const InputError& error) {
      refuse_cut(sample.time, error.what(), report);
    } catch (const NumericalError& error) {
      refuse_cut(sample.time, error.what(), report);
    }
  }
  report.triangles = swept.triangles;
  if (swept.triangles == 0) {
    if (!report.refused)
      report.reason = swept.refused;
    return false;
  }
  try {
    BodyModel next;
    next.touched_from = facing();
    next.incision = incisions_->incision();
    if (!grasps()) // a grasper remembers what it holds
      require_clear_of_tool(*next.incision, model_, scenario_.contact.condition);
    check_pieces(sample.time);
    if (hand_led_)
      zone_.spacing.segments = solvers::front_segments(*next.incision, zone_.spacing.fine);
    {
      const StageTimer timer(report.seconds.level_sets);
      incisions_->update_fields();
    }
    if (aside) {
      begin_cutting(next.incision, sample.time, report);
      shown_wound_ = std::move(wound_before);
      profile_.topology += report.seconds.topology;
      profile_.level_sets += report.seconds.level_sets;
      return false;
    }
    rebuild_ = Rebuild::in_step;
    build_cut({.way_ahead = [&] { return way_of_blade(sample, to_rest); }}, next, report);
    {
      const StageTimer timer(report.seconds.solve);
      solve(sample, next);
    }
    profile_.topology += report.seconds.topology;
    profile_.level_sets += report.seconds.level_sets;
    model_ = std::move(next);
    lead_recondensing(sample, to_rest);
    return true;
  } catch (const InputError& error) {
    refuse_cut(sample.time, error.what(), report);
  } catch (const NumericalError& error) {
    refuse_cut(sample.time, error.what(), report);
  }
  take_back_cut(body);
  return false;
}

void Session::check_pieces(double time) {
  require_pieces(incisions_->wound(), zone_.spacing);
  check_held(time);
}

void Session::check_held(double time) {
  const topology::Wound& wound = incisions_->wound();
  const std::vector<int> unheld = unheld_pieces(wound, scenario_.fixed);
  if (unheld.empty())
    return;
  const double volume = wound.pieces[static_cast<std::size_t>(unheld.front())].volume;
  const std::string what = fmt::format("{} of {} pieces ({:.3g} m3) {} severed and held by no fixed region",
                                       unheld.size(), wound.pieces.size(), volume, unheld.size() == 1 ? "is" : "are");
  const bool none_with_law = is_nonlinear(scenario_.law);
  if (none_with_law || scenario_.cut.unheld == solvers::UnheldPieces::refuse)
    throw InputError(fmt::format("{}{}; {} allows none",
                                 scenario_.blade || scenario_.precuts.empty()
                                     ? std::string() // a motion or a tear is refused, not a line
                                     : fmt::format("{}:{}: ", scenario_.file.string(), scenario_.precuts.front().line),
                                 what,
                                 none_with_law ? fmt::format("material.law = \"{}\"", name_of(scenario_.law))
                                               : std::string("cut.unheld = \"refuse\"")));
  warn(fmt::format("unheld {}", unheld.size()),
       fmt::format("t = {:g} s: {}: {}", time, what,
                   scenario_.cut.unheld == solvers::UnheldPieces::hold ? "soft springs hold it"
                                                                       : "it leaves the computation"));
}

// Lips in contact are held together in the mean over their shares; where they are apart, the distance is that of the
// surface, or, where no picture is made of it, of the nodes on it.
void Session::report_opening(const topology::Wound& wound, CutReport& report) const {
  constexpr double touching = 1e-9; // m, as finely as the contact of the lips is solved
  double apart = 0;
  for (const double mean : normal_openings(model_))
    apart = std::max(apart, mean);
  const auto tell = [&](double largest) { report.opening = apart > touching && largest > touching ? largest : apart; };
  if (!force_only_) {
    const Opening opening = opening_of(wound, model_);
    report.opening_volume = opening.volume;
    tell(opening.largest);
    return;
  }
  const VectorX& moved = displacements_of(model_);
  double largest = 0;
  for (const solvers::LipPair& pair : model_.pairs)
    largest = std::max(largest, pair.normal.dot(moved.segment<3>(3 * static_cast<Eigen::Index>(pair.plus)) -
                                                moved.segment<3>(3 * static_cast<Eigen::Index>(pair.minus))));
  tell(largest);
}

void Session::report_cut(CutReport& report) const {
  const topology::Wound& wound = *this->wound();
  if (blade_force_ != nullptr)
    report.blade = blade_force_->report();
  if (model_.incision != nullptr) {
    report.area = model_.incision->area();
    report.front_length = model_.incision->front_length();
    report.sheets = static_cast<int>(model_.incision->sheets().size());
  }
  for (const topology::WoundPiece& piece : wound.pieces)
    report.volumes.push_back(piece.volume);
  report.pieces = static_cast<int>(report.volumes.size());
  std::sort(report.volumes.rbegin(), report.volumes.rend());
  report.unheld = static_cast<int>(unheld_pieces(wound, scenario_.fixed).size());
  report.nodes = model_.sprinkling.nodes.size();
  report.lip_pairs = static_cast<int>(model_.pairs.size());
  if (model_.finite != nullptr && model_.solved()) {
    report_opening(wound, report);
    report.closed_pairs = model_.finite->last().closed_pairs;
  } else if (model_.state) {
    report_opening(wound, report);
    for (std::size_t p = 0; p < std::min(model_.pairs.size(), model_.state->lips.closed.size()); ++p)
      report.closed_pairs += model_.state->lips.closed[p];
    report.lips_converged = model_.state->lips.converged;
  }
  if (!force_only_)
    report.surface_hash = topology::surface_hash(wound.surface);
}

} // namespace spherecut::app
