// Contact on the surface itself: nodes that are held along some axes, rims, and a surface that comes to itself.
#include "src/tissue/cut_report.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

constexpr double young = 1e4, side = 0.02, strain = 0.05; // Pa, m
constexpr double pi = std::numbers::pi;

std::string held(const Vector3& point, const Vector3& normal, const std::string& axes) {
  return fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [{}, {}, {}]\nnormal = [{}, {}, {}]\naxes = [{}]\n",
                     point.x(), point.y(), point.z(), normal.x(), normal.y(), normal.z(), axes);
}

/// A cube or a cylinder of 20 mm on rollers, between rollers all round or free, under a plate larger than it.
std::string compressed(bool round, bool confined, double nu, const std::string& method) {
  std::string text = round ? "[organ]\nshape = \"cylinder\"\nradius = 0.01\nheight = 0.02\nedge = 0.001\n"
                           : "[organ]\nshape = \"block\"\nsize = [0.02, 0.02, 0.02]\nedge = 0.002\n";
  text +=
      fmt::format("[material]\nyoung_modulus = {}\npoisson_ratio = {}\n[method]\nname = \"{}\"\n", young, nu, method);
  text += held({0, 0, 1e-4}, Vector3::UnitZ(), "\"z\"");
  if (!confined) {
    if (round) // what turns and slides is held in the middle of the base, about its axis at the rim
      text += "[[fixed]]\nregion = \"sphere\"\ncentre = [0, 0, 0]\nradius = 0.003\naxes = [\"x\", \"y\"]\n"
              "[[fixed]]\nregion = \"box\"\nlower = [0.007, -0.002, -1]\nupper = [1, 0.002, 1e-4]\naxes = [\"y\"]\n"
              "[nodes]\nfine_spacing = 0.003\ncoarse_spacing = 0.003\n";
    else
      text += held({-0.0099, 0, 0}, Vector3::UnitX(), "\"x\"") + held({0, -0.0099, 0}, Vector3::UnitY(), "\"y\"");
  } else if (round) {
    for (int k = 0; k < 16; ++k) {
      const Vector3 out(std::cos(2 * pi * k / 16), std::sin(2 * pi * k / 16), 0);
      text += held(0.0097 * out, -out, "\"x\", \"y\"");
    }
  } else {
    for (const double s : {1.0, -1.0}) {
      text += held({0.0099 * s, 0, 0}, {-s, 0, 0}, "\"x\"");
      text += held({0, 0.0099 * s, 0}, {0, -s, 0}, "\"y\"");
    }
  }
  return text + fmt::format("[tool]\nshape = \"flat_punch\"\nradius = 0.02\nstep = 1\n[tool.approach]\ntarget = [0, 0, "
                            "0.02]\ndirection = [0, 0, -1]\ndepth = {}\n",
                            strain * side);
}

double exact_force(bool round, bool confined, double nu) {
  const double modulus = confined ? young * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) : young;
  return modulus * strain * (round ? pi * 0.25 * side * side : side * side);
}

/// Deepest point of the deformed surface in the tool, over corners and middles of its triangles, in spacings.
double deepest(const Session& session, const StepResult& step) {
  const topology::SurfaceMesh& surface = session.organ().domain->surface();
  const solvers::NodeCloud& nodes = session.model().sprinkling.nodes;
  double worst = 0;
  const auto look = [&](const Vector3& x) {
    double nearest = 1, spacing = 1;
    for (int i = 0; i < nodes.size(); ++i)
      if (const double away = (nodes.positions[i] - x).norm(); away < nearest) {
        nearest = away;
        spacing = nodes.spacings[i];
      }
    worst = std::max(worst, -topology::tool_distance(session.scenario().tool->shape, step.pose,
                                                     x + session.model().at(x).displacement) /
                                spacing);
  };
  for (const Vector3& x : surface.vertices)
    look(x);
  for (const Triangle& t : surface.triangles)
    look((surface.vertices[t[0]] + surface.vertices[t[1]] + surface.vertices[t[2]]) / 3);
  return worst;
}

