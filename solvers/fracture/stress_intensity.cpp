#include "solvers/fracture/stress_intensity.hpp"

#include "solvers/body/elastic_body.hpp"
#include "solvers/fracture/inset_integral.hpp"
#include "solvers/fracture/local_values.hpp"
#include "solvers/fracture/virtual_shift.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/functions.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

using topology::FrontFrame;

namespace {

const topology::Incision& incision_of(const Problem& problem) {
  if (problem.incision == nullptr)
    throw InputError("stress intensity: the body has no cut");
  return *problem.incision;
}

} // namespace

TipField tip_field(const Material& material, const Intensities& k, double ahead, double above) {
  TipField field;
  const double r = std::hypot(ahead, above), theta = std::atan2(above, ahead);
  if (!(r > 0))
    return field;
  const double mu = material.shear_modulus(), kappa = 3 - 4 * material.poisson_ratio;
  const double c = std::cos(theta / 2), s = std::sin(theta / 2),
               size = std::sqrt(r / (2 * std::numbers::pi)) / (2 * mu);
  // Angular functions of the three modes, and their derivatives.
  const Vector3 f = k[0] * Vector3(c * (kappa - 1 + 2 * s * s), s * (kappa + 1 - 2 * c * c), 0) +
                    k[1] * Vector3(s * (kappa + 1 + 2 * c * c), -c * (kappa - 1 - 2 * s * s), 0) +
                    k[2] * Vector3(0, 0, 4 * s);
  const Vector3 turn = k[0] * Vector3(-0.5 * s * (kappa - 1 + 2 * s * s) + 2 * s * c * c,
                                      0.5 * c * (kappa + 1 - 2 * c * c) + 2 * s * s * c, 0) +
                       k[1] * Vector3(0.5 * c * (kappa + 1 + 2 * c * c) - 2 * s * s * c,
                                      0.5 * s * (kappa - 1 - 2 * s * s) + 2 * s * c * c, 0) +
                       k[2] * Vector3(0, 0, 2 * c);
  field.displacement = size * f;
  const double ct = ahead / r, st = above / r;
  field.gradient.col(0) = size / r * (0.5 * ct * f - st * turn);
  field.gradient.col(1) = size / r * (0.5 * st * f + ct * turn);
  return field;
}

double energy_release_rate(const Material& material, const Intensities& k) {
  return (k[0] * k[0] + k[1] * k[1]) / plane_strain_modulus(material) + k[2] * k[2] / (2 * material.shear_modulus());
}

Intensities at_kink(const Intensities& k, double angle) {
  const double c = std::cos(angle / 2), s = std::sin(angle / 2), c3 = std::cos(1.5 * angle), s3 = std::sin(1.5 * angle);
  return {0.25 * (3 * c + c3) * k[0] - 0.75 * (s + s3) * k[1], 0.25 * (s + s3) * k[0] + 0.25 * (c + 3 * c3) * k[1],
          k[2]};
}

double angle_across(const FrontFrame& frame, const Vector3& direction) {
  return std::atan2(direction.dot(frame.normal), direction.dot(frame.ahead));
}

std::vector<FrontFrame> front_samples(const topology::Incision& incision, double spacing, double margin) {
  if (!(spacing > 0))
    throw InputError(fmt::format("front samples {} m apart: the distance must be positive", spacing));
  std::vector<FrontFrame> samples;
  double next = 0.5 * spacing, walked = 0;
  for (const topology::FrontSegment& segment : incision.front()) {
    const double length = (segment.to - segment.from).norm();
    for (; next < walked + length; next += spacing) {
      const Vector3 x = segment.from + (next - walked) / length * (segment.to - segment.from);
      if (margin > 0 && incision.domain()->signed_distance(x) > -margin)
        continue;
      if (const auto frame = incision.front_frame(x, length))
        samples.push_back(*frame);
    }
    walked += length;
  }
  return samples;
}

Intensities displacement_correlation(const Discretisation& body, const Field& field, const FrontFrame& front,
                                     const CorrelationOptions& options) {
  return displacement_correlation(
      body.problem(), front,
      [&](const Vector3& plus, const Vector3& minus) -> Vector3 {
        return body.at(plus, field).displacement - body.at(minus, field).displacement;
      },
      options);
}

