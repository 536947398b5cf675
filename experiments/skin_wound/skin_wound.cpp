// Problem:   a round piece is cut out of stretched skin: a quarter of a sheet, 24 radii wide and half a radius thick,
// with
//            a closed cut through it, drawn out from its stress-free state by its outer faces. Finite strain, nu =
//            0.49, neo-Hookean, and with fibres along the tension lines.
// Measured:  on dogs [Deroy and others 2017]: the piece shrinks by 33 % in area, 23 % along the tension lines and 10 %
//            across; the hole that it leaves grows by 9 %, 16 % along and -10 % across. The piece gives the stretch of
//            the skin; the hole is predicted. With fibres their stiffness is fitted to how slender the hole is; its
//            size is predicted.
// Reference: at small strain the hole in a plate under two tensions [Kirsch 1898]; the piece is free of stress.
// Command:   spherecut experiment run skin_wound --out DIR
#include "experiments/measured.hpp"
#include "experiments/support/finite_block.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

// [Deroy and others 2017], means: changes of diameters and area.
constexpr double piece_along = -0.23, piece_across = -0.10;
constexpr double hole_along = 0.16, hole_across = -0.10, hole_area = 0.09;

constexpr double hole_radius = 0.01; // m, of the circle marked on the skin before it is cut
constexpr double half_thickness = 0.25 * hole_radius;
constexpr double skin_poisson_ratio = 0.49;
constexpr double fibre_exponent = 1; // k2

struct Stretch {
  double along = 1 / (1 + piece_along), across = 1 / (1 + piece_across);
};

/// A cylinder across the sheet over the ellipse that the circle is when nothing stretches the skin.
topology::SurfaceMesh ring(const Stretch& stretch, double edge) {
  // Vertices on both axes, where the hole is measured; two more columns beyond each.
  const int quarter = static_cast<int>(std::ceil(0.5 * std::numbers::pi * hole_radius / edge)), columns = quarter + 4;
  const double below = -0.6 * half_thickness, above = 1.6 * half_thickness; // m
  const int rows = std::max(3, static_cast<int>(std::ceil((above - below) / edge)));
  topology::SurfaceMesh mesh;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i) {
      const double angle = 0.5 * std::numbers::pi * (i - 2) / quarter;
      mesh.vertices.emplace_back(hole_radius / stretch.along * std::cos(angle),
                                 hole_radius / stretch.across * std::sin(angle), below + (above - below) * j / rows);
    }
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int a = j * (columns + 1) + i, b = a + columns + 1;
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  return mesh;
}

struct Wound {
  int nodes = 0;
  double along = 0, across = 0; // of the hole against the circle, relative
  double piece = 0;             // of the piece's rim, moved, over the radius
  double least_jacobian = 1;
  [[nodiscard]] double area() const { return (1 + along) * (1 + across) - 1; }
};

Wound cut_out(const std::shared_ptr<const solvers::Law>& law, const Stretch& stretch, double spacing, double half_width,
              int steps) {
  const Vector3 upper(half_width * hole_radius, half_width * hole_radius, half_thickness);
  solvers::SpacingField field;
  field.fine = spacing;
  field.coarse = std::max(spacing, half_thickness); // two layers of nodes and more everywhere
  field.slope = 0.2;
  field.radius = hole_radius;
  field.centres = {{0, 0, 0}};
  HeldFaces held{};
  held[0][0] = held[2][1] = held[4][2] = true;
  for (const int face : {1, 3})
    held[face] = {true, true, false};
  const solvers::FiniteBody body(
      finite_block(
          {.upper = upper, .spacing = spacing, .held = held, .graded = field, .cuts = {ring(stretch, spacing)}}),
      law);
  solvers::Equilibrium equilibrium(body);
  Wound wound;
  wound.nodes = body.size();
  for (int k = 1; k <= steps; ++k) {
    const double share = static_cast<double>(k) / steps;
    const auto status = equilibrium.solve({body.prescribed_values([&](const Vector3& x) {
                                             return Vector3(share * (stretch.along - 1) * x.x(),
                                                            share * (stretch.across - 1) * x.y(), 0);
                                           }),
                                           1,
                                           {}});
    wound.least_jacobian = std::min(wound.least_jacobian, status.least_jacobian);
  }
  const auto moved = [&](const Vector3& x) { return body.at(x, equilibrium.coefficients()).displacement; };
  const double off = 1e-3 * hole_radius, middle = 0.5 * half_thickness;
  const double a = hole_radius / stretch.along, b = hole_radius / stretch.across;
  wound.along = (a + moved({a + off, 0, middle}).x()) / hole_radius - 1;
  wound.across = (b + moved({0, b + off, middle}).y()) / hole_radius - 1;
  wound.piece = std::max(moved({a - off, 0, middle}).norm(), moved({0, b - off, middle}).norm()) / hole_radius;
  return wound;
}

std::shared_ptr<const solvers::Law> skin_law(double fibre_modulus) {
  if (fibre_modulus == 0)
    return neo_hookean(1, skin_poisson_ratio);
  return solvers::make_law({solvers::HolzapfelLaw{.shear_modulus = 1,
                                                  .fibre_modulus = fibre_modulus,
                                                  .fibre_exponent = fibre_exponent,
                                                  .dispersion = 0,
                                                  .families = 1,
                                                  .same_everywhere = true,
                                                  .directions = {Vector3::UnitX()}},
                            solvers::bulk_modulus_of(1, skin_poisson_ratio),
                            {}});
}

