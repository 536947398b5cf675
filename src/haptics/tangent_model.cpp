// Notation: candidate c at rest at x_c with displacement u_c = b_c + sum_d C_cd f_d. Frictionless: f_c = p_c n_c with
// the tool's normal n_c, gap w_c = q_c + n_c . (u_c - b_c), q_c = g_c + n_c . (b_c - u_c at which g_c was taken), and
// w >= 0, p >= 0, p w = 0. Bonded: u_c = bond_c + motion of the tool on the caught candidates.
#include "src/haptics/tangent_model.hpp"

#include "solvers/tool_gap.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::app {
namespace {

constexpr double still = 1e-7;       // m, displacements that move by less between two rounds stand still
constexpr double gap_slack = 1e-9;   // m, of a gap that counts as closed
constexpr int most_rounds = 6;       // in a tick
constexpr int most_pivots = 16;      // in a tick, over all rounds
constexpr double singular = 1e-12;   // pivot over diagonal at which a block is not positive definite
constexpr int patience_of_block = 4; // pivots of many candidates at once without progress
constexpr int ld = 3 * most_candidates;
constexpr int most_bonded = most_candidates - 1; // the factor has room for one that is tried

} // namespace

TangentModel::TangentModel(const topology::ToolShape& tool)
    : tool_(tool), factor_(static_cast<std::size_t>(ld) * ld), right_(ld) {
  displacement_.fill(Vector3::Zero());
  moved_.fill(Vector3::Zero());
  normal_.fill(Vector3::UnitZ());
  gap_.fill(0);
  pressure_.fill(0);
  active_.fill(0);
  bond_.fill(Vector3::Zero());
  bond_force_.fill(Vector3::Zero());
  chosen_.fill(0);
  step_.fill(Vector3::Zero());
  wrong_.fill(0);
}

std::span<const Vector3> TangentModel::rest() const {
  return {snapshot_->rest.data(), static_cast<std::size_t>(snapshot_->count)};
}

std::span<const Vector3> TangentModel::normals() const {
  return {snapshot_->normals.data(), static_cast<std::size_t>(snapshot_->count)};
}

void TangentModel::solved(const ContactSnapshot& snapshot) noexcept {
  snapshot_ = &snapshot;
  pose_ = snapshot.pose;
  chosen_count_ = 0;
  for (int c = 0; c < snapshot.count; ++c) {
    displacement_[c] = snapshot.displacement[c];
    active_[c] = snapshot.active[c];
    bond_[c] = snapshot.bond[c];
    bond_force_[c].setZero();
  }
  if (snapshot.condition == solvers::ContactCondition::bonded)
    for (int c = 0; c < snapshot.count; ++c)
      if (active_[c] != 0 && !catch_node(c))
        active_[c] = 0;
}

ModelForce TangentModel::at(const topology::ToolPose& pose, double /*time*/) noexcept {
  if (snapshot_ == nullptr || snapshot_->count == 0)
    return {.stored = 0.0};
  return snapshot_->condition == solvers::ContactCondition::bonded ? follow(pose) : press(pose);
}

// Pressures of the active candidates that close their gaps: N^T C N p = -q by Cholesky. False: the block is not
// positive definite, and the candidate that made it so has been let go.
bool TangentModel::solve_active() noexcept {
  const std::vector<double>& compliance = snapshot_->compliance;
  const auto rows = static_cast<std::size_t>(3 * snapshot_->count);
  chosen_count_ = 0;
  for (int c = 0; c < snapshot_->count; ++c) {
    pressure_[c] = 0;
    if (active_[c] != 0)
      chosen_[chosen_count_++] = c;
  }
  for (int a = 0; a < chosen_count_; ++a) {
    double* row = &factor_[static_cast<std::size_t>(a) * ld];
    const int c = chosen_[a];
    const double* block = &compliance[static_cast<std::size_t>(3 * c) * rows]; // three columns; the matrix is symmetric
    const Vector3& n = normal_[c];
    for (int b = 0; b <= a; ++b) {
      const int d = chosen_[b];
      const double* p = block + static_cast<std::size_t>(3 * d);
      double value = 0;
      for (int j = 0; j < 3; ++j)
        value += normal_[d][j] * (n[0] * p[j] + n[1] * p[rows + j] + n[2] * p[2 * rows + j]);
      row[b] = value;
    }
    // Row a of the factor from those above it.
    for (int b = 0; b < a; ++b) {
      const double* other = &factor_[static_cast<std::size_t>(b) * ld];
      double value = row[b];
      for (int k = 0; k < b; ++k)
        value -= row[k] * other[k];
      row[b] = value / other[b];
    }
    double pivot = row[a];
    const double before = pivot;
    double right = -gap_[c];
    for (int k = 0; k < a; ++k) {
      pivot -= row[k] * row[k];
      right -= row[k] * right_[k];
    }
    if (!(pivot > singular * before)) {
      active_[c] = 0;
      return false;
    }
    row[a] = std::sqrt(pivot);
    right_[a] = right / row[a];
  }
  for (int a = chosen_count_ - 1; a >= 0; --a) {
    const double* row = &factor_[static_cast<std::size_t>(a) * ld];
    const double value = right_[a] / row[a];
    for (int k = 0; k < a; ++k)
      right_[k] -= row[k] * value;
    pressure_[chosen_[a]] = value;
  }
  return true;
}