Intensities displacement_correlation(const Problem& problem, const FrontFrame& front,
                                     const std::function<Vector3(const Vector3&, const Vector3&)>& jump,
                                     const CorrelationOptions& options) {
  const topology::Incision& incision = incision_of(problem);
  const double h = spacing_at(problem.nodes, front.point);
  Eigen::Matrix2d normal_matrix = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 2, 3> right = Eigen::Matrix<double, 2, 3>::Zero();
  Vector3 normal = Vector3::Zero();
  for (int k = 0; k < options.samples; ++k) {
    const double s = h * (options.from + (options.to - options.from) * (k + 0.5) / options.samples);
    const auto face = incision.closest(front.point - s * front.ahead, 0.5 * s);
    if (!face)
      throw InputError(fmt::format("stress intensity: there is no sheet {:.3g} m behind the front at ({:.6g}, {:.6g}, "
                                   "{:.6g}) m",
                                   s, front.point.x(), front.point.y(), front.point.z()));
    const Vector3 off = lip_offset * h * face->normal;
    const Vector3 apart = jump(face->point + off, face->point - off);
    const double away = (front.point - face->point).norm();
    const Eigen::Vector2d terms(std::sqrt(away), away * std::sqrt(away));
    const double weight = 1 / std::sqrt(away);
    normal_matrix += weight * terms * terms.transpose();
    right += weight * terms * apart.transpose();
    normal += face->normal;
  }
  // Of the sheet behind, in the plane across the front.
  normal = (normal - normal.dot(front.tangent) * front.tangent).normalized();
  const Vector3 ahead = front.tangent.cross(normal);
  const Vector3 leading = (normal_matrix.inverse().row(0) * right).transpose();
  const Material& material = problem.material;
  const double plane = plane_strain_modulus(material) * std::sqrt(2 * std::numbers::pi) / 8;
  const Intensities behind(plane * leading.dot(normal), plane * leading.dot(ahead),
                           material.shear_modulus() * std::sqrt(2 * std::numbers::pi) / 4 * leading.dot(front.tangent));
  return at_kink(behind, -angle_across(front, ahead));
}

namespace {

/// Of v_a, v the displacement of tip_field(): the integral over z, the distance from the plane of the cut, that is
/// analytic off the cut (it is zero on no face), and its derivative along the way ahead. v_a goes with real and
/// imaginary parts of Z^(1/2), Z = ahead + i above.
struct AcrossPlane {
  double integral, slope; // m2, m
};
AcrossPlane across_plane(const Material& material, const Intensities& k, double ahead, double above) {
  const double kappa = 3 - 4 * material.poisson_ratio,
               size = 1 / (2 * material.shear_modulus() * std::sqrt(2 * std::numbers::pi));
  const std::complex<double> root = std::sqrt(std::complex<double>(ahead, above)), cubed = root * root * root,
                             inverse = 1.0 / root;
  return {size * (k[0] * ((kappa - 3) * 2 / 3 * cubed.imag() + 2 * above * root.real()) +
                  k[1] * (-(kappa - 1) * 2 / 3 * cubed.real() + 2 * above * root.imag())),
          size * (k[0] * ((kappa - 3) * root.imag() + above * inverse.real()) +
                  k[1] * (-(kappa - 1) * root.real() + above * inverse.imag()))};
}

/// Coordinates about a front that is locally an arc in the plane of the cut: X ahead, Z above, s along.
class Tube {
 public:
  Tube(const FrontFrame& front, double curvature) : front_(front), curvature_(curvature) {}