/// Growth of the hole in an unbounded plate, relative to the stretched circle: twice each tension, less what the other
/// one draws in.
Wound in_a_plate(double along, double across) { // small strains of the plate
  const double nu = skin_poisson_ratio;
  const double s = (along + nu * across) / (1 - nu * nu), t = (across + nu * along) / (1 - nu * nu); // over E
  Wound wound;
  wound.along = 2 * s - (1 - nu) * t;
  wound.across = 2 * t - (1 - nu) * s;
  return wound;
}

} // namespace

std::vector<Check> run_skin_wound(const ExperimentContext& context) {
  const double fine = context.quick ? 0.0015 : 0.0008, half_width = context.quick ? 8 : 12;
  const int steps = 5;
  std::vector<Check> checks;
  app::Table table(
      {"fibre_modulus_over_mu", "nodes", "hole_along", "hole_across", "hole_area", "piece_moved", "least_jacobian"});
  const Stretch skin;
  context.say(fmt::format("skin is stretched by {:.3f} along and {:.3f} across", skin.along, skin.across));

  const Stretch little{1 + 0.02 * (skin.along - 1), 1 + 0.02 * (skin.across - 1)};
  const Wound small = cut_out(skin_law(0), little, fine, half_width, 1);
  const Wound plate = in_a_plate(little.along - 1, little.across - 1);
  context.say(fmt::format("small strain: hole {:+.5f} along, {:+.5f} across; in an unbounded plate {:+.5f}, {:+.5f}",
                          small.along, small.across, plate.along, plate.across));
  checks.push_back({"skin_wound_small_strain_closed_form",
                    std::max(std::abs(small.along / plate.along - 1), std::abs(small.across / plate.across - 1)),
                    "<=", context.quick ? 0.15 : 0.1});

  std::vector<Wound> wounds;
  std::vector<double> moduli = context.quick ? std::vector<double>{0, 0.5} : std::vector<double>{0, 0.25, 0.5};
  app::Series length{"length of the hole", {}, {}}, width{"width of the hole", {}, {}};
  for (const double modulus : moduli) {
    const Wound wound = cut_out(skin_law(modulus), skin, fine, half_width, steps);
    wounds.push_back(wound);
    context.say(fmt::format("fibres of {:g} mu, {} nodes: hole {:+.1f} % along, {:+.1f} % across, {:+.1f} % in area; "
                            "the piece's rim moved by {:.4f} radii, least J {:.3f}",
                            modulus, wound.nodes, 100 * wound.along, 100 * wound.across, 100 * wound.area(),
                            wound.piece, wound.least_jacobian));
    table.add(std::vector<double>{modulus, static_cast<double>(wound.nodes), wound.along, wound.across, wound.area(),
                                  wound.piece, wound.least_jacobian});
    length.x.push_back(modulus);
    length.y.push_back(100 * wound.along);
    width.x.push_back(modulus);
    width.y.push_back(100 * wound.across);
  }
  const Wound& plain = wounds.front();
  double rim = 0;
  for (const Wound& wound : wounds)
    rim = std::max(rim, wound.piece);
  checks.push_back({"skin_wound_piece_is_free", rim, "<=", 0.01});
  checks.push_back({"skin_wound_isotropic_length", std::abs(plain.along - hole_along), "<=", 0.05});
  checks.push_back({"skin_wound_isotropic_width", std::abs(plain.across - hole_across), "<=", 0.05});
  checks.push_back({"skin_wound_isotropic_area", std::abs(plain.area() - hole_area), "<=", 0.05});

  // The fibres with which the hole is as slender as measured, between two that were tried; else the nearest.
  const auto slenderness = [](const Wound& wound) { return (1 + wound.along) / (1 + wound.across); };
  const double wanted = (1 + hole_along) / (1 + hole_across);
  Wound fitted = wounds.front();
  for (const Wound& wound : wounds)
    if (std::abs(slenderness(wound) - wanted) < std::abs(slenderness(fitted) - wanted))
      fitted = wound;
  for (std::size_t k = 0; k + 1 < wounds.size(); ++k) {
    const Wound &a = wounds[k], &b = wounds[k + 1];
    if ((slenderness(a) - wanted) * (slenderness(b) - wanted) > 0)
      continue;
    const double share = (wanted - slenderness(a)) / (slenderness(b) - slenderness(a));
    fitted.along = a.along + share * (b.along - a.along);
    fitted.across = a.across + share * (b.across - a.across);
    context.say(fmt::format("as slender as measured, {:.3f}, with fibres of {:.2f} mu: {:+.1f} % along, {:+.1f} % "
                            "across, {:+.1f} % in area",
                            wanted, moduli[k] + share * (moduli[k + 1] - moduli[k]), 100 * fitted.along,
                            100 * fitted.across, 100 * fitted.area()));
    break;
  }
  checks.push_back({"skin_wound_fibres_slenderness", std::abs(slenderness(fitted) / wanted - 1), "<=", 0.03});
  checks.push_back({"skin_wound_fibres_area", std::abs(fitted.area() - hole_area), "<=", 0.05});
  table.write(context.out / "holes.csv");
  const std::vector<double> ends{moduli.front(), moduli.back()};
  app::write_png({"The hole that a round piece leaves in skin",
                  "fibre modulus k1 / mu",
                  "change of diameter [%]",
                  false,
                  false,
                  {length,
                   width,
                   {"length, measured", ends, {100 * hole_along, 100 * hole_along}, app::SeriesStyle::lines},
                   {"width, measured", ends, {100 * hole_across, 100 * hole_across}, app::SeriesStyle::lines}}},
                 context.out / "holes.png");
  return checks;
}

} // namespace spherecut::experiments
