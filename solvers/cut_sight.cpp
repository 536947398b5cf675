// Key: x point, d_j = x_j - x, R_j radius, W quartic spline of the way from x to x_j over R_j, A = sum_j W_j P_j P_j^T
// with P_j = {1, d_j / l, b_1 .. b_4}, b_k = B_k(x_j) - B_k(x) - g_k . d_j the branch functions less a linear part (any
// g_k gives the same shape functions; the gradient of B_k gives well conditioned ones except right at the front).
#include "solvers/cut_sight.hpp"

#include "topology/errors.hpp"
#include "topology/lip_lift.hpp"
#include "topology/point_tree.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

using shape_kernel::Support;
using topology::FrontFrame;

namespace {

constexpr int plain_size = 4, enriched_size = 8;
constexpr int enriched_spare = 2;        // nodes beyond the basis functions that an enriched support must have
constexpr double sheet_clearance = 1e-6; // in units of the smallest radius: nearer to the sheet a point lies on it
// Least product of the three principal spreads of a support (squares of lengths) over that of a ball. On the rim of a
// wound in a thin wedge of tissue a point may see lip nodes of one plane alone and, around the front, their partners
// 2e-4 spacings below. That tells nothing across the plane, but scaled to a unit diagonal the moment matrix does not
// show it.
constexpr double flattest = 1e-6;
constexpr double largest_growth = 2.5; // of a sphere at a point, 1.25^4

/// Everything about the support of one point, node by node.
struct Scratch {
  std::vector<double> weight;
  std::vector<Vector3> weight_gradient;
  std::vector<std::array<double, enriched_size>> basis; // P_j
  ShapeFunctions other;                                 // the second of two that are blended
  void resize(std::size_t n) {
    if (weight.size() >= n)
      return;
    weight.resize(n);
    weight_gradient.resize(n);
    basis.resize(n);
  }
};

Scratch& scratch_of_this_thread() {
  thread_local Scratch scratch;
  return scratch;
}

using Clock = std::chrono::steady_clock;
thread_local Clock::duration sight_time{};

/// The moving least squares problem on the first `size` basis functions. `slope` holds the derivatives of P at x. The
/// arrays of `out` have n entries. Returns the 1-norm condition of the moment matrix scaled to a unit diagonal.
template <int size>
double solve_moments(const Scratch& s, int n, const Eigen::Matrix<double, size, 3>& slope, ShapeFunctions& out) {
  using Vector = Eigen::Matrix<double, size, 1>;
  using Matrix = Eigen::Matrix<double, size, size>;
  const auto row = [&](int j) { return Eigen::Map<const Vector>(s.basis[j].data()); };
  Matrix a = Matrix::Zero();
  for (int j = 0; j < n; ++j) {
    const Vector p = row(j);
    a.noalias() += (s.weight[j] * p) * p.transpose();
  }
  const Vector diagonal = a.diagonal();
  if (!(diagonal.minCoeff() > 0))
    return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d mean = a.template block<3, 1>(1, 0) / a(0, 0);
  const Matrix3 spread = a.template block<3, 3>(1, 1) - a(0, 0) * mean * mean.transpose();
  if (const double even = spread.trace() / 3; !(spread.determinant() > flattest * even * even * even))
    return std::numeric_limits<double>::infinity();
  const Vector scale = diagonal.cwiseSqrt().cwiseInverse();
  a = scale.asDiagonal() * a * scale.asDiagonal();
  const Eigen::LLT<Matrix> factor(a);
  if (factor.info() != Eigen::Success)
    return std::numeric_limits<double>::infinity();
  const Matrix inverse = factor.solve(Matrix::Identity());
  const double condition = a.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();

  // A c = P(x) = e_0 and, with the frame and the branch functions' linear parts fixed at x, A c_k = P,k - A,k c.
  const Vector c = scale[0] * scale.cwiseProduct(inverse.col(0));
  Eigen::Matrix<double, size, 3> right = slope;
  for (int j = 0; j < n; ++j) {
    const Vector p = row(j);
    const double pc = p.dot(c);
    out.value[j] = s.weight[j] * pc;
    right.noalias() -= p * (pc * s.weight_gradient[j]).transpose();
  }
  const Eigen::Matrix<double, size, 3> c1 = scale.asDiagonal() * (inverse * (scale.asDiagonal() * right));
  for (int j = 0; j < n; ++j) {
    const Vector p = row(j);
    const Vector3 gradient = p.dot(c) * s.weight_gradient[j] + s.weight[j] * (c1.transpose() * p);
    out.dx[j] = gradient.x();
    out.dy[j] = gradient.y();
    out.dz[j] = gradient.z();
  }
  return condition;
}

void resize(ShapeFunctions& out, int n) {
  for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
    array->resize(n);
  for (std::vector<double>* array : {&out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz})
    array->clear();
}

/// out = share * out + (1 - share) * other, with the gradient of the share.
void blend(ShapeFunctions& out, const ShapeFunctions& other, double share, const Vector3& share_gradient) {
  for (std::size_t k = 0; k < out.value.size(); ++k) {
    const double difference = out.value[k] - other.value[k];
    out.value[k] = share * out.value[k] + (1 - share) * other.value[k];
    out.dx[k] = share * out.dx[k] + (1 - share) * other.dx[k] + share_gradient.x() * difference;
    out.dy[k] = share * out.dy[k] + (1 - share) * other.dy[k] + share_gradient.y() * difference;
    out.dz[k] = share * out.dz[k] + (1 - share) * other.dz[k] + share_gradient.z() * difference;
  }
}

} // namespace