  struct Place {
    Vector3 position;
    Matrix3 axes;   // columns ahead, normal, tangent at the place
    double stretch; // length along the front out here over that on the front
    [[nodiscard]] bool leaves(const topology::Domain& domain) const { return domain.signed_distance(position) > 0; }
  };
  [[nodiscard]] Place at(double ahead, double above, double along) const {
    const double turn = curvature_ * along;
    const Vector3 a = std::cos(turn) * front_.ahead + std::sin(turn) * front_.tangent;
    const Vector3 t = std::cos(turn) * front_.tangent - std::sin(turn) * front_.ahead;
    // sin(turn) / curvature and (1 - cos(turn)) / curvature, also where it is straight
    const double chord = std::abs(turn) < 1e-4 ? along : std::sin(turn) / curvature_;
    const double sag = std::abs(turn) < 1e-4 ? 0.5 * turn * along : (1 - std::cos(turn)) / curvature_;
    Place place;
    place.position = front_.point + chord * front_.tangent - sag * front_.ahead + ahead * a + above * front_.normal;
    place.axes << a, front_.normal, t;
    place.stretch = 1 + curvature_ * ahead;
    return place;
  }
  /// (ahead, above, along) of a place.
  [[nodiscard]] Vector3 coordinates(const Vector3& x) const {
    const Vector3 d = x - front_.point;
    const double p = d.dot(front_.ahead), q = d.dot(front_.tangent), above = d.dot(front_.normal);
    if (curvature_ == 0)
      return {p, above, q};
    // hypot(out, q) - radius without cancellation: nearly straight fronts have their centre far away.
    const double side = std::copysign(1.0, curvature_), radius = 1 / std::abs(curvature_), out = side * p + radius;
    const double ahead = (p * p + 2 * side * p * radius + q * q) / (std::hypot(out, q) + radius);
    return {side * ahead, above, radius * std::atan2(q, out)};
  }
  /// Gradient, in the axes of the place, of a field of vectors given in them that does not change along the front.
  [[nodiscard]] Matrix3 curved_gradient(const TipField& field, double ahead) const {
    Matrix3 gradient = field.gradient;
    const double c = curvature_ / (1 + curvature_ * ahead);
    gradient.col(2) = c * Vector3(-field.displacement[2], 0, field.displacement[0]);
    return gradient;
  }
  /// The same of the field of intensities k and of a displacement -c int v_a dz along the normal, c the curvature of
  /// the front out there, z from the plane of the cut. By itself the turning stretches the field along the front by c
  /// v_a: a change of volume that lambda multiplies. The displacement, of order r^(3/2), takes that back.
  [[nodiscard]] Matrix3 isochoric_gradient(const Material& material, const Intensities& k, double ahead,
                                           double above) const {
    const TipField field = tip_field(material, k, ahead, above);
    Matrix3 gradient = curved_gradient(field, ahead);
    const double c = curvature_ / (1 + curvature_ * ahead);
    const AcrossPlane across = across_plane(material, k, ahead, above);
    gradient(1, 0) += c * (c * across.integral - across.slope);
    gradient(1, 1) -= c * field.displacement[0];
    return gradient;
  }
  /// Divergence of a symmetric tensor field given in the axes of the place, by central differences.
  template <class Tensor>
  [[nodiscard]] Vector3 divergence(const Tensor& tensor, double ahead, double above, double step) const {
    const Matrix3 d_ahead = (tensor(ahead + step, above) - tensor(ahead - step, above)) / (2 * step);
    const Matrix3 d_above = (tensor(ahead, above + step) - tensor(ahead, above - step)) / (2 * step);
    const Matrix3 here = tensor(ahead, above);
    const double c = curvature_ / (1 + curvature_ * ahead);
    return {d_ahead(0, 0) + d_above(0, 1) + c * (here(0, 0) - here(2, 2)),
            d_ahead(1, 0) + d_above(1, 1) + c * here(1, 0), d_ahead(2, 0) + d_above(2, 1) + 2 * c * here(2, 0)};
  }
  [[nodiscard]] double curvature() const { return curvature_; }

