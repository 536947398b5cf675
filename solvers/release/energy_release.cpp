#include "solvers/release/energy_release.hpp"

#include "solvers/elasticity/rotation.hpp"
#include "solvers/fracture/local_values.hpp"
#include "solvers/fracture/virtual_shift.hpp"
#include "solvers/points/point_kernels.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double parallel_skin = 0.05; // cosine between the way ahead and a normal of the surface that it is along
constexpr int face_points = 24, front_points = 96;

const topology::Incision& incision_with_front(const FiniteBody& body) {
  const topology::Incision* incision = body.problem().incision.get();
  if (incision == nullptr || incision->front().empty())
    throw InputError("energy release: the body has no cut that ends in it");
  return *incision;
}

void check_release(const ReleaseOptions& options) {
  if (!(options.inner >= 0 && options.outer > options.inner && std::isfinite(options.outer)))
    throw InputError(fmt::format("energy release: a shift that fades from {} to {} spacings; allowed: 0 or more, and "
                                 "the second larger",
                                 options.inner, options.outer));
  if (options.half_length && !(*options.half_length > 0 && std::isfinite(*options.half_length)))
    throw InputError(fmt::format("energy release: a tube of half a length of {} spacings; it must be positive",
                                 *options.half_length));
  if (!(options.inset >= 0) || !std::isfinite(options.inset))
    throw InputError(
        fmt::format("energy release: a shift that fades over {} spacings; it must not be negative", options.inset));
}

[[noreturn]] void throw_leaves(const Vector3& front, double outer) {
  throw InputError(fmt::format("energy release: the tube of radius {:.3g} m around the front at ({:.6g}, {:.6g}, "
                               "{:.6g}) m leaves the body",
                               outer, front.x(), front.y(), front.z()));
}

} // namespace

/// Of the shift at a point; zero where q is.
struct EnergyMomentum::Shift {
  double q = 0;
  Vector3 gradient = Vector3::Zero(); // of q, 1/m
  Vector3 ahead = Vector3::Zero(), normal = Vector3::Zero(), tangent = Vector3::Zero();
  double turn = 0; // 1/m, of the way ahead per length along the tangent
};

/// A point of the sheet behind the front.
struct EnergyMomentum::FacePlace {
  Vector3 position, ahead, normal;
  double weight = 0; // q dS, m2
  double off = 0;    // m, from the sheet, that counts as on its face
};

EnergyMomentum::EnergyMomentum(const FiniteBody& body, const VectorX& coefficients,
                               const std::function<FibreFrame(const Vector3& x)>& fibres)
    : body_(body), coefficients_(coefficients) {
  if (!body.options().prony.empty())
    throw InputError("energy release: the body is viscoelastic; allowed: one without a Prony series");
  if (coefficients.size() != 3 * static_cast<Eigen::Index>(body.functions()))
    throw InputError(fmt::format("energy release: {} coefficients for {} functions; there are 3 of each",
                                 coefficients.size(), body.functions()));
  const PointTable& table = body.points();
  const DilatationBlocks& blocks = body.blocks();
  const Law& law = body.law();
  const auto lanes = static_cast<std::size_t>(point_lanes);
  deformations_.assign(lanes * table.groups(), Matrix3::Identity());
  of_points_.assign(deformations_.size(), 0);
  points_stress_.assign(deformations_.size(), Matrix3::Zero());
  std::vector<double> mean(blocks.volume.size(), 0);
  for_each_deformation(table, coefficients, [&](int group, int lane, const Matrix3& deformation) {
    deformations_[lanes * group + lane] = deformation;
    const double j = deformation.determinant();
    if (body.minds_volume() && !(j > 0)) {
      const Vector3& x = table.positions[lanes * group + lane];
      throw InputError(
          fmt::format("energy release: J = {:.3g} at ({:.6g}, {:.6g}, {:.6g}) m; the law has no energy there", j, x.x(),
                      x.y(), x.z()));
    }
    if (blocks.size() > 0)
      mean[blocks.block[group]] += table.weights[group].value[lane] * j / blocks.volume[blocks.block[group]];
  });
  if (blocks.size() > 0) {
    of_blocks_ = of_points_;
    blocks_stress_ = points_stress_;
  }
  const double own = body.pointwise_share(), shared = 1 - own;
  for (int group = 0; group < table.groups(); ++group)
    for (int lane = 0; lane < table.count[group]; ++lane) {
      const std::size_t point = lanes * group + lane;
      const Matrix3& deformation = deformations_[point];
      std::vector<FibreFrame> frame;
      if (fibres)
        frame.push_back(fibres(table.positions[point]));
      double energy = 0;
      Matrix3 stress;
      law.evaluate_isochoric({&deformation, 1}, frame, {&energy, 1}, {&stress, 1});
      of_points_[point] = energy;
      points_stress_[point] = stress;
      if (!body.minds_volume())
        continue;
      const double j = deformation.determinant();
      const Matrix3 cofactor = j * deformation.inverse().transpose();
      const double volumetric = law.volumetric_energy(j), pressure = law.pressure(j);
      of_points_[point] += volumetric;
      points_stress_[point] += pressure * cofactor;
      if (blocks.size() == 0)
        continue;
      const double jb = mean[blocks.block[group]], pb = law.pressure(jb);
      of_blocks_[point] = energy + own * volumetric + shared * (law.volumetric_energy(jb) + pb * (j - jb));
      blocks_stress_[point] = stress + (own * pressure + shared * pb) * cofactor;
    }
}

