// Problem:   bodies of two materials: a block of two layers in confined compression, a beam of two layers bent to a
//            constant curvature between flat sides (plane strain), a stiff ball in a soft cube that swells, a
//            cylinder with a stiff nodule below its top, which a smooth hollow presses in.
// Reference: exact solutions. Compression: one stress, strains of each layer. Bending, in a cross-section
//            u_x = -k x (z - z_n), u_z = k x^2 / 2 + integral of nu / (1 - nu) k (z - z_n): the layers have Poisson
//            ratios of their own, so that strain across them jumps. Ball: u = A r inside, B r + C / r^2 outside.
//            Nodule: axisymmetric finite elements whose edges follow it, on two meshes.
// Command:   spherecut experiment run layers --out DIR
#include "experiments/reference/axisymmetric.hpp"
#include "experiments/registered.hpp"

#include "solvers/body/discretisation.hpp"
#include "solvers/nodes/nodes.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <numbers>
#include <random>

namespace spherecut::experiments {

namespace {

using Displacement = std::function<Vector3(const Vector3&)>;

/// A block with nodes on a grid, moved at random by up to a quarter of the spacing on their face or edge.
solvers::Problem layered_block(const Vector3& lower, const Vector3& upper, double h, int seed) {
  solvers::Problem problem;
  problem.domain = topology::make_box_domain(lower, upper, h);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-0.25 * h, 0.25 * h);
  std::array<long, 3> divisions{}, at{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    divisions[axis] = std::lround((upper - lower)[static_cast<Eigen::Index>(axis)] / h);
  for (at[0] = 0; at[0] <= divisions[0]; ++at[0])
    for (at[1] = 0; at[1] <= divisions[1]; ++at[1])
      for (at[2] = 0; at[2] <= divisions[2]; ++at[2]) {
        Vector3 x, normal = Vector3::Zero();
        int faces = 0;
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
          const long index = at[static_cast<std::size_t>(axis)], last = divisions[static_cast<std::size_t>(axis)];
          const double move = shift(random);
          x[axis] = index == 0      ? lower[axis]
                    : index == last ? upper[axis]
                                    : lower[axis] + static_cast<double>(index) * h + move;
          if (index == 0 || index == last) {
            normal[axis] = index == 0 ? -1 : 1;
            ++faces;
          }
        }
        problem.nodes.add(x, h,
                          faces == 0   ? solvers::NodeKind::interior
                          : faces == 1 ? solvers::NodeKind::surface
                                       : solvers::NodeKind::edge,
                          faces > 0 ? Vector3(normal.normalized()) : normal);
      }
  return problem;
}

/// Holds the faces normal to the axes marked: along their normals, or along all axes where `fully` is.
void hold_faces(solvers::Problem& problem, const std::array<bool, 3>& normal_to, const std::array<bool, 3>& fully,
                const Displacement& field) {
  const BoundingBox box = problem.domain->bounds();
  const auto holds = [=](const Vector3& normal, int axis) {
    for (int face = 0; face < 3; ++face)
      if (std::abs(normal[face]) > 0.5 && normal_to[static_cast<std::size_t>(face)] &&
          (face == axis || fully[static_cast<std::size_t>(face)]))
        return true;
    return false;
  };
  for (int i = 0; i < problem.nodes.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3& x = problem.nodes.positions[i];
      bool held = false;
      for (int face = 0; face < 3; ++face)
        held = held || ((x[face] < box.lower[face] + 1e-9 || x[face] > box.upper[face] - 1e-9) &&
                        holds(Vector3::Unit(face), axis));
      std::array<bool, 3> along{};
      along[static_cast<std::size_t>(axis)] = true;
      if (held)
        problem.prescribed.push_back({i, along, field(x)});
    }
  problem.prescribed_region = [holds](const Vector3&, const Vector3& normal, int axis) { return holds(normal, axis); };
  problem.prescribed_field = field;
}

struct LayerErrors {
  int nodes = 0;
  double displacement = 0; // relative L2 error at the nodes
  double load = 0;         // relative error of force, moment or mean pressure
};

double layer_error(const solvers::Discretisation& body, const solvers::Field& solution, const Displacement& exact) {
  const VectorX u = body.nodal_displacements(solution);
  double error = 0, size = 0;
  for (int i = 0; i < body.problem().nodes.size(); ++i) {
    const Vector3 there = exact(body.problem().nodes.positions[i]);
    error += (u.segment<3>(3 * static_cast<Eigen::Index>(i)) - there).squaredNorm();
    size += there.squaredNorm();
  }
  return std::sqrt(error / size);
}

std::shared_ptr<const solvers::MaterialRegions> region(std::vector<solvers::RegionFace> faces,
                                                       const solvers::Material& material) {
  return std::make_shared<const solvers::MaterialRegions>(
      std::vector<solvers::MaterialRegion>{{"second", std::move(faces), material}});
}

const solvers::Material lower_layer{1, 0.45, 0};

/// Unit cube, the upper layer begins at `face`; every face is held along its normal.
LayerErrors compressed(double contrast, double face, int divisions, int seed) {
  const solvers::Material upper{contrast, 0.3, 0};
  const auto compliance = [](const solvers::Material& m) { return 1 / (m.lame_lambda() + 2 * m.shear_modulus()); };
  const double below = compliance(lower_layer), above = compliance(upper);
  const double stress = -0.01 / (below * face + above * (1 - face));
  const Displacement exact = [=](const Vector3& x) -> Vector3 {
    return stress * (below * std::min(x.z(), face) + above * std::max(x.z() - face, 0.0)) * Vector3::UnitZ();
  };
  solvers::Problem problem = layered_block(Vector3::Zero(), Vector3::Ones(), 1.0 / divisions, seed);
  problem.material = lower_layer;
  problem.regions = region(solvers::half_space_faces({-Vector3::UnitZ(), -face}), upper);
  hold_faces(problem, {true, true, true}, {}, exact);
  const auto body = solvers::discretise(std::move(problem), {});
  const solvers::Field solution = body->solve();
  const std::vector<Vector3> forces = body->constraint_forces(solution);
  double force = 0;
  for (std::size_t k = 0; k < forces.size(); ++k)
    if (const solvers::Prescribed& entry = body->problem().prescribed[k];
        entry.components[2] && body->problem().nodes.positions[entry.node].z() < 1e-9)
      force += forces[k].z();
  return {body->report().nodes, layer_error(*body, solution, exact), std::abs(force / -stress - 1)};
}

/// Beam 3 x 1 x 1, the upper layer `thickness` of its height; ends held at the exact field, sides along their normals.
LayerErrors bent(double contrast, double thickness, int divisions, int seed) {
  const double length = 3, curvature = 0.01, face = 1 - thickness;
  const solvers::Material upper{contrast, 0.3, 0};
  const auto plane = [](const solvers::Material& m) {
    return m.young_modulus / (1 - m.poisson_ratio * m.poisson_ratio);
  };
  const double first = plane(lower_layer) * face, second = plane(upper) * thickness;
  const double neutral = (first * face / 2 + second * (face + thickness / 2)) / (first + second);
  const auto cubes = [&](double from, double to) {
    return (std::pow(to - neutral, 3) - std::pow(from - neutral, 3)) / 3;
  };
  const double stiffness = plane(lower_layer) * cubes(0, face) + plane(upper) * cubes(face, 1);
  const auto swelling = [](const solvers::Material& m) { return m.poisson_ratio / (1 - m.poisson_ratio); };
  const double at_face = face - neutral;
  const Displacement exact = [=](const Vector3& x) -> Vector3 {
    const double z = x.z() - neutral;
    const double lift = z < at_face ? swelling(lower_layer) * (z * z - at_face * at_face)
                                    : swelling(upper) * (z * z - at_face * at_face);
    return {-curvature * x.x() * z, 0, curvature / 2 * (x.x() * x.x() + lift)};
  };
  solvers::Problem problem = layered_block({0, -0.5, 0}, {length, 0.5, 1}, 1.0 / divisions, seed);
  problem.material = lower_layer;
  problem.regions = region(solvers::half_space_faces({-Vector3::UnitZ(), -face}), upper);
  hold_faces(problem, {true, true, false}, {true, false, false}, exact);
  const auto body = solvers::discretise(std::move(problem), {});
  const solvers::Field solution = body->solve();
  const std::vector<Vector3> forces = body->constraint_forces(solution), points = body->constraint_points();
  double moment = 0;
  for (std::size_t k = 0; k < forces.size(); ++k)
    if (const solvers::Prescribed& entry = body->problem().prescribed[k];
        entry.components[0] && body->problem().nodes.positions[entry.node].x() > length - 1e-9)
      moment -= forces[k].x() * (points[k].z() - neutral);
  return {body->report().nodes, layer_error(*body, solution, exact), std::abs(moment / (stiffness * curvature) - 1)};
}

/// A ball of radius 0.31 in the middle of the unit cube, whose whole surface is held at the exact field. Its load is
/// the mean pressure of the body.
LayerErrors swollen(double contrast, int divisions, int seed) {
  const double radius = 0.31;
  const Vector3 centre = Vector3::Constant(0.5);
  const solvers::Material soft{1, 0.3, 0}, stiff{contrast, 0.3, 0};
  const auto bulk = [](const solvers::Material& m) { return 3 * m.lame_lambda() + 2 * m.shear_modulus(); };
  const double c = (bulk(soft) - bulk(stiff)) / (bulk(stiff) + 4 * soft.shear_modulus());
  const Displacement exact = [=](const Vector3& x) -> Vector3 {
    const Vector3 arm = x - centre;
    const double r = arm.norm();
    return 0.01 * (r < radius ? 1 + c : 1 + c * std::pow(radius / r, 3)) * arm;
  };
  solvers::Problem problem = layered_block(Vector3::Zero(), Vector3::Ones(), 1.0 / divisions, seed);
  problem.material = soft;
  problem.regions = region(solvers::ball_faces(centre, radius), stiff);
  hold_faces(problem, {true, true, true}, {true, true, true}, exact);
  const auto body = solvers::discretise(std::move(problem), {});
  const solvers::Field solution = body->solve();
  // The mean pressure of the whole body, from the forces on its surface: sum f . x is the integral of the stress's
  // trace.
  const std::vector<Vector3> forces = body->constraint_forces(solution), points = body->constraint_points();
  double trace = 0;
  for (std::size_t k = 0; k < forces.size(); ++k)
    trace += forces[k].dot(points[k] - centre);
  const double share = 4.0 / 3 * std::numbers::pi * std::pow(radius, 3);
  const double expected = 3 * 0.01 * (bulk(soft) * (1 - share) + bulk(stiff) * (1 + c) * share);
  return {body->report().nodes, layer_error(*body, solution, exact), std::abs(trace / expected - 1)};
}

/// An upright cylinder of radius and height 1 with a ball of radius 0.25 in it, its base held, its top pushed down by a
/// smooth hollow about the axis and free to slide.
constexpr double nodule_radius = 0.25, nodule_height = 0.6; // of its centre
double hollow(double r) {
  return -0.01 * std::exp(-r * r / 0.16);
}

/// Force on the top by axisymmetric finite elements. Rays from the centre of the ball carry the nodes: `rings` elements
/// in it, 2 `rings` from there to the surface of the cylinder, 6 `rings` around.
double reference_force(const solvers::Material& soft, const solvers::Material& stiff, int rings) {
  const auto outside = [](double angle) { // length of a ray
    const double across = std::sin(angle), up = std::cos(angle);
    const double to_lid = up > 0 ? (1 - nodule_height) / up : up < 0 ? -nodule_height / up : 10;
    return std::min(to_lid, across > 0 ? 1 / across : 10);
  };
  const std::array corners{0.0, std::atan2(1, 1 - nodule_height), std::atan2(1, -nodule_height), std::numbers::pi};
  std::vector<double> angles{0}, steps{0};
  for (std::size_t k = 0; k + 1 < corners.size(); ++k)
    for (int j = 1; j <= 2 * rings; ++j)
      angles.push_back(std::lerp(corners[k], corners[k + 1], static_cast<double>(j) / (2 * rings)));
  for (int j = 1; j <= 3 * rings; ++j)
    steps.push_back(static_cast<double>(j) / rings);
  const AxisymmetricGrid grid = make_grid(steps, angles, [&](double s, double angle) -> Vector2 {
    const double length = s <= 1 ? s * nodule_radius : std::lerp(nodule_radius, outside(angle), (s - 1) / 2);
    const double across = angle == std::numbers::pi ? 0 : std::sin(angle);
    return {length * across, nodule_height + length * std::cos(angle)};
  });
  std::vector<AxisymmetricSupport> supports;
  std::vector<int> top;
  for (int i = 0; i < std::ssize(grid.nodes); ++i) {
    const Vector2& x = grid.nodes[i];
    if (x.y() < 1e-9) {
      supports.push_back({i, 0, 0});
      supports.push_back({i, 1, 0});
    } else if (x.y() > 1 - 1e-9) {
      supports.push_back({i, 1, hollow(x.x())});
      top.push_back(i);
    }
  }
  const AxisymmetricSolution solution = solve_axisymmetric(
      grid, [&](const Vector2& x) { return (x - Vector2(0, nodule_height)).norm() < nodule_radius ? stiff : soft; },
      supports);
  double force = 0;
  for (const int i : top)
    force -= solution.reaction[i].y();
  return force;
}

/// The same by finite spheres.
double pressed_force(const solvers::Material& soft, const solvers::Material& stiff, double spacing, int seed,
                     int* nodes) {
  solvers::Problem problem;
  problem.domain = topology::make_cylinder_domain(1, 1, 0.06);
  solvers::SprinkleOptions sprinkling;
  sprinkling.spacing = {.fine = spacing, .coarse = 2 * spacing, .radius = 1.2 * nodule_radius};
  sprinkling.spacing.centres = {{0, 0, nodule_height}, {0, 0, 1}};
  sprinkling.random_seed = static_cast<std::uint64_t>(seed);
  problem.nodes = solvers::sprinkle(*problem.domain, sprinkling).nodes;
  problem.material = soft;
  problem.regions = region(solvers::ball_faces({0, 0, nodule_height}, nodule_radius), stiff);
  const auto field = [](const Vector3& x) -> Vector3 {
    return x.z() > 0.5 ? Vector3(0, 0, hollow(std::hypot(x.x(), x.y()))) : Vector3(Vector3::Zero());
  };
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const double z = problem.nodes.positions[i].z();
    for (int axis = 0; axis < 3; ++axis)
      if (z < 1e-9 || (axis == 2 && z > 1 - 1e-9)) {
        std::array<bool, 3> along{};
        along[static_cast<std::size_t>(axis)] = true;
        problem.prescribed.push_back({i, along, field(problem.nodes.positions[i])});
      }
  }
  problem.prescribed_region = [](const Vector3&, const Vector3& normal, int axis) {
    return normal.z() < -0.5 || (axis == 2 && normal.z() > 0.5);
  };
  problem.prescribed_field = field;
  const auto body = solvers::discretise(std::move(problem), {});
  const std::vector<Vector3> forces = body->constraint_forces(body->solve());
  double force = 0;
  for (std::size_t k = 0; k < forces.size(); ++k)
    if (body->problem().nodes.positions[body->problem().prescribed[k].node].z() > 0.5)
      force -= forces[k].z();
  *nodes = body->report().nodes;
  return force;
}

