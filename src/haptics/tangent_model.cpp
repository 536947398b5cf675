// Notation: candidate c at rest at x_c with displacement u_c = b_c + sum_d C_cd f_d. Frictionless: f_c = p_c n_c with
// the tool's normal n_c, gap w_c = q_c + n_c . (u_c - b_c), q_c = g_c + n_c . (b_c - u_c at which g_c was taken), and
// w >= 0, p >= 0, p w = 0. Frictional: f_c = p_c n_c + t_c, where C t counts as part of b. Bonded: u_c = bond_c +
// motion of the tool on the caught candidates.
#include "src/haptics/tangent_model.hpp"

#include "solvers/contact/friction.hpp"
#include "solvers/contact/tool_gap.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace spherecut::app {
namespace {

constexpr double still = 5e-7;       // m, displacements that move by less between two rounds stand still
constexpr double gap_slack = 1e-9;   // m, of a gap that counts as closed
constexpr int most_rounds = 4;       // in a tick
constexpr int most_pivots = 16;      // in a tick, over all rounds
constexpr double singular = 1e-12;   // pivot over diagonal at which a block is not positive definite
constexpr int patience_of_block = 4; // pivots of many candidates at once without progress
constexpr int most_rubs = 3;         // rounds of friction for the pressures of one round
constexpr double margin = 0.15;      // of the tip radius: candidates farther from the tool are not looked at
constexpr double lever = 0.05;       // m, about the tool's point, over which a turn of its axis counts as motion
constexpr double most_ahead = 2;     // times as far as in the last tick may a candidate be expected to go in this one
constexpr int ld = 3 * most_candidates;
constexpr int most_bonded = most_candidates - 1; // the factor has room for one that is tried

// Chosen once at start for the machine's vectors. Thread sanitizer cannot run the chooser.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__)
#define SPHERECUT_VECTORS __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SPHERECUT_VECTORS
#endif

// y += a x.
SPHERECUT_VECTORS void add_scaled(double* __restrict y, const double* __restrict x, double a, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    y[i] += a * x[i];
}

// y = a_0 x_0 + a_1 x_1 + a_2 x_2 for three columns of `size`.
SPHERECUT_VECTORS void combine(double* __restrict y, const double* __restrict columns, const double* a,
                               std::size_t size) {
  const double a0 = a[0];
  const double a1 = a[1];
  const double a2 = a[2];
  const double* __restrict second = columns + size;
  const double* __restrict third = second + size;
  for (std::size_t i = 0; i < size; ++i)
    y[i] = a0 * columns[i] + a1 * second[i] + a2 * third[i];
}

} // namespace

TangentModel::TangentModel(const topology::ToolShape& tool)
    : tool_(tool), factor_(static_cast<std::size_t>(ld) * ld), right_(ld + 1), share_(ld),
      response_(static_cast<std::size_t>(most_candidates) * ld) {
  displacement_.fill(Vector3::Zero());
  moved_.fill(Vector3::Zero());
  normal_.fill(Vector3::UnitZ());
  gap_.fill(0);
  pressure_.fill(0);
  active_.fill(0);
  bare_.fill(Vector3::Zero());
  along_.fill(Vector3::Zero());
  slip_.fill(Vector3::Zero());
  limit_.fill(0);
  bond_.fill(Vector3::Zero());
  bond_force_.fill(Vector3::Zero());
  chosen_.fill(0);
  step_.fill(Vector3::Zero());
  start_.fill(Vector3::Zero());
  change_.fill(Vector3::Zero());
  wrong_.fill(0);
  near_.fill(0);
  fresh_.fill(0);
  clearance_.fill(0);
}

std::span<const Vector3> TangentModel::rest() const {
  return {condensed_->rest.data(), static_cast<std::size_t>(snapshot_->count)};
}

std::span<const Vector3> TangentModel::normals() const {
  return {condensed_->normals.data(), static_cast<std::size_t>(snapshot_->count)};
}