/// A body of cubes of 2 mm where `full` is true, as text of an OBJ file in millimetres.
template <typename Full>
std::string voxel_body(const std::array<int, 3>& size, const Full& full) {
  std::string vertices, faces;
  std::map<std::array<int, 3>, int> known;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [found, is_new] = known.try_emplace(at, static_cast<int>(known.size()) + 1);
    if (is_new)
      vertices += fmt::format("v {} {} {}\n", 2 * at[0], 2 * at[1], 2 * at[2]);
    return found->second;
  };
  const auto inside = [&](const std::array<int, 3>& c) {
    for (std::size_t a = 0; a < 3; ++a)
      if (c[a] < 0 || c[a] >= size[a])
        return false;
    return static_cast<bool>(full(c));
  };
  std::array<int, 3> c{};
  for (c[0] = 0; c[0] < size[0]; ++c[0])
    for (c[1] = 0; c[1] < size[1]; ++c[1])
      for (c[2] = 0; c[2] < size[2]; ++c[2])
        for (std::size_t a = 0; a < 3 && inside(c); ++a)
          for (const int way : {0, 1}) {
            std::array<int, 3> beyond = c;
            beyond[a] += way == 1 ? 1 : -1;
            if (inside(beyond))
              continue;
            const std::size_t b = (a + 1) % 3, d = (a + 2) % 3;
            std::array<std::array<int, 3>, 4> corners{c, c, c, c};
            for (std::array<int, 3>& corner : corners)
              corner[a] += way;
            ++corners[1][b];
            ++corners[2][b];
            ++corners[2][d];
            ++corners[3][d];
            if (way == 0)
              std::swap(corners[1], corners[3]);
            std::array<int, 4> v{};
            for (std::size_t k = 0; k < 4; ++k)
              v[k] = vertex(corners[k]);
            faces += fmt::format("f {} {} {}\nf {} {} {}\n", v[0], v[1], v[2], v[0], v[2], v[3]);
          }
  return vertices + faces;
}

/// Two fingers of 8 mm on a common base, 6 mm apart; a ball bends the one towards the other.
Session two_fingers(const std::string& lips, double depth) {
  const TemporaryFolder folder;
  write_file(folder.path() / "fingers.obj",
             voxel_body({11, 5, 12}, [](const std::array<int, 3>& c) { return c[2] < 3 || c[0] < 4 || c[0] >= 7; }));
  const std::string text = fmt::format(R"([organ]
shape = "file"
file = "fingers.obj"
scale = 0.001
[material]
young_modulus = 1e4
poisson_ratio = 0.3
[[fixed]]
region = "half_space"
point = [0, 0, 0.0001]
normal = [0, 0, 1]
[nodes]
fine_spacing = 0.002
coarse_spacing = 0.002
[cut]
lips = "{}"
[tool]
shape = "sphere_tip"
radius = 0.004
axis = [-1, 0, 0]
step = 0.25
[tool.approach]
target = [0, 0.005, 0.020]
direction = [1, 0, 0]
depth = {}
[output]
figures = false
)",
                                       lips, depth);
  return Session(read_scenario(write_file(folder.path() / "case.toml", text)));
}

} // namespace

TEST_CASE("Cubes and cylinders between plates take the force of the closed forms, to the rims of their surface") {
  for (const bool round : {false, true})
    for (const bool confined : {true, false})
      for (const double nu : {0.3, 0.49})
        for (const std::string method : {"galerkin", "collocation"}) {
          CAPTURE(round, confined, nu, method);
          Session session = session_of(compressed(round, confined, nu, method));
          const StepResult last = run(session).back();
          CHECK(last.converged);
          CHECK(last.force.z() == Approx(exact_force(round, confined, nu)).epsilon(0.015));
          CHECK(deepest(session, last) < 0.02);
          CHECK(last.largest_penetration < 0.02 * session.zone().spacing.coarse);
        }
}