template <class ShiftAt>
EnergyRelease EnergyMomentum::integrate(const ShiftAt& shift_at, ReleasePressure pressure, double load_factor,
                                        std::optional<Matrix3>& about) const {
  const PointTable& table = body_.points();
  const bool takes_blocks = pressure == ReleasePressure::blocks && !of_blocks_.empty();
  const std::vector<double>& energies = takes_blocks ? of_blocks_ : of_points_;
  const std::vector<Matrix3>& stresses = takes_blocks ? blocks_stress_ : points_stress_;
  struct Reached {
    std::size_t point;
    double weight; // m3
    Shift shift;
  };
  std::vector<Reached> reached;
  Matrix3 sum_of_deformations = Matrix3::Zero();
  double fading = 0;
  for (int group = 0; group < table.groups(); ++group)
    for (int lane = 0; lane < table.count[group]; ++lane) {
      const std::size_t point = static_cast<std::size_t>(point_lanes) * group + lane;
      const Shift shift = shift_at(table.positions[point]);
      if (shift.q == 0)
        continue;
      const double weight = table.weights[group].value[lane], share = weight * shift.gradient.norm();
      sum_of_deformations += share * deformations_[point];
      fading += share;
      reached.push_back({point, weight, shift});
    }
  if (!about)
    about = fading > 0 ? rotation_of(sum_of_deformations / fading) : Matrix3(Matrix3::Identity());
  const auto& body_force = body_.problem().loads.body_force;
  EnergyRelease sum;
  for (const Reached& at : reached) {
    const Matrix3 h = deformations_[at.point] - *about;
    const Matrix3 s = energies[at.point] * Matrix3::Identity() - h.transpose() * stresses[at.point];
    const Shift& shift = at.shift;
    sum.rate -=
        at.weight * (shift.ahead.dot(s * shift.gradient) + shift.q * shift.turn * shift.tangent.dot(s * shift.tangent));
    if (body_force) {
      const Vector3 pull = load_factor * at.weight * shift.q * h.transpose() * body_force(table.positions[at.point]);
      sum.rate -= shift.ahead.dot(pull);
    }
  }
  return sum;
}

// On a face P n = t: e . S n = -t . H e along the sheet.
void EnergyMomentum::add_faces(const std::vector<FacePlace>& places, const Matrix3& about, double load_factor,
                               EnergyRelease& sum) const {
  const auto& lip_traction = body_.problem().loads.lip_traction;
  if (!lip_traction)
    return;
  const topology::Incision& incision = *body_.problem().incision;
  for (const FacePlace& place : places)
    for (const double side : {1.0, -1.0}) {
      Vector3 at = place.position + side * place.off * place.normal;
      if (const auto face = incision.closest(place.position, 100 * place.off); face && !face->on_border)
        at = face->point + side * place.off * face->normal;
      const Vector3 traction = load_factor * lip_traction(at, -side * place.normal);
      const Matrix3 h = body_.at(at, coefficients_).deformation - about;
      sum.rate -= place.weight * traction.dot(h * place.ahead);
    }
}

/// The shift of a short length of the front, in a tube about it that follows its curvature.
class EnergyMomentum::LocalShift {
 public:
  LocalShift(const FiniteBody& body, const topology::FrontFrame& front, const ReleaseOptions& options)
      : domain_(*body.problem().domain), front_(front), h_(spacing_at(body.problem().nodes, front.point)),
        inner_(options.inner * h_), outer_(options.outer * h_), half_(*options.half_length * h_),
        inset_(options.inset * h_), curvature_(front_curvature(incision_with_front(body), front, h_)) {
    const Vector3& at = front.point;
    if (std::abs(curvature_) * std::max(outer_, half_) > widest_turn)
      throw InputError(fmt::format("energy release: the front at ({:.6g}, {:.6g}, {:.6g}) m turns within the tube",
                                   at.x(), at.y(), at.z()));
    if (inset_ == 0)
      require_inside();
  }