bool TangentModel::solved(const ContactSnapshot& snapshot) noexcept {
  const bool same_places = count_ == snapshot.count && rest_sum_ == snapshot.rest_sum;
  const std::uint64_t number = snapshot.condensed != nullptr ? snapshot.condensed->number : 0;
  const bool same_body = same_places && condensed_number_ == number;
  const bool bladed = blade_.solved(snapshot);
  const bool bonded = snapshot.condition == solvers::ContactCondition::bonded;
  snapshot_ = &snapshot;
  count_ = snapshot.count;
  rest_sum_ = snapshot.rest_sum;
  condensed_number_ = number;
  condensed_ = snapshot.condensed.get();
  changes_ = changes_ && same_body;
  if (bonded ? same_body : same_places)
    return same_body && !bladed; // what has been found since is nearer to the tool's place now than the solve
  travelled_ = 0;
  clearance_.fill(0);
  pose_ = snapshot.pose;
  chosen_count_ = 0;
  for (int c = 0; c < snapshot.count; ++c) {
    displacement_[c] = snapshot.displacement[c];
    active_[c] = snapshot.active[c];
    bond_[c] = snapshot.bond[c];
    along_[c] = snapshot.along[c];
    bond_force_[c].setZero();
  }
  if (bonded)
    for (int c = 0; c < snapshot.count; ++c)
      if (active_[c] != 0 && !catch_node(c))
        active_[c] = 0;
  return false;
}

ModelForce TangentModel::at(const topology::ToolPose& pose, const Eigen::Quaterniond& orientation,
                            double time) noexcept {
  if (blade_.pressing())
    return blade_.at(pose.point, orientation, time);
  if (snapshot_ == nullptr || snapshot_->count == 0)
    return {.stored = 0.0};
  return snapshot_->condition == solvers::ContactCondition::bonded ? follow(pose) : press(pose);
}

void TangentModel::fetch() const noexcept {
  if (condensed_ == nullptr || blade_.pressing())
    return;
  const auto touch = [](const auto& array, std::size_t begin, std::size_t count) {
    constexpr std::size_t line = 64;
    const char* const first = reinterpret_cast<const char*>(array.data() + begin);
    const char* const last = reinterpret_cast<const char*>(array.data() + begin + count);
    for (const char* at = first; at < last; at += line)
      __builtin_prefetch(at);
  };
  const auto count = static_cast<std::size_t>(snapshot_->count);
  for (const auto* array : {&displacement_, &moved_, &normal_, &step_, &start_, &change_})
    touch(*array, 0, count);
  for (const auto* array : {&gap_, &pressure_, &clearance_})
    touch(*array, 0, count);
  for (const auto* array : {&active_, &wrong_, &fresh_})
    touch(*array, 0, count);
  for (const auto* array : {&condensed_->rest, &condensed_->normals, &condensed_->base})
    touch(*array, 0, count);
  for (int a = 0; a < chosen_count_; ++a) {
    const auto c = static_cast<std::size_t>(chosen_[a]);
    touch(condensed_->compliance, 9 * c * count, 9 * count);
    touch(response_, c * ld, 3 * count);
  }
}

// Between the tool and the surface of a candidate that has moved by u.
solvers::Gap TangentModel::gap_of(const solvers::PressingTool& tool, int c, const Vector3& u) const noexcept {
  solvers::Gap gap = solvers::contact_gap(tool, condensed_->rest[c] + u);
  gap.distance -= snapshot_->lifts[c];
  return gap;
}