/// Runs over seeds and what they give to table, figure and checks; the worst seed counts.
struct LayerStudy {
  const ExperimentContext& context;
  int seeds;
  app::Table table{{"case", "contrast", "nodes", "displacement_error", "load_error"}};
  app::Figure figure{"Bodies of two materials", "ratio of the moduli", "relative error", true, true, {}};
  std::vector<Check> checks;

  LayerErrors exact_case(const std::string& name, const std::vector<double>& contrasts,
                         const std::function<LayerErrors(double contrast, int seed)>& run) {
    app::Series displacement{name + ", displacement", {}, {}}, load{name + ", load", {}, {}};
    LayerErrors worst;
    for (const double contrast : contrasts) {
      LayerErrors of_contrast;
      for (int seed = 1; seed <= seeds; ++seed) {
        const LayerErrors outcome = run(contrast, seed);
        of_contrast.nodes = outcome.nodes;
        of_contrast.displacement = std::max(of_contrast.displacement, outcome.displacement);
        of_contrast.load = std::max(of_contrast.load, outcome.load);
      }
      table.add({name, fmt::format("{:g}", contrast), fmt::format("{}", of_contrast.nodes),
                 fmt::format("{:.2e}", of_contrast.displacement), fmt::format("{:.2e}", of_contrast.load)});
      context.say(fmt::format("{}, contrast {:g}: displacement {:.2e}, load {:.2e}", name, contrast,
                              of_contrast.displacement, of_contrast.load));
      displacement.x.push_back(contrast);
      displacement.y.push_back(of_contrast.displacement);
      load.x.push_back(contrast);
      load.y.push_back(of_contrast.load);
      worst.displacement = std::max(worst.displacement, of_contrast.displacement);
      worst.load = std::max(worst.load, of_contrast.load);
    }
    figure.series.push_back(displacement);
    figure.series.push_back(load);
    return worst;
  }