double sight_seconds() {
  return std::chrono::duration<double>(sight_time).count();
}

namespace {
double now_in_seconds() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}
} // namespace

SharedSightTime::SharedSightTime() : begin_(now_in_seconds()), sight_begin_(sight_seconds()), sight_(0), spent_(0) {}

SharedSightTime::~SharedSightTime() {
  const double share = spent_ > 0 ? std::min(1.0, sight_ / spent_) : 0;
  sight_time = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(sight_begin_ + share * (now_in_seconds() - begin_)));
}

SharedSightTime::Part::Part(const SharedSightTime& whole)
    : whole_(whole), begin_(now_in_seconds()), sight_begin_(sight_seconds()) {}

SharedSightTime::Part::~Part() {
  whole_.sight_ += sight_seconds() - sight_begin_;
  whole_.spent_ += now_in_seconds() - begin_;
}

Branch branch_at(const topology::Incision& incision, const FrontFrame& frame, const Vector3& x) {
  const Vector3 d = x - frame.point;
  const double ahead = d.dot(frame.ahead), above = d.dot(frame.normal), r = std::hypot(ahead, above);
  Branch branch;
  if (!(r > 0))
    return branch;
  double theta = std::atan2(above, ahead);
  // Behind the front the sheet itself tells the sides apart.
  if (ahead < 0 && std::abs(above) < 0.6 * -ahead)
    if (const auto face = incision.closest(x, 1.000001 * frame.distance);
        face && !face->on_border && face->sheet == incision.front()[frame.segment].sheet) {
      const bool positive = (x - face->point).dot(face->normal) > 0;
      if (positive && theta < 0)
        theta += 2 * std::numbers::pi;
      else if (!positive && theta > 0)
        theta -= 2 * std::numbers::pi;
    }
  const double root = std::sqrt(r), sh = std::sin(theta / 2), ch = std::cos(theta / 2);
  const double s = 2 * sh * ch, c = ch * ch - sh * sh;
  branch.value = {root * ch, root * sh, root * sh * s, root * ch * s};
  const std::array<double, 4> turn = {-0.5 * root * sh, 0.5 * root * ch, root * (0.5 * ch * s + sh * c),
                                      root * (-0.5 * sh * s + ch * c)};
  const Vector3 theta_gradient = (ahead * frame.normal - above * frame.ahead) / (r * r);
  const Vector3 r_gradient = (ahead * frame.ahead + above * frame.normal) / r;
  for (int k = 0; k < 4; ++k)
    branch.gradient[k] = branch.value[k] / (2 * r) * r_gradient + turn[k] * theta_gradient;
  return branch;
}

CutSight::CutSight(const Sight& sight, const std::vector<Vector3>& centres, const std::vector<double>& spacings,
                   const std::vector<double>& radii)
    : sight_(sight), front_distance_(centres.size(), std::numeric_limits<double>::infinity()) {
  if (!(sight_.reach > 0) || !(sight_.blend >= 0) || !(sight_.blend < 1))
    throw InputError(fmt::format("enrichment that fades from {} of its reach of {} spacings: the reach must be "
                                 "positive and the part in [0, 1)",
                                 sight_.blend, sight_.reach));
  if (sight_.rule != SightRule::visibility) {
    std::vector<Vector3> present;
    std::vector<double> spacing_of;
    for (std::size_t j = 0; j < centres.size(); ++j)
      if (radii[j] > 0) {
        present.push_back(centres[j]);
        spacing_of.push_back(spacings[j]);
      }
    const topology::PointTree tree(present);
    double largest = 0;
    const auto spacing_at = [&](const Vector3& x) { return spacing_of[tree.nearest(x).index]; };
    for (const topology::FrontSegment& segment : sight_.incision->front()) {
      const std::array<double, 2>& ends =
          front_spacing_.emplace_back(std::array{spacing_at(segment.from), spacing_at(segment.to)});
      largest = std::max({largest, ends[0], ends[1]});
    }
    longest_reach_ = sight_.reach * largest;
    branch_.resize(sight_.rule == SightRule::enriched ? centres.size() : 0);
  }
  known_radii_.assign(centres.size(), 0);
  eyes_.assign(centres.begin(), centres.end());
  update_radii(centres, radii);
}