 private:
  FrontFrame front_;
  double curvature_;
};

constexpr double longest_arc = 0.35;  // of the same: half the tube's length, where that is above the shortest
constexpr double shortest_half = 1;   // of the tube's length, in spacings, down to which it is shortened
constexpr double shortened_by = 0.25; // spacings, at a time
// Of a tube, in spacings, that enough points of a weak form lie in: half its length, and how far the shift fades.
constexpr double least_weak_half = 1.5, least_weak_fade = 1.5;

struct GaussRule {
  std::array<double, 2> place{-0.5773502691896257, 0.5773502691896257};
};

/// A point of the integral. To that of mode m it adds stress[m] : sigma + gradient[m] : grad u + load[m] times the load
/// factor of the field.
struct Sample {
  Vector3 position;
  std::array<Matrix3, 3> stress, gradient;
  Vector3 load;
  const ShapeFunctions* shape = nullptr; // of the body at a point of its weak form; null: to be found at the position
};

// With xi = q e the virtual shift of the front (e ahead, q = 1 at the front and 0 on the outside of the tube),
//   I Q = int [sigma_ij v_i,k + tau_ij u_i,k - sigma_mn v_m,n delta_kj] xi_k,j dV + int (tau_ij,j u_i,k - b_i v_i,k)
//   xi_k dV
//         - int_faces (t_i v_i,k + tau_ij n_j u_i,k) xi_k dS,          Q = int q ds along the front,
// u, sigma the field, v, tau = C grad v the auxiliary one, b the body force, t the traction on the faces, n out of the
// material. v keeps its components in axes that turn with the front: tau is not quite in equilibrium then.
// Within `inset_spacings` of the surface of the body xi fades to nothing (0: it does not, and the tube must not leave).
//
// Near incompressibility v keeps the volume where the front turns, since lambda multiplies what it does not keep. And
// the change of volume of u is right at the points of the weak form alone: the integral over the volume is the sum over
// these points, with their weights. Where too few of them lie in the tube, or along the way on which the shift fades
// near the surface, and with more compressible tissue, the tube has a rule of its own.
class InteractionRule {
 public:
  InteractionRule(const Discretisation& body, const FrontFrame& front, const InteractionOptions& options,
                  double inset_spacings)
      : body_(body), incision_(incision_of(body.problem())), problem_(body.problem()), front_(front), options_(options),
        h_(spacing_at(body.problem().nodes, front.point)), tube_(front, front_curvature(incision_, front, h_)),
        inset_(inset_spacings * h_) {
    size_tube();
    for (const auto& [s, ds] : along_front())
      total_ += ds * bump(s).value * covered(tube_.at(0, 0, s).position).share;
    if (!(total_ > 0))
      throw InputError(fmt::format("no part of a front of {:.3g} m lies deeper in the body than the integral begins",
                                   2 * half_length_));
  }

  /// Calls visit(sample) for every point.
  template <class Visitor>
  void each_sample(const Visitor& visit) const {
    const bool is_summed = sum_weak_points(visit);
    for (const auto& [s, ds] : along_front())
      for (int b = 0; b < cells_radial(); ++b)
        for (const double gb : gauss_.place) {
          // r = outer t^2: the singular products of the two fields are smooth in t.
          const double t = (b + 0.5 + 0.5 * gb) / cells_radial();
          const Section section{s, ds, outer_ * t * t, outer_ * t / cells_radial()};
          for (int c = 0; c < 2 * cells_around() && !is_summed; ++c)
            if (const auto sample = around(section, c))
              visit(*sample);
          for (const double side : {1.0, -1.0})
            if (const auto sample = on_face(section, side))
              visit(*sample);
        }
  }

  /// What makes intensities of the sums over the samples.
  [[nodiscard]] Intensities factors() const {
    const double plane = plane_strain_modulus(problem_.material);
    return Vector3(0.5 * plane, 0.5 * plane, problem_.material.shear_modulus()) / total_;
  }

 private:
  /// A ring of the tube: place along the front and distance from it, with their weights, m.
  struct Section {
    double s, ds, r, dr;
  };

  [[nodiscard]] int cells_radial() const { return std::max(1, options_.radial / 2); }
  [[nodiscard]] int cells_around() const { return std::max(1, options_.around / 2); }

  void size_tube();
  [[nodiscard]] bool leaves_body() const {
    for (const double s : {-half_length_, half_length_})
      for (int c = 0; c < 8; ++c)
        if (tube_.at(outer_ * std::cos(c * std::numbers::pi / 4), outer_ * std::sin(c * std::numbers::pi / 4), s)
                .leaves(*problem_.domain))
          return true;
    return false;
  }