  void check(const std::string& name, const LayerErrors& worst, double bound) {
    checks.push_back({name + "_displacement", worst.displacement, "<=", bound});
    checks.push_back({name + "_load", worst.load, "<=", bound});
  }

  /// The press on the cylinder; the force by finite elements, N.
  double pressed(const std::string& name, const solvers::Material& stiff, double bound) {
    const solvers::Material soft{1, 0.45, 0};
    const double coarse = reference_force(soft, stiff, 6), fine = reference_force(soft, stiff, context.quick ? 8 : 12);
    double worst = 0;
    int nodes = 0;
    for (int seed = 1; seed <= seeds; ++seed)
      worst = std::max(worst, std::abs(pressed_force(soft, stiff, 0.07, seed, &nodes) / fine - 1));
    table.add(
        {name, fmt::format("{:g}", stiff.young_modulus), fmt::format("{}", nodes), "", fmt::format("{:.2e}", worst)});
    context.say(fmt::format("{}, {} nodes: force {:.6g} N by finite elements, {:.1e} from the coarser mesh; off by "
                            "{:.2e}",
                            name, nodes, fine, std::abs(coarse / fine - 1), worst));
    checks.push_back({name + "_load", worst, "<=", bound});
    checks.push_back({name + "_reference_change", std::abs(coarse / fine - 1), "<=", 1e-3});
    return fine;
  }
};

} // namespace