void CutSight::update_radii(const std::vector<Vector3>& centres, const std::vector<double>& radii) {
  concern_.assign(centres.size(), 0);
  smallest_radius_ = std::numeric_limits<double>::infinity();
  for (double radius : radii)
    if (radius > 0) // a node without a sphere does not count
      smallest_radius_ = std::min(smallest_radius_, radius);
  for (std::size_t j = 0; j < centres.size(); ++j) {
    if (sight_.incision->near(centres[j], radii[j])) {
      concern_[j] |= touches_sheet;
      if (radii[j] > known_radii_[j])
        eyes_[j] = topology::eye_at(*sight_.incision, centres[j], radii[j]);
    }
    if (!front_spacing_.empty() && radii[j] > known_radii_[j])
      if (const auto frame = sight_.incision->front_frame(centres[j], longest_reach_ + largest_growth * radii[j])) {
        front_distance_[j] = frame->distance;
        if (sight_.rule == SightRule::enriched)
          branch_[j] = branch_at(*sight_.incision, *frame, centres[j]);
      }
    known_radii_[j] = radii[j];
    if (sight_.rule == SightRule::enriched && front_distance_[j] < longest_reach_ + radii[j])
      concern_[j] |= near_front;
  }
}

CutSight::EnrichedReach CutSight::reach_at(const Vector3& x, const FrontFrame& frame) const {
  const topology::FrontSegment& segment = sight_.incision->front()[frame.segment];
  const auto& [at_from, at_to] = front_spacing_[frame.segment];
  const Vector3 along = segment.to - segment.from;
  const double share = (x - segment.from).dot(along) / along.squaredNorm();
  EnrichedReach reach{sight_.reach * std::lerp(at_from, at_to, std::clamp(share, 0.0, 1.0))};
  if (share > 0 && share < 1)
    reach.gradient = (sight_.reach * (at_to - at_from) / along.squaredNorm()) * along;
  return reach;
}

bool CutSight::enriches(const Vector3& x) const {
  if (sight_.rule != SightRule::enriched || front_spacing_.empty())
    return false;
  const auto front = sight_.incision->front_frame(x, longest_reach_);
  return front && front->distance < reach_at(x, *front).length;
}

Vector3 CutSight::off_the_sheet(const Vector3& x) const {
  const double clearance = sheet_clearance * smallest_radius_;
  if (sight_.incision->near(x, 0.1 * clearance))
    if (const auto face = sight_.incision->closest(x, 0.1 * clearance))
      return face->point + clearance * face->normal;
  return x;
}