  [[nodiscard]] Shift operator()(const Vector3& x) const;
  /// m, of the shift along the front.
  [[nodiscard]] double length() const;
  [[nodiscard]] std::vector<FacePlace> faces() const;

 private:
  void require_inside() const {
    for (const double s : {-half_, 0.0, half_})
      for (int c = 0; c < 8; ++c) {
        Shift axes;
        axes_at(s, axes);
        const double angle = c * std::numbers::pi / 4;
        if (domain_.signed_distance(along_front(s) + outer_ * std::cos(angle) * axes.ahead +
                                    outer_ * std::sin(angle) * axes.normal) > 0)
          throw_leaves(front_.point, outer_);
      }
  }
  /// The place at `s` m along the front: on an arc in the plane of the cut.
  [[nodiscard]] Vector3 along_front(double s) const {
    const double turn = curvature_ * s;
    const double chord = std::abs(turn) < 1e-4 ? s : std::sin(turn) / curvature_;
    const double sag = std::abs(turn) < 1e-4 ? 0.5 * turn * s : (1 - std::cos(turn)) / curvature_;
    return front_.point + (chord * front_.tangent - sag * front_.ahead);
  }
  void axes_at(double s, Shift& shift) const {
    const double c = std::cos(curvature_ * s), sine = std::sin(curvature_ * s);
    shift.ahead = c * front_.ahead + sine * front_.tangent;
    shift.tangent = c * front_.tangent - sine * front_.ahead;
    shift.normal = front_.normal;
  }

  const topology::Domain& domain_;
  const topology::FrontFrame& front_;
  double h_;                            // m, spacing of the nodes there
  double inner_, outer_, half_, inset_; // m
  double curvature_;                    // 1/m
};

EnergyMomentum::Shift EnergyMomentum::LocalShift::operator()(const Vector3& x) const {
  Shift shift;
  const Vector3 away = x - front_.point;
  const double above = away.dot(front_.normal);
  double ahead = away.dot(front_.ahead), along = away.dot(front_.tangent);
  if (std::abs(above) >= outer_ || std::abs(along) > half_ + outer_ || std::abs(ahead) > half_ + outer_)
    return shift;
  double stretch = 1; // length along the front out here over that on the front
  if (std::abs(curvature_) * half_ > 1e-4) {
    const double radius = 1 / curvature_, out = radius + ahead, reach = std::hypot(out, along);
    ahead = std::copysign(reach, radius) - radius;
    along = std::atan2(std::copysign(1.0, radius) * along, std::abs(out)) * radius;
    stretch = 1 + curvature_ * ahead;
  }
  const double r = std::hypot(ahead, above);
  const Faded across = faded_across(r, inner_, outer_), lengthwise = faded_along(along, half_);
  const Cover left = cover(domain_, x, inset_);
  shift.q = across.value * lengthwise.value * left.share;
  if (shift.q == 0)
    return shift;
  axes_at(along, shift);
  shift.turn = curvature_ / stretch;
  shift.gradient = across.value * lengthwise.value * left.gradient +
                   across.value * left.share * lengthwise.slope / stretch * shift.tangent;
  if (across.slope != 0)
    shift.gradient += across.slope * lengthwise.value * left.share / r * (ahead * shift.ahead + above * shift.normal);
  return shift;
}

double EnergyMomentum::LocalShift::length() const {
  double length = 0;
  for (int a = 0; a < front_points; ++a) {
    const double s = half_ * ((2 * a + 1.0) / front_points - 1), ds = 2 * half_ / front_points;
    length += ds * faded_along(s, half_).value * cover(domain_, along_front(s), inset_).share;
  }
  if (!(length > 0))
    throw InputError(
        fmt::format("energy release: the shift at ({:.6g}, {:.6g}, {:.6g}) m lies in the {:.3g} m below the "
                    "surface where it fades",
                    front_.point.x(), front_.point.y(), front_.point.z(), inset_));
  return length;
}

std::vector<EnergyMomentum::FacePlace> EnergyMomentum::LocalShift::faces() const {
  constexpr int along_faces = 8;
  std::vector<FacePlace> faces;
  for (int a = 0; a < along_faces; ++a)
    for (int b = 0; b < face_points; ++b) {
      const double s = half_ * ((2 * a + 1.0) / along_faces - 1), ds = 2 * half_ / along_faces;
      const double t = (b + 0.5) / face_points, r = outer_ * t * t;
      Shift axes;
      axes_at(s, axes);
      FacePlace place{along_front(s) - r * axes.ahead, axes.ahead, axes.normal};
      place.weight = ds * 2 * outer_ * t / face_points * (1 - curvature_ * r) * faded_across(r, inner_, outer_).value *
                     faded_along(s, half_).value * cover(domain_, place.position, inset_).share;
      place.off = std::min(lip_offset * h_, 1e-3 * r);
      if (place.weight != 0)
        faces.push_back(place);
    }
  return faces;
}