// Pressures of the active candidates that close their gaps: N^T C N p = -q by Cholesky, column by column. False: the
// block is not positive definite, and the candidate that made it so has been let go.
bool TangentModel::solve_active() noexcept {
  const auto rows = 3 * static_cast<std::size_t>(snapshot_->count);
  const bool frictional = snapshot_->condition == solvers::ContactCondition::frictional;
  chosen_count_ = 0;
  for (int k = 0; k < near_count_; ++k) {
    const int c = near_[k];
    pressure_[c] = 0;
    if (active_[c] != 0)
      chosen_[chosen_count_++] = c;
  }
  const auto size = static_cast<std::size_t>(chosen_count_);
  for (std::size_t a = 0; a < size; ++a) {
    const int c = chosen_[a];
    double* response = &response_[static_cast<std::size_t>(c) * ld];
    if (fresh_[c] == 0) {
      combine(response, &condensed_->compliance[3 * static_cast<std::size_t>(c) * rows], normal_[c].data(), rows);
      fresh_[c] = 1;
    }
    double* column = &factor_[a * most_candidates];
    for (std::size_t b = a; b < size; ++b)
      column[b] = normal_[chosen_[b]].dot(Eigen::Map<const Vector3>(response + 3 * chosen_[b]));
    right_[a] = -gap_[c];
    if (frictional)
      right_[a] -= normal_[c].dot(bare_[c] - condensed_->base[c]);
  }
  for (std::size_t a = 0; a < size; ++a) {
    double* column = &factor_[a * most_candidates];
    const double before = column[a];
    for (std::size_t k = 0; k < a; ++k) {
      const double* other = &factor_[k * most_candidates];
      add_scaled(column + a, other + a, -other[a], size - a);
    }
    if (!(column[a] > singular * before)) {
      active_[chosen_[a]] = 0;
      return false;
    }
    const double scale = 1 / std::sqrt(column[a]);
    for (std::size_t b = a; b < size; ++b)
      column[b] *= scale;
    right_[a] /= column[a];
    add_scaled(&right_[a + 1], column + a + 1, -right_[a], size - a - 1);
  }
  for (std::size_t a = size; a-- > 0;) {
    const double* column = &factor_[a * most_candidates];
    double value = right_[a];
    for (std::size_t b = a + 1; b < size; ++b)
      value -= column[b] * right_[b];
    right_[a] = value / column[a];
    pressure_[chosen_[a]] = right_[a];
  }
  return true;
}

// Of the contact as it stands against a motion of the tool along the force on it: v^T A^-1 v = |L^-1 v|^2, with the
// factor L of the active block and what each of its gaps (bonded: its three displacements) changes by per metre. With
// friction all gaps close at the full rate whatever the way: what sticks is no stiffer along the surface than against
// it.
double TangentModel::stiffness_along(const Vector3& force) noexcept {
  const double size = force.norm();
  if (!(size > 0))
    return 0;
  const Vector3 way = force / size;
  const bool bonded = snapshot_->condition == solvers::ContactCondition::bonded;
  const bool frictional = snapshot_->condition == solvers::ContactCondition::frictional;
  const int rows = bonded ? 3 * chosen_count_ : chosen_count_;
  double sum = 0;
  for (int r = 0; r < rows; ++r) {
    const auto row = static_cast<std::size_t>(r);
    double value = bonded ? way[r % 3] : frictional ? 1 : normal_[chosen_[r]].dot(way);
    for (std::size_t k = 0; k < row; ++k) // bonded: the factor lies by rows
      value -= (bonded ? factor_[row * ld + k] : factor_[k * most_candidates + row]) * right_[k];
    right_[row] = value / factor_[row * (bonded ? ld : most_candidates) + row];
    sum += right_[r] * right_[r];
  }
  return sum;
}

// Displacements under the forces: `moved_` = b + C f.
void TangentModel::displace() noexcept {
  const auto rows = 3 * static_cast<std::size_t>(snapshot_->count);
  const bool bonded = snapshot_->condition == solvers::ContactCondition::bonded;
  double* u = moved_[0].data(); // Vector3 is three doubles without padding
  static_assert(sizeof(Vector3) == 3 * sizeof(double));
  if (snapshot_->condition == solvers::ContactCondition::frictional)
    std::copy(bare_.begin(), bare_.begin() + snapshot_->count, moved_.begin());
  else
    std::copy(condensed_->base.begin(), condensed_->base.begin() + snapshot_->count, moved_.begin());
  for (int a = 0; a < chosen_count_; ++a) {
    const auto c = static_cast<std::size_t>(chosen_[a]);
    double* response = &response_[c * ld];
    if (bonded)
      combine(response, &condensed_->compliance[3 * c * rows], bond_force_[c].data(), rows);
    add_scaled(u, response, bonded ? 1 : pressure_[c], rows);
  }
}