bool CutSight::evaluate(const shape_kernel::Kernel& kernel, const Vector3& x, Support& support, bool grown, bool second,
                        int spare, double worst_condition, Enrich enrich, ShapeFunctions& out) const {
  if (support.count == 0)
    return false;
  const topology::Incision& incision = *sight_.incision;
  const bool bends = sight_.rule != SightRule::visibility && !front_spacing_.empty();
  double smallest_q = support.q[0], largest_q = support.q[0];
  for (int k = 1; k < support.count; ++k) {
    smallest_q = std::min(smallest_q, support.q[k]);
    largest_q = std::max(largest_q, support.q[k]);
  }
  const double largest_radius = 1 / std::sqrt(smallest_q);
  const bool may_hide = incision.near(x, largest_radius);
  const topology::Eye eye = may_hide ? topology::eye_at(incision, x, 1 / std::sqrt(largest_q)) : topology::Eye(x);
  const bool may_enrich = bends && sight_.rule == SightRule::enriched && enrich == Enrich::where_near && !second;
  std::optional<FrontFrame> front;
  const Clock::time_point looked = Clock::now();
  if (bends && (may_enrich || may_hide))
    front = incision.front_frame(x, std::max(may_enrich ? longest_reach_ : 0, may_hide ? largest_radius : 0));

  // Nodes in sight and around the front move to the head of the support; the way and its direction give their weights.
  Scratch& scratch = scratch_of_this_thread();
  scratch.resize(support.count);
  int n = 0;
  bool bent = false;
  for (int k = 0; k < support.count; ++k) {
    const int id = support.ids[k];
    const Vector3 d(support.dx[k], support.dy[k], support.dz[k]);
    const double q = support.q[k];
    Vector3 direction = -d; // gradient of the way, times its length
    double way = 0;         // 0: straight
    if (may_hide && (grown || (concern_[id] & touches_sheet) != 0) && incision.hides(eye, eyes_[id])) {
      const double radius = 1 / std::sqrt(q);
      if (!front || front->distance + front_distance_[id] >= radius)
        continue;
      const auto detour = incision.detour(eye, eyes_[id], radius);
      if (!detour || detour->length >= radius)
        continue;
      way = detour->length;
      const Vector3 leg = x - detour->over;
      const double length = leg.norm();
      direction = length > 0 ? Vector3(leg * (way / length)) : Vector3::Zero();
      bent = true;
    }
    const double s = (way > 0 ? way : d.norm()) * std::sqrt(q), t = 1 - s;
    scratch.weight[n] = t * t * t * (1 + 3 * s);
    scratch.weight_gradient[n] = -12 * t * t * q * direction;
    support.ids[n] = id;
    support.dx[n] = d.x();
    support.dy[n] = d.y();
    support.dz[n] = d.z();
    support.q[n] = q;
    ++n;
  }
  support.count = n;
  sight_time += Clock::now() - looked;

  const EnrichedReach around = front ? reach_at(x, *front) : EnrichedReach{};
  const double reach = around.length;
  const bool enriched = may_enrich && front && front->distance < reach && front->distance > 1e-9 * reach;
  if (!bent && !enriched) {
    for (int k = n; k < n + SphereGrid::lanes; ++k) {
      support.dx[k] = support.q[k] = 1;
      support.dy[k] = support.dz[k] = 0;
    }
    return n >= plain_size + spare &&
           shape_kernel::evaluate_support(kernel, support, Basis::linear, second, worst_condition, out);
  }
  if (n < (enriched ? enriched_size + enriched_spare : plain_size + spare))
    return false;

  const double scale = std::sqrt(support.q[0]);
  for (int k = 0; k < n; ++k) {
    scratch.basis[k][0] = 1;
    scratch.basis[k][1] = scale * support.dx[k];
    scratch.basis[k][2] = scale * support.dy[k];
    scratch.basis[k][3] = scale * support.dz[k];
  }
  Eigen::Matrix<double, plain_size, 3> plain_slope = Eigen::Matrix<double, plain_size, 3>::Zero();
  plain_slope.bottomRows<3>() = scale * Matrix3::Identity();
  if (!enriched) {
    resize(out, n);
    out.moment_condition = solve_moments<plain_size>(scratch, n, plain_slope, out);
  } else {
    const Branch here = branch_at(incision, *front, x);
    const double r = std::hypot((x - front->point).dot(front->ahead), (x - front->point).dot(front->normal));
    const bool smooth = r * scale > 0.5;
    Eigen::Matrix<double, enriched_size, 3> slope = Eigen::Matrix<double, enriched_size, 3>::Zero();
    slope.topRows<plain_size>() = plain_slope;
    for (int e = 0; e < 4; ++e)
      if (!smooth)
        slope.row(plain_size + e) = here.gradient[e].transpose();
    for (int k = 0; k < n; ++k) {
      const Branch& there = branch_[support.ids[k]];
      const Vector3 d(support.dx[k], support.dy[k], support.dz[k]);
      for (int e = 0; e < 4; ++e)
        scratch.basis[k][plain_size + e] = there.value[e] - here.value[e] - (smooth ? here.gradient[e].dot(d) : 0.0);
    }
    resize(out, n);
    out.moment_condition = solve_moments<enriched_size>(scratch, n, slope, out);
    if (out.moment_condition <= worst_condition && front->distance > sight_.blend * reach) {
      ShapeFunctions& plain = scratch.other;
      resize(plain, n);
      solve_moments<plain_size>(scratch, n, plain_slope, plain);
      const double width = (1 - sight_.blend) * reach, t = (reach - front->distance) / width;
      const Vector3 nearness = (front->distance / reach) * around.gradient - (x - front->point) / front->distance;
      blend(out, plain, t * t * (3 - 2 * t), Vector3((6 * t * (1 - t) / width) * nearness));
    }
  }
  if (!(out.moment_condition <= worst_condition))
    return false;
  out.nodes.assign(support.ids, support.ids + n);
  return true;
}

} // namespace spherecut::solvers
