// A scenario file: organ, material, fixed regions, nodes, method, tool and its way, cuts, output. SI units throughout.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/contact/solver.hpp"
#include "src/scenario/cut_settings.hpp"
#include "src/scenario/haptic_settings.hpp"
#include "src/scenario/law_settings.hpp"
#include "src/scenario/tear_settings.hpp"
#include "topology/organ/surface_check.hpp"
#include "topology/tool/tool.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace spherecut::app {

struct BlockOrgan {
  Vector3 size = Vector3::Zero(); // m
};
struct CylinderOrgan {
  double radius = 0, height = 0; // m
};
struct HemisphereOrgan {
  double radius = 0; // m
};
struct LiverOrgan {
  int triangles = 20000;
};
struct FileOrgan {
  std::filesystem::path file;         // resolved against the scenario's folder
  double scale = 0;                   // m per unit of the file; 0: derived
  std::optional<int> label;           // of a label volume; empty: its only one
  topology::SurfaceChoices choices{}; // of pieces and cavities
};

struct OrganSettings {
  std::variant<BlockOrgan, CylinderOrgan, HemisphereOrgan, LiverOrgan, FileOrgan> shape;
  double edge = 0;       // m, of the built-in block, cylinder, hemisphere; 0: derived
  double voxel_size = 0; // m, level set of liver and file; 0: derived
};

struct BoxRegion {
  Vector3 lower, upper; // m
};
struct SphereRegion {
  Vector3 centre; // m
  double radius;  // m
};

/// Nearer to a plane than half its thickness.
struct SlabRegion {
  Plane middle;
  double thickness = 0; // m
};
/// Depths below the organ's surface.
struct DepthRegion {
  double from = 0, to = 0; // m
};
/// Inside a closed surface.
struct SolidRegion {
  std::shared_ptr<const topology::Domain> solid;
};

/// A part of the organ with a material of its own.
struct RegionSettings {
  using Shape = std::variant<BoxRegion, SphereRegion, Plane, SlabRegion, DepthRegion, SolidRegion>;
  std::string name; // for messages
  Shape shape;
  solvers::Material material;
  int line = 0; // of the scenario file
};

struct FixedRegion {
  std::string name; // for messages
  std::variant<BoxRegion, SphereRegion, Plane> shape;
  std::array<bool, 3> components{true, true, true};
  int line = 0;                                     // of the scenario file
  [[nodiscard]] bool holds(const Vector3& x) const; // bounds included, to 1e-9 m
};

struct NodeSettings {
  double fine_spacing = 0;   // m, 0: derived
  double coarse_spacing = 0; // m, 0: derived
  double slope = 0.3;
  double fine_radius = 0; // m, 0: derived
  int count = 0;          // 0: not scaled
  std::uint64_t random_seed = 1;
};

/// Straight press along a line.
struct Approach {
  Vector3 target, direction;       // m; unit vector
  double depth = 0, clearance = 0; // m after and before the first touch
  double duration = 0;             // s
  int line = 0;                    // of the scenario file
};

/// Where the tool's reference point is at a time.
struct PathPoint {
  double time = 0; // s
  Vector3 position = Vector3::Zero();
  int line = 0; // of the scenario file, of its position
};

/// A tool that takes hold of the surface within its radius; it touches nothing before and after.
struct GraspSettings {
  double grasp = 0;                                         // s
  double release = std::numeric_limits<double>::infinity(); // s
};

struct ToolSettings {
  topology::ToolShape shape;          // of a grasper: a ball of its radius
  std::optional<GraspSettings> grasp; // a grasper's
  int line = 0;                       // of the scenario file
  Vector3 axis = Vector3::UnitZ();    // unit; a laparoscope takes its axis from its port
  double step = 0;                    // s, 0: derived
  std::variant<Approach, std::vector<PathPoint>> motion;
};

struct ContactSettings {
  solvers::ContactCondition condition = solvers::ContactCondition::frictionless;
  double friction = 0;         // coefficient
  double candidate_radius = 0; // m, 0: derived
  double follow_fraction = 0.5;
};

struct OutputSettings {
  int vtp_every = 1; // steps, 0: none
  bool figures = true;
};

struct Scenario {
  std::filesystem::path file;
  std::string text; // of the file, for the summary
  std::string title;
  OrganSettings organ;
  LawSettings law;
  solvers::Material material; // small-strain moduli of the law, and the density
  std::vector<RegionSettings> regions;
  double toughness = 0; // of the material, G_c, J/m2 of new cut; 0: not given, nothing resists a blade
  std::vector<ToughnessLayer> layers;
  std::function<double(const Vector3&)> toughness_function; // J/m2, a program's own, in place of both; empty: theirs
  TearSettings tearing;
  std::vector<FixedRegion> fixed;
  NodeSettings nodes;
  solvers::DiscretisationOptions method;
  std::optional<Vector3> gravity;       // m/s2
  Matrix3 pretension = Matrix3::Zero(); // strain that the tissue is stretched by in its given shape
  std::optional<ToolSettings> tool;
  ContactSettings contact;
  std::vector<PrecutSettings> precuts;
  CutSettings cut;
  std::optional<BladeSettings> blade;
  HapticSettings haptics;
  OutputSettings output;
};

/// Toughness in the tissue at rest, J/m2: the scenario's function, or that of the last layer that holds the place, or
/// that of the material. A function's value that is not positive and finite is an InputError that names the place.
std::function<double(const Vector3&)> toughness_field(const Scenario& scenario);

/// Reads and checks a scenario file. Throws InputError with one line for every offence: file:line, key, value and what
/// is allowed.
Scenario read_scenario(const std::filesystem::path& file);
/// The same from a text that was once in that file: other files that it names are looked for beside it.
Scenario read_scenario_text(const std::filesystem::path& file, std::string text);

} // namespace spherecut::app