// Displacements under friction alone: `bare_` = b + C t.
void TangentModel::drag_along() noexcept {
  const auto rows = 3 * static_cast<std::size_t>(snapshot_->count);
  std::copy(condensed_->base.begin(), condensed_->base.begin() + snapshot_->count, bare_.begin());
  for (int k = 0; k < near_count_; ++k) {
    const auto c = static_cast<std::size_t>(near_[k]);
    if (along_[c].isZero(0))
      continue;
    combine(share_.data(), &condensed_->compliance[3 * c * rows], along_[c].data(), rows);
    add_scaled(bare_[0].data(), share_.data(), 1, rows);
  }
}

// Friction for the pressures as they are, and the displacements with it. Whether it stands still.
bool TangentModel::rub() noexcept {
  for (int k = 0; k < near_count_; ++k)
    if (active_[near_[k]] == 0)
      along_[near_[k]].setZero();
  for (int a = 0; a < chosen_count_; ++a) {
    const int c = chosen_[a];
    limit_[c] = snapshot_->friction * std::max(pressure_[c], 0.0);
    slip_[c] = moved_[c] - bond_[c];
  }
  const solvers::SlidingContact contact{{chosen_.data(), static_cast<std::size_t>(chosen_count_)},
                                        condensed_->compliance.data(),
                                        3 * static_cast<std::size_t>(snapshot_->count),
                                        normal_,
                                        limit_};
  double moved = 0;
  for (int i = 0; i < most_rubs; ++i) {
    moved = solvers::relax_friction(contact, slip_, along_);
    if (moved < 0.1 * still)
      break;
  }
  drag_along();
  displace();
  return moved < still;
}

// What slips, and what is free, sticks from where it is now.
void TangentModel::settle_bonds() noexcept {
  for (int c = 0; c < snapshot_->count; ++c)
    if (active_[c] == 0 || solvers::slips(along_[c], limit_[c]))
      bond_[c] = displacement_[c];
    else
      bond_[c] += normal_[c].dot(displacement_[c] - bond_[c]) * normal_[c];
}

// Where the tool goes on as in the last tick the candidates do, too, and the rounds start there: their first step is
// what the motion changes by, and not the motion.
void TangentModel::expect(const Vector3& motion) noexcept {
  const double before = motion_.squaredNorm();
  const double share = changes_ && before > 0 ? std::clamp(motion.dot(motion_) / before, 0.0, most_ahead) : 0;
  motion_ = motion;
  double farthest = 0; // squared
  for (int c = 0; c < snapshot_->count; ++c) {
    start_[c] = displacement_[c];
    if (share == 0)
      continue;
    displacement_[c] += share * change_[c];
    farthest = std::max(farthest, change_[c].squaredNorm());
  }
  travelled_ += share * std::sqrt(farthest);
}

// Candidates near enough to the tool to meet it in this tick. The others were farther when last looked at than tool and
// surface have moved since.
void TangentModel::look_around(const solvers::PressingTool& tool) noexcept {
  const double radius = topology::tip_radius(tool_);
  travelled_ += (tool.pose.point - pose_.point).norm() + lever * (tool.pose.axis - pose_.axis).norm() +
                (snapshot_->reach + radius) * (tool.front - front_).norm();
  front_ = tool.front;
  const double far = margin * radius;
  near_count_ = 0;
  for (int c = 0; c < snapshot_->count; ++c) {
    if (active_[c] == 0 && clearance_[c] - travelled_ > far)
      continue;
    const double gap = gap_of(tool, c, displacement_[c]).distance;
    clearance_[c] = gap + travelled_;
    if (active_[c] != 0 || gap <= 2 * far)
      near_[near_count_++] = c;
  }
}

// Gaps of the candidates that are looked at, as they are now.
void TangentModel::linearise(const solvers::PressingTool& tool) noexcept {
  for (int k = 0; k < near_count_; ++k) {
    const int c = near_[k];
    const solvers::Gap gap = gap_of(tool, c, displacement_[c]);
    normal_[c] = gap.normal;
    gap_[c] = gap.distance + gap.normal.dot(condensed_->base[c] - displacement_[c]);
    fresh_[c] = 0;
  }
}