EnergyRelease EnergyMomentum::at(const topology::FrontFrame& front, const ReleaseOptions& options,
                                 double load_factor) const {
  check_release(options);
  if (!options.half_length)
    return mean(options, load_factor);
  const LocalShift shift(body_, front, options);
  std::optional<Matrix3> about;
  EnergyRelease sum = integrate(shift, options.pressure, load_factor, about);
  sum.length = shift.length();
  add_faces(shift.faces(), *about, load_factor, sum);
  sum.rate /= sum.length;
  return sum;
}

EnergyRelease EnergyMomentum::mean(const ReleaseOptions& options, double load_factor) const {
  check_release(options);
  const topology::Incision& incision = incision_with_front(body_);
  const topology::Domain& domain = *body_.problem().domain;
  const NodeCloud& nodes = body_.problem().nodes;
  const std::vector<topology::FrontSegment>& front = incision.front();
  double longest = 0;
  for (const topology::FrontSegment& segment : front)
    longest = std::max({longest, spacing_at(nodes, segment.from), spacing_at(nodes, segment.to)});
  const double inner = options.inner * longest, outer = options.outer * longest, inset = options.inset * longest;
  const auto shift_at = [&](const Vector3& x) {
    Shift shift;
    const auto frame = incision.front_frame(x, outer);
    if (!frame)
      return shift;
    const Vector3 away = x - frame->point;
    const double ahead = away.dot(frame->ahead), above = away.dot(frame->normal), r = std::hypot(ahead, above);
    const Faded across = faded_across(r, inner, outer);
    const Cover left = cover(domain, x, inset);
    shift.q = across.value * left.share;
    if (shift.q == 0)
      return shift;
    shift.ahead = frame->ahead;
    shift.normal = frame->normal;
    shift.tangent = frame->tangent;
    const double curvature = front_curvature(incision, *frame, longest);
    shift.turn = curvature / std::max(0.1, 1 + curvature * ahead);
    shift.gradient = across.value * left.gradient;
    if (across.slope != 0)
      shift.gradient += across.slope * left.share / r * (ahead * shift.ahead + above * shift.normal);
    return shift;
  };
  std::optional<Matrix3> about = Matrix3::Identity();
  EnergyRelease sum = integrate(shift_at, options.pressure, load_factor, about);
  std::vector<FacePlace> faces;
  const double step = 0.25 * longest;
  for (int k = 0; k < std::ssize(front); ++k) {
    const double length = (front[k].to - front[k].from).norm();
    const int parts = std::max(1, static_cast<int>(std::ceil(length / step)));
    for (int a = 0; a < parts; ++a) {
      const topology::FrontFrame frame = incision.front_frame_at(k, (a + 0.5) / parts);
      sum.length += length / parts * cover(domain, frame.point, inset).share;
      const double curvature = front_curvature(incision, frame, longest);
      if (std::abs(curvature) * outer > widest_turn)
        throw InputError(fmt::format("energy release: the front at ({:.6g}, {:.6g}, {:.6g}) m turns within the tube",
                                     frame.point.x(), frame.point.y(), frame.point.z()));
      if (inset == 0)
        for (int c = 0; c < 8; ++c) {
          const double angle = c * std::numbers::pi / 4;
          const Vector3 x = frame.point + outer * (std::cos(angle) * frame.ahead + std::sin(angle) * frame.normal);
          if (domain.signed_distance(x) > 0 && std::abs(domain.normal(x).dot(frame.ahead)) > parallel_skin)
            throw_leaves(frame.point, outer);
        }
      for (int b = 0; b < face_points; ++b) {
        const double t = (b + 0.5) / face_points, r = outer * t * t;
        FacePlace place{frame.point - r * frame.ahead, frame.ahead, frame.normal};
        if (domain.signed_distance(place.position) > 0)
          continue;
        place.weight = length / parts * 2 * outer * t / face_points * (1 - curvature * r) *
                       faded_across(r, inner, outer).value * cover(domain, place.position, inset).share;
        place.off = std::min(lip_offset * longest, 1e-3 * r);
        if (place.weight != 0)
          faces.push_back(place);
      }
    }
  }
  if (!(sum.length > 0))
    throw InputError(fmt::format("energy release: all of the front lies in the {:.3g} m below the surface where the "
                                 "shift fades",
                                 inset));
  add_faces(faces, *about, load_factor, sum);
  sum.rate /= sum.length;
  return sum;
}

} // namespace spherecut::solvers