  /// Places along the front with their weights, m.
  [[nodiscard]] std::vector<std::pair<double, double>> along_front() const {
    const int cells = std::max(1, options_.along / 2);
    std::vector<std::pair<double, double>> places;
    for (int a = 0; a < cells; ++a)
      for (const double ga : gauss_.place)
        places.emplace_back(half_length_ * ((2 * a + 1 + ga) / cells - 1), half_length_ / cells);
    return places;
  }

  /// Of the shift across the tube and along it, and near the surface of the body, where it has to vanish.
  [[nodiscard]] Faded fade(double r) const { return faded_across(r, inner_, outer_); }
  [[nodiscard]] Faded bump(double s) const { return faded_along(s, half_length_); }
  [[nodiscard]] Cover covered(const Vector3& x) const { return cover(*problem_.domain, x, inset_); }

  /// Where the sheet bends off the plane of the front (a tear kinks), a point belongs to the side of the sheet it is
  /// on.
  [[nodiscard]] double side_of(const Vector3& x, double r, double above) const {
    const auto face = incision_.closest(x, 0.5 * r);
    if (!face || face->on_border)
      return above >= 0 ? 1.0 : -1.0;
    return (x - face->point).dot(face->normal) >= 0 ? 1.0 : -1.0;
  }

  /// A place in the tube: its distance from the front, m, with the cosine and sine of the angle from the way ahead, and
  /// its place along the front.
  struct Point {
    double r, cosine, sine, s;
    [[nodiscard]] double ahead() const { return r * cosine; }
    [[nodiscard]] double above() const { return r * sine; }
  };
  /// False: the integral is not over the points of the weak form, or there are none.
  template <class Visitor>
  bool sum_weak_points(const Visitor& visit) const {
    if (!is_weak_)
      return false;
    const double farthest = outer_ + half_length_ * (1 + outer_ * std::abs(tube_.curvature()));
    const Vector3& x = front_.point;
    bool any = false;
    body_.visit_weak_points(
        {x.array() - farthest, x.array() + farthest},
        [&](const Vector3& at) { return is_inside(tube_.coordinates(at)); },
        [&](const QuadraturePoint& point, const ShapeFunctions& shape) {
          const Vector3 at = tube_.coordinates(point.position);
          const double r = std::hypot(at[0], at[1]);
          const Point here{r, at[0] / r, at[1] / r, at[2]};
          any = true;
          if (auto sample = sample_at(here, tube_.at(at[0], at[1], at[2]), point.weight)) {
            sample->shape = &shape;
            visit(*sample);
          }
        });
    return any;
  }
  [[nodiscard]] bool is_inside(const Vector3& at) const {
    const double r = std::hypot(at[0], at[1]);
    return r > 0 && r < outer_ && std::abs(at[2]) < half_length_;
  }
  [[nodiscard]] Matrix3 auxiliary_gradient(int mode, double ahead, double above) const {
    return keeps_volume_ ? tube_.isochoric_gradient(problem_.material, modes_[mode], ahead, above)
                         : tube_.curved_gradient(tip_field(problem_.material, modes_[mode], ahead, above), ahead);
  }
  /// `volume`, m3: what the point stands for.
  [[nodiscard]] std::optional<Sample> sample_at(const Point& point, const Tube::Place& place, double volume) const;
  [[nodiscard]] std::optional<Sample> around(const Section& section, int c) const;
  [[nodiscard]] std::optional<Sample> on_face(const Section& section, double side) const;