// Candidates change sides until none is pulled and none lies in the tool (true), or until a tick has no more pivots.
bool TangentModel::pivot(int& pivots) noexcept {
  int fewest = std::numeric_limits<int>::max();
  int patience = patience_of_block;
  while (true) {
    while (!solve_active()) {
    } // ends: every failure lets one candidate go
    displace();
    int wrong = 0;
    int last = -1;
    const auto is_wrong = [&](int c) {
      return active_[c] != 0 ? pressure_[c] < 0
                             : gap_[c] + normal_[c].dot(moved_[c] - condensed_->base[c]) < -gap_slack;
    };
    for (int k = 0; k < near_count_; ++k) {
      const int c = near_[k];
      wrong_[c] = is_wrong(c) ? 1 : 0;
      if (wrong_[c] != 0) {
        ++wrong;
        last = c;
      }
    }
    if (wrong == 0 || pivots >= most_pivots)
      return wrong == 0;
    ++pivots;
    if (wrong < fewest) {
      fewest = wrong;
      patience = patience_of_block;
    } else {
      --patience;
    }
    // All at once while that helps, else one by one [Judice and Pires 1994].
    for (int k = 0; k < near_count_; ++k)
      if (const int c = near_[k]; patience > 0 ? wrong_[c] != 0 : c == last)
        active_[c] = static_cast<char>(active_[c] == 0);
  }
}

void TangentModel::add_forces(const topology::ToolPose& pose, bool frictional, ModelForce& result) const noexcept {
  double stored = 0;
  for (int a = 0; a < chosen_count_; ++a) {
    const int c = chosen_[a];
    const double pressure = std::max(pressure_[c], 0.0);
    if (pressure > 0) {
      ++result.active;
      const Vector3 on_body = frictional ? Vector3(pressure * normal_[c] + along_[c]) : Vector3(pressure * normal_[c]);
      result.force -= on_body;
      result.torque -= (condensed_->rest[c] + moved_[c] - pose.point).cross(on_body);
      stored += 0.5 * on_body.dot(moved_[c] - condensed_->base[c]);
    }
  }
  result.stored = stored;
}

ModelForce TangentModel::press(const topology::ToolPose& pose) noexcept {
  const int count = snapshot_->count;
  const solvers::PressingTool tool = solvers::pressing(tool_, pose, rest(), normals());
  const bool frictional = snapshot_->condition == solvers::ContactCondition::frictional;
  if (frictional)
    for (int c = 0; c < count; ++c)
      if (active_[c] != 0)
        bond_[c] += solvers::tool_motion(pose_, pose, condensed_->rest[c] + bond_[c]);
  expect(pose.point - pose_.point);
  look_around(tool);
  if (frictional)
    drag_along();
  ModelForce result;
  result.converged = false;
  int pivots = 0;
  double went = 0; // m, of any candidate in this tick, at most
  double relaxation = 1;
  double last_square = 0; // of the last step, and its product with this one, for Aitken's factor
  while (result.rounds < most_rounds) {
    ++result.rounds;
    linearise(tool);
    const bool complementary = pivot(pivots);
    const bool stands = !frictional || rub();
    double largest = 0; // of any component
    double square = 0;
    double product = 0;
    for (int c = 0; c < count; ++c) {
      const Vector3 now = moved_[c] - displacement_[c];
      largest = std::max(largest, now.lpNorm<Eigen::Infinity>());
      product += now.dot(step_[c]);
      square += now.squaredNorm();
      step_[c] = now;
    }
    const double farthest = std::numbers::sqrt3 * largest;
    if (largest < still && complementary && stands) {
      went += farthest;
      for (int c = 0; c < count; ++c)
        displacement_[c] = moved_[c];
      result.converged = true;
      break;
    }
    if (result.rounds > 1) {
      const double turn = square - 2 * product + last_square;
      if (turn > 0)
        relaxation = std::clamp(-relaxation * (product - last_square) / turn, 0.25, 4.0);
    }
    last_square = square;
    went += std::max(1.0, relaxation) * farthest;
    for (int c = 0; c < count; ++c)
      displacement_[c] += relaxation * step_[c];
    if (pivots >= most_pivots)
      break;
  }
  add_forces(pose, frictional, result);
  if (frictional)
    settle_bonds();
  result.stiffness = stiffness_along(result.force);
  for (int k = 0; k < near_count_; ++k) {
    const int c = near_[k];
    result.sinking = std::max(result.sinking, -(gap_[c] + normal_[c].dot(moved_[c] - condensed_->base[c])));
  }
  for (int c = 0; c < count; ++c)
    change_[c] = displacement_[c] - start_[c];
  changes_ = true;
  travelled_ += went;
  pose_ = pose;
  return result;
}