TEST_CASE("No point of the surface is left in a ball, however coarse the nodes below it") {
  for (const std::string spacing : {"0.002", "0.004"}) {
    CAPTURE(spacing);
    Session session = session_of(replaced(small_scenario, "fine_spacing = 0.004", "fine_spacing = " + spacing));
    for (const StepSample& sample : session.steps()) {
      const StepResult step = session.step(sample);
      if (step.active_nodes == 0)
        continue;
      const double found = deepest(session, step);
      CHECK(found < 0.0201);
      CHECK(step.largest_penetration >= 0);
    }
    for (const std::string& warning : session.warnings())
      CHECK_THAT(warning, !Contains("lies"));
  }
}

TEST_CASE("A surface that a fixed region holds against the tool is told, with its depth") {
  std::string text = small_scenario;
  text += "[[fixed]]\nregion = \"sphere\"\ncentre = [0.004, 0, 0.03]\nradius = 0.003\n";
  Session session = session_of(text);
  const StepResult last = run(session).back();
  CHECK(last.largest_penetration > 0.5e-3);
  REQUIRE_FALSE(session.warnings().empty());
  bool told = false;
  for (const std::string& warning : session.warnings())
    told = told || warning.find("fixed region holds it there against the tool") != std::string::npos;
  CHECK(told);
}

TEST_CASE("Fingers that come to each other push on one another, and where that is left out it is told how deep") {
  Session apart = two_fingers("open", 0.008);
  const StepResult through = run(apart).back();
  CHECK(through.self_penetration > 0.5e-3);
  REQUIRE_FALSE(apart.warnings().empty());
  bool told = false;
  for (const std::string& warning : apart.warnings())
    told = told || warning.find("passes through itself") != std::string::npos;
  CHECK(told);
  Session together = two_fingers("frictionless", 0.008);
  const StepResult pushed = run(together).back();
  CHECK(pushed.self_penetration < 0.2e-3);
  CHECK(pushed.force.norm() > 1.1 * through.force.norm());
  // What the finger that is pushed onto takes, the base carries.
  Vector3 carried = Vector3::Zero();
  for (const Vector3& force : together.model().body->constraint_forces(together.model().field))
    carried += force;
  CHECK((carried - pushed.force).norm() < 1e-6 * pushed.force.norm());
}

TEST_CASE("The opening that is told is that of the surface that is written") {
  Session session = session_of(cut_block + disc_precut + "pressure = 300\n");
  const StepResult last = run(session).back();
  const topology::Wound& wound = *session.wound();
  double apart = 0;
  for (const topology::LipPair& pair : topology::lip_pairs(wound))
    apart = std::max(apart, (session.model().at(wound.evaluation[pair.plus]).displacement -
                             session.model().at(wound.evaluation[pair.minus]).displacement)
                                .z());
  REQUIRE(apart > 1e-5);
  CHECK(last.cut->opening == Approx(apart).epsilon(1e-3));
}

TEST_CASE("The way of an approach counts from the first touch of the organ as it hangs") {
  const std::string heavy = replaced(small_scenario, "poisson_ratio = 0.3\n",
                                     "poisson_ratio = 0.3\ndensity = 1000\n[gravity]\nacceleration = [0, 0, -9.81]\n");
  Session session = session_of(heavy);
  session.step(session.steps().front());
  // Held at its base a block sinks by rho g H^2 / 2 E times a factor between 0.74 (no way aside) and 1.
  const double sag = -session.model().at({0, 0, 0.03}).displacement.z();
  CHECK(sag > 0.7 * 1000 * 9.81 * 9e-4 / 2e4);
  CHECK(session.steps().back().tool->point.z() == Approx(0.03 - sag - 0.002).margin(2e-6));
  CHECK(session.steps().front().tool->point.z() == Approx(0.03 - sag + 0.001).margin(2e-6));
}