  const Discretisation& body_;
  const topology::Incision& incision_;
  const Problem& problem_;
  const FrontFrame& front_;
  const InteractionOptions& options_;
  double h_; // m, spacing of the nodes there
  Tube tube_;
  double inset_; // m
  GaussRule gauss_;
  std::array<Intensities, 3> modes_{Vector3::UnitX(), Vector3::UnitY(), Vector3::UnitZ()};
  double inner_ = 0, outer_ = 0, half_length_ = 0; // m, of the tube
  double total_ = 0;                               // m, of the bump, by the same rule
  bool keeps_volume_ = false;                      // near incompressibility
  bool is_weak_ = false;                           // over the points of the weak form
};

/// Sections meet at the centre of curvature. Behind a front that turns round it the tube is narrowed, for they would
/// count twice there, the second time negative. It is shortened where it would leave the body.
void InteractionRule::size_tube() {
  const Vector3& at = front_.point;
  const double narrowed = std::min(1.0, widest_turn / (std::max(0.0, tube_.curvature()) * options_.outer * h_));
  inner_ = narrowed * options_.inner * h_;
  outer_ = narrowed * options_.outer * h_;
  const double shortest = std::min(options_.half_length, shortest_half) * h_;
  half_length_ = options_.half_length * h_;
  if (half_length_ * std::abs(tube_.curvature()) > longest_arc)
    half_length_ = std::max(shortest, longest_arc / std::abs(tube_.curvature()));
  if (tube_.curvature() * outer_ <= -widest_turn)
    throw InputError(fmt::format("stress intensity: the front at ({:.6g}, {:.6g}, {:.6g}) m turns within the tube",
                                 at.x(), at.y(), at.z()));
  if (inset_ > 0 && -problem_.domain->signed_distance(at) < 0.2 * inset_)
    throw InputError(fmt::format("stress intensity: the front at ({:.6g}, {:.6g}, {:.6g}) m is {:.3g} m from the "
                                 "surface; allowed: {:.3g} m",
                                 at.x(), at.y(), at.z(), -problem_.domain->signed_distance(at), 0.2 * inset_));
  while (inset_ == 0 && half_length_ > shortest && leaves_body())
    half_length_ = std::max(shortest, half_length_ - shortened_by * h_);
  if (inset_ == 0 && leaves_body())
    throw InputError(fmt::format("stress intensity: the tube of radius {:.3g} m and length {:.3g} m around the front "
                                 "at ({:.6g}, {:.6g}, {:.6g}) m leaves the body",
                                 outer_, 2 * half_length_, at.x(), at.y(), at.z()));
  keeps_volume_ = problem_.material.is_nearly_incompressible();
  constexpr double rounding = 1e-6; // spacings
  is_weak_ = keeps_volume_ && inset_ == 0 && half_length_ >= (least_weak_half - rounding) * h_ &&
             outer_ - inner_ >= (least_weak_fade - rounding) * h_;
}

/// The c-th point of a ring.
std::optional<Sample> InteractionRule::around(const Section& section, int c) const {
  const int cell = c / 2;
  const double theta = std::numbers::pi * ((2 * cell + 1 + gauss_.place[c % 2]) / cells_around() - 1);
  const Point point{section.r, std::cos(theta), std::sin(theta), section.s};
  const Tube::Place place = tube_.at(point.ahead(), point.above(), point.s);
  return sample_at(point, place,
                   section.r * (std::numbers::pi / cells_around()) * section.ds * section.dr * place.stretch);
}

std::optional<Sample> InteractionRule::sample_at(const Point& point, const Tube::Place& place, double volume) const {
  const double r = point.r, ahead = point.ahead();
  const auto [fade_r, dq_r] = fade(r);
  const auto [q_s, dq_s] = bump(point.s);
  double above = point.above();
  if (ahead < 0 && std::abs(above) < -ahead)
    if (const double side = side_of(place.position, r, above), least = 1e-3 * r; side * above < least)
      above = side * least; // at the cut of the auxiliary field, or beyond it: taken next to it
  const Cover left = covered(place.position);
  if (left.share == 0)
    return std::nullopt;
  const double q_r = fade_r * left.share;
  Sample sample;
  sample.position = place.position;
  // Gradient of xi = q e in the axes of the place; e turns along the front.
  Matrix3 shift = Matrix3::Zero();
  shift.row(0) =
      left.share * Vector3(dq_r * q_s * point.cosine, dq_r * q_s * point.sine, fade_r * dq_s / place.stretch) +
      fade_r * q_s * place.axes.transpose() * left.gradient;
  shift(2, 2) = q_r * q_s * tube_.curvature() / place.stretch;
  for (int m = 0; m < 3; ++m) {
    const Matrix3 v = auxiliary_gradient(m, ahead, above);
    const auto tau_at = [&](double x, double z) {
      return stress_from_gradient(problem_.material, auxiliary_gradient(m, x, z));
    };
    const Matrix3 tau = stress_from_gradient(problem_.material, v);
    sample.stress[m] = volume * place.axes * (v * shift - shift.trace() * v) * place.axes.transpose();
    Matrix3 by_gradient = tau * shift.transpose();
    if (tube_.curvature() != 0)
      by_gradient.col(0) += q_r * q_s * tube_.divergence(tau_at, ahead, above, 1e-4 * r);
    sample.gradient[m] = volume * place.axes * by_gradient * place.axes.transpose();
    sample.load[m] = 0;
    if (problem_.loads.body_force)
      sample.load[m] =
          -volume * q_r * q_s * (place.axes.transpose() * problem_.loads.body_force(place.position)).dot(v.col(0));
  }
  return sample;
}

/// The point of a ring on one face.
std::optional<Sample> InteractionRule::on_face(const Section& section, double side) const {
  const double r = section.r, q_s = bump(section.s).value;
  const double off = std::min(lip_offset * h_, 1e-3 * r);
  Tube::Place place = tube_.at(-r, side * off, section.s);
  if (const auto face = incision_.closest(tube_.at(-r, 0, section.s).position, 0.5 * r); face && !face->on_border)
    place.position = face->point + side * off * face->normal;
  const double q_r = fade(r).value * covered(place.position).share;
  if (q_r == 0)
    return std::nullopt;
  const Vector3 outward = -side * front_.normal;
  Vector3 traction = Vector3::Zero();
  if (problem_.loads.lip_traction)
    traction = place.axes.transpose() * problem_.loads.lip_traction(place.position, outward);
  if (traction.isZero(0) && tube_.curvature() == 0)
    return std::nullopt;
  Sample sample;
  sample.position = place.position;
  const double weight = q_r * q_s * section.ds * section.dr * place.stretch;
  for (int m = 0; m < 3; ++m) {
    const Matrix3 v = auxiliary_gradient(m, -r, side * 1e-12 * r);
    const Vector3 pull = -side * stress_from_gradient(problem_.material, v).col(1);
    sample.stress[m].setZero();
    sample.gradient[m] = -weight * place.axes * pull * place.axes.col(0).transpose();
    sample.load[m] = -weight * traction.dot(v.col(0));
  }
  return sample;
}

/// Calls visit(sample) for every point and gives the factors that make intensities of the sums.
template <class Visitor>
Intensities each_sample(const Discretisation& body, const FrontFrame& front, const InteractionOptions& options,
                        double inset_spacings, const Visitor& visit) {
  const InteractionRule rule(body, front, options, inset_spacings);
  rule.each_sample(visit);
  return rule.factors();
}

Intensities integral_over(const Discretisation& body, const Field& field, const FrontFrame& front,
                          const InteractionOptions& options, double inset) {
  Vector3 integral = Vector3::Zero();
  const Vector3 factors = each_sample(body, front, options, inset, [&](const Sample& sample) {
    const PointState state = sample.shape != nullptr
                                 ? state_from(body.problem(), body.problem().material, *sample.shape, field)
                                 : body.at(sample.position, field);
    for (int m = 0; m < 3; ++m)
      integral[m] += sample.stress[m].cwiseProduct(state.stress).sum() +
                     sample.gradient[m].cwiseProduct(state.gradient).sum() + field.load_factor * sample.load[m];
  });
  return factors.cwiseProduct(integral);
}

void require_inset(double inset) {
  if (!(inset > 0) || !std::isfinite(inset))
    throw InputError(
        fmt::format("stress intensity: a shift that fades over {} node spacings; it must be positive", inset));
}

// Of a point's shape functions: sigma and grad u are linear in the coefficients (state_from).
IntensityRule rule_over(const Discretisation& body, bool with_pressure, const FrontFrame& front,
                        const InteractionOptions& options, double inset) {
  const Problem& problem = body.problem();
  const double mu = problem.material.shear_modulus();
  const double lambda = with_pressure ? 0 : problem.material.lame_lambda();
  const Matrix3 initial = 0.5 * (problem.loads.initial_strain + problem.loads.initial_strain.transpose());
  const Matrix3 relieved = lambda * initial.trace() * Matrix3::Identity() + 2 * mu * initial;
  const std::size_t count = static_cast<std::size_t>(body.coefficient_count()) / 3; // nodes, and what a cut appends
  std::vector<Matrix3> weights(count, Matrix3::Zero());                             // row: mode
  std::vector<Vector3> pressures(with_pressure ? count : 0, Vector3::Zero());
  std::vector<char> known(count, 0);
  IntensityRule rule;
  ShapeFunctions found;
  const Vector3 factors = each_sample(body, front, options, inset, [&](const Sample& sample) {
    if (sample.shape == nullptr)
      body.shape_at(sample.position, found);
    const ShapeFunctions& shape = sample.shape != nullptr ? *sample.shape : found;
    std::array<Matrix3, 3> by_gradient;
    Vector3 traces;
    for (int m = 0; m < 3; ++m) {
      const Matrix3& by_stress = sample.stress[m];
      traces[m] = by_stress.trace();
      by_gradient[m] =
          sample.gradient[m] + lambda * traces[m] * Matrix3::Identity() + mu * (by_stress + by_stress.transpose());
      rule.loads[m] += sample.load[m] - by_stress.cwiseProduct(relieved).sum();
    }
    for (int k = 0; k < shape.size(); ++k) {
      const auto node = static_cast<std::size_t>(shape.nodes[k]);
      known[node] = 1;
      for (int m = 0; m < 3; ++m)
        weights[node].row(m) += (by_gradient[m] * shape.gradient(k)).transpose();
      if (with_pressure)
        pressures[node] -= shape.value[k] * traces;
    }
    for (const VectorTerm& term : shape.vectors) {
      const auto group = static_cast<std::size_t>(term.group);
      known[group] = 1;
      for (int m = 0; m < 3; ++m)
        for (int unknown = 0; unknown < 3; ++unknown)
          weights[group](m, unknown) += by_gradient[m].cwiseProduct(term.gradient[unknown]).sum();
    }
  });
  rule.loads = factors.cwiseProduct(rule.loads);
  for (std::size_t i = 0; i < count; ++i)
    if (known[i] != 0) {
      rule.nodes.push_back(static_cast<int>(i));
      rule.coefficients.emplace_back(factors.asDiagonal() * weights[i]);
      if (with_pressure)
        rule.pressures.emplace_back(factors.cwiseProduct(pressures[i]));
    }
  return rule;
}

} // namespace