std::vector<Check> run_layers(const ExperimentContext& context) {
  const int divisions = 8;
  const double face = 0.43, thickness = 0.43; // between the rows of nodes
  LayerStudy study{.context = context, .seeds = context.quick ? 1 : 3, .checks = {}};
  const std::vector<double> contrasts =
      context.quick ? std::vector<double>{10, 1000} : std::vector<double>{1, 10, 100, 1000};
  study.check("compression",
              study.exact_case("compression", contrasts,
                               [&](double contrast, int seed) { return compressed(contrast, face, divisions, seed); }),
              0.01);
  study.check("bending",
              study.exact_case("bending", contrasts,
                               [&](double contrast, int seed) { return bent(contrast, thickness, divisions, seed); }),
              0.01);
  const auto ball = [&](double contrast, int seed) { return swollen(contrast, divisions, seed); };
  study.check(
      "ball",
      study.exact_case("ball", context.quick ? std::vector<double>{100} : std::vector<double>{1, 10, 100}, ball), 0.04);
  const LayerErrors stiffest = study.exact_case("ball of 1000", {1000}, ball);
  study.checks.push_back({"ball_1000_displacement_reported", stiffest.displacement, ">=", 0});
  study.checks.push_back({"ball_1000_load_reported", stiffest.load, ">=", 0});
  const double plain = study.pressed("pressed_without_nodule", {1, 0.45, 0}, 0.04);
  const double with_nodule = study.pressed("pressed_nodule", {100, 0.45, 0}, 0.04);
  study.checks.push_back({"nodule_stiffens_by_reported", with_nodule / plain - 1, ">=", 0});
  study.table.write(context.out / "errors.csv");
  app::write_png(study.figure, context.out / "errors.png");
  return study.checks;
}

} // namespace spherecut::experiments
