// Key: x point, d_j = x_j - x, R_j radius, W quartic spline of the way from x to x_j over R_j, A = sum_j W_j P_j P_j^T
// with P_j = {1, d_j / l, b_1 .. b_4}, b_k = B_k(x_j) - B_k(x) - g_k . d_j the branch functions less a linear part (any
// g_k gives the same shape functions; the gradient of B_k gives well conditioned ones except right at the front).
#include "solvers/shapes/cut_sight.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/lip_lift.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

using shape_kernel::Support;
using topology::FrontFrame;

namespace {

constexpr int plain_size = 4, enriched_size = 8;
constexpr int enriched_spare = 2;     // nodes beyond the basis functions that an enriched support must have
constexpr double on_the_sheet = 1e-6; // in units of the smallest radius: nearer to the sheet a point lies on it
// Least product of the three principal spreads of a support (squares of lengths) over that of a ball. On the rim of a
// wound in a thin wedge of tissue a point may see lip nodes of one plane alone and, around the front, their partners
// 2e-4 spacings below. That tells nothing across the plane, but scaled to a unit diagonal the moment matrix does not
// show it.
constexpr double flattest = 1e-6;
// Largest sum of the gradients' lengths of an enriched support times the distance from the front. It is 1 to 16 where
// nodes lie around the point (one in 100 000 above 16); hundreds where as many as the basis has functions lie on one
// face and the others are about to leave: off a corner of the rim the field then goes astray by millimetres.
constexpr double steepest = 40;
constexpr std::size_t few_walls = 8;   // among so many the one that blocks a sight line is found one by one
constexpr double largest_growth = 2.5; // of a sphere at a point, 1.25^4

/// Everything about the support of one point, node by node, with room for whole registers.
struct Scratch {
  std::vector<char> hidden; // does not see the point
  std::vector<double> room;
  std::size_t stride = 0;
  void resize(std::size_t n) {
    const std::size_t padded = (n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes;
    if (stride >= padded)
      return;
    stride = padded;
    room.resize((4 + enriched_size - 1) * stride);
  }
  double* weight() { return room.data(); }
  double* weight_gradient(int axis) { return room.data() + static_cast<std::ptrdiff_t>(1 + axis) * stride; }
  double* basis(int i) { return room.data() + static_cast<std::ptrdiff_t>(3 + i) * stride; } // from 1 on
};

Scratch& scratch_of_this_thread() {
  thread_local Scratch scratch;
  return scratch;
}

using Clock = std::chrono::steady_clock;
thread_local Clock::duration sight_time{};

void resize(ShapeFunctions& out, int n) {
  for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
    array->resize(n);
  for (std::vector<double>* array : {&out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz})
    array->clear();
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
    const topology::PointTree tree(centres);
    double largest = 0;
    const auto spacing_at = [&](const Vector3& x) { return spacings[tree.nearest(x).index]; };
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
  const double clearance = on_the_sheet * smallest_radius_;
  if (sight_.incision->near(x, 0.1 * clearance))
    if (const auto face = sight_.incision->closest(x, 0.1 * clearance))
      return face->point + clearance * face->normal;
  return x;
}

void CutSight::look(std::span<const QuadraturePoint> points, std::span<const int> nodes,
                    std::span<const std::uint32_t> reached, CellView& view) const {
  const Clock::time_point begin = Clock::now();
  const topology::Incision& incision = *sight_.incision;
  Vector3 lower = points.front().position, upper = lower;
  for (const QuadraturePoint& point : points) {
    lower = lower.cwiseMin(point.position);
    upper = upper.cwiseMax(point.position);
  }
  const Vector3 centre = 0.5 * (lower + upper), half = 0.5 * (upper - lower);
  view.hidden.assign(nodes.size(), 0);
  view.points.assign(points.size(), {});
  view.altered = view.on_sheet = 0;
  if (const double off = 0.1 * on_the_sheet * smallest_radius_; incision.near(centre, half.norm() + off))
    for (std::size_t q = 0; q < points.size(); ++q)
      if (off_the_sheet(points[q].position) != points[q].position)
        view.on_sheet |= std::uint32_t{1} << q;

  std::uint32_t lifted = 0; // bit q: the eye of point q is known
  double largest_radius = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const int id = nodes[k];
    largest_radius = std::max(largest_radius, known_radii_[id]);
    if ((concern_[id] & touches_sheet) == 0)
      continue;
    const topology::Eye& eye = eyes_[id];
    const bool are_few = incision.walls_between(centre, half, eye.at, few_walls, view.walls);
    if (view.walls.empty())
      continue;
    int wall = view.walls.front();
    const auto is_blocked = [&](const Vector3& a, const Vector3& b) {
      return are_few ? incision.blocks(a, b, view.walls) : incision.blocks(a, b, wall);
    };
    for (std::uint32_t bits = reached[k] & ~view.on_sheet; bits != 0; bits &= bits - 1) {
      const int q = std::countr_zero(bits);
      const std::uint32_t bit = std::uint32_t{1} << q;
      const Vector3& x = points[q].position;
      if (!is_blocked(x, eye.at))
        continue;
      if ((lifted & bit) == 0) {
        double smallest_radius = std::numeric_limits<double>::infinity();
        for (std::size_t j = 0; j < nodes.size(); ++j)
          if ((reached[j] & bit) != 0)
            smallest_radius = std::min(smallest_radius, known_radii_[nodes[j]]);
        view.points[q].eye = topology::eye_at(incision, x, smallest_radius);
        lifted |= bit;
      }
      // As a rule one of the same walls stands between the lifted eyes, too.
      const topology::Eye& own = view.points[q].eye;
      const bool is_told = !are_few && (own.on_face() || eye.on_face()); // by the whole sheets
      if (is_blocked(own.lifted, eye.lifted) || (!is_told && incision.hides_blocked(own, eye))) {
        view.hidden[k] |= bit;
        view.altered |= bit;
      }
    }
  }
  view.altered |= view.on_sheet;