Intensities IntensityRule::operator()(const Field& field) const {
  if ((field.pressure.size() > 0) != !pressures.empty())
    throw InputError("stress intensity: the rule is for fields of another form, with or without pressure");
  Intensities k = field.load_factor * loads;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    k += coefficients[i] * field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(nodes[i]));
  for (std::size_t i = 0; i < pressures.size(); ++i)
    k += field.pressure[nodes[i]] * pressures[i];
  return k;
}

IntensityRule interaction_rule(const Discretisation& body, bool with_pressure, const FrontFrame& front,
                               const InteractionOptions& options) {
  return rule_over(body, with_pressure, front, options, 0);
}

IntensityRule inset_rule(const Discretisation& body, bool with_pressure, const FrontFrame& front, double inset,
                         const InteractionOptions& options) {
  require_inset(inset);
  return rule_over(body, with_pressure, front, options, inset);
}

Intensities interaction_integral(const Discretisation& body, const Field& field, const FrontFrame& front,
                                 const InteractionOptions& options) {
  return integral_over(body, field, front, options, 0);
}

Intensities inset_integral(const Discretisation& body, const Field& field, const FrontFrame& front, double inset,
                           const InteractionOptions& options) {
  require_inset(inset);
  return integral_over(body, field, front, options, inset);
}

} // namespace spherecut::solvers