// Displacements under the forces: `moved_` = b + C f.
void TangentModel::displace() noexcept {
  const auto rows = static_cast<std::size_t>(3 * snapshot_->count);
  const bool bonded = snapshot_->condition == solvers::ContactCondition::bonded;
  double* u = moved_[0].data(); // Vector3 is three doubles without padding
  static_assert(sizeof(Vector3) == 3 * sizeof(double));
  for (int c = 0; c < snapshot_->count; ++c)
    moved_[c] = snapshot_->base[c];
  for (int a = 0; a < chosen_count_; ++a) {
    const int c = chosen_[a];
    const Vector3 force = bonded ? bond_force_[c] : Vector3(pressure_[c] * normal_[c]);
    const double* first = &snapshot_->compliance[static_cast<std::size_t>(3 * c) * rows];
    const double* second = first + rows;
    const double* third = second + rows;
    for (std::size_t i = 0; i < rows; ++i)
      u[i] += force[0] * first[i] + force[1] * second[i] + force[2] * third[i];
  }
}

ModelForce TangentModel::press(const topology::ToolPose& pose) noexcept {
  const int count = snapshot_->count;
  const solvers::PressingTool tool = solvers::pressing(tool_, pose, rest(), normals());
  ModelForce result;
  result.converged = false;
  int pivots = 0;
  double relaxation = 1;
  double last_square = 0; // of the last step, and its product with this one, for Aitken's factor
  while (result.rounds < most_rounds) {
    ++result.rounds;
    for (int c = 0; c < count; ++c) {
      const solvers::Gap gap = solvers::contact_gap(tool, snapshot_->rest[c] + displacement_[c]);
      normal_[c] = gap.normal;
      gap_[c] = gap.distance + gap.normal.dot(snapshot_->base[c] - displacement_[c]);
    }
    int fewest = std::numeric_limits<int>::max();
    int patience = patience_of_block;
    bool complementary = false;
    while (true) {
      while (!solve_active()) {
      } // ends: every failure lets one candidate go
      displace();
      int wrong = 0;
      int last = -1;
      const auto is_wrong = [&](int c) {
        return active_[c] != 0 ? pressure_[c] < 0
                               : gap_[c] + normal_[c].dot(moved_[c] - snapshot_->base[c]) < -gap_slack;
      };
      for (int c = 0; c < count; ++c)
        if (is_wrong(c)) {
          ++wrong;
          last = c;
        }
      complementary = wrong == 0;
      if (complementary || pivots >= most_pivots)
        break;
      ++pivots;
      if (wrong < fewest) {
        fewest = wrong;
        patience = patience_of_block;
      } else {
        --patience;
      }
      // All at once while that helps, else one by one [Judice and Pires 1994]. All are judged before any changes.
      if (patience > 0) {
        for (int c = 0; c < count; ++c)
          wrong_[c] = is_wrong(c) ? 1 : 0;
        for (int c = 0; c < count; ++c)
          active_[c] = wrong_[c] != 0 ? static_cast<char>(active_[c] == 0) : active_[c];
      } else {
        active_[last] = static_cast<char>(active_[last] == 0);
      }
    }
    double largest = 0;
    double square = 0;
    double product = 0;
    for (int c = 0; c < count; ++c) {
      const Vector3 now = moved_[c] - displacement_[c];
      largest = std::max(largest, now.lpNorm<Eigen::Infinity>());
      product += now.dot(step_[c]);
      square += now.squaredNorm();
      step_[c] = now;
    }
    if (largest < still && complementary) {
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
    for (int c = 0; c < count; ++c)
      displacement_[c] += relaxation * step_[c];
    if (pivots >= most_pivots)
      break;
  }
  double stored = 0;
  for (int a = 0; a < chosen_count_; ++a) {
    const int c = chosen_[a];
    const double pressure = std::max(pressure_[c], 0.0);
    if (pressure > 0) {
      ++result.active;
      result.force -= pressure * normal_[c];
      stored += 0.5 * pressure * normal_[c].dot(moved_[c] - snapshot_->base[c]);
    }
  }
  result.stored = stored;
  for (int c = 0; c < count; ++c)
    result.sinking = std::max(result.sinking, -(gap_[c] + normal_[c].dot(moved_[c] - snapshot_->base[c])));
  pose_ = pose;
  return result;
}

// Adds a candidate to those that move with the tool: three more rows of the factor. False: it depends on the others.
bool TangentModel::catch_node(int candidate) noexcept {
  const std::vector<double>& compliance = snapshot_->compliance;
  const auto rows = static_cast<std::size_t>(3 * snapshot_->count);
  chosen_[chosen_count_] = candidate;
  for (int i = 0; i < 3; ++i) {
    const int r = 3 * chosen_count_ + i;
    double* row = &factor_[static_cast<std::size_t>(r) * ld];
    const double* column = &compliance[static_cast<std::size_t>(3 * candidate + i) * rows];
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
      double value = bond_[c][r % 3] - snapshot_->base[c][r % 3];
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
      const solvers::Gap gap = solvers::contact_gap(tool, snapshot_->rest[c] + moved_[c]);
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
    stored += 0.5 * bond_force_[c].dot(moved_[c] - snapshot_->base[c]);
  }
  result.active = chosen_count_;
  result.stored = stored;
  pose_ = pose;
  return result;
}

} // namespace spherecut::app