// Adds a candidate to those that move with the tool: three more rows of the factor. False: it depends on the others.
bool TangentModel::catch_node(int candidate) noexcept {
  const std::vector<double>& compliance = condensed_->compliance;
  const auto rows = 3 * static_cast<std::size_t>(snapshot_->count);
  chosen_[chosen_count_] = candidate;
  for (int i = 0; i < 3; ++i) {
    const int r = 3 * chosen_count_ + i;
    double* row = &factor_[static_cast<std::size_t>(r) * ld];
    const double* column = &compliance[(3 * static_cast<std::size_t>(candidate) + static_cast<std::size_t>(i)) * rows];
    for (int s = 0; s <= r; ++s) {
      const double* other = &factor_[static_cast<std::size_t>(s) * ld];
      double value = column[3 * chosen_[s / 3] + s % 3];
      for (int k = 0; k < s; ++k)
        value -= row[k] * other[k];
      if (s < r) {
        row[s] = value / other[s];
      } else {
        if (!(value > singular * column[3 * candidate + i]))
          return false;
        row[s] = std::sqrt(value);
      }
    }
  }
  ++chosen_count_;
  active_[candidate] = 1;
  return true;
}

ModelForce TangentModel::follow(const topology::ToolPose& pose) noexcept {
  const int count = snapshot_->count;
  const solvers::PressingTool tool = solvers::pressing(tool_, pose, rest(), normals());
  const Vector3 motion = pose.point - pose_.point;
  ModelForce result;
  for (int a = 0; a < chosen_count_; ++a)
    bond_[chosen_[a]] += motion;
  for (bool grew = true; grew && result.rounds < most_rounds;) {
    ++result.rounds;
    grew = false;
    const int size = 3 * chosen_count_;
    for (int r = 0; r < size; ++r) {
      const int c = chosen_[r / 3];
      const double* row = &factor_[static_cast<std::size_t>(r) * ld];
      double value = bond_[c][r % 3] - condensed_->base[c][r % 3];
      for (int k = 0; k < r; ++k)
        value -= row[k] * right_[k];
      right_[r] = value / row[r];
    }
    for (int r = size - 1; r >= 0; --r) {
      const double* row = &factor_[static_cast<std::size_t>(r) * ld];
      const double value = right_[r] / row[r];
      for (int k = 0; k < r; ++k)
        right_[k] -= row[k] * value;
      bond_force_[chosen_[r / 3]][r % 3] = value;
    }
    displace();
    for (int c = 0; c < count && chosen_count_ < most_bonded; ++c) {
      if (active_[c] != 0)
        continue;
      const solvers::Gap gap = gap_of(tool, c, moved_[c]);
      result.sinking = std::max(result.sinking, -gap.distance);
      if (gap.distance < -gap_slack) {
        bond_[c] = moved_[c] - gap.distance * gap.normal;
        grew = catch_node(c) || grew;
      }
    }
    result.converged = !grew;
  }
  double stored = 0;
  for (int a = 0; a < chosen_count_; ++a) {
    const int c = chosen_[a];
    displacement_[c] = moved_[c];
    result.force -= bond_force_[c];
    result.torque -= (condensed_->rest[c] + moved_[c] - pose.point).cross(bond_force_[c]);
    stored += 0.5 * bond_force_[c].dot(moved_[c] - condensed_->base[c]);
  }
  result.active = chosen_count_;
  result.stored = stored;
  result.found = true; // while the first solve is on its way, the hand drags along without a force
  result.stiffness = stiffness_along(result.force);
  pose_ = pose;
  return result;
}

} // namespace spherecut::app