  if (!front_spacing_.empty()) {
    const bool may_enrich =
        sight_.rule == SightRule::enriched && incision.front_frame(centre, longest_reach_ + half.norm());
    for (std::size_t q = 0; q < points.size(); ++q) {
      const std::uint32_t bit = std::uint32_t{1} << q;
      const bool bends = (view.altered & ~view.on_sheet & bit) != 0;
      if ((view.on_sheet & bit) != 0 || (!may_enrich && !bends))
        continue;
      const Vector3& x = points[q].position;
      std::optional<FrontFrame>& front = view.points[q].front;
      front = incision.front_frame(x, std::max(may_enrich ? longest_reach_ : 0, bends ? largest_radius : 0));
      if (may_enrich && front && front->distance < reach_at(x, *front).length)
        view.altered |= bit;
    }
  }
  sight_time += Clock::now() - begin;
}

bool CutSight::evaluate(const shape_kernel::Kernel& kernel, const Vector3& x, Support& support, bool grown, bool second,
                        int spare, double worst_condition, Enrich enrich, ShapeFunctions& out) const {
  if (support.count == 0)
    return false;
  const Clock::time_point looked = Clock::now();
  const topology::Incision& incision = *sight_.incision;
  const bool bends = sight_.rule != SightRule::visibility && !front_spacing_.empty();
  double smallest_q = support.q[0], largest_q = support.q[0];
  for (int k = 1; k < support.count; ++k) {
    smallest_q = std::min(smallest_q, support.q[k]);
    largest_q = std::max(largest_q, support.q[k]);
  }
  const double largest_radius = 1 / std::sqrt(smallest_q);
  const bool may_hide = incision.near(x, largest_radius);
  PointView view;
  view.eye = may_hide ? topology::eye_at(incision, x, 1 / std::sqrt(largest_q)) : topology::Eye(x);
  const bool may_enrich = bends && sight_.rule == SightRule::enriched && enrich == Enrich::where_near && !second;
  if (bends && (may_enrich || may_hide))
    view.front = incision.front_frame(x, std::max(may_enrich ? longest_reach_ : 0, may_hide ? largest_radius : 0));
  std::vector<char>& hidden = scratch_of_this_thread().hidden;
  hidden.resize(support.count);
  for (int k = 0; k < support.count; ++k) {
    const int id = support.ids[k];
    hidden[k] =
        may_hide && (grown || (concern_[id] & touches_sheet) != 0) && incision.hides(view.eye, eyes_[id]) ? 1 : 0;
  }
  sight_time += Clock::now() - looked;
  return evaluate_seen(kernel, x, view, hidden, {second, may_enrich, spare, worst_condition}, support, out);
}

bool CutSight::evaluate_seen(const shape_kernel::Kernel& kernel, const Vector3& x, const PointView& view,
                             std::span<const char> hidden, Support& support, double worst_condition,
                             ShapeFunctions& out) const {
  return evaluate_seen(kernel, x, view, hidden, {false, sight_.rule == SightRule::enriched, 0, worst_condition},
                       support, out);
}

/// Nodes in sight and around the front move to the head of the support; the way and its direction give their weights.
/// Whether some way bends.
bool CutSight::weigh(const Vector3& x, const PointView& view, std::span<const char> hidden, Support& support) const {
  const topology::Incision& incision = *sight_.incision;
  Scratch& scratch = scratch_of_this_thread();
  scratch.resize(support.count);
  double* weight = scratch.weight();
  int n = 0;
  bool bent = false;
  for (int k = 0; k < support.count; ++k) {
    const int id = support.ids[k];
    const Vector3 d(support.dx[k], support.dy[k], support.dz[k]);
    const double q = support.q[k];
    Vector3 direction = -d; // gradient of the way, times its length
    double way = 0;         // 0: straight
    if (hidden[k] != 0) {
      const double radius = 1 / std::sqrt(q);
      if (!view.front || view.front->distance + front_distance_[id] >= radius)
        continue;
      const auto detour = incision.detour(view.eye, eyes_[id], radius, view.front->segment);
      if (!detour || detour->length >= radius)
        continue;
      way = detour->length;
      const Vector3 leg = x - detour->over;
      const double length = leg.norm();
      direction = length > 0 ? Vector3(leg * (way / length)) : Vector3::Zero();
      bent = true;
    }
    const double s = (way > 0 ? way : d.norm()) * std::sqrt(q), t = 1 - s;
    weight[n] = t * t * t * (1 + 3 * s);
    for (int axis = 0; axis < 3; ++axis)
      scratch.weight_gradient(axis)[n] = -12 * t * t * q * direction[axis];
    support.ids[n] = id;
    support.dx[n] = d.x();
    support.dy[n] = d.y();
    support.dz[n] = d.z();
    support.q[n] = q;
    ++n;
  }
  support.count = n;
  return bent;
}

/// The linear part of the moments at a point whose support has been weighed, padded to whole registers.
shape_kernel::Moments CutSight::linear_moments(Support& support) {
  Scratch& scratch = scratch_of_this_thread();
  const int n = support.count, padded = (n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes;
  const double scale = std::sqrt(support.q[0]);
  for (int k = n; k < padded; ++k) {
    scratch.weight()[k] = support.dx[k] = support.dy[k] = support.dz[k] = 0;
    for (int axis = 0; axis < 3; ++axis)
      scratch.weight_gradient(axis)[k] = 0;
  }
  shape_kernel::Moments moments{};
  moments.count = n;
  moments.weight = scratch.weight();
  moments.slope = scale;
  moments.share = 1;
  moments.flattest = flattest;
  for (int axis = 0; axis < 3; ++axis) {
    moments.weight_gradient[axis] = scratch.weight_gradient(axis);
    const double* d = axis == 0 ? support.dx : axis == 1 ? support.dy : support.dz;
    double* to = scratch.basis(1 + axis);
    for (int k = 0; k < padded; ++k)
      to[k] = scale * d[k];
    moments.basis[axis] = to;
  }
  return moments;
}

/// Adds the branch functions, which fade towards the end of their reach.
void CutSight::enrich(const Vector3& x, const FrontFrame& front, const EnrichedReach& around, const Support& support,
                      shape_kernel::Moments& moments) const {
  Scratch& scratch = scratch_of_this_thread();
  const int n = support.count, padded = (n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes;
  const double scale = moments.slope, reach = around.length;
  moments.enriched = true;
  const Branch here = branch_at(*sight_.incision, front, x);
  const double r = std::hypot((x - front.point).dot(front.ahead), (x - front.point).dot(front.normal));
  const bool smooth = r * scale > 0.5;
  for (int e = 0; e < 4; ++e) {
    double* to = scratch.basis(plain_size + e);
    const Vector3 linear = smooth ? here.gradient[e] : Vector3::Zero();
    for (int k = 0; k < n; ++k)
      to[k] = branch_[support.ids[k]].value[e] - here.value[e] -
              (linear.x() * support.dx[k] + linear.y() * support.dy[k] + linear.z() * support.dz[k]);
    std::fill(to + n, to + padded, 0.0);
    moments.basis[plain_size - 1 + e] = to;
    for (int axis = 0; axis < 3 && !smooth; ++axis)
      moments.branch_slope[e][axis] = here.gradient[e][axis];
  }
  if (front.distance > sight_.blend * reach) {
    const double width = (1 - sight_.blend) * reach, t = (reach - front.distance) / width;
    const Vector3 nearness = (front.distance / reach) * around.gradient - (x - front.point) / front.distance;
    moments.share = t * t * (3 - 2 * t);
    for (int axis = 0; axis < 3; ++axis)
      moments.share_gradient[axis] = 6 * t * (1 - t) / width * nearness[axis];
  }
}

bool CutSight::evaluate_seen(const shape_kernel::Kernel& kernel, const Vector3& x, const PointView& view,
                             std::span<const char> hidden, const Wanted& wanted, Support& support,
                             ShapeFunctions& out) const {
  const std::optional<FrontFrame>& front = view.front;
  const auto [second, may_enrich, spare, worst_condition] = wanted;
  const Clock::time_point looked = Clock::now();
  const bool bent = weigh(x, view, hidden, support);
  sight_time += Clock::now() - looked;

  const int n = support.count;
  const EnrichedReach around = front ? reach_at(x, *front) : EnrichedReach{};
  const bool enriched =
      may_enrich && front && front->distance < around.length && front->distance > 1e-9 * around.length;
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

  shape_kernel::Moments moments = linear_moments(support);
  if (enriched)
    enrich(x, *front, around, support, moments);
  resize(out, (n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes);
  out.moment_condition =
      kernel.solve_moments(moments, {out.value.data(), out.dx.data(), out.dy.data(), out.dz.data(), {}});
  resize(out, n);
  if (!(out.moment_condition <= worst_condition))
    return false;
  if (enriched) {
    double gradients = 0;
    for (int k = 0; k < n; ++k)
      gradients += out.gradient(k).norm();
    if (gradients * front->distance > steepest)
      return false;
  }
  out.nodes.assign(support.ids, support.ids + n);
  return true;
}

} // namespace spherecut::solvers
